"""Configurations put in where the speed along a pass has to change, so that it changes soon.

A move has one speed. Where a long move leads to a slow one, speeds that change gradually would make
all of it slow. What is put in lies on the line of the move, so it moves nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from opl.cell.robot import Robot
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.gradual import LEAST_COUNTED, PLANNED_RATIO, STEP_TIME
from opl.motion.motion import Motion, MoveKind
from opl.motion.process_settings import ProcessSettings
from opl.motion.timing import followed, on_wheel

PIECE = (
    2.0 * STEP_TIME
)  # [s] that a piece of a move takes, each faster than the one before by a step
LONG = 0.2  # [s] that a move takes at the least that is cut
ROUNDS = 3  # what is cut may show the next slow move


def with_speed_steps(
    motion: Motion, points: CutterPoints, process: ProcessSettings, robot: Robot
) -> Motion:
    """Return a motion whose long moves on the wheel are cut next to slow ones.

    Raises:
        UnsafeError: If the time law does not keep the limits it was given.
    """
    for _ in range(ROUNDS):
        cuts = dict(_cuts(motion, points, process, robot))
        if not cuts:
            break
        motion = with_moves_cut(motion, cuts)
    return motion


def _cuts(
    motion: Motion, points: CutterPoints, process: ProcessSettings, robot: Robot
) -> Iterator[tuple[int, Array]]:
    """Yield moves that are to be cut, by their index, and at which fractions, ascending."""
    way, least = on_wheel(motion, points, process)
    for index in range(points.n_passes):
        moves = np.flatnonzero(motion.grinding & (motion.pass_index == index))
        rows = np.concatenate([[moves[0] - 1], moves])
        # what each needs for itself, its neighbours aside
        seconds = followed(motion.q[rows], least[moves], robot)
        speed = np.maximum(way[moves] / seconds, LEAST_COUNTED * process.feed)
        for k in np.flatnonzero(seconds > LONG):
            shares: list[float] = []
            for other, at_start in ((k - 1, True), (k + 1, False)):
                if not 0 <= other < len(moves) or speed[k] <= PLANNED_RATIO * speed[other]:
                    continue
                ends = _piece_ends(float(speed[other]), float(speed[k])) / way[moves[k]]
                shares += [end if at_start else 1.0 - end for end in ends if end < 0.5]
            if shares:
                yield int(moves[k]), np.unique(shares)


def _piece_ends(slow: float, fast: float) -> Array:
    """Return where pieces end that lead from one speed to another, in [m] from the slow end."""
    steps = int(np.ceil(np.log(fast / slow) / np.log(PLANNED_RATIO)))
    return np.asarray(np.cumsum(slow * PLANNED_RATIO ** np.arange(1, steps + 1)) * PIECE)


def with_moves_cut(motion: Motion, cuts: Mapping[int, Array]) -> Motion:
    """Return the motion with configurations on the lines of its moves on the wheel.

    `cuts` are fractions of each move, ascending, by its index, which ascends as well.
    """
    before = np.concatenate([np.full(len(shares), move) for move, shares in cuts.items()])
    share = np.concatenate(list(cuts.values()))

    def between(values: Array) -> Array:
        start, end = values[before - 1], values[before]
        weight = share.reshape(-1, *(1,) * (values.ndim - 1))
        return np.asarray(start + weight * (end - start))

    kinds = list(motion.kind)
    for move in before[::-1]:
        kinds.insert(move, MoveKind.BETWEEN)
    return Motion(
        np.insert(motion.q, before, between(motion.q), axis=0),
        tuple(kinds),
        np.insert(motion.contact_position, before, between(motion.contact_position)),
        np.insert(motion.cutter_point, before, between(motion.cutter_point)),
        np.insert(motion.pass_index, before, motion.pass_index[before]),
    )
