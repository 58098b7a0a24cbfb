"""Places at one contact position: where a motion in a box can pass it, and where not."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from opl.geometry.frames import Array
from opl.least.stretches import passed
from opl.search.box import JointBox
from opl.search.impasse import barred
from opl.search.ladder import Ladder

SMALLEST_EDGE = 1.0 / 500.0  # of that between cutter points that is still given places
MOST_PARTS = 8  # into which an edge that bulges is cut at once
FINE_SHARE = 3e-5  # of the box: what an edge may bulge
SWEEP = 6.0  # belt units that the contact moves from cutter point to cutter point in a sweep
SAME = 1e-5  # cutter points that two places are apart at the least
SAME_PLACE = 1e-9  # cutter points that two stretches of a row are apart at the least


@dataclass(frozen=True)
class Row:
    """Places of a pass at one contact position.

    Attributes:
        places: Increasing, shape (m,).
        contact_position: Theirs.
        q: Placed postures in [rad], NaN where there are none, shape (m, 6).
    """

    places: Array
    contact_position: float
    q: Array


@dataclass(frozen=True)
class Bulge:
    """Where a track leaves its box between two places.

    Attributes:
        first: The place before.
        last: The place after.
        parts: Into how many parts the way between them should be cut.
        steep: Whether the contact sweeps over the wheel there.
    """

    first: float
    last: float
    parts: int
    steep: bool


Learn = Callable[[Sequence[Bulge]], bool]  # told where places are wanted; whether that is new


def _one_after_the_other(rows: Sequence[Row]) -> tuple[Array, Array, np.ndarray, Array]:
    """Return rows as the compiled loops take them."""
    return (
        np.concatenate([row.q for row in rows]),
        np.concatenate([row.places for row in rows]),
        np.cumsum([0, *(len(row.places) for row in rows)]),
        np.array([row.contact_position for row in rows]),
    )


def crossed(places: Array, crossings: Array, otherwise: Array) -> Array:
    """Return at which contact position a way crosses each place, shape (n, 1).

    Straight on from crossing to crossing, which is a guess where nothing is cut finer between them;
    ``otherwise``, shape (n, 1), before the first and past the last. Crossings of shape (k, 2) as of
    `Passages`.
    """
    t: Array = otherwise.copy()
    if len(crossings):
        known, first = np.unique(crossings[:, 0], return_index=True)
        inside = (places > known[0] - SAME) & (places < known[-1] + SAME)
        t[inside, 0] = np.interp(places[inside], known, crossings[first, 1])
    return t


def shut_edges(places: Array, t: Array, rows: Sequence[Row], box: JointBox) -> np.ndarray:
    """Return the sorted keys of the edges that pass a row where it lies outside of a box.

    The nodes are at some places and contact positions, shape (n,) and (n, m).
    """
    counts = np.zeros((2, len(t) - 1, t.shape[1]), dtype=np.int64)
    if rows:
        at = np.array(places), np.ascontiguousarray(t)
        passed(*at, _one_after_the_other(rows), box.lower, box.upper, SAME_PLACE, SAME, counts)
    before, after = counts
    return np.flatnonzero(before[:, :, None] != after[:, None, :])


def bulging(places: Array, t: Array, edge: np.ndarray, excess: Array) -> list[Bulge]:
    """Return where a motion leaves its box between two places that are cut further.

    Args:
        places: Fractional cutter points, shape (n,).
        t: Contact position at each, shape (n,).
        edge: After which place each configuration of the motion is, shape (k,).
        excess: By how much it is outside, in sizes of the box, shape (k,).
    """
    found = []
    for column in np.unique(edge[excess > 0.0]).tolist():
        first, last = places[column : column + 2].tolist()
        if last - first > SMALLEST_EDGE:
            over = excess[edge == column].max() / FINE_SHARE
            # falls with the square
            parts = int(np.clip(np.ceil(np.sqrt(1.0 + over)), 2, MOST_PARTS))
            steep = bool(abs(t[column + 1] - t[column]) > SWEEP * (last - first))
            found.append(Bulge(first, last, parts, steep))
    return found


def broken_at(places: Array, columns: Sequence[int]) -> list[Bulge]:
    """Return ways from a place to the next, cut further: they cannot be made as they are."""
    edges = [(float(places[column]), float(places[column + 1])) for column in columns]
    return [Bulge(*edge, MOST_PARTS, True) for edge in edges if edge[1] - edge[0] > SMALLEST_EDGE]


def bars(
    places: Array, ladders: Sequence[Ladder], blocked_edges: Sequence[np.ndarray]
) -> list[Bulge]:
    """Return between which places no track of a ladder gets further, onwards or back.

    From its start or end, and from where it would go on had it got past one. It would get past what
    is shut, or joints would turn further than an edge may. Where that is so only at places that are
    as close as they may be, what tracks do that sweep over the wheel before may be to blame: then
    it is told of those that do not. The edges that are blocked in each ladder are sorted keys, as
    of `shut_edges`.
    """
    found = _bars(places, ladders, blocked_edges)
    return found or _bars(places, [_unswept(one, places) for one in ladders], blocked_edges)


def _bars(
    places: Array, ladders: Sequence[Ladder], blocked_edges: Sequence[np.ndarray]
) -> list[Bulge]:
    found: list[Bulge] = []
    for ladder, blocked in zip(ladders, blocked_edges, strict=True):
        for k, turned in (end for back in (False, True) for end in _ends(ladder, blocked, back)):
            if places[k + 1] - places[k] > SMALLEST_EDGE:
                shut, least = not np.isfinite(turned).any(), turned.min(initial=np.inf)
                parts = 2 if shut else int(np.clip(np.ceil(least), 2, MOST_PARTS))
                found.append(Bulge(float(places[k]), float(places[k + 1]), parts, shut))
    return list(dict.fromkeys(found))  # the same in each image


def _unswept(ladder: Ladder, places: Array) -> Ladder:
    """Return a ladder whose contact does not sweep over the wheel where places are far apart.

    There nothing is known of what it would sweep over.
    """
    apart = np.diff(places)
    most = np.where(apart > 1.0 / MOST_PARTS, SWEEP * apart, np.inf)
    return replace(ladder, max_contact_change=np.minimum(ladder.contact_changes, most))


def _ends(ladder: Ladder, blocked: np.ndarray, back: bool) -> Iterator[tuple[int, Array]]:
    """Yield over which edges tracks get no further, and how far joints would turn over each."""
    shut, reached = barred(ladder, blocked, back)
    for k in np.flatnonzero(shut).tolist():
        before, after = (ladder.free, reached) if back else (reached, ladder.free)
        yield k, _turned(ladder, k, blocked, before[k], after[k + 1])


def _turned(
    ladder: Ladder, k: int, blocked: np.ndarray, before: np.ndarray, after: np.ndarray
) -> Array:
    """Return how far joints turn from some nodes of a place to some of the next, in what they may.

    The nodes are flags of shape (m,) each; infinite where something is shut in between.
    """
    one, other, size = np.flatnonzero(before), np.flatnonzero(after), len(before) * len(after)
    t, q = ladder.t_of_nodes, ladder.q
    change = np.abs(t[k + 1, other] - t[k, one, None])
    steps = np.maximum(np.ceil(change / ladder.max_contact_step - 1e-9), 1.0)
    largest = np.zeros_like(change)
    for start, end in zip(q[k, one].T, q[k + 1, other].T, strict=True):
        np.maximum(largest, np.abs(end - start[:, None]), out=largest)
    shut = change > ladder.contact_changes[k] + 1e-9
    if ladder.sides is not None:
        shut |= ladder.sides[k, 0, one][:, None] != ladder.sides[k, 1, other]
    first, end = np.searchsorted(blocked, [k * size, (k + 1) * size])
    if end > first:
        edges = np.zeros((len(before), len(after)), dtype=bool)
        edges.flat[blocked[first:end] - k * size] = True
        shut |= edges[np.ix_(one, other)]
    return np.asarray(np.where(shut, np.inf, largest / (steps * ladder.max_joint_step)))
