"""Propose, check, block: tracks are proposed in turn until the whole motion of one is free.

Robot collisions cost far more than nodes, so they are looked for only on tracks that a search
proposes. What a proposed motion collides with is taken out of its matrix, and the search goes on;
it ends with the track it would have found had all collisions been known before.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from opl.geometry.frames import Array
from opl.motion.motion import Motion
from opl.motion.path import GrindingPath
from opl.planning.blocking import block
from opl.planning.open_matrix import OpenMatrix, Track
from opl.planning.problem import GrindingProblem
from opl.planning.reasons import no_path
from opl.planning.symmetry import flipped_alike
from opl.planning.track_check import Collides, Free, check_track

NEGLIGIBLE = 1e-4  # of travel in [rad] and the like: round-off along a path that rests adds up
AT_REST = 1e-6  # [rad] what joints turn all together at the most where the robot counts as at rest
WORK_OF_A_CHECK = 0.1  # units, for each of the places of a motion, beside what the scene is asked


@dataclass(frozen=True)
class ObjectiveValue:
    """What is known of the least travel, time or weighted sum.

    Attributes:
        value: Of the path found.
        lower_bound: No motion along the passes has less, whatever its contact positions.
    """

    value: float
    lower_bound: float

    @property
    def gap(self) -> float:
        """Fraction by which the path may miss the least; 0 where what it has is negligible."""
        return 1.0 - self.lower_bound / self.value if self.value > NEGLIGIBLE else 0.0


@dataclass(frozen=True)
class Holder:
    """A place that keeps the joint range sum from being smaller.

    Attributes:
        place: Cutter point, fractional between two.
        pass_index: Its pass.
        joints: Those whose range it holds, the dearest first.
        bound_without: No motion has a smaller joint range sum even if this place need not be
            ground, in [rad].
    """

    place: float
    pass_index: int
    joints: tuple[int, ...]
    bound_without: float


@dataclass(frozen=True)
class Plan:
    """A track and the motion it became.

    Attributes:
        path: Configurations on the wheel.
        motion: The whole motion, free of collision as far as the planner knows.
        checks: How many motions were checked, this one included.
        lower_bound: No motion along the passes that keeps the clearances of the plan has a smaller
            joint range sum, whatever the contact positions, in [rad]; None if no bound was wanted.
        open_because: Why the bound is further off than wanted, in words; None if it is not.
        objective: What was kept small, where that is not the joint range sum alone.
        holders: What keeps the joint range sum from being smaller, what could gain most first.
    """

    path: GrindingPath
    motion: Motion
    checks: int
    lower_bound: float | None = None
    open_because: str | None = None
    objective: ObjectiveValue | None = None
    holders: tuple[Holder, ...] = ()

    @property
    def gap(self) -> float | None:
        """Fraction by which the joint range sum may miss the least there is; 0 at rest."""
        if self.lower_bound is None:
            return None
        if self.path.joint_range_sum <= AT_REST:
            return 0.0
        return 1.0 - self.lower_bound / self.path.joint_range_sum

    def at_places(self, places: Array) -> Plan:
        """Return the plan of points that are places of others: fractional ones, shape (n,)."""
        path, motion, columns = self.path, self.motion, np.arange(len(places))
        path = replace(path, cutter_point=np.interp(path.cutter_point, columns, places))
        motion = motion.renumbered(np.interp(motion.cutter_point, columns, places))
        return replace(self, path=path, motion=motion)


@dataclass(frozen=True)
class Pause:
    """A search has worked, but has no track to propose so far.

    Attributes:
        work: How much since the last, in units.
    """

    work: float


@dataclass(frozen=True)
class Found:
    """A search ended with a free motion."""

    plan: Plan


@dataclass(frozen=True)
class Exhausted:
    """No proposal is left, and none was free; so many motions were checked.

    Attributes:
        checks: How many.
        matrices: What is blocked, and why.
    """

    checks: int
    matrices: list[OpenMatrix]


@dataclass(frozen=True)
class OutOfBudget:
    """A search ended before it came to an end: as much was done as is allowed.

    Attributes:
        checks: How many motions were checked.
        matrices: What is blocked so far, and why.
    """

    checks: int
    matrices: list[OpenMatrix]


Same = tuple[bytes, bytes]  # IK branches and contact positions of a track
SearchOutcome = Found | Exhausted | OutOfBudget


def propose_and_check(
    problem: GrindingProblem,
    matrices: list[OpenMatrix],
    proposals: Iterable[Track | Pause],
    checks: int = 0,
    most_checks: int | None = None,
    most_work: float = np.inf,
    collided: dict[Same, Collides] | None = None,
) -> SearchOutcome:
    """Check proposed tracks in turn until the motion of one is free; block what is not.

    Args:
        problem: What is to be planned.
        matrices: The matrices; what is blocked is noted there, for the proposer to learn from.
        proposals: Tracks, best first, with pauses.
        checks: How many motions were checked before.
        most_checks: How many to check at the most, those before included; None for no limit.
        most_work: In units, after which no other is checked.
        collided: What is known to collide of such tracks; grows.
    """
    first, begun = checks, problem.scene.work
    of_a_check = WORK_OF_A_CHECK * len(problem.points)
    collided = {} if collided is None else collided
    sunk: dict[Same, Collides] = {}  # the other flip of the wrist moves the part alike
    proposing = 0.0

    def done() -> float:
        return problem.scene.work - begun + (checks - first) * of_a_check + proposing

    for track in proposals:
        if isinstance(track, Pause):
            proposing += track.work
            if done() >= most_work:
                return OutOfBudget(checks, matrices)
            continue
        matrix = matrices[track.matrix]
        # full turns bring the same bodies to the same places
        at = matrix.nodes.t_along(track.rows).tobytes()
        same = matrix.nodes.ik_branch.tobytes(), at
        alike = flipped_alike(problem.cell.robot, matrix.nodes.ik_branch).tobytes(), at
        if (known := collided.get(same) or sunk.get(alike)) is not None:
            block(problem, matrix, track.rows, known)
            continue
        checks += 1
        found = check_track(problem, matrix.nodes, track.rows)
        if isinstance(found, Free):
            return Found(Plan(found.path, found.motion, checks))
        block(problem, matrix, track.rows, found)
        if isinstance(found, Collides):
            collided[same] = found
            if (deep := found.of_part_and_wheel) is not None:
                sunk[alike] = deep
        if checks == most_checks or done() >= most_work:
            return OutOfBudget(checks, matrices)
    return Exhausted(checks, matrices)


def first_free(
    problem: GrindingProblem, matrices: list[OpenMatrix], proposals: Iterable[Track | Pause]
) -> Plan:
    """Return the first of the proposed tracks whose motion is free, as `propose_and_check` does.

    Raises:
        NoFreeMoveError: If nothing but its free moves stops the motion of some path.
        NoPathError: If there is none for another reason; with place and reasons.
    """
    outcome = propose_and_check(problem, matrices, proposals)
    if isinstance(outcome, Found):
        return outcome.plan
    raise no_path(problem, matrices)
