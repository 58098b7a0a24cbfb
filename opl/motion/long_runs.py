"""The fewest configurations of long runs, where looking at every pair would cost too much.

Where cutter points lie far closer together than a controller needs positions, most configurations
lie on the joint lines between others: leaving those out of the choice loses little, and the choice
costs by how the run bends instead of by how many configurations it has. Lines are chosen over the
few places that are kept, and then looked at at every place; a place that one misses is kept too,
and the choice is made anew.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from opl.files.kernels import kernel
from opl.motion.fewest import ChainRule, Lines, chain_of, fewest
from opl.motion.line_error import Run, Screws, straight_off

ENOUGH = 192  # configurations, evenly spread, to choose from; twice as many are left as they are
# of the error allowed: what a line past configurations that are left out may be off; the second
# where no chain is left of the first
LEFT_OUT = (0.1, 0.01)


def fewest_of_long(
    screws: Screws,
    run: Run,
    rule: ChainRule,
    blocked: frozenset[tuple[int, ...]] = frozenset(),
    lines: Lines | None = None,
) -> NDArray[np.intp] | None:
    """Return the fewest configurations that do, in order, the first and the last among them.

    As `fewest` for runs of less than twice `ENOUGH` configurations. Of longer ones the fewest of
    about so many, and of all where lines past those left out are off by more than a share of what
    is allowed (`LEFT_OUT`). Every place of the run keeps the rule all the same.

    Args:
        screws: The arm.
        run: The run, two configurations at least.
        rule: What the chain has to keep.
        blocked: What may not be taken, as in `fewest`.
        lines: Those of the arm and the run, if they were looked at before.

    Returns:
        Indices in the run; None if no chain keeps the rule.
    """
    stride = len(run.q) // ENOUGH
    lines = lines or Lines(screws, run)
    if stride <= 1:
        return fewest(screws, run, rule, blocked, lines)
    arm, values = (screws.axes, screws.T_base_flange), run.arrays[:-1]
    for share in LEFT_OUT:
        kept, refused = _kept(*arm, *values, share, stride), blocked
        while (chain := chain_of(screws, run, rule, refused, kept, lines)) is not None:
            missed: list[int] = []
            for line in pairwise(chain.tolist()):
                off, place = _off(*arm, *values, *line)
                if off:
                    refused |= {line}
                    missed += [place]
            if not missed:
                return chain
            kept = np.union1d(kept, missed)
    return fewest(screws, run, rule, blocked, lines)


@kernel(makes_arrays=True)
def _kept(  # type: ignore[no-untyped-def]
    axes, T0, q, places, targets, freedom, room, allowed, pace, share, most
):
    """Return configurations between which lines are off by a share of what is allowed at most.

    Up to ``most`` indices are between neighbours.
    """
    T, work = np.empty((3, 4)), np.empty((3, 6))
    kept, here, last = [0], 0, len(q) - 1
    while here < last:
        stride = min(most, last - here)
        while stride > 1:
            error, _ = straight_off(
                axes, T0, q, places, targets, freedom, room, allowed, pace,
                here, here + stride, -1, T, work,
            )  # fmt: skip
            if error <= share:
                break
            stride //= 2
        here += stride
        kept.append(here)
    return np.array(kept)


@kernel(makes_arrays=True)
def _off(axes, T0, q, places, targets, freedom, room, allowed, pace, start, end):  # type: ignore[no-untyped-def]
    """Return whether a line is off by more than is allowed somewhere, and a place that tells so."""
    T, work = np.empty((3, 4)), np.empty((3, 6))
    error, place = straight_off(
        axes, T0, q, places, targets, freedom, room, allowed, pace, start, end, -1, T, work
    )
    return error > 1.0, place if place >= 0 else end - 1
