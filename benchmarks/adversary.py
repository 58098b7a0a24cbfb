"""Tries to find a motion below a printed bound. By hand: python -m benchmarks.adversary.

Shares no code with the search: tracks begin at random postures and contact positions, at those that
differential evolution finds, and at the motion that the search found; each cutter point, and places
between, has its own t, more of them where the box is held up between two; the box of joint space is
made smaller by linear programs over all t at once, and by random changes. Inverse kinematics and
contact frames are the cell's; a motion counts only if it keeps the limits and comes out of forward
kinematics and opl's own check of motions on the wheel, with the clearances of the plan.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution, linprog
from scipy.sparse import csr_array, vstack

import opl
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import forward_kinematics
from opl.cell.wheel_distance import signed_wheel_distance
from opl.geometry.frames import inverse
from opl.geometry.toolpath import CutterPoints
from opl.motion.collision_check import colliding_moves
from opl.motion.motion import Motion, MoveKind
from opl.motion.path import GrindingPath
from opl.planning.problem import GrindingProblem
from opl.run.preparing import prepare
from opl.run.searches import search_path

WORKPIECES = Path(__file__).resolve().parent.parent / "workpieces"
CASES = ("v_shape", "s_shape", "faucet", "turbine_blade")
TRIES = 25_000  # motions that are looked at for each part
GRID = 0.5  # belt units between the contact positions where a posture is held against the cell
BETWEEN = 2  # places looked at between two places with a t of their own
KNOTS = 2  # places with a t of their own from one cutter point to the next, at first
DRAWN = 0.5  # of the tries: motions that begin anew
MORE_KNOTS = 12  # times that more are put in
BENT = 1e-5  # of the box: how far postures between two leave their chord where one is put in
NEAREST = 1.0 / 512.0  # of the way from one cutter point to the next: no nearer than that
CLOSELY = 8  # places looked at between two in the end
EVOLVED = 3  # contact positions of a pass that differential evolution moves
GENERATIONS = 12
SHORTENED = 8  # halvings of a step into what is not free
JUMP = 0.6  # [rad] between neighbouring places; more is no motion
BATCH = 256  # random changes that are looked at together
STEP = 1e-4  # belt units, for derivatives
ENOUGH = 1e-5  # fraction by which a linear program must make a box smaller to go on
SURE = 1e-9  # [rad] and [m] that rounding may cost

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Attack:
    """The best motion that was found.

    Attributes:
        size: Its joint range sum in [rad], infinite if none was found.
        knots: Places with a t of their own, as fractional cutter points, shape (n,).
        t: Contact position at each of them, shape (n,).
        slots: IK branch of each pass, shape (n_passes,).
        tries: How many motions were looked at.
    """

    size: float
    knots: Array
    t: Array
    slots: np.ndarray
    tries: int


@dataclass(frozen=True)
class Places:
    """Places along the passes that are looked at.

    Attributes:
        place: Fractional cutter points, shape (P,).
        frames: Cutter frames there, shape (P, 4, 4).
        pass_index: Pass of each, shape (P,).
        left: The last place before it with a t of its own, shape (P,).
        right: And the first after it.
        x: How much of the way from one to the other it is, shape (P,).
    """

    place: Array
    frames: Array
    pass_index: np.ndarray
    left: np.ndarray
    right: np.ndarray
    x: Array

    def at(self, t: Array) -> Array:
        """Return the contact positions there of tracks with these at the knots, (..., n)."""
        return np.asarray(t[..., self.left] * (1.0 - self.x) + t[..., self.right] * self.x)


class Adversary:
    """Looks for motions with a small joint range sum.

    Args:
        problem: What is to be ground. Its nodes are not used.
        seed: Of what is drawn.
        between: How many places are looked at between two with a t of their own.
        knots: How many of those there are from one cutter point to the next.
    """

    def __init__(
        self, problem: GrindingProblem, seed: int, between: int = BETWEEN, knots: int = KNOTS
    ) -> None:
        self._cell, self._scene = problem.cell, problem.scene
        self._path, self._part, self._between = problem.points, problem.scene.part, between
        self._random = np.random.default_rng(seed)
        self.tries = 0
        wheel = self._cell.wheel
        count = int(np.ceil(2.0 * wheel.last_position / GRID)) + 1
        self._grid = np.linspace(-wheel.last_position, wheel.last_position, count)
        self._open: dict[tuple[float, int], np.ndarray] = {}
        self._first = _between(problem.points, knots)
        self._look_at(self._first)
        q = self._turned(self._inverse(self._grid, self._frames[:, None]))
        reached = self._reached(np.arange(len(q)), q)
        for (row, slot), found in zip(
            np.ndindex(*q.shape[:3:2]), np.moveaxis(reached, 2, 1).reshape(-1, count), strict=True
        ):
            self._open[float(self._knots[row]), slot] = found
        self._q, self._all_open = q, reached

    def _look_at(self, knots: Array) -> None:
        """Give these places a t of their own, no others."""
        self._knots, self._frames = knots, self._path.frames_at(knots)
        self._passes = self._path.pass_index[knots.astype(int)]
        self._joined = np.flatnonzero(np.diff(self._passes) == 0)
        self._seen = self._places(self._between)

    def _places(self, between: int) -> Places:
        """Return places with so many between two with a t of their own."""
        share = np.arange(between + 1) / (between + 1)
        ends = np.flatnonzero(np.append(np.diff(self._passes) != 0, True))
        left = np.concatenate([np.repeat(self._joined, between + 1), ends])
        x = np.concatenate([np.tile(share, len(self._joined)), np.zeros(len(ends))])
        order = np.lexsort([x, left])
        left, x = left[order], x[order]
        right = np.where(x > 0.0, left + 1, left)
        place = self._knots[left] * (1.0 - x) + self._knots[right] * x
        return Places(place, self._path.frames_at(place), self._passes[left], left, right, x)

    def _reached(self, rows: np.ndarray, q: Array) -> np.ndarray:
        """Return which postures at the grid of contact positions are free.

        Args:
            rows: Of places with a t of their own, shape (r,).
            q: In [rad], shape (r, M, slots, 6); NaN where there are none.
        """
        n, count = len(rows), len(self._grid)
        free = self._distance(np.repeat(rows, count), np.tile(self._grid, n))
        free = (free >= -self._cell.planned_penetration).reshape(n, count)
        reached = np.isfinite(q).all(axis=-1) & free[..., None]
        reached[reached] = ~self._scene.collision.collides(q[reached])
        return np.asarray(reached)

    def _distance(self, column: np.ndarray, t: Array) -> Array:
        """Return how far the part is from the wheel where places are ground, in [m]."""
        wheel, T = self._cell.wheel, self._frames[column]
        Ts = wheel.T_contact0_contact(t) @ inverse(T)
        limit = -self._cell.planned_penetration
        return np.asarray(signed_wheel_distance(self._part, wheel, Ts, limit))

    def _inverse(self, t: Array, frames: Array) -> Array:
        return inverse_kinematics(self._cell.robot.arm, self._cell.Ts_base_flange(t, frames))

    def _turned(self, q: Array) -> Array:
        """Return angles turned within the limits, near their middle; NaN where that is not so."""
        robot = self._cell.robot
        middle = (robot.lower + robot.upper) / 2.0
        q = q + 2.0 * np.pi * np.round((middle - q) / (2.0 * np.pi))
        return np.asarray(np.where((q >= robot.lower) & (q <= robot.upper), q, np.nan))

    def attack(self, tries: int, known: GrindingPath | None = None) -> Attack:
        """Return the best motion found in some tries, from a known one or from many drawn."""
        slots = np.zeros(self._path.n_passes, dtype=int)
        best = Attack(np.inf, self._first, np.zeros(len(self._first)), slots, 0)
        self.tries = 0
        if known is not None:
            knots = np.union1d(self._first, known.cutter_point)
            t = np.interp(knots, known.cutter_point, known.contact_position)
            self._look_at(knots)
            best = self._followed(best, t, known.ik_branches, tries)
        turn = 0
        while known is None and self.tries < DRAWN * tries:
            turn += 1
            drawn = self._evolved() if turn % 4 == 0 else self._draw()
            if drawn is None:
                self.tries += 1
                continue
            best = self._followed(best, *drawn, tries)
        if np.isfinite(best.size):
            best = self._finer(self._shaken(self._finer(best), tries))
        return replace(best, tries=self.tries)

    def _shaken(self, best: Attack, tries: int) -> Attack:
        """Return a motion made better by changes at random."""
        self._look_at(best.knots)
        while self.tries < tries:
            careful = bool(self._random.random() < 0.5)
            size = float(self.size(best.t, best.slots))
            changed, t = self._changed(best.t, best.slots, size, careful)
            if changed < size * (1.0 - ENOUGH):
                t = self._as_far_as_free(best.t, t, best.slots)
                found = Attack(0.0, best.knots, t, best.slots, self.tries)
                if (held := self.hold(found)) < best.size:
                    best = replace(found, size=held)
        return best

    def _finer(self, best: Attack) -> Attack:
        """Return a motion made better where it is held up between places with a t of their own."""
        for _ in range(MORE_KNOTS):
            self._look_at(best.knots)
            fresh = self._held_up(best)
            if not len(fresh):
                break
            knots = np.union1d(best.knots, fresh)
            t = np.interp(knots, best.knots, best.t)
            self._look_at(knots)
            # the same motion, looked at more closely
            same = Attack(0.0, knots, t, best.slots, self.tries)
            held = self.hold(same)
            if not np.isfinite(held):
                break
            best = self._followed(replace(same, size=held), t, best.slots, self.tries)
        return best

    def _held_up(self, best: Attack) -> Array:
        """Return places in the middle between two where postures between them bend at a face."""
        seen = self._places(1)
        q = self._postures(best.t, best.slots, seen)
        middle = np.flatnonzero(seen.x > 0.0)
        bent = np.abs(q[middle] - (q[middle - 1] + q[middle + 1]) / 2.0)
        about = np.stack([q[middle - 1], q[middle], q[middle + 1]])
        pressed = about.max(axis=0) + bent >= q.max(axis=0)
        pressed |= about.min(axis=0) - bent <= q.min(axis=0)
        held = (pressed & (bent > BENT * best.size)).any(axis=1)
        held &= seen.place[middle + 1] - seen.place[middle - 1] > 2.0 * NEAREST
        return seen.place[middle[held]]

    def _followed(self, best: Attack, t: Array, slots: np.ndarray, tries: int) -> Attack:
        """Return the better of an attack and what a track can be made to."""
        sure, free = np.inf, t
        for careful in (False, True):
            size, now = self._pressed(t if careful else free, slots, careful)
            # half of the work on what looks good
            while np.isfinite(size) and size < 1.1 * best.size and self.tries < tries:
                changed, now = self._changed(now, slots, size, careful)
                if changed >= size * (1.0 - ENOUGH):
                    break
                size = changed
            if size < min(best.size, sure):
                now = self._as_far_as_free(free, now, slots)
                held = self.hold(Attack(0.0, self._knots, now, slots, 0))
                if held < sure:
                    sure, free = held, now
            if size == sure:
                break  # nothing was in its way
        if sure < best.size:
            best = Attack(sure, self._knots, free, slots, self.tries)
        return best

    def _as_far_as_free(self, t: Array, wanted: Array, slots: np.ndarray) -> Array:
        """Return a track as near to a wanted one as is free, from another."""
        if np.isfinite(self.hold(Attack(0.0, self._knots, wanted, slots, 0))):
            return wanted
        low, high = 0.0, 1.0
        for _ in range(SHORTENED):
            middle = (low + high) / 2.0
            between = t + middle * (wanted - t)
            if np.isfinite(self.hold(Attack(0.0, self._knots, between, slots, 0))):
                low = middle
            else:
                high = middle
        return t + low * (wanted - t)

    def _evolved(self) -> tuple[Array, np.ndarray] | None:
        """Return a track that differential evolution makes of few contact positions of a pass."""
        random = self._random
        drawn = self._draw()
        passes = self._passes
        if drawn is None:
            return None
        t, slots = drawn
        share = np.concatenate([np.linspace(0.0, 1.0, int(k)) for k in np.bincount(passes)])
        at = np.linspace(0.0, 1.0, EVOLVED)

        def track(x: Array) -> Array:
            moved = x.reshape(self._path.n_passes, EVOLVED, -1)
            there = np.clip(share * (EVOLVED - 1), 0, EVOLVED - 1 - 1e-9)
            low = there.astype(int)
            rest = (there - low)[:, None]
            return np.asarray(
                t + ((1.0 - rest) * moved[passes, low] + rest * moved[passes, low + 1]).T
            )

        last = self._cell.wheel.last_position
        found = differential_evolution(
            lambda x: np.minimum(self.size(np.clip(track(x), -last, last), slots), 1e3),
            [(-last / 2.0, last / 2.0)] * (len(at) * self._path.n_passes),
            maxiter=GENERATIONS, popsize=4, seed=int(random.integers(1 << 30)), polish=False,
            vectorized=True, updating="deferred", x0=np.zeros(len(at) * self._path.n_passes),
        )  # fmt: skip
        return np.clip(track(found.x[:, None])[0], -last, last), slots

    def _draw(self) -> tuple[Array, np.ndarray] | None:
        """Draw a continuous track near a random posture: shortest paths through the grid."""
        self._look_at(self._first)
        passes, random = self._passes, self._random
        column = random.integers(len(passes))
        choices = np.argwhere(self._all_open[column])
        if not len(choices):
            return None
        row, slot = choices[random.integers(len(choices))]
        wanted = self._q[column, row, slot]
        weight = random.exponential(1.0, 6)
        slide = 10.0 ** random.uniform(-4.0, -1.0)
        t = np.empty(len(passes))
        slots = np.full(self._path.n_passes, slot)
        for index in range(self._path.n_passes):
            columns = np.flatnonzero(passes == index)
            whole = np.flatnonzero(self._all_open[columns].any(axis=1).all(axis=0))
            if slot not in whole or random.random() < 0.1:
                if not len(whole):
                    return None
                slots[index] = whole[random.integers(len(whole))]
            away = np.abs(self._q[columns][:, :, slots[index]] - wanted) @ weight
            cost = np.where(self._all_open[columns][:, :, slots[index]], away, 1e9)
            t[columns] = self._grid[_shortest(cost, slide, self._grid)]
        return t, slots

    def _postures(self, t: Array, slots: np.ndarray, seen: Places | None = None) -> Array:
        """Return the postures of tracks at all places, shape (..., P, 6); NaN where there is none.

        The turns of each pass are counted so that it keeps the limits, near the first.
        """
        seen = self._seen if seen is None else seen
        q = self._inverse(seen.at(t), seen.frames)
        q = q[..., np.arange(len(seen.place)), slots[seen.pass_index], :]
        robot = self._cell.robot
        reference: Array | None = None
        for index in range(self._path.n_passes):
            own = seen.pass_index == index
            now = np.unwrap(q[..., own, :], axis=-2)
            low, high = now.min(axis=-2), now.max(axis=-2)
            least = np.ceil((robot.lower - low) / (2.0 * np.pi))
            most = np.floor((robot.upper - high) / (2.0 * np.pi))
            if reference is None:
                wanted = np.round(((robot.lower + robot.upper) / 2.0 - low) / (2.0 * np.pi))
            else:
                wanted = np.round((reference - (low + high) / 2.0) / (2.0 * np.pi))
            turns = np.where(least <= most, np.clip(wanted, least, most), np.nan)
            now = now + 2.0 * np.pi * turns[..., None, :]
            if reference is None:
                reference = (now.min(axis=-2) + now.max(axis=-2)) / 2.0
            jumps = np.abs(np.diff(now, axis=-2)).max(axis=(-2, -1), initial=0.0) > JUMP
            now[jumps] = np.nan
            q[..., own, :] = now
        return np.asarray(q)

    def size(self, t: Array, slots: np.ndarray) -> Array:
        """Return the joint range sum of tracks in [rad], infinite for what is none, shape (...)."""
        q = self._postures(t, slots)
        self.tries += q.size // (6 * len(self._seen.place))
        return np.asarray(np.nan_to_num(np.ptp(q, axis=-2).sum(axis=-1), nan=np.inf))

    def _room(self, t: Array, slots: np.ndarray, careful: bool) -> tuple[Array, Array]:
        """Return between which contact positions each place may be moved.

        Those next to where the grid is free all the way, or carefully, those where it is free.
        """
        more = 0 if careful else 1
        asked = list(zip(self._knots.tolist(), slots[self._passes].tolist(), strict=True))
        new = np.flatnonzero([one not in self._open for one in asked])
        if len(new):
            q = self._turned(self._inverse(self._grid, self._frames[new, None]))
            q = q[np.arange(len(new)), :, slots[self._passes[new]]][:, :, None]
            for k, found in zip(new.tolist(), self._reached(new, q)[..., 0], strict=True):
                self._open[asked[k]] = found
        reached = np.stack([self._open[one] for one in asked])
        row = np.clip(np.searchsorted(self._grid, t), 0, len(self._grid) - 1)
        low, high = t.copy(), t.copy()
        for column, here in enumerate(row):
            shut = np.flatnonzero(~reached[column])
            below, above = shut[shut < here], shut[shut > here]
            low[column] = self._grid[below[-1] + 1 - more] if len(below) else self._grid[0]
            high[column] = self._grid[above[0] - 1 + more] if len(above) else self._grid[-1]
        return np.minimum(low, t), np.maximum(high, t)

    def _pressed(self, t: Array, slots: np.ndarray, careful: bool) -> tuple[float, Array]:
        """Make the box of a track small by linear programs within a trust region."""
        size = float(self.size(t, slots))
        trust, low_high = 8.0, self._room(t, slots, careful)
        while trust > 0.02 and np.isfinite(size):
            q = self._postures(t, slots)
            slope = self._postures(t + STEP, slots) - self._postures(t - STEP, slots)
            moved = t + self._step(q, slope / (2.0 * STEP), trust, t, low_high)
            found = float(self.size(moved, slots))
            if found < size * (1.0 - ENOUGH):
                t, size = moved, found
            else:
                trust /= 3.0
        return size, t

    def _step(
        self, q: Array, slope: Array, trust: float, t: Array, low_high: tuple[Array, Array]
    ) -> Array:
        """Return the change of t with the smallest box, postures taken for linear."""
        n = len(t)
        slope = np.nan_to_num(slope)
        reach = np.abs(slope) * trust
        # places that can be at a face of the box at all
        rows, limits = [], []
        for sign, face in ((1.0, 6), (-1.0, 0)):
            far, near = sign * q + reach, (sign * q - reach).max(axis=0)
            place, joint = np.nonzero(far >= near)
            k = len(place)
            index = np.repeat(np.arange(k), 3)
            columns = np.stack(
                [12 + self._seen.left[place], 12 + self._seen.right[place], face + joint], axis=-1
            )
            along = sign * slope[place, joint]
            x = self._seen.x[place]
            values = np.stack([along * (1.0 - x), along * x, np.full(k, -sign)], axis=-1)
            rows.append(csr_array((values.ravel(), (index, columns.ravel())), shape=(k, 12 + n)))
            limits.append(-sign * q[place, joint])
        low, high = low_high
        bounds = [(None, None)] * 12 + list(
            zip(np.maximum(low - t, -trust), np.minimum(high - t, trust), strict=True)
        )
        cost = np.concatenate([-np.ones(6), np.ones(6), np.zeros(n)])
        found = linprog(
            cost, A_ub=vstack(rows), b_ub=np.concatenate(limits), bounds=bounds, method="highs"
        )
        return np.zeros(n) if found.x is None else np.asarray(found.x[12:])

    def _changed(
        self, t: Array, slots: np.ndarray, size: float, careful: bool
    ) -> tuple[float, Array]:
        """Change a track at random, smoothly along the passes, and press the best change."""
        random, n = self._random, len(t)
        low, high = self._room(t, slots, careful)
        middle = random.uniform(0.0, n, (BATCH, 1))
        width = n * 10.0 ** random.uniform(-2.0, 0.0, (BATCH, 1))
        amount = random.choice([-1.0, 1.0], (BATCH, 1)) * 10.0 ** random.uniform(
            -1.5, 1.2, (BATCH, 1)
        )
        bumps = amount * np.exp(-(((np.arange(n) - middle) / width) ** 2))
        changed = np.clip(t + bumps, low, high)
        sizes = self.size(changed, slots)
        pick = int(np.argmin(sizes)) if random.random() < 0.5 else int(random.integers(BATCH))
        found, moved = self._pressed(changed[pick], slots, careful)
        return (found, moved) if found < size else (size, t)

    def hold(self, found: Attack) -> float:
        """Return the joint range sum of a motion after a closer look; infinite if it is none.

        Looked at are forward kinematics at all places, limits, and what opl checks of motions on
        the wheel: arm, part and all around it, and the part's depth in the belt, on the way too.
        """
        if found.knots is not self._knots:
            self._look_at(found.knots)
        seen = self._places(CLOSELY)
        q = self._postures(found.t, found.slots, seen)
        if not np.isfinite(q).all():
            return np.inf
        at = seen.at(found.t)
        wanted = self._cell.Ts_base_flange(at, seen.frames)
        robot = self._cell.robot
        away = np.abs(forward_kinematics(robot, q) - wanted).max()
        cut = self._distance(np.arange(len(found.t)), found.t).min()
        within = (q >= robot.lower - SURE).all() and (q <= robot.upper + SURE).all()
        kept = away < 1e-6 and cut + self._cell.planned_penetration >= -SURE and within
        if not kept or self._collides(q, at, seen):
            return np.inf
        return float(np.ptp(q, axis=0).sum())

    def _collides(self, q: Array, at: Array, seen: Places) -> bool:
        """Return whether opl's check refuses a motion on the wheel, all places looked at."""
        scene = self._scene
        for index in range(self._path.n_passes):
            own = np.flatnonzero(seen.pass_index == index)
            kinds = (MoveKind.BETWEEN,) * len(own)
            motion = Motion(q[own], kinds, at[own], seen.place[own], seen.pass_index[own])
            if colliding_moves(scene.cell, scene.collision, scene.part, motion):
                return True
            if len(own) == 1 and scene.collision.collides(q[own]).any():
                return True
        return False


