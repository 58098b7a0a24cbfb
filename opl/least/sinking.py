"""Where a motion sinks too deep into the wheel between two places, though it does not at both.

Flat triangles stand in for a curved part, and a joint line leads past its contact: on the way from
place to place the part is a few micrometres deeper than at the places themselves. Tracks that run
where the part is as deep as allowed are shut by that, one after the other; so places are left a
spare depth, as much as was seen to be too little. Where other bodies collide between two places,
more places are taken in.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from opl.cell.robot import forward_kinematics
from opl.cell.wheel_distance import signed_wheel_distance
from opl.cell.wheel_triangle import TOLERANCE
from opl.cell.workcell import PART, WHEEL
from opl.geometry.frames import Array
from opl.least.rows import MOST_PARTS, SMALLEST_EDGE, Bulge
from opl.motion.motion import Phase
from opl.planning.plan import Same
from opl.planning.problem import GrindingProblem
from opl.planning.track_check import Collides

LOOKS = 8  # along a move that sinks too deep
LEADS = Phase.APPROACHING, Phase.RETRACTING
ALONG = *LEADS, Phase.GRINDING
USELESS = 0.5  # of what was too deep: where so much still is, sparing depth is of no use
MORE = 1.25  # times what was too deep: what is spared for it
HARDLY = 1e-6  # [m] too deep: what can be spared nearly anywhere
BESIDE = 0.1  # cutter points: places so near are as deep
DEEP = 2e-5  # [m] too deep: what had better not be spared where places help


def sunk_between(
    problem: GrindingProblem, blocked: Collides, along: Sequence[Phase] = ALONG
) -> Array:
    """Return by how much the part is too deep between columns in [m], 0 elsewhere, (n - 1,).

    What it is too deep by on a lead counts between the two columns at that end of the pass.

    Args:
        problem: What is to be planned, of n columns.
        blocked: A motion, and its moves that collide.
        along: What is looked at of it.
    """
    cell, motion = problem.cell, blocked.motion
    sunk = np.zeros(len(problem.points) - 1)
    phases = motion.phase
    moves = [
        fault.move
        for fault in blocked.faults
        if fault.pair == (PART, WHEEL) and phases[fault.move] in along
    ]
    if not moves:
        return sunk
    share = np.arange(LOOKS + 1)[:, None] / LOOKS
    q = np.stack([motion.q[k - 1] + share * (motion.q[k] - motion.q[k - 1]) for k in moves])
    Ts = cell.Ts_contact0_workpiece(forward_kinematics(cell.robot, q))
    allowed = -cell.planned_penetration
    distance = signed_wheel_distance(problem.scene.part, cell.wheel, Ts, allowed)
    too_deep = np.maximum(allowed - distance.min(axis=1), 0.0) + TOLERANCE
    last = np.cumsum(np.bincount(problem.points.pass_index)) - 1
    ends = {Phase.APPROACHING: np.append(0, last[:-1] + 1) + 1, Phase.RETRACTING: last}
    after = [
        ends[phases[k]][motion.pass_index[k]] if phases[k] in ends else motion.cutter_point[k]
        for k in moves
    ]
    np.maximum.at(sunk, np.clip(np.ceil(after).astype(int) - 1, 0, len(sunk) - 1), too_deep)
    return sunk


def struck_between(problem: GrindingProblem, collided: Mapping[Same, Collides]) -> np.ndarray:
    """Return between which columns bodies collide, part and wheel aside, shape (n - 1,).

    Args:
        problem: What is to be planned, of n columns.
        collided: Motions that collide; where they do so at a column, it is not between two.
    """
    struck = np.zeros(len(problem.points) - 1, dtype=bool)
    for blocked in collided.values():
        motion = blocked.motion
        for fault in blocked.faults:
            place = motion.cutter_point[fault.move]
            at_column = fault.at_end and place == np.rint(place)
            grinding = motion.phase[fault.move] is Phase.GRINDING
            if grinding and not at_column and fault.pair != (PART, WHEEL):
                struck[int(np.ceil(place)) - 1] = True
    return struck


def sunk_at(collided: Mapping[Same, Collides]) -> dict[int, float]:
    """Return the columns at which a motion sinks too deep, and at which contact positions."""
    deep = {}
    for blocked in collided.values():
        motion = blocked.motion
        for fault in blocked.faults:
            place, t = motion.cutter_point[fault.move], motion.contact_position[fault.move]
            if fault.at_end and fault.pair == (PART, WHEEL) and place == np.rint(place):
                deep[int(place)] = float(t)
    return deep


def first_sunk(problem: GrindingProblem, collided: Mapping[Same, Collides]) -> Array | None:
    """Return `sunk_between` of the first motion that sinks, None if none does."""
    for blocked in collided.values():
        sunk = sunk_between(problem, blocked)
        if sunk.any():
            return sunk
    return None


def leads_are_deep(problem: GrindingProblem, collided: Mapping[Same, Collides]) -> bool:
    """Return whether some motion sinks so deep on its leads that places are of no help."""
    return any((sunk_between(problem, one, LEADS) > DEEP).any() for one in collided.values())


def shallower(sunk: Array, before: Array | None) -> bool:
    """Return whether what was spared for what sank before, if anything, was of use there."""
    return before is None or not ((before > 0.0) & (sunk > USELESS * before)).any()


def spare_for(places: Array, spare: Array, sunk: Array) -> Array:
    """Return what columns leave of the depth allowed, (n,), after what was spared was too little.

    Where places are close together, those beside leave as much: else the motion sinks there next.

    Args:
        places: Fractional cutter points of the columns, shape (n,).
        spare: What they left in [m], shape (n,).
        sunk: As of `sunk_between`.
    """
    here = np.maximum(np.append(sunk, 0.0), np.append(0.0, sunk))
    more = np.where(here > 0.0, np.maximum(MORE * here, HARDLY), 0.0)
    around = more.copy()
    for column in np.flatnonzero(more).tolist():
        first, end = np.searchsorted(places, places[column] + np.array([-BESIDE, BESIDE]))
        around[first:end] = np.maximum(around[first:end], more[column])
    return np.asarray(spare + around)


def places_for(places: Array, sunk: Array) -> Sequence[Bulge]:
    """Return where places are wanted to sink less, as of `sunk_between`."""
    # it falls with the square
    parts = np.clip(np.ceil(np.sqrt(sunk / HARDLY)), 2, MOST_PARTS).astype(int)
    return places_between(places, sunk > 0.0, parts)


def places_between(
    places: Array, wanted: np.ndarray, parts: np.ndarray | int = 2
) -> Sequence[Bulge]:
    """Return between which places others are wanted, shape (n - 1,), and into how many parts."""
    edges = np.flatnonzero(wanted & (np.diff(places) > SMALLEST_EDGE)).tolist()
    parts = np.broadcast_to(parts, wanted.shape)
    return [Bulge(float(places[k]), float(places[k + 1]), int(parts[k]), False) for k in edges]
