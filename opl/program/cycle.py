"""How long a written program runs, with the ramps that the controller puts to its moves.

The speeds of a program are those between the ramps: a controller comes up to them from rest and
goes down to rest wherever it stops. How long that takes says the time law that planned the
moves, now at rest at both ends of each run between two stops.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

import numpy as np

from opl.cell.robot import Robot
from opl.motion.rounded import rounded_line
from opl.motion.time_law import JointLimits, fastest_law
from opl.program.actions import Call, Dwell, WaitInput
from opl.program.moves import CycleTime, Move, PartTime, Program, Purpose
from opl.program.settings import ProgramSettings


def cycle_time(
    program: Program, times: Mapping[int, float], robot: Robot, settings: ProgramSettings
) -> CycleTime:
    """Return how long a program takes from its first configuration to its last.

    Args:
        program: The moves.
        times: Time of the move to each configuration at the written speed in [s], by the
            configuration's index.
        robot: Whose moves; where the job slows its ramps (ACC, DEC), so are they here.
        settings: How the program is written.

    Raises:
        UnsafeError: If the time law does not keep the joints' limits.
    """
    seconds: list[tuple[Move, float]] = []  # of each move but the first, ramps included
    ramps = 0.0
    for moves in _runs(program.moves):
        limits = JointLimits(robot.max_speed, _acceleration(moves[1:], robot, settings))
        wanted = np.array([move.duration or 0.0 for move in moves[1:]])
        q = np.array([move.q for move in moves])
        longer = np.zeros(len(wanted))
        if wanted.min(initial=np.inf) > 0.0:
            law = fastest_law(rounded_line(q, wanted), limits, at_rest=True)
            longer = np.diff(law.node_times) - wanted
        ramps += float(longer.sum())
        for move, time, more in zip(moves[1:], wanted, longer, strict=True):
            seconds.append((move, times.get(move.motion_index, float(time)) + float(more)))
    spent = dict.fromkeys(Purpose, 0.0)
    for move, time in seconds:
        spent[move.kind] += time
    runs = groupby(seconds, key=lambda one: one[0].part)
    parts = [PartTime(part, index, sum(time for _, time in run)) for (part, index), run in runs]
    actions = [action for move in program.moves for action in move.actions]
    return CycleTime(
        passes=spent[Purpose.WHEEL],
        leads=spent[Purpose.LEAD],
        air=spent[Purpose.AIR],
        waits=sum((one.seconds for one in actions if isinstance(one, Dwell)), 0.0),
        ramps=ramps,
        open_ended=any(isinstance(one, (WaitInput, Call)) for one in actions),
        parts=tuple(parts),
    )


def _runs(moves: Sequence[Move]) -> Iterator[Sequence[Move]]:
    """Yield the moves from one stop to the next; the first of each is where it starts."""
    start = 0
    for k in range(1, len(moves)):
        if moves[k].exact_stop or k == len(moves) - 1:
            yield moves[start : k + 1]
            start = k


def _acceleration(moves: Sequence[Move], robot: Robot, settings: ProgramSettings) -> np.ndarray:
    """Return the joint accelerations of a run as the program sets them, shape (6,)."""
    percents = [100.0]
    for ramp in (settings.acceleration, settings.deceleration):
        percents += [percent for move in moves if (percent := ramp.of(move.kind))]
    return robot.max_acceleration * min(percents) / 100.0