def _between(points: CutterPoints, knots: int) -> Array:
    """Return the cutter points and places put in evenly between those of a pass."""
    joined = np.flatnonzero(np.diff(points.pass_index) == 0)
    between = (joined[:, None] + np.arange(1, knots) / knots).ravel()
    return np.sort(np.concatenate([np.arange(len(points), dtype=float), between]))


def _shortest(cost: Array, slide: float, grid: Array) -> np.ndarray:
    """Return the rows of the cheapest way through columns, changes of t charged for."""
    change = slide * np.abs(grid[:, None] - grid)
    total, come = cost[0], []
    for column in cost[1:]:
        via = total[:, None] + change
        come.append(np.argmin(via, axis=0))
        total = via.min(axis=0) + column
    rows = [int(np.argmin(total))]
    for before in reversed(come):
        rows.append(int(before[rows[-1]]))
    return np.array(rows[::-1])


def attacked(path: Path, tries: int, seed: int) -> bool:
    """Attack the bound of a job and print what came of it; return whether it held."""
    job = opl.load_job(path)
    prepared = prepare(opl.cut_surface(job))
    plan = search_path(job.search, prepared.problem).plan
    assert plan.lower_bound is not None, f"{path} asks for no bound"
    start = time.perf_counter()
    adversary = Adversary(prepared.problem, seed)
    held = True
    for origin, known in (("the motion that was found", plan.path), ("nothing", None)):
        found = adversary.attack(tries, known)
        size = adversary.hold(found)
        held &= size >= plan.lower_bound
        print(
            f"{job.name}: bound {plan.lower_bound:.5f}, path {plan.path.joint_range_sum:.5f}; best "
            f"of {found.tries} tries from {origin} {size:.5f} rad, "
            f"{100.0 * (size / plan.lower_bound - 1.0):+.3f} % from the bound, "
            f"{time.perf_counter() - start:.0f} s: "
            f"{'the bound holds' if size >= plan.lower_bound else 'THE BOUND IS FALSE'}",
            flush=True,
        )
    return held


def main() -> None:
    """Attack the parts or job files that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "parts", nargs="*", default=CASES, help="parts of workpieces/, or job files"
    )
    parser.add_argument("--tries", type=int, default=TRIES, help="motions looked at for each")
    arguments = parser.parse_args()
    paths = [
        Path(one) if one.endswith(".yaml") else WORKPIECES / one / "job.yaml"
        for one in arguments.parts
    ]
    held = [attacked(path, arguments.tries, seed) for seed, path in enumerate(paths)]
    raise SystemExit(0 if all(held) else 1)


if __name__ == "__main__":
    main()
