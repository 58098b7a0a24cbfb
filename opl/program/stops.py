"""Where along a motion the robot comes to rest, and what is done there."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from opl.motion.motion import Motion, Stretch
from opl.program.actions import Action, Actions

# Sharpest turn in joint space [rad] that a move off the wheel goes through without a stop. Rounding
# a corner leaves the proven path by more, the sharper it is.
MAX_BLENDED_TURN = np.deg2rad(10.0)

ON_WHEEL = (Stretch.GRIND, Stretch.BETWEEN)


def stops_at(motion: Motion, kept: NDArray[np.intp], on_wheel: NDArray[np.bool_]) -> list[bool]:
    """Say at which postures the robot comes to rest.

    Args:
        motion: The motion.
        kept: Indices of the postures that have a move, shape (n,).
        on_wheel: Which of them touch the wheel, shape (n,).
    """
    stops = np.logical_or.reduceat(ends_of_stretches(motion), kept)
    stops[0] = True
    stops[1:] |= on_wheel[1:] & ~on_wheel[:-1]
    steps = np.diff(motion.q[kept], axis=0)
    directions = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    cos_turn = np.sum(directions[:-1] * directions[1:], axis=1)
    stops[1:-1] |= ~on_wheel[1:-1] & (cos_turn < np.cos(MAX_BLENDED_TURN))
    return stops.tolist()


def ends_of_stretches(motion: Motion) -> list[bool]:
    """Say which postures end a stretch, the last one too."""
    stretch = [Stretch.GRIND if s in ON_WHEEL else s for s in motion.stretch]
    # the move onto the wheel belongs to the approach, which ends where the part touches
    touches = (Stretch.APPROACH, Stretch.GRIND)
    steps_on = list(pairwise(stretch))
    return [here is not after and (here, after) != touches for here, after in steps_on] + [True]


def actions_at(
    motion: Motion, kept: NDArray[np.intp], on_wheel: NDArray[np.bool_], actions: Actions
) -> dict[int, tuple[Action, ...]]:
    """Return what is done after which moves: in front of the wheel, and at home.

    Args:
        motion: The motion.
        kept: Indices of the postures that have a move, shape (n,).
        on_wheel: Which of them touch the wheel, shape (n,).
        actions: What is asked for.
    """
    stretch = [motion.stretch[posture] for posture in kept]
    last = len(kept) - 1
    found = {0: actions.at_start}
    for m in np.flatnonzero(on_wheel):
        if m and not on_wheel[m - 1]:
            before = next(k for k in range(m - 1, -1, -1) if stretch[k] is not Stretch.APPROACH)
            found[before] = (*found.get(before, ()), *actions.before_pass)
        if m < last and not on_wheel[m + 1]:
            beyond = (k for k in range(m + 1, last + 1) if stretch[k] is not Stretch.RETRACT)
            after = next(beyond, last + 1) - 1
            found[after] = (*found.get(after, ()), *actions.after_pass)
    found[last] = (*found.get(last, ()), *actions.at_end)
    return found
