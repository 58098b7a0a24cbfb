"""Joint limits, joint speeds, and whether every cutter point is ground: no geometry needed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from opl.cell.workcell import WorkCell
from opl.findings import Finding, Level
from opl.geometry.toolpath import CutterPoints
from opl.motion.motion import Motion, TimedMotion

SPEED_TOLERANCE = 1.001  # programmed speeds have four digits


def limit_findings(cell: WorkCell, timed: TimedMotion) -> list[Finding]:
    """Return a finding for each configuration beyond a limit and each move beyond a speed."""
    robot, motion, found = cell.robot, timed.motion, []
    beyond = np.rad2deg(np.maximum(robot.lower - motion.q, motion.q - robot.upper))
    for move, joint in np.argwhere(beyond > np.rad2deg(1e-9)):
        message = (
            f"joint {robot.joint_names[joint]}: {beyond[move, joint]:.3f} deg beyond its limit"
        )
        found.append(Finding(Level.ERROR, "limit", motion.place(move), message))
    found += _limits_of_cell(cell, motion)
    turned = np.abs(np.diff(motion.q, axis=0, prepend=motion.q[:1]))
    allowed = robot.max_speed * timed.duration[:, None] * SPEED_TOLERANCE
    for move, joint in np.argwhere(turned > allowed + 1e-12):
        speed = np.rad2deg(turned[move, joint]) / max(timed.duration[move], 1e-12)
        most = np.rad2deg(robot.max_speed[joint])
        message = f"joint {robot.joint_names[joint]}: {speed:.1f} deg/s, {most:.1f} allowed"
        found.append(Finding(Level.ERROR, "speed", motion.place(move), message))
    return found


def _limits_of_cell(cell: WorkCell, motion: Motion) -> Iterator[Finding]:
    """Yield a finding for each configuration beyond a limit that the cell adds.

    Joints move linearly between the configurations and what is limited is linear in them, so
    between two configurations it lies between its values at both.
    """
    for limit in cell.limits:
        for move, q in enumerate(motion.q):
            total = sum(float(c * angle) for c, angle in zip(limit.coefficients, q, strict=True))
            if limit.lower - 1e-9 <= total <= limit.upper + 1e-9:
                continue
            message = (
                f"{limit.name}: {np.rad2deg(total):.3f} deg, must be in "
                f"{np.rad2deg(limit.lower):g} to {np.rad2deg(limit.upper):g}"
            )
            yield Finding(Level.ERROR, "limit", motion.place(move), message)


def missing_points(points: CutterPoints, motion: Motion) -> list[Finding]:
    """Return a finding unless every cutter point is ground, once and in order."""
    ground = motion.ground_points.tolist()
    if ground == list(range(len(points))):
        return []
    expected = next(
        (k for k, point in enumerate(ground) if point != k), min(len(ground), len(points) - 1)
    )
    message = f"{len(points)} cutter points expected in order, {len(ground)} ground"
    return [Finding(Level.ERROR, "order", f"cutter point {expected}", message)]
