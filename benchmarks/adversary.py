"""Tries to find a motion below a printed bound. By hand: python -m benchmarks.adversary.

Shares no code with the search: tracks begin at random postures and contact positions, at those that
differential evolution finds, and at the motion that the search found; each cutter point, and places
between, has its own t; the box of joint space is made smaller by linear programs over all t at
once, and by random changes. Inverse kinematics and contact frames are the cell's; a motion counts
only if it keeps the limits and comes out of forward kinematics and opl's own check of motions on
the wheel, with the clearances of the plan.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
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
KNOTS = 2  # places with a t of their own from one cutter point to the next
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
        t: Contact position at each place with one of its own, shape (n,).
        slots: IK branch of each pass, shape (n_passes,).
        tries: How many motions were looked at.
    """

    size: float
    t: Array
    slots: np.ndarray
    tries: int


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
        self._knots, self._points = _refined(problem.points, knots)
        self._part = problem.scene.part
        self._random = np.random.default_rng(seed)
        self.tries = 0
        n = len(self._points)
        passes = self._points.pass_index
        joined = np.flatnonzero(np.diff(passes) == 0)
        share = np.arange(between + 1) / (between + 1)
        place = np.concatenate([joined[:, None] + share, np.empty((0, between + 1))]).ravel()
        ends = np.flatnonzero(np.append(np.diff(passes) != 0, True)).astype(float)
        self._place = np.sort(np.concatenate([place, ends]))
        self._frames = self._points.frames_at(self._place)
        self._left = self._place.astype(int)
        self._right = np.minimum(self._left + 1, n - 1)
        self._x = self._place - self._left
        self._pass = passes[self._left]
        wheel = self._cell.wheel
        count = int(np.ceil(2.0 * wheel.last_position / GRID)) + 1
        self._grid = np.linspace(-wheel.last_position, wheel.last_position, count)
        free = self._distance(np.repeat(np.arange(n), count), np.tile(self._grid, n))
        self._free = (free >= -self._cell.planned_penetration).reshape(n, count)
        q = self._inverse(np.tile(self._grid, (n, 1)), self._points.Ts_workpiece_cutter[:, None])
        self._q = self._turned(q)
        self._reached = np.isfinite(self._q).all(axis=-1) & self._free[..., None]
        self._reached[self._reached] = ~problem.scene.collision.collides(self._q[self._reached])

    def _distance(self, column: np.ndarray, t: Array) -> Array:
        """Return how far the part is from the wheel where cutter points are ground, in [m]."""
        wheel, T = self._cell.wheel, self._points.Ts_workpiece_cutter[column]
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
        """Return the best motion found in some tries, from a known one among others."""
        n, n_passes = len(self._points), self._points.n_passes
        best = Attack(np.inf, np.zeros(n), np.zeros(n_passes, dtype=int), 0)
        self.tries = 0
        if known is not None:
            best = self._followed(best, *self._start(known), tries)
        turn = 0
        while self.tries < tries:
            turn += 1
            drawn = self._evolved() if turn % 4 == 0 else self._draw()
            if drawn is None:
                self.tries += 1
                continue
            best = self._followed(best, *drawn, tries)
        return Attack(best.size, best.t, best.slots, self.tries)

    def _start(self, known: GrindingPath) -> tuple[Array, np.ndarray]:
        """Return a motion that is known as a track."""
        t = np.interp(self._knots, known.cutter_point, known.contact_position)
        return t, np.full(self._points.n_passes, known.ik_branch)

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
                held = self.hold(Attack(0.0, now, slots, 0))
                if held < sure:
                    sure, free = held, now
            if size == sure:
                break  # nothing was in its way
        return Attack(sure, free, slots, self.tries) if sure < best.size else best

    def _as_far_as_free(self, t: Array, wanted: Array, slots: np.ndarray) -> Array:
        """Return a track as near to a wanted one as is free, from another."""
        if np.isfinite(self.hold(Attack(0.0, wanted, slots, 0))):
            return wanted
        low, high = 0.0, 1.0
        for _ in range(SHORTENED):
            middle = (low + high) / 2.0
            if np.isfinite(self.hold(Attack(0.0, t + middle * (wanted - t), slots, 0))):
                low = middle
            else:
                high = middle
        return t + low * (wanted - t)

    def _evolved(self) -> tuple[Array, np.ndarray] | None:
        """Return a track that differential evolution makes of few contact positions of a pass."""
        passes, random = self._points.pass_index, self._random
        drawn = self._draw()
        if drawn is None:
            return None
        t, slots = drawn
        share = np.concatenate([np.linspace(0.0, 1.0, int(k)) for k in np.bincount(passes)])
        at = np.linspace(0.0, 1.0, EVOLVED)

        def track(x: Array) -> Array:
            moved = x.reshape(self._points.n_passes, EVOLVED, -1)
            there = np.clip(share * (EVOLVED - 1), 0, EVOLVED - 1 - 1e-9)
            low = there.astype(int)
            rest = (there - low)[:, None]
            return np.asarray(
                t + ((1.0 - rest) * moved[passes, low] + rest * moved[passes, low + 1]).T
            )

        last = self._cell.wheel.last_position
        found = differential_evolution(
            lambda x: np.minimum(self.size(np.clip(track(x), -last, last), slots), 1e3),
            [(-last / 2.0, last / 2.0)] * (len(at) * self._points.n_passes),
            maxiter=GENERATIONS, popsize=4, seed=int(random.integers(1 << 30)), polish=False,
            vectorized=True, updating="deferred", x0=np.zeros(len(at) * self._points.n_passes),
        )  # fmt: skip
        return np.clip(track(found.x[:, None])[0], -last, last), slots

    def _draw(self) -> tuple[Array, np.ndarray] | None:
        """Draw a continuous track near a random posture: shortest paths through the grid."""
        passes, random = self._points.pass_index, self._random
        column = random.integers(len(self._points))
        choices = np.argwhere(self._reached[column])
        if not len(choices):
            return None
        row, slot = choices[random.integers(len(choices))]
        wanted = self._q[column, row, slot]
        weight = random.exponential(1.0, 6)
        slide = 10.0 ** random.uniform(-4.0, -1.0)
        t = np.empty(len(self._points))
        slots = np.full(self._points.n_passes, slot)
        for index in range(self._points.n_passes):
            columns = np.flatnonzero(passes == index)
            whole = np.flatnonzero(self._reached[columns].any(axis=1).all(axis=0))
            if slot not in whole or random.random() < 0.1:
                if not len(whole):
                    return None
                slots[index] = whole[random.integers(len(whole))]
            away = np.abs(self._q[columns][:, :, slots[index]] - wanted) @ weight
            cost = np.where(self._reached[columns][:, :, slots[index]], away, 1e9)
            t[columns] = self._grid[_shortest(cost, slide, self._grid)]
        return t, slots

    def _postures(self, t: Array, slots: np.ndarray) -> Array:
        """Return the postures of tracks at all places, shape (..., P, 6); NaN where there is none.

        The turns of each pass are counted so that it keeps the limits, near the first.
        """
        at = t[..., self._left] * (1.0 - self._x) + t[..., self._right] * self._x
        q = self._inverse(at, self._frames)
        q = q[..., np.arange(len(self._place)), slots[self._pass], :]
        robot = self._cell.robot
        reference: Array | None = None
        for index in range(self._points.n_passes):
            own = self._pass == index
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
        self.tries += q.size // (6 * len(self._place))
        return np.asarray(np.nan_to_num(np.ptp(q, axis=-2).sum(axis=-1), nan=np.inf))

    def _room(self, t: Array, slots: np.ndarray, careful: bool) -> tuple[Array, Array]:
        """Return between which contact positions each place may be moved.

        Those next to where the grid is free all the way, or carefully, those where it is free.
        """
        more = 0 if careful else 1
        reached = self._reached[np.arange(len(t)), :, slots[self._points.pass_index]]
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
                [12 + self._left[place], 12 + self._right[place], face + joint], axis=-1
            )
            along = sign * slope[place, joint]
            x = self._x[place]
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
        q = self._postures(found.t, found.slots)
        if not np.isfinite(q).all():
            return np.inf
        at = found.t[self._left] * (1.0 - self._x) + found.t[self._right] * self._x
        wanted = self._cell.Ts_base_flange(at, self._frames)
        robot = self._cell.robot
        away = np.abs(forward_kinematics(robot, q) - wanted).max()
        cut = self._distance(np.arange(len(self._points)), found.t).min()
        within = (q >= robot.lower - SURE).all() and (q <= robot.upper + SURE).all()
        kept = away < 1e-6 and cut + self._cell.planned_penetration >= -SURE and within
        if not kept or self._collides(q, at):
            return np.inf
        return float(np.ptp(q, axis=0).sum())

    def _collides(self, q: Array, at: Array) -> bool:
        """Return whether opl's check refuses a motion on the wheel, all places looked at."""
        for index in range(self._points.n_passes):
            own = np.flatnonzero(self._pass == index)
            motion = Motion(
                q[own], (MoveKind.BETWEEN,) * len(own), at[own], self._place[own], self._pass[own]
            )
            scene = self._scene
            if colliding_moves(scene.cell, scene.collision, scene.part, motion):
                return True
            if len(own) == 1 and scene.collision.collides(q[own]).any():
                return True
        return False


