"""Where a pass cannot begin or end, whatever the posture within a cell: its lead is surely shut.

A part comes to the wheel and leaves it as `opl.motion.free_leads` says, and at the least until a
free move may begin: part and links are farther from all that stands still than a clearance asks.
Where each of these leads fails before, as it is out of reach, beyond the limits, in collision or
too deep in the wheel all over a cell of contact positions, no motion of opl grinds the first or
last cutter point of a pass in that cell.
"""

from __future__ import annotations

import numpy as np

from opl.cell.collision import CollisionScene
from opl.cell.flange_jets import contact_jets
from opl.cell.full_turns import FULL_TURN, principal
from opl.cell.inverse_jets import joint_derivatives
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.geometry import frames
from opl.geometry.frames import Array
from opl.motion.free_leads import SHARES
from opl.motion.motion import MoveKind
from opl.motion.straight_moves import WHERE_BEGUN
from opl.planning.cut_cells import surely_nearer
from opl.planning.enclosed import ROUND_OFF
from opl.planning.images import TOUCHING, wrist_flips
from opl.planning.problem import GrindingProblem
from opl.search.walls import Piece

AT_ONCE = 4  # configurations of a lead that are looked at together
CELLS_OF_WORK = 15  # enclosed along a lead, that cost a unit of work
NODES_OF_WORK = 100  # looked at along a lead, likewise
PARTS, ROUNDS = 8, 3  # into which the way between two contact positions is cut, how often
RESERVE = 3e-4  # [m] of clearance: a motion may come nearer between two samples than at both
# places of the part that each lead goes through as if they were ground, shape (k, 4, 4)
Leads = tuple[Array, ...]


