"""Corners between moves on the wheel that a zone is too wide for, when positions are chosen."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from opl.cell.part_tree import PartTree
from opl.cell.robot import forward_kinematics
from opl.cell.wheel_distance import signed_wheel_distance
from opl.geometry.frames import inverse
from opl.geometry.toolpath import CutterPoints
from opl.job.values import Job
from opl.motion.motion import Motion
from opl.proof.corners import contact_errors, looked_at
from opl.proof.roundings import Rounding, roundings, tool_points_of

# of the error allowed: the proof of the file recognises the places of its moves anew, and finds a
# little more
USED = 0.99


class TooWide:
    """Tells them of one motion after the other; corners of the last one are not looked at again.

    What a corner may be made of depends on nothing but the configurations from the position before
    it to the one after it, and on the places of the pass that they grind.
    """

    def __init__(self, job: Job, points: CutterPoints, part: PartTree, zone: float) -> None:
        """Begin with nothing known; `zone` in [m], see `opl.planning.positions.PositionRule`."""
        self._job, self._points, self._part, self._zone = job, points, part, zone
        self._known: dict[bytes, bool] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return TooWide, (self._job, self._points, self._part, self._zone)

    def __call__(self, motion: Motion) -> Iterator[tuple[int, int, int]]:
        """Yield the corners, by the indices of three written configurations each."""
        positions, grinding = motion.positions, motion.grinding[motion.positions]
        # both of its moves grind
        keys = {
            k: _key(motion, positions[k - 1 : k + 2])
            for k in (np.flatnonzero(grinding[1:-1] & grinding[2:]) + 1).tolist()
        }
        new = np.zeros(len(positions), dtype=bool)
        new[[k for k, key in keys.items() if key not in self._known]] = True
        wide = set(self._wide(motion, new))
        self._known = {key: k in wide if new[k] else self._known[key] for k, key in keys.items()}
        for k, key in keys.items():
            if self._known[key]:
                before, here, after = positions[k - 1 : k + 2].tolist()
                yield before, here, after

    def _wide(self, motion: Motion, chosen: NDArray[np.bool_]) -> Iterator[int]:
        """Yield the numbers of the positions that the zone is too wide for, of those chosen."""
        job = self._job
        zones = np.where(chosen, self._zone, 0.0)
        corners = list(roundings(motion, zones, tool_points_of(job)))
        if not corners:
            return
        errors = contact_errors(job, self._points, motion, corners)[:, -1]
        for corner, error, deep in zip(corners, errors, self._deep(corners), strict=True):
            if deep or error > USED * job.search.max_contact_error:
                yield corner.k

    def _deep(self, corners: list[Rounding]) -> NDArray[np.bool_]:
        """Return which corners take the part too deep into the belt on some chords, shape (n,)."""
        cell = self._job.cell
        wheel, deepest = cell.wheel, -cell.planned_penetration
        q = np.stack([looked_at(corner) for corner in corners])
        Ts_contact0_workpiece = (
            inverse(wheel.T_base_contact0)
            @ forward_kinematics(cell.robot, q)
            @ cell.T_flange_workpiece
        )
        distance = signed_wheel_distance(self._part, wheel, Ts_contact0_workpiece, deepest)
        return np.asarray((distance < deepest).any(axis=1))


def _key(motion: Motion, corner: NDArray[np.intp]) -> bytes:
    """Return what a corner is: its three positions, all between them, and the pass."""
    first, here, last = corner.tolist()
    rows = slice(first, last + 1)
    return (
        motion.q[rows].tobytes()
        + motion.cutter_point[rows].tobytes()
        + np.array([here - first, motion.pass_index[here]], dtype=np.int64).tobytes()
    )
