"""What a person should know of cutter points before a path is planned."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opl.findings import Finding, Level
from opl.geometry.coverage import AreaSamples, lying_on_others, uncovered
from opl.geometry.frames import Array, rotation_angle
from opl.geometry.mesh_surface import MeshSurface
from opl.geometry.passes import LaidPasses, MachinedSurface, Order, Passes, longest_side
from opl.geometry.wheel import ContactWheel

# normals that turn by more than this from one cutter point to the next jump [rad]
LARGEST_TURN = np.deg2rad(20.0)

# less than this part of the area may stay uncovered without a word
UNCOVERED = 0.01

# [m] that the proof leaves for triangles of the solid that lie off the surface
OFF_SOLID = 1e-4

# the area is looked at about this often across a pitch, and this often across the surface at most
_LOOKS_PER_PITCH, _MOST_LOOKS = 6.0, 150.0

# what it is, which cutter points, and what of them
_Doubt = tuple[str, NDArray[np.bool_], str]


@dataclass(frozen=True, eq=False)
class Inspection:
    """What a person should know of cutter points.

    Attributes:
        findings: What is doubtful; all are warnings.
        doubtful: Which cutter points they name, shape (N,).
        uncovered: Points of the surface that no pass comes by.
        uncovered_fraction: Their part of the whole area, 0 to 1.
    """

    findings: tuple[Finding, ...]
    doubtful: NDArray[np.bool_]
    uncovered: AreaSamples
    uncovered_fraction: float


def inspect(
    surface: MachinedSurface,
    passes: Passes,
    laid: LaidPasses,
    wheel: ContactWheel,
    max_belt_penetration: float,
    heights: Array,
) -> Inspection:
    """Look for what is doubtful about cutter points.

    Args:
        surface: What is ground.
        passes: How it was cut.
        laid: The cutter points.
        wheel: The wheel.
        max_belt_penetration: How deep the part may sink into the belt in [m].
        heights: How far above cutter points the solid lies, see `heights_of_solid`.
    """
    pointed = [
        *_off_solid(heights),
        *_hollows(laid, wheel, max_belt_penetration),
        *_segments(laid, passes),
        *_jumps(laid),
        *_repeated(laid, passes),
    ]
    findings = [
        Finding(Level.WARNING, kind, _points(chosen), message) for kind, chosen, message in pointed
    ]
    doubtful = np.zeros(len(laid.points), dtype=bool)
    for _, chosen, _ in pointed:
        doubtful |= chosen
    spacing = max(passes.pitch / _LOOKS_PER_PITCH, longest_side(surface) / _MOST_LOOKS)
    samples = surface.area_samples(spacing)
    missed = samples.chosen(uncovered(samples, laid.points, passes.pitch))
    fraction = float(missed.areas.sum() / samples.areas.sum())
    if fraction > UNCOVERED:
        findings.append(
            Finding(
                Level.WARNING,
                "coverage",
                "the surface",
                f"{100.0 * fraction:.1f} % of the area is more than half a pitch "
                f"({500.0 * passes.pitch:.3g} mm) away from every pass",
            )
        )
    if isinstance(surface, MeshSurface) and surface.facet_error > passes.max_bow_height:
        findings.append(
            Finding(
                Level.WARNING,
                "mesh",
                "the surface",
                f"its triangles lie up to about {1e3 * surface.facet_error:.2g} mm off the smooth "
                f"surface through their corners, more than the bow height of "
                f"{1e3 * passes.max_bow_height:.2g} mm; export a finer mesh",
            )
        )
    return Inspection(tuple(findings), doubtful, missed, fraction)


def _off_solid(heights: Array) -> Iterator[_Doubt]:
    """Yield where the triangles of the solid lie off the surface.

    Contact is planned on the surface and proven on the triangles.
    """
    for off, effect in (
        (-heights, "below the surface, so that part and wheel may not touch"),
        (heights, "above the surface, and as much deeper in the belt"),
    ):
        chosen = off > OFF_SOLID
        if chosen.any():
            most = int(np.argmax(off))
            amount = f"up to {1e3 * off[most]:.2g} mm" if off[most] < np.inf else "far"
            yield (
                "solid",
                chosen,
                f"the triangles of the solid lie {amount} {effect}, farthest at cutter point "
                f"{most} ({1e3 * OFF_SOLID:g} mm is left for it); export a finer mesh",
            )


def _hollows(laid: LaidPasses, wheel: ContactWheel, penetration: float) -> Iterator[_Doubt]:
    """Yield where the surface is too hollow for the wheel.

    Across the path the wheel is round: a hollow of a smaller radius takes neither its flat nor its
    edges. Along the path its flat is straight and bridges any hollow as long as that; its edges
    enter. How long a hollow is, curvature at a point does not tell: a wave may be ground beside it.
    """
    along, across = laid.bending[:, 0, 0], laid.bending[:, 1, 1]
    tight = across < -1.0 / wheel.radius
    if tight.any():
        deepest = int(np.argmin(across))
        yield (
            "hollow",
            tight,
            f"radius {-1e3 / across[deepest]:.1f} mm across the path at cutter point {deepest} "
            f"against a wheel of {1e3 * wheel.radius:g} mm: the wheel cannot enter",
        )
    # how deep both edges of the flat sink in when its middle touches
    sunk = -along * wheel.width**2 / 8.0
    bridged = (sunk > penetration) & ~tight
    if bridged.any():
        deepest = int(np.argmax(np.where(bridged, sunk, 0.0)))
        hint = (
            "only an edge of the wheel can grind there"
            if wheel.max_roll > 0.0
            else "no wheel grinds it whose edges the part may not roll about (max_roll_deg)"
        )
        yield (
            "hollow",
            bridged,
            f"radius {-1e3 / along[deepest]:.1f} mm along the path at cutter point {deepest} "
            f"against the wheel's flat of {1e3 * wheel.width:g} mm, which would cut in "
            f"{1e3 * sunk[deepest]:.2g} mm ({1e3 * penetration:g} mm allowed): where the hollow is "
            f"that long, {hint}",
        )


def _segments(laid: LaidPasses, passes: Passes) -> Iterator[_Doubt]:
    """Yield steps and passes that are shorter than the bow height."""
    origins, pass_index = laid.points.Ts_workpiece_cutter[:, :3, 3], laid.points.pass_index
    lengths = np.linalg.norm(np.diff(origins, axis=0), axis=1)
    short = (np.diff(pass_index) == 0) & (lengths < passes.max_bow_height)
    if short.any():
        at = np.append(short, False)
        yield (
            "short segment",
            at,
            f"the next point is as near as {1e3 * lengths[short].min():.2g} mm, less than the bow "
            "height",
        )
    counts = np.bincount(pass_index)
    alone = counts[pass_index] < 3
    extents = np.array([np.ptp(origins[pass_index == k], axis=0).max() for k in range(len(counts))])
    tiny = alone & (extents < passes.max_bow_height)[pass_index]
    if tiny.any():
        yield "short segment", tiny, "passes shorter than the bow height"


def _jumps(laid: LaidPasses) -> Iterator[_Doubt]:
    """Yield where the normal turns so far within a step that the robot would have to jump."""
    Ts = laid.points.Ts_workpiece_cutter
    turns = rotation_angle(Ts[:-1], Ts[1:])
    jumps = (np.diff(laid.points.pass_index) == 0) & (turns > LARGEST_TURN)
    if jumps.any():
        worst = int(np.argmax(np.where(jumps, turns, 0.0)))
        step = np.linalg.norm(Ts[worst + 1, :3, 3] - Ts[worst, :3, 3])
        yield (
            "normal jumps",
            np.append(jumps, False),
            f"the frame turns {np.rad2deg(turns[worst]):.0f} deg within {1e3 * step:.2g} mm after "
            f"cutter point {worst}",
        )


def _repeated(laid: LaidPasses, passes: Passes) -> Iterator[_Doubt]:
    """Yield passes that lie on another one though the job grinds none twice."""
    if passes.order is Order.BOTH or passes.repeats > 1:
        return
    pairs = lying_on_others(laid.points, passes.pitch, passes.max_bow_height)
    if pairs:
        listed = [f"pass {again + 1} lies on pass {first + 1}" for first, again in pairs[:4]]
        listed += [f"{len(pairs) - 4} more"] if len(pairs) > 4 else []
        yield (
            "duplicate",
            np.isin(laid.points.pass_index, [again for _, again in pairs]),
            f"{', '.join(listed)}: do faces of the surface lie on each other?",
        )


def _points(chosen: np.ndarray) -> str:
    """Return which cutter points are chosen, e.g. ``cutter points 0-12, 40 (14 of 99)``."""
    places = np.flatnonzero(chosen)
    runs = np.split(places, np.flatnonzero(np.diff(places) > 1) + 1)
    listed = [f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs[:8]]
    if len(runs) > 8:
        listed.append("...")
    return f"cutter points {', '.join(listed)} ({len(places)} of {len(chosen)})"
