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
from opl.geometry.frames import Array
from opl.motion.free_leads import SHARES
from opl.motion.motion import MoveKind
from opl.motion.straight_moves import WHERE_BEGUN
from opl.planning.problem import GrindingProblem
from opl.search.walls import Piece
from opl.walls.images import wrist_flips
from opl.walls.lead_cells import LeadCells, Seen

PARTS, ROUNDS = 8, 3  # into which the way between two contact positions is cut, how often
RESERVE = 3e-4  # [m] of clearance: a motion may come nearer between two samples than at both
# of it in depth: between two configurations of a lead the part sinks some micrometres deeper
SPARE = 0.2
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
        self._over_field: dict[float, dict[bytes, Seen]] = {}  # by the reserve and places of a lead
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
        seen = self._over_field.setdefault(reserve, {})
        shut = self._shut(T, family, flip, t, t, reserve, seen)
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
        self,
        T: Array,
        family: int,
        flip: int,
        low: Array,
        high: Array,
        reserve: float,
        seen: dict[bytes, Seen] | None = None,
    ) -> np.ndarray:
        """Return in which cells every lead is shut, whatever the contact position, shape (n,).

        What was seen of these contact positions, whatever the posture, is kept if asked for.
        """
        if reserve not in self._scenes:
            scene = self._problem.scene.collision.wider(reserve)
            self._scenes[reserve] = scene, scene.against_surroundings(WHERE_BEGUN)
        shut = np.zeros(len(low), dtype=bool)
        for leads in self._leads.get(T.tobytes(), ()):
            # only those of which all leads before are shut
            left = np.flatnonzero(~shut)
            for lead in leads:
                scenes, posture = self._scenes[reserve], (family, self._flips[flip])
                given = *posture, low, high, *scenes, SPARE * reserve
                cells = LeadCells(self._problem, *given, seen)
                left = left[cells.shut(T, lead, left)]
                self.work += cells.work
            shut[left] = True
        return shut


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
