"""Where along a motion the robot comes to rest, and what is done there."""

from __future__ import annotations

import numpy as np

from opl.motion.motion import Motion, Phase
from opl.program.actions import Action, Actions

# Sharpest turn in joint space [rad] that a free move goes through without a stop. Rounding
# a corner leaves the proven path by more, the sharper it is.
MAX_BLENDED_TURN = np.deg2rad(10.0)


def stops_at(motion: Motion) -> list[bool]:
    """Return at which configurations, none like the one before it, the robot comes to rest.

    At home, where leads and free moves meet, and at sharp corners of free moves; on the wheel and
    where it is met and left, never.
    """
    free, on_wheel = motion.free, motion.on_wheel
    stops = (motion.ends_phase | motion.at_home) & ~on_wheel
    steps = np.diff(motion.q, axis=0)
    directions = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    cos_turn = np.sum(directions[:-1] * directions[1:], axis=1)
    stops[1:-1] |= free[1:-1] & free[2:] & (cos_turn < np.cos(MAX_BLENDED_TURN))
    return [bool(stop) for stop in stops]


def actions_at(motion: Motion, actions: Actions) -> dict[int, tuple[Action, ...]]:
    """Return what is done at which configurations: in front of the wheel, and at home."""
    found = {0: actions.at_start}
    last = len(motion) - 1
    for phase, moves in motion.runs():
        if phase is Phase.APPROACHING:
            before = int(moves[0]) - 1
            found[before] = (*found.get(before, ()), *actions.before_pass)
        elif phase is Phase.RETRACTING:
            after = int(moves[-1])
            found[after] = (*found.get(after, ()), *actions.after_pass)
    found[last] = (*found.get(last, ()), *actions.at_end)
    return found
