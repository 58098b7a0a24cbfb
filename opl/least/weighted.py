"""The least weighted sum of joint range sum, joint travel and time; travel or time alone.

Travel and time add up along a track, the joint range sum does not. But no track in a box has a
larger one than the box, and the cheapest tracks of the passes are sought in it: so the least box is
widened step by step up to the whole field, and the best trade between the two is kept. It is the
best of these, not proven to be the best of all; the lower bound is that of the joint range sum and
that of travel and time, added up.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from opl.least.least_cost import least_cost
from opl.least.own_track import OwnTrack, joined, tracks_of
from opl.least.pass_tracks import FEWS, PassTracks
from opl.least.track_motion import motion_of_track
from opl.motion.figures import figures_of_path
from opl.planning.plan import ObjectiveValue, Plan
from opl.planning.problem import GrindingProblem
from opl.planning.settings import CostWeights, ObjectiveWeights
from opl.planning.so_far import ENDED, Follow, SoFar, to_the_end
from opl.search.box import JointBox

# by which fraction of its size the least box is widened; at last not bounded at all
WIDENINGS = (1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0)
MOST_BRANCHES = 2  # on which all passes are ground: those cheapest over few cutter points
WORTH_CHANGING = 0.01  # of the sum: what is gained where passes lie on several IK branches
WORTH_BRANCH = 1e-3  # of the cost of one pass: likewise
ALIKE = 1e-4  # by which fraction the sums of images may differ
MOST_TURNS = 6  # from tracks to their motion
MOST_TRIED = 4  # proposals of which motions are made
BOUND_BEGINS, MOTIONS_BEGIN = 0.4, 0.7  # of the work; tracks before


def plan_weighted(
    problem: GrindingProblem,
    weights: ObjectiveWeights,
    costs: CostWeights,
    known: Sequence[Plan],
    follow: Follow = to_the_end,
) -> Plan:
    """Find a collision-free motion with a small weighted sum, and a bound on the least one.

    Args:
        problem: What is to be planned.
        weights: What is charged for.
        costs: What decides between tracks of equal weighted sum.
        known: Motions that are known, the best of which is returned if none better is found. If the
            joint range sum is charged for, the first has the least, with its bound.
        follow: Given the value of the best motion and its lower bound, often.

    Returns:
        The plan with its weighted sum and what that can be at the least.
    """
    lower_bound = 0.0
    if weights.joint_range > 0.0:
        lower_bound = weights.joint_range * (known[0].lower_bound or 0.0)
    values = [_value(problem, plan, weights) for plan in known]
    value = min(values)
    best, ended = known[values.index(value)], False

    def goes_on(done: float, least: float) -> bool:
        nonlocal ended
        ended = not follow(SoFar(min(done, 1.0), value, min(least, value)))
        return not ended

    if weights.travel > 0.0 or weights.time > 0.0:
        tracks = PassTracks(problem, weights, costs)
        proposals = []
        for one in _proposals(tracks, weights, known):
            proposals.append(one)
            if not goes_on(0.0, lower_bound):
                break
        cheapest = [] if ended else _cheapest_of_passes(tracks, proposals)
        best_of = dict(enumerate(cheapest))
        begun = [tracks.charged(track) for track in cheapest]
        of_ranges, attained = lower_bound, sum(track.cost for track in begun)

        def rises(cost: float) -> bool:
            done = cost / attained if attained > 0.0 else 1.0
            return goes_on(BOUND_BEGINS + (MOTIONS_BEGIN - BOUND_BEGINS) * done, of_ranges + cost)

        def attain(way: OwnTrack) -> OwnTrack | None:
            index = int(problem.points.pass_index[int(way.places[0])])
            found = tracks.along_way(way, best_of.get(index))
            if found is not None and (index not in best_of or found.cost < best_of[index].cost):
                best_of[index] = found
            return None if found is None else tracks.charged(found)

        if not ended:
            prices = weights.travel, weights.time
            lower_bound += least_cost(problem, *prices, begun, rises, attain)
        if len(best_of) == problem.points.n_passes:
            passes = [best_of[index] for index in sorted(best_of)]
            proposals.append(_proposal(weights, passes, None))
        for one in _different(proposals):
            # a motion costs hardly less than its track does at the cutter points
            if ended:
                break
            if one.least >= value:
                continue
            found = _motion(problem, tracks, one)
            if found is not None and (now := _value(problem, found, weights)) < value:
                best, value = found, now
            goes_on(MOTIONS_BEGIN, lower_bound)
    objective = ObjectiveValue(value, min(lower_bound, value))
    open_because = ENDED if ended and objective.gap > 0.0 else None
    return replace(
        best, lower_bound=None, open_because=open_because, objective=objective, holders=()
    )


@dataclass(frozen=True)
class _Proposal:
    """Tracks of all passes.

    Attributes:
        least: Their weighted sum.
        rank: The same, told larger where passes lie on several IK branches.
        passes: The tracks.
        box: Where they stay, if anywhere.
    """

    least: float
    rank: float
    passes: list[OwnTrack]
    box: JointBox | None


def _motion(problem: GrindingProblem, tracks: PassTracks, proposal: _Proposal) -> Plan | None:
    """Return the motion of a proposal, or of one near to it where that is stopped, if any.

    Through more places where the part sinks between them.
    """
    passes = [tracks.through_places(track, proposal.box) for track in proposal.passes]
    for _ in range(MOST_TURNS):
        track = joined(passes)
        found = motion_of_track(problem, tracks.prices, track)
        if isinstance(found, Plan):
            return found
        if len(found) == len(track.places):
            break
        more = [tracks.with_places(track, found, proposal.box) for track in passes]
        passes = [track for track in more if track is not None]
        if len(passes) < len(more):
            break
    return None


def _cheapest_of_passes(tracks: PassTracks, proposals: Sequence[_Proposal]) -> list[OwnTrack]:
    """Return the cheapest track of each pass that is proposed, if any is.

    On the IK branch of the best proposal, unless one of another is worth it.
    """
    if not proposals:
        return []
    best = min(proposals, key=lambda one: one.rank).passes
    found = []
    for index, own in enumerate(best):
        of_pass = [one.passes[index] for one in proposals]
        others = np.array([track.ik_branch[0] != own.ik_branch[0] for track in of_pass])
        costs = np.array([track.cost for track in of_pass]) * (1.0 + WORTH_BRANCH * others)
        cheapest = of_pass[int(np.argmin(costs))]
        found.append(tracks.through_places(tracks.straightened(cheapest)))
    return found


def _different(proposals: Iterable[_Proposal]) -> list[_Proposal]:
    """Return the best proposals, of images one."""
    found: list[_Proposal] = []
    for one in sorted(proposals, key=lambda one: one.rank):
        if not found or one.rank - found[-1].rank > ALIKE * one.rank:
            found.append(one)
    return found[:MOST_TRIED]


def _proposals(
    tracks: PassTracks, weights: ObjectiveWeights, known: Sequence[Plan]
) -> Iterator[_Proposal]:
    """Yield cheap tracks of all passes in boxes about the first of some plans.

    In each box, those near to the plans, the cheapest on one IK branch, and those on several.
    """
    boxes: list[JointBox | None] = [None]
    if weights.joint_range > 0.0:
        q = known[0].path.q
        least = JointBox(q.min(axis=0), q.max(axis=0))
        boxes[:0] = [least.widened(amount * least.size) for amount in WIDENINGS]
    begun = [tracks_of(plan.path) for plan in known]
    for box in boxes:
        # a larger box holds what this one does
        near = [[tracks.about(track, box) for track in one] for one in begun]
        for passes in (*near, *_on_branches(tracks, len(begun[0]), box)):
            found = [track for track in passes if track is not None]
            if len(found) == len(passes):
                yield _proposal(weights, found, box)


def _proposal(weights: ObjectiveWeights, passes: list[OwnTrack], box: JointBox | None) -> _Proposal:
    """Return tracks of all passes as a proposal."""
    whole = joined(passes)
    range_sum = float(np.ptp(whole.q, axis=0).sum())
    total = weights.joint_range * range_sum + whole.cost
    changes = bool((whole.ik_branch != whole.ik_branch[0]).any())
    return _Proposal(total, total * (1.0 + WORTH_CHANGING * changes), passes, box)


def _on_branches(
    tracks: PassTracks, n_passes: int, box: JointBox | None
) -> list[list[OwnTrack | None]]:
    """Return tracks of all passes: cheap ones on one IK branch, and the cheapest on several."""
    passes = range(n_passes)
    fews = FEWS if box is None else FEWS[:1]  # in boxes, tracks of smaller ones are known
    begun = [[tracks.over_few(index, few, box) for index in passes] for few in fews]
    begun = [one for one in begun if all(one)]
    branches, pairs = list[int](), list[tuple[int, int]]()
    for one in begun:
        common = set(one[0]).intersection(*one)
        branches += _cheapest({branch: sum(at[branch].cost for at in one) for branch in common})
        for index, at in enumerate(one):
            pairs.append((index, _cheapest({branch: at[branch].cost for branch in at})[0]))
    pairs += [(index, branch) for branch in branches for index in passes]
    found: dict[tuple[int, int], OwnTrack | None] = {}
    for index, branch in dict.fromkeys(pairs):
        starts = [one[index][branch] for one in begun if branch in one[index]]
        ends = filter(None, [tracks.over_all(start, box) for start in starts])
        found[index, branch] = min(ends, key=lambda track: track.cost, default=None)
    chosen = [[found[index, branch] for index in passes] for branch in dict.fromkeys(branches)]
    of_passes = [
        [track for (i, _), track in found.items() if i == index and track] for index in passes
    ]
    if all(of_passes):
        chosen.append([min(one, key=lambda track: track.cost) for one in of_passes])
    return chosen


def _cheapest(costs: Mapping[int, float]) -> list[int]:
    """Return the cheapest IK branches, of images one."""
    found: list[int] = []
    for branch in sorted(costs, key=costs.__getitem__):
        if not found or costs[branch] - costs[found[-1]] > ALIKE * costs[branch]:
            found.append(branch)
    return found[:MOST_BRANCHES]


def _value(problem: GrindingProblem, plan: Plan, weights: ObjectiveWeights) -> float:
    robot = problem.cell.robot
    figures = figures_of_path(plan.path, plan.motion, problem.points, problem.process, robot)
    return weights.value(figures)