class ShutLeads:
    """Tells where leads are shut.

    Args:
        problem: What is planned.

    Attributes:
        work: What was looked at so far, in units of work.
    """

    def __init__(self, problem: GrindingProblem) -> None:
        self.work = 0.0
        self._problem = problem
        self._flips = wrist_flips(problem.cell.robot.arm)
        self._scenes: dict[float, tuple[CollisionScene, CollisionScene]] = {}  # by the reserve
        self._leads: dict[bytes, list[Leads]] = {}  # by the place
        self._known: dict[tuple[bytes, int, int, float], tuple[bool, Array]] = {}
        points = problem.points
        for index in range(points.n_passes):
            own = np.flatnonzero(points.pass_index == index)
            for kind, column in ((MoveKind.APPROACH, own[0]), (MoveKind.RETRACT, own[-1])):
                T = points.frames_at(np.array([float(column)]))[0]
                self._leads.setdefault(T.tobytes(), []).append(
                    _leads(problem, kind, int(column), T)
                )

    def surely(
        self, piece: Piece, flip: int, low: Array, high: Array
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return in which cells every lead is surely shut, and in which it is at the middle.

        Args:
            piece: The cells are parts of it.
            flip: Which flip of its postures.
            low: Least contact position of each, shape (n,).
            high: Greatest.

        Returns:
            Two flags, each of shape (n,); all false where a piece is not at the end of a pass.
        """
        T = piece.line.T_workpiece_cutter
        if T is None:
            return np.zeros(len(low), dtype=bool), np.zeros(len(low), dtype=bool)
        near = self.at(T, piece.family, flip, (low + high) / 2.0)
        surely = near.copy()
        surely[near] = self._shut(T, piece.family, flip, low[near], high[near], 0.0)
        return surely, near

    def at(
        self, T_workpiece_cutter: Array, family: int, flip: int, t: Array, reserve: float = RESERVE
    ) -> np.ndarray:
        """Return at which contact positions every lead is shut, as far as the field tells, (n,).

        Where two neighbouring contact positions of the field agree, so does what lies between.

        Args:
            T_workpiece_cutter: The place; nothing is shut where that is not the end of a pass.
            family: The posture.
            flip: Which flip of it.
            t: The contact positions in belt units, shape (n,).
            reserve: What leads leave beyond the clearance needed, in [m].
        """
        key = T_workpiece_cutter.tobytes(), family, flip, reserve
        if key[0] not in self._leads:
            return np.zeros(len(t), dtype=bool)
        if key not in self._known:
            self._known[key] = self._where_shut(T_workpiece_cutter, *key[1:])
        first, changes = self._known[key]
        return np.asarray((np.searchsorted(changes, t) % 2 == 1) != first)

    def _where_shut(self, T: Array, family: int, flip: int, reserve: float) -> tuple[bool, Array]:
        """Return whether leads are shut at the least contact position, and where that changes."""
        t = self._problem.field.contact_positions
        shut = self._shut(T, family, flip, t, t, reserve)
        before = np.flatnonzero(shut[1:] != shut[:-1])
        low, high = t[before], t[before + 1]
        for _ in range(ROUNDS if len(before) else 0):
            inside = low + np.arange(1, PARTS)[:, None] / PARTS * (high - low)
            there = self._shut(T, family, flip, inside.ravel(), inside.ravel(), reserve)
            as_before = there.reshape(inside.shape) == shut[before]
            # up to the first change
            kept = np.logical_and.accumulate(as_before, axis=0).sum(axis=0)
            ends, own = np.concatenate([low[None], inside, high[None]]), np.arange(len(before))
            low, high = ends[kept, own], ends[kept + 1, own]
        return bool(shut[0]), np.where(shut[before], high, low)

    def _shut(
        self, T: Array, family: int, flip: int, low: Array, high: Array, reserve: float
    ) -> np.ndarray:
        """Return in which cells every lead is shut, whatever the contact position, shape (n,)."""
        if reserve not in self._scenes:
            scene = self._problem.scene.collision.wider(reserve)
            self._scenes[reserve] = scene, scene.against_surroundings(WHERE_BEGUN)
        shut = np.zeros(len(low), dtype=bool)
        for leads in self._leads.get(T.tobytes(), ()):
            # only those of which all leads before are shut
            left = np.flatnonzero(~shut)
            for lead in leads:
                ends = low[left], high[left]
                scenes = self._scenes[reserve]
                cells = _Cells(self._problem, family, self._flips[flip], *ends, *scenes)
                self.work += len(left) / (CELLS_OF_WORK if (low < high).any() else NODES_OF_WORK)
                left = left[cells.shut(T, lead)]
            shut[left] = True
        return shut


class _Cells:
    """Cells of contact positions, in one posture.

    Args:
        problem: What is planned.
        family: The posture.
        flip: Sign and shift of its flip.
        low: Least contact position of each, shape (n,).
        high: Greatest; those of no width are looked at where they are.
        collision: In which a lead collides.
        begun: In which it does not, links and all that stands still, where a free move may begin.
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
    ) -> None:
        self._collision, self._begun = collision, begun
        self._cell, self._scene = problem.cell, problem.scene
        self._family, self._flip = family, flip
        self._low, self._high = low, high
        self._middle, self._radius = (low + high) / 2.0, (high - low) / 2.0

    def shut(self, T_workpiece_cutter: Array, lead: Array) -> np.ndarray:
        """Return in which cells a lead from a place fails before a free move may begin, (n,)."""
        every = np.arange(len(self._low))
        contact, turned, none = (of[0] for of in self._postures(T_workpiece_cutter[None], every))
        before, turned_before = contact.copy(), turned.copy()
        # over all of a cell the joints make as many full turns on their way as at its middle
        alike = np.ones(contact.shape, dtype=bool)
        shut, begun = np.zeros(len(contact), dtype=bool), none | np.isnan(contact[:, 0])
        for first in range(0, len(lead), AT_ONCE):
            left = np.flatnonzero(~shut & ~begun)
            if not len(left):
                break
            Ts = lead[first : first + AT_ONCE]
            q, now, none = self._postures(Ts, left)
            steps = principal(np.diff(q, axis=0, prepend=before[None, left]))
            q = before[left] + np.cumsum(steps, axis=0)
            way = np.abs(steps) + now + np.concatenate([turned_before[None, left], now[:-1]])
            same = alike[left] & np.logical_and.accumulate(way < np.pi, axis=0)
            before[left], turned_before[left], alike[left] = q[-1], now[-1], same[-1]
            there = q, np.where(same, now, np.inf)
            out = none | self._out_of_limits((contact[left], turned[left]), there)
            out |= self._nearer(Ts, left, -self._cell.planned_penetration)
            away = ~self._nearer(Ts, left, self._cell.part_from_wheel + WHERE_BEGUN)
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

    def _nearer(self, Ts_workpiece_cutter: Array, asked: np.ndarray, distance: float) -> np.ndarray:
        """Return in which cells asked about the part is nearer to the wheel all over, (k, n)."""
        k, n = len(Ts_workpiece_cutter), len(asked)
        at = np.tile(self._low[asked], k), np.tile(self._high[asked], k)
        Ts = np.repeat(Ts_workpiece_cutter, n, axis=0)
        nearer, _ = surely_nearer(self._cell, self._scene.part, Ts, *at, distance)
        return nearer.reshape(k, n)

    def _collides(self, scene: CollisionScene, q: Array, turned: Array) -> np.ndarray:
        """Return which postures collide in a scene, however far joints turn, shape (n,)."""
        sign, shift = self._flip
        placed = q * sign + shift
        hits = scene.collides(placed)
        if turned.any():
            hits[hits] = scene.collides_throughout(placed[hits], turned[hits])
        return np.asarray(hits)


def _leads(
    problem: GrindingProblem, kind: MoveKind, column: int, T_workpiece_cutter: Array
) -> Leads:
    """Return the leads at an end of a pass."""
    process, direction = problem.process, problem.points.direction_at(column)
    leads = []
    for share in SHARES:
        offsets = process.lead_shape(share * process.approach_run).offsets(kind, direction)
        Ts_away_contact = np.tile(np.eye(4), (len(offsets), 1, 1))
        Ts_away_contact[:, :3, 3] = -offsets
        leads.append(T_workpiece_cutter @ Ts_away_contact)
    return tuple(leads)
