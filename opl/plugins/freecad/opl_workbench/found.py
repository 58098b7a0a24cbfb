"""What came back from the service, as values: cutter points, the place of a reason, the motion."""

from __future__ import annotations

import bisect
import csv
import io
import json
import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import FreeCAD

from .job_object import placement
from .keeping import kept_text

# "cutter point 3", "points 5 to 18", "points 0-12, 40 (14 of 99)", "points (3-7, 12)"; the one
# beyond which there is no path was reached
_PLACES = re.compile(
    r"(?<!beyond )cutter points? \(?(\d+(?:\.\d+)?(?:(?: to |-)\d+)?"
    r"(?:, \d+(?:-\d+)?(?=[,)]| \())*)"
)
_RUN = re.compile(r"(\d+)(?:\.\d+)?(?:(?: to |-)(\d+))?")


@dataclass(frozen=True)
class CutterPoint:
    """A cutter point in the workpiece frame: its pass from 1, its place in mm, its normal."""

    pass_: int
    place: Any
    normal: Any


def cutter_points(job: Any) -> list[CutterPoint]:
    """Return the cutter points that a job keeps."""
    text = kept_text(job, "PointsKept", "_points.csv")
    rows = csv.DictReader(io.StringIO(text or ""))
    return [
        CutterPoint(
            int(row["pass"]), _vector(row, "xyz", "_mm"), _vector(row, "xyz", "", "normal_")
        )
        for row in rows
    ]


def marked(job: Any) -> list[int]:
    """Return the cutter points, from 0, that the reason of a failed job names."""
    runs = [run for found in _PLACES.finditer(job.Message) for run in _RUN.finditer(found[1])]
    return sorted({k for run in runs for k in range(int(run[1]), int(run[2] or run[1]) + 1)})


class Motion:
    """The motion of a run: postures at their times, each with what is ground there."""

    def __init__(self, text: str) -> None:
        found = json.loads(text)
        self.times: list[float] = found["time_s"]
        self.q: list[list[float]] = found["q_rad"]
        self._kind, self._pass = found["kind"], found["pass"]
        self._point, self._clearance = found["cutter_point"], found["clearance_mm"]

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return self.times[-1]

    def posture(self, moment: float) -> list[float]:
        """Return the joint positions in [rad] at a time; all joints turn in step."""
        at = bisect.bisect_left(self.times, moment)
        if at == 0 or at == len(self.times):
            return list(self.q[min(at, len(self.q) - 1)])
        before, after = self.times[at - 1], self.times[at]
        part = (moment - before) / (after - before)
        return [a + part * (b - a) for a, b in zip(self.q[at - 1], self.q[at])]

    def where(self, moment: float) -> str:
        """Return what is done at a time, in words."""
        at = min(bisect.bisect_left(self.times, moment), len(self.times) - 1)
        words = [self._kind[at].replace("_", " ")]
        if self._pass[at] is not None:
            words.append(f"pass {self._pass[at]}")
        if self._point[at] is not None:
            words.append(f"cutter point {self._point[at]:.2f}")
        if self._clearance[at] is not None:
            words.append(f"clearance {self._clearance[at]:.1f} mm")
        return ", ".join(words)

    def moment_of(self, cutter_point: float) -> float:
        """Return the time at which a cutter point is ground, or the one nearest to it."""
        known = [
            (abs(p - cutter_point), t) for p, t in zip(self._point, self.times) if p is not None
        ]
        return min(known)[1] if known else 0.0


def motion_of(job: Any) -> Motion | None:
    """Return the motion that a job keeps, None if it has none."""
    found: Motion | None = _read(Motion, job, "RunKept", "_motion.json")
    return found


class Cell:
    """A cell to be drawn: its joints and its solids."""

    def __init__(self, text: str) -> None:
        found = json.loads(text)
        self.home: list[float] = found["home_rad"]
        self.solids: list[dict[str, Any]] = found["solids"]
        self.T_base_contact0 = placement(found["T_base_contact0_mm"])
        self._joints = [
            (placement(joint["T_mm"]), FreeCAD.Vector(*joint["axis"])) for joint in found["joints"]
        ]
        T_flange_workpiece = placement(found["T_flange_workpiece_mm"])
        self.T_joint_workpiece = placement(found["T_joint_flange_mm"]).multiply(T_flange_workpiece)

    def joints(self, q: Sequence[float]) -> list[Any]:
        """Return the poses of base frame and joints in the base frame, for a posture in [rad]."""
        poses = [FreeCAD.Placement()]
        for (fixed, axis), angle in zip(self._joints, q):
            turn = FreeCAD.Placement(FreeCAD.Vector(), FreeCAD.Rotation(axis, math.degrees(angle)))
            poses.append(poses[-1].multiply(fixed).multiply(turn))
        return poses

    def part(self, q: Sequence[float]) -> Any:
        """Return the pose of the part in the base frame, for joint positions in [rad]."""
        return self.joints(q)[-1].multiply(self.T_joint_workpiece)


def cell_of(job: Any) -> Cell | None:
    """Return the cell that a job keeps, None if it has none."""
    found: Cell | None = _read(Cell, job, "PointsKept", "_cell.json")
    return found


_last: dict[str, tuple[Any, Any]] = {}  # what was read last: a slider asks for it again and again


def _read(kind: Any, job: Any, name: str, end: str) -> Any:
    """Return what a kept file holds, read once; None if there is none."""
    path = getattr(job, name)
    if not path:
        return None
    state = os.stat(path)
    key = (path, state.st_mtime_ns, state.st_size)
    if _last.get(end, (None,))[0] != key:
        text = kept_text(job, name, end)
        _last[end] = (key, None if text is None else kind(text))
    return _last[end][1]


def _vector(row: dict[str, str], axes: str, end: str, begin: str = "") -> Any:
    return FreeCAD.Vector(*(float(row[f"{begin}{axis}{end}"]) for axis in axes))
