"""A lead over cells of contact positions, in one posture: in which of them it fails.

Before a free move may begin it is out of reach, beyond the limits, in collision or too deep in the
wheel, all over the cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.collision import CollisionScene
from opl.cell.flange_jets import contact_jets
from opl.cell.full_turns import FULL_TURN, principal
from opl.cell.inverse_jets import joint_derivatives
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.geometry import frames
from opl.geometry.frames import Array
from opl.motion.straight_moves import WHERE_BEGUN
from opl.planning.problem import GrindingProblem
from opl.walls.cut_cells import surely_nearer
from opl.walls.enclosed import ROUND_OFF
from opl.walls.images import TOUCHING

AT_ONCE = 4  # configurations of a lead that are looked at together
# units of work of a look at these, and of each of them in each cell: where it is, and all over it
WORK, ENCLOSED_WORK = (0.4, 1.0 / 400.0), (1.5, 1.0 / 200.0)


@dataclass(frozen=True)
class Seen:
    """Places of a lead at contact positions, whatever the posture: what was looked at so far.

    Attributes:
        q: Every inverse solution in [rad], shape (k, n, 8, 6).
        solved: Of which contact positions these are known, shape (n,).
        deep: Where the part is too deep in the wheel, shape (k, n).
        near: Where it is so near to the wheel that no free move may begin, shape (k, n).
        measured: Of which contact positions these two are known, shape (n,).
    """

    q: Array
    solved: np.ndarray
    deep: np.ndarray
    near: np.ndarray
    measured: np.ndarray

    @classmethod
    def nothing(cls, k: int, n: int) -> Seen:
        """Return what is known of k places at n contact positions before any is looked at."""
        flags = (np.zeros(shape, dtype=bool) for shape in (n, (k, n), (k, n), n))
        return cls(np.full((k, n, 8, 6), np.nan), *flags)


class LeadCells:
    """Cells of contact positions, in one posture.

    Args:
        problem: What is planned.
        family: The posture.
        flip: Sign and shift of its flip.
        low: Least contact position of each, shape (n,).
        high: Greatest; those of no width are looked at where they are.
        collision: In which a lead collides.
        begun: In which it does not, links and all that stands still, where a free move may begin.
        spare: Depth in the wheel that a lead leaves of what is allowed, in [m].
        seen: What was seen of these contact positions before, whatever the posture; grows.

    Attributes:
        work: What was looked at so far, in units of work.
    """

    def __init__(
        self,
        problem: GrindingProblem,
        family: int,
        flip: tuple[Array, Array],
        low: Array,
        high: Array,
        collision: CollisionScene,
        begun: CollisionScene,
        spare: float,
        seen: dict[bytes, Seen] | None = None,
    ) -> None:
        self._collision, self._begun, self._spare = collision, begun, spare
        self._cell, self._scene = problem.cell, problem.scene
        self._family, self._flip = family, flip
        self._low, self._high = low, high
        self._middle, self._radius = (low + high) / 2.0, (high - low) / 2.0
        self._seen = seen
        self.work = 0.0

    def shut(self, T_workpiece_cutter: Array, lead: Array, cells: np.ndarray) -> np.ndarray:
        """Return in which of some cells a lead fails before a free move may begin, (n,).

        Those without a posture on the wheel are among them: no pass begins there.
        """
        contact, turned, none = (of[0] for of in self._postures(T_workpiece_cutter[None], cells))
        before, turned_before = contact.copy(), turned.copy()
        # over all of a cell the joints make as many full turns on their way as at its middle
        alike = np.ones(contact.shape, dtype=bool)
        # what has no posture counts as shut: just inside of the reach, leads may leave it at once,
        # and where that begins is looked for between contact positions that differ
        shut, begun = none.copy(), np.zeros(len(contact), dtype=bool)
        for first in range(0, len(lead), AT_ONCE):
            left = np.flatnonzero(~shut & ~begun)
            if not len(left):
                break
            Ts = lead[first : first + AT_ONCE]
            look, looked = ENCLOSED_WORK if self._radius.any() else WORK
            self.work += look + looked * len(Ts) * len(left)
            q, now, none = self._postures(Ts, cells[left])
            steps = principal(np.diff(q, axis=0, prepend=before[None, left]))
            q = before[left] + np.cumsum(steps, axis=0)
            way = np.abs(steps) + now + np.concatenate([turned_before[None, left], now[:-1]])
            same = alike[left] & np.logical_and.accumulate(way < np.pi, axis=0)
            before[left], turned_before[left], alike[left] = q[-1], now[-1], same[-1]
            there = q, np.where(same, now, np.inf)
            out = none | self._out_of_limits((contact[left], turned[left]), there)
            too_deep, near = self._beside_wheel(Ts, cells[left])
            out, away = out | too_deep, ~near
            known = ~out & ~np.isnan(q[..., 0]) & np.isfinite(now).all(axis=-1)
            on = np.ones(len(left), dtype=bool)  # neither shut nor begun so far
            for k in range(len(Ts)):
                asked = np.flatnonzero(on & known[k])
                out[k, asked] = self._collides(self._collision, q[k, asked], now[k, asked])
                shut[left[on & out[k]]] = True
                asked = np.flatnonzero(on & known[k] & ~out[k] & away[k])
                away[k, asked] = ~self._collides(self._begun, q[k, asked], now[k, asked])
                begun[left[on & ~out[k] & away[k]]] = True
                on &= ~out[k] & ~away[k]
        return np.asarray(~begun)

    def _postures(
        self, Ts_workpiece_cutter: Array, asked: np.ndarray
    ) -> tuple[Array, Array, np.ndarray]:
        """Return postures at the middle, how far joints turn in the cell, and where none is.

        Of places of shape (k, 4, 4) and n cells asked about: principal angles in [rad], NaN where
        there is none, shape (k, n, 6); not finite where it is not known, shape (k, n, 6); shape
        (k, n).
        """
        cell, arm, k, n = self._cell, self._cell.robot.arm, len(Ts_workpiece_cutter), len(asked)
        if self._seen is not None:
            q = np.ascontiguousarray(self._solved(Ts_workpiece_cutter, asked)[:, :, self._family])
            return q, np.zeros_like(q), np.isnan(q[..., 0])
        Ts = cell.Ts_base_flange(self._middle[asked], Ts_workpiece_cutter[:, None])
        q = np.ascontiguousarray(inverse_kinematics(arm, Ts)[:, :, self._family])
        if not self._radius.any():
            return q, np.zeros_like(q), np.isnan(q[..., 0])
        Ts_cutter_flange = frames.inverse(cell.T_flange_workpiece @ Ts_workpiece_cutter)
        middle, radius = np.tile(self._middle[asked], k), np.tile(self._radius[asked], k)
        flange = contact_jets(cell.wheel, np.repeat(Ts_cutter_flange, n, axis=0), middle, radius)
        found = joint_derivatives(arm, flange, [self._family])
        turned = found.first[0].T * radius[:, None] + ROUND_OFF
        return q, turned.reshape(k, n, 6), found.none[0].reshape(k, n)

    def _out_of_limits(self, contact: tuple[Array, Array], lead: tuple[Array, Array]) -> np.ndarray:
        """Return which postures no full turns bring within the limits, those of contact and lead.

        The same full turns both, each given by its middle and how far joints turn, shape (n, 6) of
        contact, (k, n, 6) of a lead. Shape (k, n).
        """
        robot, (sign, shift) = self._cell.robot, self._flip
        fewest, most = np.full(6, -np.inf), np.full(6, np.inf)
        for middle, turned in (contact, lead):
            q = middle * sign + shift
            low, high = (
                (robot.lower - q - turned) / FULL_TURN,
                (robot.upper - q + turned) / FULL_TURN,
            )
            fewest = np.maximum(fewest, np.ceil(low - TOUCHING))
            most = np.minimum(most, np.floor(high + TOUCHING))
        return np.asarray((fewest > most).any(axis=-1))

    def _of(self, Ts_workpiece_cutter: Array) -> Seen:
        """Return what is seen so far of some places, at all contact positions."""
        assert self._seen is not None
        key = Ts_workpiece_cutter.tobytes()
        if key not in self._seen:
            self._seen[key] = Seen.nothing(len(Ts_workpiece_cutter), len(self._middle))
        return self._seen[key]

    def _solved(self, Ts_workpiece_cutter: Array, asked: np.ndarray) -> Array:
        """Return every inverse solution of places at some contact positions, (k, n, 8, 6)."""
        seen = self._of(Ts_workpiece_cutter)
        new = asked[~seen.solved[asked]]
        if len(new):
            Ts = self._cell.Ts_base_flange(self._middle[new], Ts_workpiece_cutter[:, None])
            seen.q[:, new], seen.solved[new] = inverse_kinematics(self._cell.robot.arm, Ts), True
        return seen.q[:, asked]

    def _beside_wheel(
        self, Ts_workpiece_cutter: Array, asked: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return in which cells the part is surely too deep, and too near to move on, (k, n)."""
        if self._seen is None:
            return self._measured(Ts_workpiece_cutter, asked)
        seen = self._of(Ts_workpiece_cutter)
        new = asked[~seen.measured[asked]]
        if len(new):
            seen.deep[:, new], seen.near[:, new] = self._measured(Ts_workpiece_cutter, new)
            seen.measured[new] = True
        return seen.deep[:, asked], seen.near[:, asked]

    def _measured(
        self, Ts_workpiece_cutter: Array, asked: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Measure what `_beside_wheel` returns."""
        k, n = len(Ts_workpiece_cutter), len(asked)
        Ts = np.repeat(Ts_workpiece_cutter, n, axis=0)
        low, high = np.tile(self._low[asked], k), np.tile(self._high[asked], k)
        deep, cell, part = np.zeros(k * n, dtype=bool), self._cell, self._scene.part
        near, _ = surely_nearer(cell, part, Ts, low, high, cell.part_from_wheel + WHERE_BEGUN)
        # what is not near is not deep
        too_deep = self._spare - cell.planned_penetration
        deep[near], _ = surely_nearer(cell, part, Ts[near], low[near], high[near], too_deep)
        return deep.reshape(k, n), near.reshape(k, n)

    def _collides(self, scene: CollisionScene, q: Array, turned: Array) -> np.ndarray:
        """Return which postures collide in a scene, however far joints turn, shape (n,)."""
        sign, shift = self._flip
        placed = q * sign + shift
        hits = scene.collides(placed)
        if turned.any():
            hits[hits] = scene.collides_throughout(placed[hits], turned[hits])
        return np.asarray(hits)
