"""Search and check in turn: the best track whose whole motion is free of collision.

Robot collisions cost far more than nodes, so they are asked only about tracks that a search
proposes. What a proposed motion collides with is taken out of the ladder, and the search goes on;
it ends with the track it would have found had all collisions been known before.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from opl.cell.workcell import PART, WHEEL
from opl.errors import NoPathError, NoWayError
from opl.field.path import BrokenStepError, GrindingPath, fill_in
from opl.motion.air import BlockedLinkError, UnreachableApproachError, linked, whole_motion
from opl.motion.check import Fault, find_faults
from opl.motion.motion import Motion, MoveKind
from opl.planning.blocked_links import block_link
from opl.planning.branch import Branch, Track, branches_of
from opl.planning.impasse import shortest_impasse
from opl.planning.objective import WeightedValue
from opl.planning.problem import GrindingProblem
from opl.planning.reasons import explain, explain_air
from opl.planning.starts import Start, tracks_from_best_start, tracks_from_nearest_start
from opl.planning.symmetry import twins


@dataclass(frozen=True)
class Refinement:
    """What more contact positions than those of the field have gained.

    Attributes:
        joint_range_sum: Of the best path found at the field's contact positions in [rad].
        lower_bound: The bound at these positions in [rad].
        gain: By how much that of the refined path is smaller in [rad].
        rounds: How often the contact positions around the path were halved with a gain.
        bound_positions: How many contact positions the bound of the plan holds for: those of the
            field, or more where the refined path is below what is possible at these.
    """

    joint_range_sum: float
    lower_bound: float | None
    gain: float
    rounds: int
    bound_positions: int


@dataclass(frozen=True)
class Plan:
    """A track and the motion it became.

    Attributes:
        path: Postures on the wheel.
        motion: The whole motion, free of collision as far as the planner can tell.
        checks: How many motions were checked, this one included.
        lower_bound: No path through the cutter points, at the contact positions that it holds for,
            has a smaller joint range sum, in [rad]; None if that was not asked.
        refinement: What contact positions between those of the field have gained; None if they were
            not tried.
        weighted: The weighted sum that was kept small; None if that was not asked.
    """

    path: GrindingPath
    motion: Motion
    checks: int
    lower_bound: float | None = None
    refinement: Refinement | None = None
    weighted: WeightedValue | None = None

    @property
    def gap(self) -> float | None:
        """Fraction by which the joint range sum may miss the least there is."""
        if self.lower_bound is None:
            return None
        return 1.0 - self.lower_bound / self.path.joint_range_sum


def plan_recursive(problem: GrindingProblem, start: Start = Start.BEST) -> Plan:
    """Find a collision-free motion by the recursive search of the paper.

    Args:
        problem: What is to be planned.
        start: Which start nodes to try.

    Raises:
        NoWayError: If nothing but its ways through the air stops the motion of some path.
        NoPathError: If there is none for another reason; says where it ends and why.
    """
    branches = branches_of(problem)
    plan = _first_free(problem, branches, _tracks(problem, branches, start))
    if plan is None:
        raise no_path(problem, branches)
    return plan


def try_recursive(problem: GrindingProblem, start: Start, most_checks: int) -> Plan | None:
    """Return what the recursive search finds within a number of checked motions, or None.

    Args:
        problem: What is to be planned.
        start: Which start nodes to try.
        most_checks: How many motions to check at the most.
    """
    branches = branches_of(problem)
    tracks = islice(_tracks(problem, branches, start), most_checks)
    return _first_free(problem, branches, tracks)


def _tracks(problem: GrindingProblem, branches: list[Branch], start: Start) -> Iterator[Track]:
    """Yield tracks in the order in which the search wants them checked."""
    if start is Start.NEAREST:
        yield from tracks_from_nearest_start(branches, problem.process.home)
        return
    robot = problem.cell.robot
    for track in tracks_from_best_start(branches):
        yield from twins(branches, track, robot.lower, robot.upper)


def _first_free(
    problem: GrindingProblem, branches: list[Branch], tracks: Iterator[Track]
) -> Plan | None:
    """Return the first of the tracks whose motion is free, blocking what is not on the way."""
    for checks, track in enumerate(tracks, start=1):
        plan = check_track(problem, branches[track.branch], track.rows, checks)
        if plan is not None:
            return plan
    return None


def check_track(
    problem: GrindingProblem, branch: Branch, rows: np.ndarray, checks: int
) -> Plan | None:
    """Return the plan if a track's whole motion is free, else block what is not.

    Args:
        problem: What is to be planned.
        branch: The branch of the track.
        rows: The row in each column, shape (N,).
        checks: How many motions were checked, this one included.
    """
    try:
        path = fill_in(problem.cell, problem.points, branch.nodes, rows, problem.interpolation)
    except BrokenStepError as error:
        branch.block_step(error.column, rows, error.cause)
        return None
    try:
        motion = whole_motion(problem.cell, problem.points, path, problem.process)
    except UnreachableApproachError as error:
        branch.block_node(error.column, int(rows[error.column]), f"approach: {error.cause}")
        return None
    faults = find_faults(problem.cell, problem.scene, problem.part, motion)
    # what is in the way of a free move is led around, unless it is where an approach begins
    faults = [
        fault
        for fault in faults
        if not motion.kind[fault.move].is_free
        or (fault.at_end and motion.pass_index[fault.move] >= 0)
    ]
    for fault in faults:
        _block(problem, branch, rows, motion, fault)
    if faults:
        return None
    try:
        return Plan(path, linked(motion, problem.links), checks)
    except BlockedLinkError as blocked:
        block_link(problem, branch, rows, motion, blocked)
        return None


def _block(
    problem: GrindingProblem, branch: Branch, rows: np.ndarray, motion: Motion, fault: Fault
) -> None:
    """Take out of the ladder what a fault rules out: a node or a step."""
    cause = " and ".join(fault.pair)
    kind, index = motion.kind[fault.move], int(motion.pass_index[fault.move])
    on_pass = np.flatnonzero(problem.points.pass_index == index)
    if kind.on_wheel:
        point = motion.cutter_point[fault.move]
        end = int(np.ceil(point))
        if point == end and fault.at_end and fault.pair != (PART, WHEEL):
            branch.sweep(problem.scene, end, cause)
        if end == on_pass[0]:
            branch.block_node(end, int(rows[end]), cause)
        elif branch.free[end, rows[end]]:
            branch.block_step(end - 1, rows, cause)
    elif kind is MoveKind.RETRACT:
        branch.block_node(int(on_pass[-1]), int(rows[on_pass[-1]]), f"retract: {cause}")
    else:  # the approach, or a free move that ends where it begins
        branch.block_node(int(on_pass[0]), int(rows[on_pass[0]]), f"approach: {cause}")


def no_path(problem: GrindingProblem, branches: list[Branch]) -> NoPathError:
    """Return the error that says how far the searches came and what stopped them."""
    cut_off = sum((branch.cut_off for branch in branches), Counter())
    if cut_off:
        return NoWayError(
            "no path: the passes can be ground, but there is no way through the air",
            explain_air(problem.cell, cut_off),
        )
    reached = max((branch.reached for branch in branches), default=0)
    causes: Counter[tuple[int, str]] = Counter()
    for branch in branches:
        causes.update(branch.causes)
    n = len(problem.points)
    reasons = explain(problem, reached, causes, shortest_impasse(branches))
    if reached == 0:
        return NoPathError(
            f"no path: no free posture at cutter point 0 (0 of {n} reached)", reasons
        )
    if reached == n:
        return NoPathError(f"no path: every track through the {n} cutter points collides", reasons)
    return NoPathError(
        f"no path beyond cutter point {reached - 1} ({reached} of {n} reached)", reasons
    )
