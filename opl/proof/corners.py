"""The corners of a program as a controller may round them: contact, depth, clearance."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from opl.cell.robot import forward_kinematics
from opl.files.beside import Beside
from opl.findings import Finding, Level
from opl.geometry.frames import Array, inverse
from opl.geometry.toolpath import CutterPoints
from opl.job.values import Job
from opl.motion.motion import Motion
from opl.program.played import Playback
from opl.proof.roundings import DEPTHS, Rounding, roundings, tool_points_of, zones_of
from opl.verification.contact import contact_positions
from opl.verification.triangles import Triangles
from opl.verification.world import World

AT_ONCE = 128  # corners whose frames are held in memory
IN_TURN = 24  # corners that whoever is free takes together
MOST_NAMED = 3  # corners of each kind of fault
_NUDGE = 1e-3  # of a cutter point, for the way along a pass
_NEWTON = 2  # steps to the place of a pass that an edge of the wheel grinds


@dataclass(frozen=True)
class CornerProof:
    """What rounding leaves of a program.

    Attributes:
        rounded: Number of corners that may be rounded.
        unknown: Number of those whose zones nobody knows: half of each move is taken for them.
        max_contact_error: Largest distance of the ground point from the wheel's surface on any
            rounding between moves on the wheel in [m].
        place: Where that is, empty without contact.
        allowed: How large it may be in [m].
        at_ends: The same where the part meets and leaves the belt, which is told, not limited: a
            rounding begins to lift it off before the end of the pass.
        findings: What is wrong.
        stops: Places in the files of the corners off the wheel that come too near to something:
            without rounding they are as free as their moves.
    """

    rounded: int
    unknown: int
    max_contact_error: float
    place: str
    allowed: float
    at_ends: float
    findings: tuple[Finding, ...]
    stops: tuple[str, ...] = ()


def corner_proof(
    job: Job,
    points: CutterPoints,
    motion: Motion,
    playback: Playback,
    beside: Beside | None = None,
) -> CornerProof:
    """Prove every rounding of a program inside its zones, see `opl.proof.roundings`.

    Contact and depth in the belt are looked at on chords across each triangle, clearances all over
    it. Limits and order need no look: where both moves keep them, so does what lies between.

    Args:
        job: Cell and tolerances.
        points: Its cutter points.
        motion: What the program does, with its meaning, a written configuration for each move.
        playback: The moves.
        beside: What may work beside this process, if anything.
    """
    allowed, tool_points = job.search.max_contact_error, tool_points_of(job)
    zones = zones_of(playback.moves, playback.q[playback.stations], tool_points)
    corners = list(roundings(motion, zones, tool_points))
    some = [corners[first : first + IN_TURN] for first in range(0, len(corners), IN_TURN)]
    looks = (beside or Beside()).share(_looking, (job, points, motion), some)
    errors = np.concatenate([np.zeros((0, len(DEPTHS))), *(look.errors for look in looks)])
    inner = np.array([all(corner.grinds) for corner in corners], dtype=bool)
    worst = np.where(inner, errors[:, -1], 0.0)
    faults: list[tuple[Rounding, str]] = []
    for one in np.argsort(-worst, kind="stable")[:MOST_NAMED].tolist():
        if worst[one] > allowed:
            part = np.interp(allowed, np.append(0.0, errors[one]), np.append(0.0, DEPTHS))
            fits = 1e3 * part * corners[one].reach(tool_points)
            what = "zone"
            written, zone = playback.moves[corners[one].k].corner, zones[corners[one].k]
            if written.arc and np.isfinite(zone):
                what, fits = "corner radius", fits * written.reach / zone
            faults.append(
                (
                    corners[one],
                    f"leaves the ground point {1e3 * worst[one]:.3f} mm from the wheel's surface, "
                    f"{1e3 * allowed:g} mm allowed; a {what} of "
                    f"{np.floor(100.0 * fits) / 100.0:g} mm would do",
                )
            )
    near = [(corners[IN_TURN * n + k], why) for n, look in enumerate(looks) for k, why in look.near]
    deep = [(corners[IN_TURN * n + k], why) for n, look in enumerate(looks) for k, why in look.deep]
    faults += [*near[:MOST_NAMED], *deep[:MOST_NAMED]]
    most = int(worst.argmax()) if worst.max(initial=0.0) > 0.0 else None
    return CornerProof(
        len(corners),
        int(np.isinf(zones[[corner.k for corner in corners]]).sum()),
        0.0 if most is None else float(worst[most]),
        "" if most is None else _place(motion, corners[most]),
        allowed,
        float(errors[~inner, -1].max(initial=0.0)),
        tuple(
            Finding(
                Level.ERROR,
                "corner",
                f"{_place(motion, corner)} ({playback.moves[corner.k].place})",
                f"{playback.moves[corner.k].corner.in_words(zones[corner.k])} {fault}",
            )
            for corner, fault in faults
        ),
        tuple(
            playback.moves[corner.k].place
            for corner, _ in near
            if not motion.on_wheel[motion.positions[corner.k]]
        ),
    )


@dataclass(frozen=True, eq=False)
class _Look:
    """What was found at some corners.

    Attributes:
        errors: Largest distances of their ground points, see `contact_errors`.
        near: Which of them bring bodies too near to each other, and how.
        deep: Which of them take the part too deep into the belt, and how.
    """

    errors: Array
    near: list[tuple[int, str]]
    deep: list[tuple[int, str]]


@contextmanager
def _looking(
    job: Job, points: CutterPoints, motion: Motion
) -> Iterator[Callable[[Sequence[Rounding]], _Look]]:
    """Open what looks at corners."""
    with World(job.cell) as world:
        triangles, allowed = Triangles(world), job.cell.max_belt_penetration

        def look(corners: Sequence[Rounding]) -> _Look:
            return _Look(
                contact_errors(job, points, motion, corners),
                list(_too_near(triangles, corners)),
                list(_too_deep(world, corners, allowed)),
            )

        yield look


def _place(motion: Motion, corner: Rounding) -> str:
    return motion.place(int(motion.positions[corner.k]))


def contact_errors(
    job: Job, points: CutterPoints, motion: Motion, corners: Sequence[Rounding]
) -> Array:
    """Return the largest distances of ground points from the wheel's surface in [m], (n, DEPTHS).

    Down to each depth of the triangle, with what parabolas through three neighbours have between
    them. On an edge of the wheel a point that is too deep may be near its side: there the distance
    along the normal of the contact counts where it is larger.
    """
    parts = [np.zeros((0, len(DEPTHS)))]
    for first in range(0, len(corners), AT_ONCE):
        parts.append(_errors(job, points, motion, corners[first : first + AT_ONCE]))
    return np.concatenate(parts)


def _errors(job: Job, points: CutterPoints, motion: Motion, corners: Sequence[Rounding]) -> Array:
    """Do `contact_errors` for one corner or more."""
    wheel = job.cell.wheel
    place = np.stack([corner.places(_points_per_lead(job, points, corner)) for corner in corners])
    known = np.isfinite(place)
    q = np.stack([corner.configurations() for corner in corners])[known]
    Ts_contact0_workpiece = (
        inverse(wheel.T_base_contact0)
        @ forward_kinematics(job.cell.robot, q)
        @ job.cell.T_flange_workpiece
    )
    index = motion.pass_index[motion.positions[[corner.k for corner in corners]]]
    of_point = np.broadcast_to(index[:, None, None], place.shape)[known]
    first = np.searchsorted(points.pass_index, of_point)
    last = np.searchsorted(points.pass_index, of_point, side="right") - 1
    at = np.clip(place[known], first, last)
    for _ in range(_NEWTON):
        # an edge grinds what comes to it: the place where the pass crosses it
        Ts = Ts_contact0_workpiece @ points.frames_at(at)
        t = contact_positions(wheel, Ts)
        T_contact_contact0 = inverse(wheel.T_contact0_contact(t))
        here = (T_contact_contact0 @ Ts)[:, 0, 3]
        nudged = np.where(at + _NUDGE <= last, _NUDGE, -_NUDGE)
        there = T_contact_contact0 @ Ts_contact0_workpiece @ points.frames_at(at + nudged)
        slope = (there[:, 0, 3] - here) / nudged
        on_edge = (np.abs(t) > wheel.flat_end) & (slope != 0.0)
        step = np.where(on_edge, -here / np.where(slope == 0.0, 1.0, slope), 0.0)
        at = np.clip(at + np.clip(step, -1.0, 1.0), first, last)
    Ts = Ts_contact0_workpiece @ points.frames_at(at)
    Ts_contact0_contact = wheel.T_contact0_contact(contact_positions(wheel, Ts))
    apart = Ts[:, :3, 3] - Ts_contact0_contact[:, :3, 3]
    found = np.full((2, *place.shape), np.nan)
    found[0, known] = wheel.signed_distance(Ts[:, :3, 3])
    found[1, known] = (Ts_contact0_contact[:, :3, 2] * apart).sum(axis=1)
    error = np.nan_to_num(_with_bows(found)).max(axis=(0, 3))
    return np.asarray(np.maximum.accumulate(error, axis=1))


def _points_per_lead(job: Job, points: CutterPoints, corner: Rounding) -> float:
    """Return how many cutter points a lead next to the end of a pass passes in all of its move.

    The part is only moved on a lead, so every point of it moves as the flange does.
    """
    if sum(corner.grinds) != 1:
        return 0.0
    lead, way = (corner.after, 1) if corner.grinds[0] else (corner.before, -1)
    if np.isnan(lead.place[0]):  # the belt is left elsewhere than at a written position
        return 0.0
    here = round(float(lead.place[0]))
    step = abs(points.arc_length[here] - points.arc_length[here - way])
    p_flange = forward_kinematics(job.cell.robot, lead.q)[:, :3, 3]
    return float(np.linalg.norm(np.diff(p_flange, axis=0), axis=1).sum() / step)


def _with_bows(values: Array) -> Array:
    """Return amounts at places, and those of the parabolas through any three neighbours.

    `values` have shape (..., n), the amounts, none below 0 and NaN where nothing is known, more.
    """
    first, middle, last = values[..., :-2], values[..., 1:-1], values[..., 2:]
    slope, bend = (last - first) / 2.0, first - 2.0 * middle + last
    inside = np.abs(slope) < np.abs(bend)
    vertex = middle - np.where(inside, slope**2 / (2.0 * np.where(inside, bend, 1.0)), 0.0)
    return np.asarray(np.abs(np.concatenate([values, vertex], axis=-1)))


def _too_near(triangles: Triangles, corners: Sequence[Rounding]) -> Iterator[tuple[int, str]]:
    """Yield corners that bring bodies too near to each other, and which."""
    triangles.forget()  # whoever looked at other corners before
    for k, corner in enumerate(corners):
        found = triangles.too_near(*corner.triangle(), corner.free)
        if found is not None:
            yield (
                k,
                f"brings {found.names} to {1e3 * found.distance:.2f} mm, "
                f"{1e3 * found.needed:g} mm needed",
            )


def _too_deep(
    world: World, corners: Sequence[Rounding], allowed: float
) -> Iterator[tuple[int, str]]:
    """Yield corners that take the part too deep into the belt, and how deep."""
    for k, corner in enumerate(corners):
        deepest = _deepest(world, corner, allowed)
        if deepest > allowed:
            yield (
                k,
                f"takes the part {1e3 * deepest:.3f} mm into the belt, "
                f"{1e3 * allowed:g} mm allowed",
            )


def _deepest(world: World, corner: Rounding, allowed: float) -> float:
    """Return how deep the part is in the belt on some chords in [m], if deeper than allowed.

    Else some depth that is not; 0 where it must keep off.
    """
    if corner.free:
        return 0.0
    gaps = []
    for q in looked_at(corner):
        world.move_to(q)
        gaps.append(world.gap(-allowed))
    return max(0.0, -min(gaps))


def looked_at(corner: Rounding) -> Array:
    """Return configurations of some chords of a corner, whose ends lie on the moves: (10, 6)."""
    on_chords = corner.configurations()
    return np.concatenate([on_chords[-1, 4:-1:4], on_chords[1, 8:-1:8]])
