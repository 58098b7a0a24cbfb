"""The fewest configurations of a run whose joint lines lead as they should: exactly, not greedily.

Whether a line may join two configurations is no matter of how far they are apart: a longer one may
do where a shorter one does not. So every pair is looked at, and of all chains of lines that lead
from the first configuration to the last the shortest is found by dynamic programming over lines,
since what a rounded corner may be depends on both of its lines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opl.files.kernels import kernel
from opl.geometry.frames import Array
from opl.motion.corner_error import rounded_off
from opl.motion.gradual import LEAST_COUNTED
from opl.motion.line_error import Run, Screws, straight_off

_SHORT = 1 << 20  # what a line shorter in time than the controller follows counts for, in lines
_NEVER = 1 << 60  # what no chain is as dear as
_STEPS = np.array([-1, 0, 1])  # to a configuration itself and those next to it


@dataclass(frozen=True)
class ChainRule:
    """What a chain of joint lines has to keep besides its contact.

    Attributes:
        shortest: Least time of a line in [s]; one that cannot but be shorter counts for many.
        ratio: Largest ratio of the speeds of neighbouring lines, as `opl.motion.gradual` has them;
            where neighbours in the run differ by more, their lines may.
        zone: How far from a corner in [m] of the tool point a controller may leave its lines, no
            earlier than half-way; 0 for exact corners.
        corner: How far from the wheel's surface that may take the contact, in [m]; where nothing
            lies between neighbours in the run, their corner may be as it is.
    """

    shortest: float
    ratio: float = np.inf
    zone: float = 0.0
    corner: float = np.inf


class Lines:
    """The lines of a run that keep their contact, found once for every choice of configurations.

    Args:
        screws: The arm.
        run: The run, two configurations at least.
    """

    def __init__(self, screws: Screws, run: Run) -> None:
        self._arm = screws.axes, screws.T_base_flange
        self._values = run.arrays[:-1]
        self._found: dict[bytes, tuple[NDArray[np.int64], NDArray[np.int64], Array]] = {}
        self._last: NDArray[np.intp] = np.arange(0)

    def among(
        self, kept: NDArray[np.intp], barred: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
        """Return lines between some configurations by where they end.

        Args:
            kept: Indices of those in the run, in order.
            barred: Lines that are left out, by the places of their ends among these, shape (b, 2).

        Returns:
            Where each line starts; of each configuration the first line that ends there, and the
            number of all; the largest error of each as a fraction of what is allowed.
        """
        key = kept.tobytes()
        if key not in self._found:
            self._found[key] = _lines(*self._arm, *(value[kept] for value in self._values))
        starts, first, errors = self._found[key]
        self._last = kept
        ends = np.repeat(np.arange(len(kept)), np.diff(first))
        wanted = ~np.isin(ends * len(kept) + starts, barred[:, 1] * len(kept) + barred[:, 0])
        counts = np.bincount(ends[wanted], minlength=len(kept))
        return starts[wanted], np.append(0, np.cumsum(counts)), errors[wanted]

    def beside(self, lines: NDArray[np.intp]) -> list[tuple[int, int]]:
        """Return lines both of whose ends are the same as those of some line, or next to them.

        Of those between the configurations that were asked for last (`among`); `lines` are the
        indices of their ends in the run, shape (n, 2), and so are those returned.
        """
        kept = self._last
        starts, first, _ = self._found[kept.tobytes()]
        ends = np.repeat(np.arange(len(kept)), np.diff(first))
        place = np.searchsorted(kept, lines[np.isin(lines, kept).all(axis=1)])
        begin, end = (place[:, which, None] + _STEPS for which in (0, 1))
        # no line starts behind its end, so one beyond the first or last configuration is no line
        near = end[:, :, None] * len(kept) + begin[:, None, :]
        found = np.isin(ends * len(kept) + starts, near)
        return list(zip(kept[starts[found]].tolist(), kept[ends[found]].tolist(), strict=True))


def fewest(
    screws: Screws,
    run: Run,
    rule: ChainRule,
    blocked: frozenset[tuple[int, ...]] = frozenset(),
    lines: Lines | None = None,
) -> NDArray[np.intp] | None:
    """Return the fewest configurations that do, in order, the first and the last among them.

    Of several such chains the one with the least largest error is taken, as a fraction of what is
    allowed; of equal ones always the same.

    Args:
        screws: The arm.
        run: The run, two configurations at least.
        rule: What the chain has to keep.
        blocked: What may not be taken: lines by the indices of their ends, and corners by where
            their lines come from, meet and lead to.
        lines: Those of the arm and the run, if they were looked at before.

    Returns:
        Indices in the run; None if no chain keeps the rule.
    """
    lines = lines or Lines(screws, run)
    return chain_of(screws, run, rule, blocked, np.arange(len(run.q)), lines)


def chain_of(
    screws: Screws,
    run: Run,
    rule: ChainRule,
    blocked: frozenset[tuple[int, ...]],
    kept: NDArray[np.intp],
    lines: Lines,
) -> NDArray[np.intp] | None:
    """Return the fewest of some configurations, as `fewest` does.

    Lines are looked at where they pass those; ``kept`` are their indices in the run, in order, the
    first and the last among them.
    """
    of_kept = {int(row): place for place, row in enumerate(kept)}
    known = [
        tuple(of_kept[row] for row in one)
        for one in sorted(blocked)
        if all(row in of_kept for row in one)
    ]
    barred, corners = (
        np.array([one for one in known if len(one) == n], dtype=np.int64).reshape(-1, n)
        for n in (2, 3)
    )
    arm = screws.axes, screws.T_base_flange
    limits = rule.shortest, rule.ratio, rule.zone, rule.corner
    values = (value[kept] for value in run.arrays)
    chain = _chain(*arm, *values, *limits, *lines.among(kept, barred), corners, kept)
    return kept[chain] if len(chain) else None


@kernel(
    "Tuple((int64[::1],int64[::1],float64[::1]))(float64[:,::1],float64[:,::1],float64[:,::1],"
    "float64[:,:,::1],float64[:,:,::1],int64[::1],float64[:,::1],float64[::1],float64[:,::1])",
    early=True,
    makes_arrays=True,
)
def _lines(axes, T0, q, places, targets, freedom, room, allowed, pace):  # type: ignore[no-untyped-def]
    """Return the lines that keep their contact by where they end: starts, first ones, errors."""
    n = len(q)
    T, work = np.empty((3, 4)), np.empty((3, 6))
    starts, errors = np.empty(4 * n, np.int64), np.empty(4 * n)
    first = np.zeros(n + 1, np.int64)
    suspects = np.full(n, -1)
    count = 0
    for j in range(1, n):
        first[j] = count
        for i in range(j):
            error, suspects[i] = straight_off(
                axes,
                T0,
                q,
                places,
                targets,
                freedom,
                room,
                allowed,
                pace,
                i,
                j,
                suspects[i],
                T,
                work,
            )
            if error > 1.0:
                continue
            if count == len(starts):
                starts = np.concatenate((starts, np.empty(count, np.int64)))
                errors = np.concatenate((errors, np.empty(count)))
            starts[count], errors[count] = i, error
            count += 1
    first[n] = count
    return starts[:count], first, errors[:count]


@kernel(makes_arrays=True)
def _even(pace, i, j, k, ratio):  # type: ignore[no-untyped-def]
    """Return whether the speeds of the lines from i to j and on to k are near enough."""
    if k == i + 2:
        return True
    before, after = pace[j] - pace[i], pace[k] - pace[j]
    if LEAST_COUNTED * before[1] > before[2] or LEAST_COUNTED * after[1] > after[2]:
        return True
    one, other = max(before[2] / before[0], LEAST_COUNTED), max(after[2] / after[0], LEAST_COUNTED)
    return max(one / other, other / one) <= ratio * (1.0 + 1e-9)


@kernel(
    "int64[::1](float64[:,::1],float64[:,::1],float64[:,::1],float64[:,:,::1],float64[:,:,::1],"
    "int64[::1],float64[:,::1],float64[::1],float64[:,::1],float64[:,::1],"
    "float64,float64,float64,float64,int64[::1],int64[::1],float64[::1],int64[:,::1],int64[::1])",
    early=True,
    makes_arrays=True,
)
def _chain(  # type: ignore[no-untyped-def]
    axes, T0, q, places, targets, freedom, room, allowed, pace, tool,
    shortest, ratio, zone, most, starts, first, errors, wide, at,
):  # fmt: skip
    """Return the best chain; empty if there is none. A line is charged for with all before it.

    ``starts``, ``first`` and ``errors`` are those of `_lines`; ``at`` are the indices of the
    configurations in the run that they are of.
    """
    n, m = len(q), len(starts)
    cost, largest, before = np.empty(m, np.int64), np.empty(m), np.full(m, -1, np.int64)
    order = np.arange(m)  # the lines that end at a configuration, the best first
    for k in range(1, n):
        for line in range(first[k], first[k + 1]):
            j = starts[line]
            own = 1 if pace[k, 0] - pace[j, 0] >= shortest else _SHORT
            cost[line], largest[line] = (own, errors[line]) if j == 0 else (_NEVER, np.inf)
            for ahead in order[first[j] : first[j + 1]]:
                if cost[ahead] == _NEVER:
                    break
                corner = 0.0
                if not _even(pace, starts[ahead], j, k, ratio):
                    continue
                if zone > 0.0 and at[k] > at[starts[ahead]] + 2:
                    corner = rounded_off(
                        axes, T0, q, places, targets, freedom, tool, starts[ahead], j, k, zone, most
                    )
                refused = corner > most
                for b in range(len(wide)):
                    here = wide[b, 0] == starts[ahead] and wide[b, 1] == j
                    refused |= here and wide[b, 2] == k
                if not refused:
                    cost[line] = cost[ahead] + own
                    largest[line] = max(largest[ahead], errors[line])
                    before[line] = ahead
                    break
        for place in range(first[k] + 1, first[k + 1]):
            line = order[place]
            while place > first[k]:
                other = order[place - 1]
                if cost[other] < cost[line] or (
                    cost[other] == cost[line] and largest[other] <= largest[line]
                ):
                    break
                order[place] = other
                place -= 1
            order[place] = line
    if first[n] == first[n - 1] or cost[order[first[n - 1]]] == _NEVER:
        return np.empty(0, np.int64)
    line, chain = order[first[n - 1]], [n - 1]
    while line >= 0:
        chain.append(starts[line])
        line = before[line]
    return np.array(chain[::-1])
