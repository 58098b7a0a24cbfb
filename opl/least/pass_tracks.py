"""The cheapest tracks of passes, at contact positions between those of the field as well.

Joint travel and time add up along a track. Over the contact positions of the field the cheapest is
a staircase, and however fine they are, what it costs stays above what a slanted way does. So the
cheapest is sought over few cutter points first, which are far apart beside the contact positions;
more and more are put in between, each with contact positions of its own about the track, until all
are there. It is the best of what was looked at, not proven to be the best of all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from opl.geometry.frames import Array
from opl.least.own_track import ABOUT, OwnTrack, nodes_about
from opl.least.telling_places import way_prices
from opl.least.track_over_chords import track_over_chords
from opl.planning.costs import track_cost
from opl.planning.filling import BrokenEdgesError, fill_in
from opl.planning.nodes import NodeMatrix
from opl.planning.open_matrix import open_matrices
from opl.planning.problem import GrindingProblem
from opl.planning.settings import CostWeights, ObjectiveWeights
from opl.planning.symmetry import everywhere
from opl.planning.turned import Kept
from opl.search.box import JointBox
from opl.search.smooth import smoothest
from opl.search.way_cells import WayPrices
from opl.walls.images import wrist_flips
from opl.walls.shut_leads import RESERVE, ShutLeads

# cutter points of a pass that are looked at first: the more, the more of a staircase the first
# track is; the fewer, the less it knows of what lies between
FEWS = 17, 5, 2
WIDER = 1.0, 4.0, 16.0  # times as far to either side, where nothing nearer is free
CLOSER = 0.25  # times as far to either side next, where the track hardly gets cheaper
HARDLY = 0.0005  # of its cost
# spacings of the field: no closer than that before more cutter points are put in, and at last
CLOSEST_BETWEEN, CLOSEST = 0.25, 0.005
NEAREST_WAY = 0.1  # likewise, of ways over chords: bent over so little they are as good as straight
ALIKE = 1e-6  # tracks whose costs differ by less are images of one another
# times the costs that decide between tracks that are charged alike: for travel few are, for time
# most, whose motions take longer than is told from place to place where joints turn fast
TIES_OF_TRAVEL, TIES_OF_TIME = 1e-4, 1e-3
LONGER = 0.002  # of the mean way from place to place: what a way may be longer than it is told
MOST_HALVINGS = 6  # of ways that are


class PassTracks:
    """Finds cheap tracks of passes, free of collision at their nodes.

    Args:
        problem: What is to be planned.
        weights: What a track is charged for.
        costs: What decides between tracks that are charged alike.

    Attributes:
        prices: What is charged for, and a little of what decides.
    """

    def __init__(
        self, problem: GrindingProblem, weights: ObjectiveWeights, costs: CostWeights
    ) -> None:
        self._problem, self._weights = problem, weights
        self.prices = _prices(weights, costs)
        self._scene = problem.scene.collision.wider(RESERVE)
        self._leads = ShutLeads(problem)

    def about(
        self,
        track: OwnTrack,
        box: JointBox | None = None,
        closest: float = CLOSEST,
        widest: float = ABOUT,
    ) -> OwnTrack | None:
        """Return the cheapest track that is found about another of one pass.

        Contact positions are sampled closer and closer around the cheapest so far.

        Args:
            track: The other.
            box: Where it stays, if anywhere.
            closest: How close samples lie at last, in spacings of the field.
            widest: How far to either side they lie at first.
        """
        about, cost = widest, np.inf
        while about > closest:
            nodes = nodes_about(self._problem, track, about)
            found = self._cheapest(track.places, int(track.ik_branch[0]), *nodes, box)
            if found is None:
                return None
            if found.cost >= cost * (1.0 - HARDLY) - ALIKE:
                about *= CLOSER
            track, cost = found, found.cost
        return track

    def over_few(
        self, index: int, count: int = FEWS[0], box: JointBox | None = None
    ) -> dict[int, OwnTrack]:
        """Return the cheapest tracks over so many cutter points of a pass, by IK branch.

        At contact positions of the field, each in the first matrix of the branch that has one.
        """
        problem, found = self._problem, dict[int, OwnTrack]()
        few = _spread(np.flatnonzero(problem.points.pass_index == index), count)
        for nodes in problem.field.matrices:
            q = nodes.at(few[:, None], np.arange(len(nodes.position_index)))
            q[problem.cuts[few][:, nodes.position_index]] = np.nan
            t, branch = nodes.contact_position[few], int(nodes.ik_branch[few[0]])
            track = self._cheapest(few.astype(float), branch, t, q, box)
            if track is not None and (
                branch not in found or track.cost < found[branch].cost - ALIKE
            ):
                found[branch] = track
        return found

    def over_all(self, begun: OwnTrack, box: JointBox | None = None) -> OwnTrack | None:
        """Return the track over all cutter points that one over some places of a pass leads to."""
        index = self._problem.points.pass_index
        columns = np.flatnonzero(index == index[int(begun.places[0])])
        while not np.isin(columns, begun.places).all():
            closer = self.about(begun, box, CLOSEST_BETWEEN)
            if closer is None:
                return None
            begun = closer.at(_spread(columns, 2 * len(begun.places) - 1).astype(float))
        return self.about(begun, box)

    def along_way(self, way: OwnTrack, other: OwnTrack | None = None) -> OwnTrack | None:
        """Return the track over all cutter points that a way over some of a pass leads to.

        Through places between them where that is longer. It is made with the flip and the full
        turns that are farthest from the limits, or with the flip of another track if it can be.

        Args:
            way: The way, with the family of its postures for the IK branch.
            other: That track, if any.
        """
        flips = [
            (way.ik_branch + 4 * flip, *move)
            for flip, move in enumerate(wrist_flips(self._problem.cell.robot.arm))
        ]
        t, q, chosen = way.t[:, None], way.q[:, None], np.ones((len(way.t), 1), dtype=bool)
        made = everywhere(self._problem.cell, t, q, chosen, flips)
        if not made:
            return None
        wanted = None if other is None else other.ik_branch[0] // 4
        image = next((one for one in made if one.ik_branch[0] // 4 == wanted), made[0])
        begun = OwnTrack(way.places, image.ik_branch, way.t, np.asarray(image.q)[:, 0])
        found = self.over_all(begun)
        return None if found is None else self.through_places(self.straightened(found))

    def straightened(self, track: OwnTrack) -> OwnTrack:
        """Return a track of one pass that is charged less, of ways over chords about it.

        Nearer and nearer to it, as long as that is more than hardly anything; the same if none is.
        """
        about, best = ABOUT, self.charged(track).cost
        while about > NEAREST_WAY:
            way = track_over_chords(self._problem, self._way_prices(track), track, about)
            found = None if way is None else self.about(way, None, CLOSEST, about * CLOSER)
            if found is not None and (now := self.charged(found).cost) < best * (1.0 - HARDLY):
                track, best = found, now
            else:
                about *= CLOSER
        return track

    def through_places(self, track: OwnTrack, box: JointBox | None = None) -> OwnTrack:
        """Return a track of one pass through places between its own, where it is longer than told.

        Between two places the contact position changes evenly, and joints may turn farther than
        from one posture to the other.
        """
        for _ in range(MOST_HALVINGS):
            longer = self._longer(track)
            if not len(longer):
                break
            halves = (track.places[longer] + track.places[longer + 1]) / 2.0
            finer = self.about(track.at(np.sort(np.append(track.places, halves))), box)
            if finer is None:
                break
            track = finer
        return track

    def with_places(
        self, track: OwnTrack, places: Array, box: JointBox | None = None
    ) -> OwnTrack | None:
        """Return the cheapest track found about one of a pass, through other places of it."""
        track = track.at(places[(places >= track.places[0]) & (places <= track.places[-1])])
        found = (self.about(track, box, widest=times * ABOUT) for times in WIDER)
        return next(filter(None, found), None)

    def charged(self, track: OwnTrack) -> OwnTrack:
        """Return a track with what travel and time along it cost, without what decides."""
        return replace(track, cost=float(self._costs(track).sum()))

    def _longer(self, track: OwnTrack) -> np.ndarray:
        """Return after which places of a track the way costs more than from place to place."""
        problem, nodes = self._over(
            track.places, track.ik_branch, track.t[:, None], track.q[:, None]
        )
        rows = np.zeros(len(track.places), dtype=int)
        try:
            path = fill_in(problem.cell, problem.points, nodes, rows, problem.interpolation)
        except BrokenEdgesError as broken:
            return np.array(list(broken.causes))
        if not len(told := self._costs(track)):
            return np.empty(0, dtype=int)
        before = path.cutter_point[:-1].astype(int)
        places = np.interp(path.cutter_point, np.arange(len(track.places)), track.places)
        filled = replace(track, places=places, t=path.contact_position, q=path.q)
        costs = np.bincount(before, self._costs(filled), len(told))
        return np.flatnonzero(costs - told > LONGER * told.sum() / len(told))

    def _costs(self, track: OwnTrack) -> Array:
        """Return what the ways from place to place of a track cost, shape (n - 1,)."""
        prices = self._way_prices(track)
        return prices.of(np.diff(track.q, axis=0), np.diff(track.t), prices.seconds)

    def _way_prices(self, track: OwnTrack) -> WayPrices:
        return way_prices(self._problem, self._weights.travel, self._weights.time, track.places)

    def _over(
        self, places: Array, ik_branch: np.ndarray, t: Array, q: Array
    ) -> tuple[GrindingProblem, NodeMatrix]:
        """Return the problem of places over some nodes, and these as a matrix."""
        nodes = NodeMatrix(ik_branch, Kept(q), t, np.arange(t.shape[1]))
        points = self._problem.points.at_places(places)
        return self._problem.over_nodes(places, points, t, [nodes]), nodes

    def _cheapest(
        self, places: Array, ik_branch: int, t: Array, q: Array, box: JointBox | None
    ) -> OwnTrack | None:
        """Return the cheapest track over some nodes of one pass that is free at all of its own.

        It begins and ends where the pass can, as far as is seen.
        """
        branches = np.full(len(places), ik_branch)
        problem, nodes = self._over(places, branches, t, q)
        (matrix,) = open_matrices(problem)
        if box is not None:
            matrix.free &= matrix.free_inside(box)
        cost = track_cost(problem, nodes, self.prices, matrix.free)
        while True:
            found = smoothest(matrix.ladder, matrix.blocked_edges, matrix.free, cost)
            if found is None:
                return None
            along = nodes.along(found.rows)
            struck = np.flatnonzero(self._scene.collides(along)).tolist()
            for column in struck:
                matrix.sweep(self._scene, column, "collides")
            shut = False
            for end in (0, len(places) - 1):
                here = places[end], ik_branch
                if self._leads_shut(*here, t[end, found.rows[[end]]]).any():
                    rows, shut = np.flatnonzero(matrix.free[end]), True
                    matrix.free[end, rows] = ~self._leads_shut(*here, t[end, rows])
            if not struck and not shut:
                return OwnTrack(places, branches, nodes.t_along(found.rows), along, found.cost)

    def _leads_shut(self, place: float, ik_branch: int, t: Array) -> np.ndarray:
        """Return at which contact positions a pass cannot begin or end at a place, shape (n,)."""
        flips = len(wrist_flips(self._problem.cell.robot.arm))
        family, flip = (ik_branch % 4, ik_branch // 4) if flips > 1 else (ik_branch, 0)
        T = self._problem.points.frames_at(np.array([place]))[0]
        return self._leads.at(T, family, flip, t, 0.0)


def _prices(weights: ObjectiveWeights, costs: CostWeights) -> CostWeights:
    """Return what adds up along a track, costs where it leaves a choice hardly charged for."""
    share = max(TIES_OF_TRAVEL * weights.travel, TIES_OF_TIME * weights.time)
    return CostWeights(
        joint_weights=weights.travel + share * costs.joint_weights,
        contact_weight=share * costs.contact_weight,
        time_weight=weights.time,
        limit_weight=share * costs.limit_weight,
        singularity_weight=share * costs.singularity_weight,
        push_away=0.0,
        push_weight=0.0,
    )


def _spread(columns: np.ndarray, most: int) -> np.ndarray:
    """Return at most so many of some columns, the first and the last among them."""
    share = np.linspace(0, len(columns) - 1, min(most, len(columns)))
    return np.asarray(columns[share.astype(int)])
