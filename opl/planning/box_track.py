"""From a box of joint space to the motion inside it.

Each place along the passes gets contact positions of its own, sampled only where its postures lie
in the box, closer and closer around the smoothest track through them. Where the track bulges out of
the box between two places, more places are taken in.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from opl.geometry.frames import Array
from opl.planning.box_columns import ColumnSampler
from opl.planning.costs import PushAway, track_cost
from opl.planning.families import grown
from opl.planning.filling import BrokenEdgeError, fill_in
from opl.planning.nodes import NodeField
from opl.planning.open_matrix import Track, close_collisions, open_matrices
from opl.planning.passages import NO_PASSAGES, Passages
from opl.planning.plan import Found, Plan, Same, propose_and_check
from opl.planning.postures import Columns
from opl.planning.problem import GrindingProblem
from opl.planning.rows import Bulge, Row, bars, broken_at, bulging, crossed, levels, shut_edges
from opl.planning.settings import CostWeights
from opl.planning.sinking import (
    first_sunk,
    places_for,
    shallower,
    spare_for,
    struck_between,
    until_sunk,
)
from opl.planning.symmetry import everywhere, twins
from opl.planning.track_check import Collides
from opl.search import in_box
from opl.search.box import JointBox
from opl.search.joint_limits import cut_at
from opl.search.smooth import Travel, smoothest_within

SAMPLES = 17  # contact positions of a place
ROUNDS = 3  # of sampling closer around a track
BULGE = 1.75  # times the room of a motion: how far it may leave its box between two places
EDGES_OF_WORK = 3e5  # that cost a unit of work to search, all rounds
MOST_CHECKS = 16  # of motions in one box; those begun with a track are all made
MOST_WORK = 5000.0  # units on them, most of them spent on free moves that are not there
MOST_SPARED = 4  # times that depth is spared in one box for what sinks between places
MOST_ROUNDS = 6  # of asking nodes of a track for their clearance

Learn = Callable[[Sequence[Bulge]], bool]  # told where places are wanted; whether that is new


class BoxTracks:
    """Finds motions in boxes.

    Args:
        problem: What is to be planned.
        sampler: Samples its places.
        costs: What a track is charged for.
        max_contact_change: Largest change of t between neighbouring places in belt units.
        most: How far joints and contact should move at the most.
    """

    def __init__(
        self,
        problem: GrindingProblem,
        sampler: ColumnSampler,
        costs: CostWeights,
        max_contact_change: float,
        most: Travel,
    ) -> None:
        self._problem = problem
        self.sampler = sampler
        self._costs = costs
        self._max_contact_change = max_contact_change
        self._most = most
        self.push_away = PushAway(problem.cell, costs)
        self.checks = self.places_checked = self.collided = 0  # those that sink aside

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
            ladders = [one.ladder_within(self._max_contact_change) for one in few.values()]
            if learn(bars(places, ladders, [one.blocked_edges for one in few.values()])):
                return None
            return self.plan(columns, NO_PASSAGES, box, room, learn) if rows else None
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
            plan, sunk, learnt = closest.check(track, learn)
            if plan is not None and before is not None and plan.path.joint_range_sum > most:
                learn(places_for(places, before))  # places may cost less than depth does
            if plan is not None or learnt:
                return plan
            if sunk is None or not shallower(sunk, before):
                break
            before, spare = sunk, spare_for(sampled.spare, sunk)
            # where the box holds no posture that leaves so much, the nearest that does
            columns = self.sampler.columns(box, columns.placements, places, spare)
            box = grown(columns.q, columns.free, box) or box
            sampled = self._sampled(columns, passages, box, room, spare)
            track = sampled.smoothest()
        if sunk is not None and learn(places_for(places, sunk)):
            return None
        coarse.sweep()
        around = coarse.smoothest()
        return None if around is None else coarse.check(around, learn)[0]

    def _sampled(
        self, columns: Columns, passages: Passages, box: JointBox, room: float, spare: Array
    ) -> _Sampled:
        """Return the nodes of places that a motion in a box may use."""
        inner = cut_at(box.widened(room / 2.0), self.sampler.limits)
        t, spacing = in_box.sampled(columns.t, columns.q, columns.free, inner, SAMPLES)
        places, one = columns.places, t[:, :1]
        known = levels(places, passages.rows, inner, one), crossed(places, passages.crossings, one)
        t = np.concatenate([t, *known], axis=1)
        self.sampler.work += len(t) * t.shape[1] ** 2 / EDGES_OF_WORK
        at = self.sampler.at(places, columns.points, columns.placements, t)
        return _Sampled(self, at, passages.rows, inner, spare, spacing)


class _Sampled:
    """The nodes of some places at contact positions of their own."""

    def __init__(
        self,
        search: BoxTracks,
        columns: Columns,
        rows: Sequence[Row],
        box: JointBox,
        spare: Array,
        spacing: Array,
    ) -> None:
        self._search = search
        self._columns = columns = search.sampler.spared(columns, spare)
        self._rows = rows
        self._box = box
        self.spare = spare  # depth in [m] that nodes leave of what is allowed, by column
        self._spacing = spacing  # belt units between contact positions, by column
        problem = search._problem
        near = columns.free & in_box.nearest(columns.q, columns.free, box)
        q = np.where(near[..., None], columns.q, np.nan)
        pass_index, sampler = columns.points.pass_index, search.sampler
        flips = []
        for flip, move in enumerate(sampler.flips):
            slots = np.array([placed.slot(flip) for placed in columns.placements])
            if not sampler.collisions or flip == sampler.mirrored:
                flips.append((slots[pass_index], *move))
        matrices = everywhere(problem.cell, columns.t, q, flips)
        self.problem = replace(
            problem,
            points=columns.points,
            field=NodeField(columns.t[0], problem.field.reached[:0], {}, tuple(matrices)),
            wheel_distance=np.zeros(columns.t.shape),
            known_sides=problem.sides_at(columns.places, columns.t),
        )
        self.matrices = open_matrices(self.problem)
        self._swept = False
        shut = shut_edges(columns.places, columns.t, rows, box)
        for matrix in self.matrices:
            matrix.shut = shut

    def sweep(self) -> None:
        """Close every node that collides."""
        self._swept = True
        close_collisions(self.matrices, self.problem.scene.collision)

    def smoothest(self) -> Track | None:
        """Return the smoothest track in the matrix that is farthest from the limits."""
        search, without = self._search, set()
        for index, matrix in enumerate(self.matrices):
            # images differ in their limits only: one with the same nodes has no track either
            left = matrix.free.tobytes(), matrix.blocked_edges.tobytes()
            if left in without:
                continue
            without.add(left)
            cost = track_cost(
                self.problem, matrix.nodes, replace(search._costs, push_weight=0.0), matrix.free
            )
            ladder = matrix.ladder_within(search._max_contact_change)
            asked = np.zeros_like(matrix.free)
            columns = np.arange(len(matrix.free))
            for asking in range(MOST_ROUNDS + 1):
                edges = matrix.blocked_edges
                found = smoothest_within(ladder, edges, matrix.free, cost, search._most)
                if found is None:
                    break
                # only along the track, and all over columns where something is nearer than wanted
                new = ~asked[columns, found.rows]
                charge = search.push_away.charge(matrix.nodes.q[columns[new], found.rows[new]])
                now = np.zeros_like(asked)
                now[columns[new][charge > 0.0]] = True
                now &= matrix.free & ~asked
                if asking == MOST_ROUNDS or not now.any():
                    return Track(index, found.rows)
                cost.node_cost[now] += search.push_away.charge(matrix.nodes.q[now])
                asked |= now
        return None

    def _closer(self, track: Track) -> _Sampled:
        """Return closer samples around a track, whose own nodes are among them."""
        search, columns = self._search, self._columns
        own = self.matrices[track.matrix].nodes.t_along(track.rows)
        about = np.linspace(-1.0, 1.0, SAMPLES)
        last = search._problem.cell.wheel.last_position
        t = np.clip(own[:, None] + about * self._spacing[:, None], -last, last)
        around = search.sampler.at(columns.places, columns.points, columns.placements, t)
        spacing = self._spacing * 2.0 / (SAMPLES - 1)
        return _Sampled(search, around, self._rows, self._box, self.spare, spacing)

    def closest(self, track: Track) -> tuple[_Sampled, Track]:
        """Return samples closer and closer around a track, and the smoothest track in them."""
        sampled: _Sampled = self
        for _ in range(ROUNDS):
            closer = sampled._closer(track)
            if (finer := closer.smoothest()) is None:
                break
            sampled, track = closer, finer
        return sampled, track

    def bulges(self, track: Track, box: JointBox) -> list[Bulge]:
        """Return where a track leaves the box on its way from place to place, or cannot be made."""
        problem, nodes = self.problem, self.matrices[track.matrix].nodes
        try:
            path = fill_in(problem.cell, problem.points, nodes, track.rows, problem.interpolation)
        except BrokenEdgeError as broken:
            return broken_at(self._columns.places, broken.column)
        if path.joint_range_sum <= box.size:
            return []
        spanned = nodes.along(track.rows)
        outer = JointBox(spanned.min(axis=0), spanned.max(axis=0))
        excess = in_box.missing(path.q, outer.widened(max(box.size - outer.size, 0.0)))
        where = path.cutter_point.astype(int), excess / box.size
        return bulging(self._columns.places, nodes.t_along(track.rows), *where)

    def check(self, track: Track, learn: Learn) -> tuple[Plan | None, Array | None, bool]:
        """Return the plan of a track, or of the next smoothest, if its whole motion is free.

        One that sinks is the last: others do so as well. `sunk_between` of it, if it does; and
        whether something was learnt of where motions collide instead.
        """
        search, places, problem = self._search, self._columns.places, self.problem
        scene, robot = problem.scene, problem.cell.robot
        most, end = search.checks + MOST_CHECKS, scene.work + MOST_WORK
        while search.checks < most and scene.work < end:
            before, hits = search.checks, dict[Same, Collides]()
            tries = until_sunk(problem, twins(self.matrices, track, robot), hits)
            left = end - scene.work
            outcome = propose_and_check(problem, self.matrices, tries, before, None, left, hits)
            now = outcome.plan if isinstance(outcome, Found) else outcome
            search.checks = now.checks
            search.places_checked += (search.checks - before) * len(places)
            if isinstance(outcome, Found):
                return outcome.plan.at_places(places), None, False
            if (sunk := first_sunk(problem, hits)) is not None:
                return None, sunk, False
            search.collided += 1
            struck = places_for(places, struck_between(problem, hits))
            if struck and learn(struck):
                return None, None, True
            if not self._swept:
                self.sweep()
            if (following := self.smoothest()) is None:
                break
            track = following
        return None, None, False
