"""From a box of joint space to the motion inside it.

Each place along the passes gets contact positions of its own, sampled only where its postures lie
in the box, closer and closer around the smoothest track through them. Where the track bulges out of
the box between two places, more places are taken in.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from opl.geometry.frames import Array
from opl.least.box_nodes import SAMPLES, BoxNodes, TrackSearch
from opl.least.passages import NO_PASSAGES, Passages
from opl.least.postures import Columns
from opl.least.rows import Bulge, Learn, bars, crossed
from opl.least.sinking import DEEP, places_for, shallower, spare_for
from opl.planning.open_matrix import Track
from opl.planning.plan import Plan
from opl.search import in_box
from opl.search.box import JointBox
from opl.search.joint_limits import cut_at
from opl.walls.families import grown

BULGE = 1.75  # times the room of a motion: how far it may leave its box between two places
EDGES_OF_WORK = 3e5  # that cost a unit of work to search, all rounds
MOST_SPARED = 4  # times that depth is spared in one box for what sinks between places


class BoxTracks:
    """Finds motions in boxes.

    Args:
        search: By what tracks are sought.
    """

    def __init__(self, search: TrackSearch) -> None:
        self._search = search
        self._tried: object = None  # in which box a motion was sought last, and among what

    def tried(self, columns: Columns, passages: Passages, box: JointBox) -> bool:
        """Return whether the last that were asked about here were the same: so is the motion."""
        images = tuple(placement.key for placement in columns.placements)
        learnt = self._search.sampler.learnt
        sampled = columns.t.tobytes(), columns.free.tobytes(), len(passages.rows), learnt
        before, self._tried = self._tried, (box.size, images, sampled)
        return before == self._tried

    def plan(
        self,
        columns: Columns,
        passages: Passages,
        box: JointBox,
        room: float,
        learn: Learn,
    ) -> Plan | None:
        """Return the motion of the smoothest free track in a box.

        Args:
            columns: Places, all with postures in the box.
            passages: Contact positions that are passed only where they lie in the box, and ways.
            box: The box.
            room: By how much the motion may leave it, in [rad] of its size.
            learn: Told where tracks leave the box, end or collide.

        Returns:
            The motion; None if nothing is free, or if something was learnt instead.
        """
        places, rows = columns.places, passages.rows
        coarse = sampled = self._sampled(columns, passages, box, room, np.zeros(len(places)))
        track: Track | None = coarse.smoothest()
        if track is None:
            # images differ in their limits only: those with the same nodes tell the same
            few = {(m.free.tobytes(), m.blocked_edges.tobytes()): m for m in coarse.matrices}
            ladders, blocked = (
                [m.ladder for m in few.values()],
                [m.blocked_edges for m in few.values()],
            )
            if learn(bars(places, ladders, blocked)) or not rows:
                return None
            return self.plan(columns, NO_PASSAGES, box, room, partial(learn_if_steep, learn))
        # where collisions are left out, they are looked for on whole motions only
        if not self._search.sampler.collisions and coarse.collides(track):
            self._search.collided += 1
            return None
        bulges = coarse.bulges(track, box.widened(BULGE * room))
        if any(bulge.steep for bulge in bulges) and learn(bulges):
            return None
        sunk, before, most = None, None, box.size + room
        for _ in range(MOST_SPARED + 1):
            if track is None:
                break
            closest, track = sampled.closest(track)
            if (bulges := closest.bulges(track, box.widened(BULGE * room))) and learn(bulges):
                return None
            before = sunk
            plan, sunk, learnt = closest.check(track, learn)
            if plan is not None or learnt:
                return plan
            if sunk is None or not shallower(sunk, before):
                break
            if (sunk > DEEP).any() and learn(places_for(places, np.where(sunk > DEEP, sunk, 0.0))):
                return None
            spare = spare_for(places, sampled.spare, sunk)
            # where the box holds no posture that leaves so much, the nearest that does
            columns = self._search.sampler.columns(box, columns.placements, places, spare)
            larger = grown(columns.q, columns.free, box)
            # places may cost less than depth does
            if (larger is None or larger.size > most) and learn(places_for(places, sunk)):
                return None
            box = larger or box
            sampled = self._sampled(columns, passages, box, room, spare)
            track = sampled.smoothest()
        # where nothing is free that spares so much depth, places may do
        wanted = before if sunk is None else sunk
        if wanted is not None and learn(places_for(places, wanted)):
            return None
        if (track := coarse.sweep()) is None:
            return None
        closest, track = coarse.closest(track)
        if (bulges := closest.bulges(track, box.widened(BULGE * room))) and learn(bulges):
            return None
        return closest.check(track, learn)[0]

    def _sampled(
        self, columns: Columns, passages: Passages, box: JointBox, room: float, spare: Array
    ) -> BoxNodes:
        """Return the nodes of places that a motion in a box may use."""
        inner = cut_at(box.widened(room / 2.0), self._search.sampler.limits)
        t, spacing = in_box.sampled(columns.t, columns.q, columns.free, inner, SAMPLES)
        places, one = columns.places, t[:, :1]
        sampler, crossing = self._search.sampler, crossed(places, passages.crossings, one)
        free = nearest_free(columns, inner) if sampler.collisions else one[:, :0]
        t = np.concatenate([t, crossing, free, sampler.ends.contact_positions(len(t))], axis=1)
        sampler.work += len(t) * t.shape[1] ** 2 / EDGES_OF_WORK
        at = sampler.at(places, columns.points, columns.placements, t)
        return BoxNodes(self._search, at, passages.rows, inner, spare, spacing)


def learn_if_steep(learn: Learn, bulges: Sequence[Bulge]) -> bool:
    """Learn of bulges where one is steep; return whether anything was.

    Of a track past rows: rows tell where it sinks between places, these would but be cut finer.
    """
    return any(bulge.steep for bulge in bulges) and learn(bulges)


def nearest_free(columns: Columns, box: JointBox) -> Array:
    """Return between which sampled contact positions places are nearest to a box, shape (n, 2).

    Columns sampled with collisions left out do not collide there. Where little of a box is free,
    samples spread over it would miss that. In belt units.
    """
    _, row = in_box.nearest_points(columns.q, columns.free, box)
    both = np.stack([np.floor(row), np.ceil(row)], axis=1).astype(int)
    return np.asarray(np.take_along_axis(columns.t, np.maximum(both, 0), axis=1))
