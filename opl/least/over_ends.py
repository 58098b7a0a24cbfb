"""Over the ends of the wheel's flat: where motions sank there, tracks pass them where they may."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from opl.cell.workcell import PART, WHEEL
from opl.geometry.frames import Array
from opl.least.box_columns import ColumnSampler
from opl.least.postures import Columns
from opl.least.rows import MOST_PARTS, Learn
from opl.least.sinking import places_between
from opl.planning.plan import Same
from opl.planning.problem import GrindingProblem
from opl.planning.track_check import Collides

SAME = 1e-6  # belt units
BESIDE = 0.25  # of an edge: so close to a place that is free
CLOSE = 0.01  # cutter points: places so near are not cut finer


def sunk_over_ends(problem: GrindingProblem, collided: Mapping[Same, Collides]) -> list[int]:
    """Return after which columns motions sink just where they pass an end of the flat.

    Args:
        problem: What is to be planned.
        collided: Motions that collide.
    """
    end, columns = problem.cell.wheel.flat_end, set[int]()
    for blocked in collided.values():
        motion = blocked.motion
        for fault in blocked.faults:
            place, t = motion.cutter_point[fault.move], motion.contact_position[fault.move]
            there = fault.at_end and abs(abs(t) - end) < SAME
            if there and fault.pair == (PART, WHEEL) and place != np.rint(place):
                columns.add(int(place))
    return sorted(columns)


def learn_of_ends(
    sampler: ColumnSampler, columns: Columns, after: list[int], sunk: Array, learn: Learn
) -> bool:
    """Learn of motions that sink as they pass an end of the flat; return whether anything was.

    A pass that does so leads from now on where the part is not too deep there. Between two such
    places it may be a little: places are taken in, and where they are close, depth is spared.

    Args:
        sampler: Takes note.
        columns: The places.
        after: As `sunk_over_ends` returns it.
        sunk: By how much the part is too deep between them in [m], shape (n - 1,).
        learn: Told where places are wanted.
    """
    passes, wide = columns.points.pass_index, np.diff(columns.places) > CLOSE
    after = [k for k in after if sunk[k] > 0.0]
    coarse = [k for k in after if sampler.ends.sank[passes[k]] and wide[k]]
    wanted = places_between(columns.places, np.isin(np.arange(len(sunk)), coarse), MOST_PARTS)
    learnt = bool(wanted) and learn(wanted)
    for index in np.unique(passes[[k for k in after if k not in coarse]]).tolist():
        sampler.ends.note(index, max(float(sunk[k]) for k in after if passes[k] == index))
        learnt = True
    return learnt


def shut_over_ends(sampler: ColumnSampler, columns: Columns, t: Array) -> np.ndarray:
    """Return the sorted keys of the edges that pass an end of the flat where the part is too deep.

    Of passes that sank there. An edge between a place that is free and one that is not may be used
    if it passes the end close to the former.

    Args:
        sampler: Samples the places.
        columns: The places.
        t: Contact positions of their nodes in belt units, shape (n, m).
    """
    found = np.zeros((len(t) - 1, t.shape[1], t.shape[1]), dtype=bool)
    for index in np.flatnonzero(sampler.ends.sank).tolist():
        own = np.flatnonzero(columns.points.pass_index == index)
        places, ends = columns.places[own], sampler.ends.contact_positions(len(own))
        free = sampler.at(places, sampler.there(places), [columns.placements[index]], ends).free
        for end, shut in zip(ends[0], ~free.T, strict=True):
            some = np.flatnonzero(shut[:-1] | shut[1:])
            before, after = t[own[some], :, None] - end, t[own[some] + 1, None] - end
            over = before * after < 0.0
            share = np.where(over, before, 0.0) / np.where(over, before - after, 1.0)
            beside = np.where(shut[some, None, None], 1.0 - share, share) <= BESIDE
            one_is_free = (~(shut[some] & shut[some + 1]))[:, None, None]
            found[own[some]] |= over & ~(beside & one_is_free)
    return np.flatnonzero(found)
