"""Approaches and retracts cut as short as the free moves between them allow.

A motion is planned with whole leads, and every configuration of them is known to be free. So the
part may leave a lead anywhere: where the straight move from there to the next lead, or to home, is
proven free. What keeps clear of everything on that move, `opl.motion.straight_moves` says; that is
the clearance, what the second opinion may differ by, and 0.05 mm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array
from opl.motion.motion import Motion, MoveKind, Phase

Joined = Callable[[Array, Array], bool]  # whether the straight move between two ``q`` is free


def shortened(motion: Motion, joined: Joined) -> Motion:
    """Return a motion whose leads end as soon as the free move from there is straight and free.

    Between two passes both leads are cut at the same number of configurations, then each alone as
    far as it goes. Where no straight move is free, the leads stay whole and the way around what
    blocks it as it was found.
    """
    rows = np.arange(len(motion))
    kept = np.ones(len(motion), dtype=bool)
    kinds = list(motion.kind)
    for before, after in _gaps(motion):
        cut = _cut(motion, before, after, joined)
        if cut is None:
            continue
        first, last = cut
        kept[first + 1 : last] = False
        kinds[last] = MoveKind.HOME if before[0] == 0 or after[0] == rows[-1] else MoveKind.LINK
    return replace(motion, kind=tuple(kinds)).take(rows[kept])


def _gaps(motion: Motion) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Return the configurations of the leads on either side of each gap, off the wheel first.

    Of the wheel outwards: those of a retract, and those of the approach that follows; home alone at
    the ends of the motion, and wherever it comes by.
    """
    at_home = motion.at_home
    sides = [(Phase.RETRACTING, np.array([0], dtype=np.intp))]
    for phase, moves in motion.runs():
        if phase is Phase.APPROACHING:
            # the last move ends on the wheel; the first begins where a free move ended
            sides.append((phase, moves[::-1] - 1))
        elif phase is Phase.RETRACTING:
            sides.append((phase, moves))
        elif at_home[moves[:-1]].any():
            home = moves[:-1][at_home[moves[:-1]]][:1]
            sides += [(Phase.APPROACHING, home), (Phase.RETRACTING, home)]
    sides.append((Phase.APPROACHING, np.array([len(motion) - 1], dtype=np.intp)))
    return [(sides[k][1], sides[k + 1][1]) for k in range(0, len(sides), 2)]


def _cut(
    motion: Motion, before: NDArray[np.intp], after: NDArray[np.intp], joined: Joined
) -> tuple[int, int] | None:
    """Return between which configurations of two leads a straight move is free, None if nowhere."""

    def free(one: int, other: int) -> bool:
        return joined(motion.q[before[one]], motion.q[after[other]])

    longest = max(len(before), len(after))
    pairs = ((min(k, len(before) - 1), min(k, len(after) - 1)) for k in range(longest))
    found = next((pair for pair in pairs if free(*pair)), None)
    if found is None:
        return None
    one, other = found
    while one > 0 and free(one - 1, other):
        one -= 1
    while other > 0 and free(one, other - 1):
        other -= 1
    return int(before[one]), int(after[other])
