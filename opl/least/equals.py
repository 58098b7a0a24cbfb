"""Of all motions that are equal for the search, the one whose free moves take the least time.

A full turn of a joint, or the other flip of the wrist, makes the same motion over the wheel
elsewhere in joint space: every sum that a search keeps small stays the same, and so does the time
on the wheel. What differs is how far it is from home, from pass to pass and back. Where a pass may
have a count of full turns of its own, those of all passes are chosen together.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from opl.geometry.frames import Array
from opl.least.borders import TOUCH_UP, Nameable
from opl.motion.motion import Motion, Phase
from opl.motion.path import GrindingPath
from opl.motion.timing import air_seconds
from opl.planning.plan import Plan
from opl.planning.problem import GrindingProblem
from opl.planning.symmetry import SAME_SUM
from opl.planning.track_check import Free, check_path
from opl.walls.images import wrist_flips

CLEAR_OF_LIMITS = np.deg2rad(5.0)  # of every joint; motions that keep it come before all others
SAME_TIME = 1e-6  # [s] choices that differ by less are equally long
MOST_CHECKS = 12  # of motions, the shortest choices first
MOST_WORK = 2000.0  # units, after which no other is checked once one is free


@dataclass(frozen=True)
class _Choice:
    """A choice of images.

    Attributes:
        near_limit: Whether a joint comes nearer to its limit than `CLEAR_OF_LIMITS`.
        seconds: Time of the free moves if all of them are straight, in [s]; none is shorter.
        flip: Index of the flip of the wrist.
        turns: Full turns of each pass and joint, shape (n_passes, 6).
    """

    near_limit: bool
    seconds: float
    flip: int
    turns: np.ndarray

    @property
    def rank(self) -> tuple[bool, int, int, int, list[int]]:
        """What the better of two has the smaller value of; never the same for two choices."""
        turned = int(np.abs(self.turns).sum())
        time = round(self.seconds / SAME_TIME)
        return self.near_limit, time, self.flip, turned, self.turns.ravel().tolist()


def quickest_of_equals(
    problem: GrindingProblem, plan: Plan, keeps_ranges: bool, nameable: Nameable | None = None
) -> Plan:
    """Return the plan with its motion made where the free moves take the least time.

    The motions compared have the same contact positions, joint travel, time on the wheel and, to
    `SAME_SUM`, joint range sum. Those whose configurations a program can name come first, then
    those that keep `CLEAR_OF_LIMITS`; among these the time of the free moves decides, as they lead
    around obstacles. Ties go to the fewest full turns.

    Args:
        problem: What was planned.
        plan: A plan whose motion is free.
        keeps_ranges: Whether the joint range sum counts; if not, each pass may have any count of
            full turns within the limits.
        nameable: Which configurations the program names without doubt; None for all.
    """
    best, least = plan, (len(plan.path.q) + 1, True, np.inf)
    begun = problem.scene.work
    choices = []
    for choice in _choices(problem, plan, keeps_ranges):
        path = _image(problem, plan.path, choice)
        unnamed = 0 if nameable is None else int(np.count_nonzero(~nameable(path.q, TOUCH_UP)))
        choices.append((unnamed, choice.rank, choice, path))
    choices.sort(key=lambda item: item[:2])
    for unnamed, _, choice, path in choices[:MOST_CHECKS]:
        if (unnamed, choice.near_limit, choice.seconds + SAME_TIME) > least:
            break
        if best is not plan and problem.scene.work - begun > MOST_WORK:
            break
        if (motion := _free_motion(problem, plan, path)) is None:
            continue
        seconds = air_seconds(motion, problem.cell.robot, problem.process)
        if (unnamed, choice.near_limit, seconds + SAME_TIME) < least:
            best = replace(plan, path=path, motion=motion)
            least = unnamed, choice.near_limit, seconds
    return best


def _free_motion(problem: GrindingProblem, plan: Plan, path: GrindingPath) -> Motion | None:
    """Return the free motion of an image of the path of a plan; that of this path is known."""
    if np.array_equal(path.q, plan.path.q):
        return plan.motion
    found = check_path(problem, path)
    return found.motion if isinstance(found, Free) else None


def _image(problem: GrindingProblem, path: GrindingPath, choice: _Choice) -> GrindingPath:
    """Return the same path elsewhere in joint space."""
    sign, shift = wrist_flips(problem.cell.robot.arm)[choice.flip]
    q = path.q * sign + shift + 2.0 * np.pi * choice.turns[path.pass_index]
    # with the wrist flipped, the slot of the inverse kinematics is one of the other four
    return replace(path, ik_branches=path.ik_branches ^ (4 * choice.flip), q=q)


def _choices(problem: GrindingProblem, plan: Plan, keeps_ranges: bool) -> Iterator[_Choice]:
    """Yield the shortest choice for each image that all passes may share, or may not."""
    for flip, (sign, shift) in enumerate(wrist_flips(problem.cell.robot.arm)):
        passes = _Passes(problem, plan, sign, shift)
        shared = [passes.alike(turn) for turn in passes.turns[0]]
        for alike in (alike for alike in shared if alike is not None):
            yield passes.choice(flip, alike)
            allowed = passes.inside(alike) if keeps_ranges else passes.all_states
            for clear in (True, False):
                chosen = passes.shortest(allowed, clear)
                if chosen is not None:
                    yield passes.choice(flip, chosen)
            if not keeps_ranges:
                break  # the same would be found again


class _Passes:
    """The images of each pass with one flip of the wrist: every full turn within the limits."""

    def __init__(self, problem: GrindingProblem, plan: Plan, sign: Array, shift: Array) -> None:
        cell, process, path = problem.cell, problem.process, plan.path
        self._seconds_per_turn = 1.0 / (cell.robot.max_speed * process.air_speed)
        self._home = process.home
        starts, ends = _far_ends(plan.motion)
        self._q = []  # of each pass, on the wheel
        self._ends = []  # of each pass: where its approach begins and its retract ends, (2, 6)
        self.turns = []  # of each pass, shape (k, 6)
        self._near_limit = []  # of each pass and turn, shape (k,)
        for index in range(problem.points.n_passes):
            on_wheel = path.q[path.pass_index == index] * sign + shift
            off_wheel = plan.motion.q[[starts[index], ends[index]]] * sign + shift
            q = np.concatenate([on_wheel, off_wheel])
            low, high = q.min(axis=0), q.max(axis=0)
            lower, upper = cell.robot.lower, cell.robot.upper
            first = np.ceil((lower - low) / (2.0 * np.pi) - 1e-9)
            last = np.floor((upper - high) / (2.0 * np.pi) + 1e-9)
            counts = [np.arange(a, b + 1) for a, b in zip(first, last, strict=True)]
            turns = np.stack(np.meshgrid(*counts, indexing="ij"), axis=-1).reshape(-1, 6)
            kept = [cell.within_limits(q + 2.0 * np.pi * turn).all() for turn in turns]
            turns = turns[np.array(kept, dtype=bool)].astype(int)
            whole = 2.0 * np.pi * turns
            margin = np.minimum(low + whole - lower, upper - high - whole).min(axis=1)
            self._q.append(on_wheel)
            self._ends.append(off_wheel)
            self.turns.append(turns)
            self._near_limit.append(margin < CLEAR_OF_LIMITS)

    @property
    def all_states(self) -> list[np.ndarray]:
        """All images of each pass, by their indices."""
        return [np.arange(len(turns)) for turns in self.turns]

    def alike(self, turn: np.ndarray) -> list[int] | None:
        """Return the same full turn of every pass, None where the limits forbid it."""
        found = [np.flatnonzero((turns == turn).all(axis=1)) for turns in self.turns]
        return [int(one[0]) for one in found] if all(len(one) for one in found) else None

    def inside(self, alike: list[int]) -> list[np.ndarray]:
        """Return the images of each pass that stay within the joint ranges of all passes alike."""
        whole = np.concatenate(
            [
                q + 2.0 * np.pi * turns[one]
                for q, turns, one in zip(self._q, self.turns, alike, strict=True)
            ]
        )
        slack = SAME_SUM / 12.0  # at both ends of six ranges
        lower, upper = whole.min(axis=0) - slack, whole.max(axis=0) + slack
        return [
            np.flatnonzero(
                (
                    (q.min(axis=0) + 2.0 * np.pi * turns >= lower)
                    & (q.max(axis=0) + 2.0 * np.pi * turns <= upper)
                ).all(axis=1)
            )
            for q, turns in zip(self._q, self.turns, strict=True)
        ]

    def shortest(self, allowed: list[np.ndarray], clear: bool) -> list[int] | None:
        """Return the images with the least time of straight free moves, by dynamic programming.

        Only those that keep `CLEAR_OF_LIMITS` if they have to be clear of them; None if a pass has
        none.
        """
        if clear:
            allowed = [one[~near[one]] for one, near in zip(allowed, self._near_limit, strict=True)]
        if not all(len(one) for one in allowed):
            return None
        _, at = self._at(0, allowed[0])
        cost = self._seconds(self._home, self._at(0, allowed[0])[0])
        came_from = []
        for index in range(1, len(allowed)):
            begin, end = self._at(index, allowed[index])
            total = cost[:, None] + self._seconds(at[:, None], begin)
            came_from.append(total.argmin(axis=0))
            cost, at = total.min(axis=0), end
        state = int((cost + self._seconds(at, self._home)).argmin())
        chosen = [state]
        for before in reversed(came_from):
            chosen.insert(0, int(before[chosen[0]]))
        return [int(one[k]) for one, k in zip(allowed, chosen, strict=True)]

    def choice(self, flip: int, chosen: list[int]) -> _Choice:
        """Return a choice of images with its time."""
        ends = [self._at(index, np.array([one])) for index, one in enumerate(chosen)]
        visited = np.concatenate([[self._home], *(q for pair in ends for q in pair), [self._home]])
        seconds = self._seconds(visited[:-1:2], visited[1::2]).sum()
        near = any(near[one] for near, one in zip(self._near_limit, chosen, strict=True))
        turns = np.array([turns[one] for turns, one in zip(self.turns, chosen, strict=True)])
        return _Choice(bool(near), float(seconds), flip, turns)

    def _at(self, index: int, states: np.ndarray) -> tuple[Array, Array]:
        """Return where a pass begins and ends off the wheel, shape (k, 6) each."""
        whole = 2.0 * np.pi * self.turns[index][states]
        return self._ends[index][0] + whole, self._ends[index][1] + whole

    def _seconds(self, q: Array, other: Array) -> Array:
        """Return the times of straight free moves in [s]; the shapes (..., 6) must broadcast."""
        return np.asarray((np.abs(other - q) * self._seconds_per_turn).max(axis=-1))


def _far_ends(motion: Motion) -> tuple[list[int], list[int]]:
    """Return where each approach begins and each retract ends, as indices of configurations."""
    runs = list(motion.runs())
    starts = [int(moves[0]) - 1 for phase, moves in runs if phase is Phase.APPROACHING]
    return starts, [int(moves[-1]) for phase, moves in runs if phase is Phase.RETRACTING]
