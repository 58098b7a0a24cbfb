"""The nodes of some places in a box, at contact positions of their own, and tracks through them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from opl.geometry.frames import Array
from opl.least.box_columns import LESS, ColumnSampler
from opl.least.over_ends import learn_of_ends, shut_over_ends, sunk_over_ends
from opl.least.postures import Columns
from opl.least.rows import Bulge, Learn, Row, broken_at, bulging, shut_edges
from opl.least.sinking import (
    first_sunk,
    leads_are_deep,
    places_between,
    struck_between,
    sunk_at,
)
from opl.planning.costs import PushAway, track_cost
from opl.planning.filling import BrokenEdgesError, fill_in
from opl.planning.open_matrix import Track, close_collisions, open_matrices
from opl.planning.plan import Found, Plan, Same, propose_and_check
from opl.planning.problem import GrindingProblem
from opl.planning.settings import CostWeights
from opl.planning.symmetry import everywhere, twins
from opl.planning.track_check import Collides
from opl.search import in_box
from opl.search.box import JointBox
from opl.search.smooth import Travel, smoothest_within
from opl.walls.shut_leads import RESERVE

SAMPLES = 17  # contact positions of a place
ROUNDS = 3  # of sampling closer around a track
MOST_CHECKS = 16  # of motions in one box; those begun with a track are all made
MOST_WORK = 5000.0  # units on them, most of them spent on free moves that are not there
MOST_ROUNDS = 6  # of asking nodes of a track for their clearance


@dataclass
class TrackSearch:
    """By what tracks are sought, and how many were checked.

    Attributes:
        problem: What is to be planned.
        sampler: Samples its places.
        costs: What a track is charged for.
        most: How far joints and contact should move at the most.
        push_away: What nodes that are near to something are charged.
        checks: How many motions were checked.
        places_checked: How many places all of them had.
        collided: How many collided, those that sink aside.
        stopped: What stopped the motions checked last, until one was free: place and cause, and how
            many nodes and edges were blocked for it.
    """

    problem: GrindingProblem
    sampler: ColumnSampler
    costs: CostWeights
    most: Travel
    push_away: PushAway
    checks: int = 0
    places_checked: int = 0
    collided: int = 0
    stopped: Counter[tuple[float, str]] = field(default_factory=Counter)


class BoxNodes:
    """The nodes of some places at contact positions of their own.

    Args:
        search: By what tracks are sought.
        columns: The places and their postures.
        rows: Contact positions that are passed only where they lie in the box.
        box: The box.
        spare: Depth in [m] that nodes leave of what is allowed, by place, shape (n,).
        spacing: Belt units between contact positions, by place, shape (n,).
    """

    def __init__(
        self,
        search: TrackSearch,
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
        self.spare, self._spacing = spare, spacing
        problem = search.problem
        near = columns.free & in_box.nearest(columns.q, columns.free, box)
        pass_index, sampler = columns.points.pass_index, search.sampler
        flips = []
        for flip, move in enumerate(sampler.flips):
            slots = np.array([placed.slot(flip) for placed in columns.placements])
            if not sampler.collisions or flip == sampler.mirrored:
                flips.append((slots[pass_index], *move))
        matrices = everywhere(problem.cell, columns.t, columns.q, near, flips)
        places, points, t = columns.places, columns.points, columns.t
        self.problem = problem.over_nodes(places, points, t, matrices)
        self.matrices = open_matrices(self.problem)
        self._swept = False
        over_ends = shut_over_ends(sampler, columns, t)
        shut = np.union1d(shut_edges(places, t, rows, box), over_ends)
        for matrix in self.matrices:
            matrix.shut = shut

    def sweep(self) -> Track | None:
        """Close every node that collides; return the smoothest track that is left.

        Nodes that keep less than a reserve of clearance are closed as well where their column has
        others: between two of them a motion may collide.
        """
        self._swept = True
        scene = self.problem.scene.collision
        close_collisions(self.matrices, scene)
        left = [matrix.free.copy() for matrix in self.matrices]
        for reserve in (RESERVE, *LESS):
            close_collisions(self.matrices, scene.wider(reserve), leave_some=True)
        if (track := self.smoothest()) is None:
            for matrix, free in zip(self.matrices, left, strict=True):
                matrix.free[:] = free
            track = self.smoothest()
        return track

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
                self.problem, matrix.nodes, replace(search.costs, push_weight=0.0), matrix.free
            )
            asked = np.zeros_like(matrix.free)
            columns = np.arange(len(matrix.free))
            for asking in range(MOST_ROUNDS + 1):
                edges = matrix.blocked_edges
                found = smoothest_within(matrix.ladder, edges, matrix.free, cost, search.most)
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

    def _closer(self, track: Track) -> BoxNodes:
        """Return closer samples around a track, whose own nodes are among them."""
        search, columns = self._search, self._columns
        own = self.matrices[track.matrix].nodes.t_along(track.rows)
        about = np.linspace(-1.0, 1.0, SAMPLES)
        last = search.problem.cell.wheel.last_position
        t = np.clip(own[:, None] + about * self._spacing[:, None], -last, last)
        around = search.sampler.at(columns.places, columns.points, columns.placements, t)
        spacing = self._spacing * 2.0 / (SAMPLES - 1)
        return BoxNodes(search, around, self._rows, self._box, self.spare, spacing)

    def closest(self, track: Track) -> tuple[BoxNodes, Track]:
        """Return samples closer and closer around a track, and the smoothest track in them.

        They are swept if these are.
        """
        sampled: BoxNodes = self
        for _ in range(ROUNDS):
            closer = sampled._closer(track)
            finer = closer.sweep() if self._swept else closer.smoothest()
            if finer is None:
                break
            sampled, track = closer, finer
        return sampled, track

    def bulges(self, track: Track, box: JointBox) -> list[Bulge]:
        """Return where a track leaves the box on its way from place to place, or cannot be made."""
        problem, nodes = self.problem, self.matrices[track.matrix].nodes
        try:
            path = fill_in(problem.cell, problem.points, nodes, track.rows, problem.interpolation)
        except BrokenEdgesError as broken:
            return broken_at(self._columns.places, list(broken.causes))
        if path.joint_range_sum <= box.size:
            return []
        spanned = nodes.along(track.rows)
        outer = JointBox(spanned.min(axis=0), spanned.max(axis=0))
        excess = in_box.missing(path.q, outer.widened(max(box.size - outer.size, 0.0)))
        where = path.cutter_point.astype(int), excess / box.size
        return bulging(self._columns.places, nodes.t_along(track.rows), *where)

    def collides(self, track: Track) -> bool:
        """Return whether a track collides at places with the wrist either way.

        So would its motion, however finely it is cut.
        """
        q = self.matrices[track.matrix].nodes.along(track.rows)
        scene, flips = self.problem.scene.collision, self._search.sampler.flips
        return all(scene.first_colliding(q * sign + shift) < len(q) for sign, shift in flips)

    def check(self, track: Track, learn: Learn) -> tuple[Plan | None, Array | None, bool]:
        """Return the plan of a track, or of the next smoothest, if its whole motion is free.

        One that sinks is the last: others do so as well, but not where its leads are too deep.
        `sunk_between` of it, if it does; and whether something was learnt of where motions collide,
        or sink at a place, instead.
        """
        search, places, problem = self._search, self._columns.places, self.problem
        scene, robot = problem.scene, problem.cell.robot
        most, end = search.checks + MOST_CHECKS, scene.work + MOST_WORK
        while search.checks < most and scene.work < end:
            before, hits = search.checks, dict[Same, Collides]()
            tries = twins(self.matrices, track, robot)
            left = end - scene.work
            outcome = propose_and_check(problem, self.matrices, tries, before, None, left, hits)
            now = outcome.plan if isinstance(outcome, Found) else outcome
            search.checks = now.checks
            search.places_checked += (search.checks - before) * len(places)
            if isinstance(outcome, Found):
                search.stopped = Counter()
                return outcome.plan.at_places(places), None, False
            search.stopped = self._stopped()
            sunk, deep = first_sunk(problem, hits), sunk_at(hits)
            passes, t = problem.points.pass_index[list(deep)], np.array(list(deep.values()))
            if search.sampler.doubts.note(passes, t):
                return None, None, True
            if sunk is not None:
                after = sunk_over_ends(problem, hits)
                if learn_of_ends(search.sampler, self._columns, after, sunk, learn):
                    return None, None, True
            leads_are_shut = leads_are_deep(problem, hits)
            if leads_are_shut and not search.sampler.collisions:
                search.collided += 1  # they are left out with what collides
                return None, None, False
            if sunk is not None and not leads_are_shut:
                return None, sunk, False
            search.collided += 1
            if not self._swept:
                self.sweep()
            nodes_are_free = self.matrices[track.matrix].free[np.arange(len(places)), track.rows]
            if nodes_are_free.all():  # it collides between them alone
                struck = places_between(places, struck_between(problem, hits))
                if struck and learn(struck):
                    return None, None, True
            if (following := self.smoothest()) is None:
                break
            track = following
        return None, None, False

    def _stopped(self) -> Counter[tuple[float, str]]:
        """Return what stopped the motions checked here, as of `TrackSearch.stopped`."""
        causes = sum((matrix.causes for matrix in self.matrices), Counter[tuple[int, str]]())
        places = self._columns.places.tolist()
        return Counter({(places[column], why): count for (column, why), count in causes.items()})
