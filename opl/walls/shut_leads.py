"""Where a pass cannot begin or end, whatever the posture within a cell: its lead is surely shut.

A part comes to the wheel and leaves it as `opl.motion.free_leads` says, and at the least until a
free move may begin: part and links are farther from all that stands still than a clearance asks.
Where each of these leads fails before, as it is out of reach, beyond the limits, in collision or
too deep in the wheel all over a cell of contact positions, no motion of opl grinds the first or
last cutter point of a pass in that cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.collision import CollisionScene
from opl.geometry.frames import Array
from opl.motion.free_leads import SHARES
from opl.motion.motion import MoveKind
from opl.motion.straight_moves import WHERE_BEGUN
from opl.planning.problem import GrindingProblem
from opl.walls.images import wrist_flips
from opl.walls.lead_cells import LeadCells, Seen

PARTS, ROUNDS = 8, 3  # into which the way between two contact positions is cut, how often
RESERVE = 3e-4  # [m] of clearance: a motion may come nearer between two samples than at both
# of it in depth: between two configurations of a lead the part sinks some micrometres deeper
SPARE = 0.2
# places of the part that each lead goes through as if they were ground, shape (k, 4, 4)
Leads = tuple[Array, ...]


@dataclass
class _OverField:
    """What is known of a place in one posture over the contact positions of the field.

    Attributes:
        looked: At which it was looked, shape (n,).
        shut: At which of these all leads are shut.
        change: Up to where it is behind each as it is there, where the next one is not alike, in
            belt units; NaN where that is not known.
    """

    looked: np.ndarray
    shut: np.ndarray
    change: Array

    @classmethod
    def nothing(cls, n: int) -> _OverField:
        """Return what is known before any is looked at."""
        return cls(np.zeros(n, dtype=bool), np.zeros(n, dtype=bool), np.full(n, np.nan))


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
        self._known: dict[tuple[bytes, int, int, float], _OverField] = {}
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
        self, T_workpiece_cutter: Array | None, family: int, flip: int, low: Array, high: Array
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return in which cells every lead is surely shut, and in which it is at the middle.

        Args:
            T_workpiece_cutter: The place; None along a contact position, where no pass ends.
            family: The posture.
            flip: Which flip of it.
            low: Least contact position of each, shape (n,).
            high: Greatest.

        Returns:
            Two flags, each of shape (n,); all false where that is not at the end of a pass.
        """
        if T_workpiece_cutter is None:
            return np.zeros(len(low), dtype=bool), np.zeros(len(low), dtype=bool)
        near = self.at(T_workpiece_cutter, family, flip, (low + high) / 2.0)
        surely = near.copy()
        own = T_workpiece_cutter, family, flip
        surely[near] = self._shut(*own, low[near], high[near], 0.0)
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
        if T_workpiece_cutter.tobytes() not in self._leads:
            return np.zeros(len(t), dtype=bool)
        positions = self._problem.field.contact_positions
        key = T_workpiece_cutter.tobytes(), family, flip, reserve
        if key not in self._known:
            self._known[key] = _OverField.nothing(len(positions))
        known = self._known[key]
        before = np.clip(np.searchsorted(positions, t, side="right") - 1, 0, len(positions) - 2)
        ends = np.unique(np.concatenate([before, before + 1]))
        if len(new := ends[~known.looked[ends]]):
            seen = self._over_field.setdefault(reserve, {})
            field = positions, positions, reserve
            known.shut[new] = self._shut(T_workpiece_cutter, family, flip, *field, new, seen)[new]
            known.looked[new] = True
        differ = known.shut[before] != known.shut[before + 1]
        between = np.unique(before[differ])
        if len(new := between[np.isnan(known.change[between])]):
            given = family, flip, reserve, new, known.shut[new]
            known.change[new] = self._where_it_changes(T_workpiece_cutter, *given)
        behind = differ & (t > known.change[before])
        return np.asarray(known.shut[before + behind])

    def _where_it_changes(
        self,
        T: Array,
        family: int,
        flip: int,
        reserve: float,
        before: np.ndarray,
        shut: np.ndarray,
    ) -> Array:
        """Return up to which contact positions it stays as it is at some of the field, shape (n,).

        Whether leads are shut there is given, and that this is not so at the next one.
        """
        t = self._problem.field.contact_positions
        low, high = t[before], t[before + 1]
        for _ in range(ROUNDS):
            inside = low + np.arange(1, PARTS)[:, None] / PARTS * (high - low)
            there = self._shut(T, family, flip, inside.ravel(), inside.ravel(), reserve)
            as_before = there.reshape(inside.shape) == shut
            # up to the first change
            kept = np.logical_and.accumulate(as_before, axis=0).sum(axis=0)
            ends, own = np.concatenate([low[None], inside, high[None]]), np.arange(len(before))
            low, high = ends[kept, own], ends[kept + 1, own]
        return np.asarray(np.where(shut, high, low))

    def _shut(
        self,
        T: Array,
        family: int,
        flip: int,
        low: Array,
        high: Array,
        reserve: float,
        asked: np.ndarray | None = None,
        seen: dict[bytes, Seen] | None = None,
    ) -> np.ndarray:
        """Return in which cells every lead is shut, whatever the contact position, shape (n,).

        Of all cells, or of those asked about. What was seen of these contact positions, whatever
        the posture, is kept if wanted.
        """
        if reserve not in self._scenes:
            scene = self._problem.scene.collision.wider(reserve)
            self._scenes[reserve] = scene, scene.against_surroundings(WHERE_BEGUN)
        shut = np.zeros(len(low), dtype=bool)
        asked = np.arange(len(low)) if asked is None else asked
        for leads in self._leads.get(T.tobytes(), ()):
            # only those of which all leads before are shut
            left = asked[~shut[asked]]
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
