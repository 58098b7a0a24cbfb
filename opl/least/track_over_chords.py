"""The cheapest way over chords between the contact positions about a track.

Over nodes alone a joint that could be held still wobbles, by what lies between two of them at each
place; and what moves the whole track a little, for little, is told from that only with nodes that
are very close.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from opl.least.own_track import OwnTrack, nodes_about
from opl.planning.problem import GrindingProblem
from opl.search.chord_ways import cheapest_over_chords, way_over_chords
from opl.search.way_cells import Cells, WayPrices


def track_over_chords(
    problem: GrindingProblem, prices: WayPrices, track: OwnTrack, about: float
) -> OwnTrack | None:
    """Return the cheapest way about a track, whatever collides on it; None if there is none.

    Args:
        problem: What is to be planned.
        prices: What it is charged for.
        track: The track.
        about: How far it may lie to either side, in spacings of the field.
    """
    t, q = nodes_about(problem, track, about)
    exists = ~np.isnan(q[..., 0])
    chords = exists[:, :-1] & exists[:, 1:]
    if not chords.any(axis=1).all():
        return None
    start, end = q[:, :-1][chords], q[:, 1:][chords]
    none = np.zeros_like(start)
    first = np.concatenate([[0], np.cumsum(chords.sum(axis=1))])
    low, high = t[:, :-1][chords], t[:, 1:][chords]
    cells = Cells(start, end - start, none, none, low, high, first)
    total, _ = cheapest_over_chords(cells, prices)
    t_way, q_way = way_over_chords(cells, prices, total)
    return replace(track, t=t_way, q=q_way, cost=np.inf)
