"""A path on the wheel: a track with its intermediate nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from opl.geometry.frames import Array
from opl.motion.motion import MoveKind


@dataclass(frozen=True, eq=False)
class PassEnd:
    """Where a pass begins or ends on the wheel: there its approach ends, or its retract begins.

    Attributes:
        kind: Which of the two.
        ik_branch: Slot of the inverse kinematics.
        cutter_point: The first or the last cutter point of the pass.
        contact_position: Where it is ground, in belt units.
        q: There, in [rad], shape (6,).
    """

    kind: MoveKind
    ik_branch: int
    cutter_point: int
    contact_position: float
    q: Array


@dataclass(frozen=True)
class GrindingPath:
    """Configurations on the wheel, joined by linear joint interpolation within a pass.

    Attributes:
        ik_branches: Slot of the inverse kinematics of each pass, shape (n_passes,).
        q: Joint positions in [rad], shape (n, 6).
        contact_position: t of each configuration, shape (n,).
        cutter_point: Index of the cutter point, fractional at intermediate nodes, shape (n,).
        pass_index: The pass of each configuration, shape (n,).
    """

    ik_branches: np.ndarray
    q: Array
    contact_position: Array
    cutter_point: Array
    pass_index: np.ndarray

    @property
    def n_intermediate(self) -> int:
        """Number of configurations between cutter points."""
        return int(np.count_nonzero(self.cutter_point % 1.0))

    @property
    def joint_ranges(self) -> Array:
        """Largest minus smallest value of each joint in [rad], shape (6,)."""
        return np.asarray(np.ptp(self.q, axis=0))

    @cached_property
    def joint_range_sum(self) -> float:
        """Sum of the joint ranges in [rad]: what the search keeps small (equation 14)."""
        return float(self.joint_ranges.sum())

    @property
    def joint_travel(self) -> float:
        """Sum over all moves and joints of the absolute change in [rad], on the wheel only."""
        return float(np.abs(np.diff(self.q, axis=0)[self._on_wheel]).sum())

    @property
    def contact_travel(self) -> float:
        """Sum over all moves of the absolute change of t in belt units, on the wheel only."""
        return float(np.abs(np.diff(self.contact_position)[self._on_wheel]).sum())

    def pass_ends(self) -> list[tuple[PassEnd, PassEnd]]:
        """Return where each pass begins and where it ends."""
        ends = []
        for index in range(int(self.pass_index[-1]) + 1):
            on_pass = np.flatnonzero(self.pass_index == index)
            first, last = (
                PassEnd(
                    kind, int(self.ik_branches[index]), int(self.cutter_point[k]),
                    float(self.contact_position[k]), self.q[k],
                )
                for kind, k in ((MoveKind.APPROACH, on_pass[0]), (MoveKind.RETRACT, on_pass[-1]))
            )  # fmt: skip
            ends.append((first, last))
        return ends

    @property
    def _on_wheel(self) -> np.ndarray:
        """Which moves stay on the wheel, shape (n - 1,)."""
        return np.asarray(np.diff(self.pass_index) == 0)
