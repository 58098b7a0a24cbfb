"""What a person should know of cutter points before a path is planned."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from opl.findings import Finding, Level
from opl.geometry.coverage import uncovered_fraction
from opl.geometry.frames import rotation_angle
from opl.geometry.mesh_surface import MeshSurface
from opl.geometry.passes import LaidPasses, MachinedSurface, Passes
from opl.geometry.wheel import ContactWheel

# normals that turn by more than this from one cutter point to the next jump [rad]
LARGEST_TURN = np.deg2rad(20.0)

# less than this part of the area may stay uncovered without a word
UNCOVERED = 0.01

# the area is looked at about this often across a pitch, and this often across the surface at most
_LOOKS_PER_PITCH, _MOST_LOOKS = 6.0, 150.0


def inspect(
    surface: MachinedSurface,
    passes: Passes,
    laid: LaidPasses,
    wheel: ContactWheel,
    contact_allowance: float,
) -> tuple[Finding, ...]:
    """Return what is doubtful about cutter points; all are warnings.

    Args:
        surface: What is ground.
        passes: How it was cut.
        laid: The cutter points.
        wheel: The wheel.
        contact_allowance: How deep the part may sink into the belt in [m].
    """
    found = [*_hollows(laid, wheel, contact_allowance), *_segments(laid, passes), *_jumps(laid)]
    uncovered = uncovered_area(surface, passes, laid)
    if uncovered > UNCOVERED:
        found.append(
            _warning(
                "coverage",
                "the surface",
                f"{100.0 * uncovered:.1f} % of the area is more than half a pitch "
                f"({500.0 * passes.pitch:.3g} mm) away from every pass",
            )
        )
    if isinstance(surface, MeshSurface) and surface.facet_error > passes.max_bow_height:
        found.append(
            _warning(
                "mesh",
                "the surface",
                f"its triangles lie up to about {1e3 * surface.facet_error:.2g} mm off the smooth "
                f"surface through their corners, more than the bow height of "
                f"{1e3 * passes.max_bow_height:.2g} mm; export a finer mesh",
            )
        )
    return tuple(found)


def uncovered_area(surface: MachinedSurface, passes: Passes, laid: LaidPasses) -> float:
    """Return the part of the area that no pass comes by, 0 to 1."""
    extents = [np.ptp(surface.extent_along(axis)) for axis in np.eye(3)]
    spacing = max(passes.pitch / _LOOKS_PER_PITCH, float(max(extents)) / _MOST_LOOKS)
    Ts, pass_index = laid.points.Ts_workpiece_cutter, laid.points.pass_index
    return uncovered_fraction(surface.area_samples(spacing), Ts[:, :3, 3], pass_index, passes.pitch)


def _hollows(laid: LaidPasses, wheel: ContactWheel, allowance: float) -> Iterator[Finding]:
    """Yield where the surface is too hollow for the wheel.

    Across the path the wheel is round: a hollow of a smaller radius takes neither its flat nor its
    edges. Along the path its flat is straight and bridges any hollow; its edges enter.
    """
    along, across = laid.bending[:, 0, 0], laid.bending[:, 1, 1]
    tight = across < -1.0 / wheel.radius
    if tight.any():
        deepest = int(np.argmin(across))
        yield _warning(
            "hollow",
            _points(tight),
            f"radius {-1e3 / across[deepest]:.1f} mm across the path at cutter point {deepest} "
            f"against a wheel of {1e3 * wheel.radius:g} mm: the wheel cannot enter",
        )
    # how deep both edges of the flat sink in when its middle touches
    sunk = -along * wheel.width**2 / 8.0
    bridged = (sunk > allowance) & ~tight
    if bridged.any():
        deepest = int(np.argmax(np.where(bridged, sunk, 0.0)))
        way = (
            "only an edge of the wheel can grind there"
            if wheel.max_roll > 0.0
            else "it cannot be ground: the part may not roll about the wheel's edges (max_roll_deg)"
        )
        yield _warning(
            "hollow",
            _points(bridged),
            f"radius {-1e3 / along[deepest]:.1f} mm along the path at cutter point {deepest} "
            f"against the wheel's flat of {1e3 * wheel.width:g} mm, which would cut in "
            f"{1e3 * sunk[deepest]:.2g} mm ({1e3 * allowance:g} mm allowed): {way}",
        )


def _segments(laid: LaidPasses, passes: Passes) -> Iterator[Finding]:
    """Yield steps that are shorter than the bow height, and places that are ground again."""
    origins, pass_index = laid.points.Ts_workpiece_cutter[:, :3, 3], laid.points.pass_index
    lengths = np.linalg.norm(np.diff(origins, axis=0), axis=1)
    short = (np.diff(pass_index) == 0) & (lengths < passes.max_bow_height)
    if short.any():
        at = np.append(short, False)
        yield _warning(
            "short segment",
            _points(at),
            f"the next point is as near as {1e3 * lengths[short].min():.2g} mm, less than the bow "
            "height",
        )
    counts = np.bincount(pass_index)
    alone = counts[pass_index] < 3
    extents = np.array([np.ptp(origins[pass_index == k], axis=0).max() for k in range(len(counts))])
    tiny = alone & (extents < passes.max_bow_height)[pass_index]
    if tiny.any():
        yield _warning("short segment", _points(tiny), "passes shorter than the bow height")


def _jumps(laid: LaidPasses) -> Iterator[Finding]:
    """Yield where the normal turns so far within a step that the robot would have to jump."""
    Ts = laid.points.Ts_workpiece_cutter
    turns = rotation_angle(Ts[:-1], Ts[1:])
    jumps = (np.diff(laid.points.pass_index) == 0) & (turns > LARGEST_TURN)
    if jumps.any():
        worst = int(np.argmax(np.where(jumps, turns, 0.0)))
        step = np.linalg.norm(Ts[worst + 1, :3, 3] - Ts[worst, :3, 3])
        yield _warning(
            "normal jumps",
            _points(np.append(jumps, False)),
            f"the frame turns {np.rad2deg(turns[worst]):.0f} deg within {1e3 * step:.2g} mm after "
            f"cutter point {worst}",
        )


def _warning(kind: str, where: str, message: str) -> Finding:
    return Finding(Level.WARNING, kind, where, message)


def _points(chosen: np.ndarray) -> str:
    """Return which cutter points are chosen, e.g. ``cutter points 0-12, 40 (14 of 99)``."""
    places = np.flatnonzero(chosen)
    runs = np.split(places, np.flatnonzero(np.diff(places) > 1) + 1)
    told = [f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs[:8]]
    if len(runs) > 8:
        told.append("...")
    return f"cutter points {', '.join(told)} ({len(places)} of {len(chosen)})"