def _refined(points: CutterPoints, knots: int) -> tuple[Array, CutterPoints]:
    """Return the cutter points with more put in evenly between, and their places among the old."""
    joined = np.flatnonzero(np.diff(points.pass_index) == 0)
    between = (joined[:, None] + np.arange(1, knots) / knots).ravel()
    places = np.sort(np.concatenate([np.arange(len(points), dtype=float), between]))
    arc_length = np.interp(places, np.arange(len(points)), points.arc_length)
    index = points.pass_index[places.astype(int)]
    return places, CutterPoints(points.frames_at(places), index, arc_length)


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
    found = adversary.attack(tries, plan.path)
    size = adversary.hold(found)
    held = size >= plan.lower_bound
    print(
        f"{job.name}: bound {plan.lower_bound:.5f}, path {plan.path.joint_range_sum:.5f}; best of "
        f"{found.tries} tries {size:.5f} rad, {100.0 * (size / plan.lower_bound - 1.0):+.3f} % "
        f"from the bound, {time.perf_counter() - start:.0f} s: "
        f"{'the bound holds' if held else 'THE BOUND IS FALSE'}",
        flush=True,
    )
    return held


def main() -> None:
    """Attack the parts named, or job files; the first argument may be the number of tries."""
    arguments = sys.argv[1:]
    tries = int(arguments.pop(0)) if arguments and arguments[0].isdigit() else TRIES
    paths = [
        Path(one) if one.endswith(".yaml") else WORKPIECES / one / "job.yaml"
        for one in arguments or CASES
    ]
    held = [attacked(path, tries, seed) for seed, path in enumerate(paths)]
    raise SystemExit(0 if all(held) else 1)


if __name__ == "__main__":
    main()
