"""The figures by which paths are compared, the same for every method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.robot import Robot
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.motion import Motion
from opl.motion.path import GrindingPath
from opl.motion.process_settings import ProcessSettings
from opl.motion.timing import followed, time_motion


@dataclass(frozen=True)
class Figures:
    """What a path over the wheel costs.

    Attributes:
        joint_ranges: Largest minus smallest value of each joint in [rad], shape (6,).
        joint_travel: Sum over steps and joints of the absolute change in [rad].
        contact_travel: Sum over steps of the absolute change of t in belt units.
        seconds: Time on the wheel at the set feed, or as fast as the joints can follow, in [s].
    """

    joint_ranges: Array
    joint_travel: float
    contact_travel: float
    seconds: float

    @property
    def joint_range_sum(self) -> float:
        """Sum of the joint ranges in [rad] (equation 14)."""
        return float(self.joint_ranges.sum())


def figures_of_path(
    path: GrindingPath, motion: Motion, points: CutterPoints, process: ProcessSettings, robot: Robot
) -> Figures:
    """Return the figures of a found path.

    `motion` is the whole motion that the path is part of.
    """
    timed = time_motion(motion, points, process, robot).timed
    seconds = timed.duration[timed.motion.grinding].sum()
    return Figures(path.joint_ranges, path.joint_travel, path.contact_travel, float(seconds))


def figures_of_points(
    q: Array, points: CutterPoints, process: ProcessSettings, robot: Robot
) -> Figures:
    """Return the figures of a contact-fixed path, one ``q`` per cutter point, shape (N, 6)."""
    on_wheel = np.diff(points.pass_index) == 0
    turned = np.abs(np.diff(q, axis=0))
    arc = np.abs(np.diff(points.arc_length))
    seconds = np.maximum(arc / process.feed, (turned / robot.max_speed).max(axis=1))
    ground = [np.flatnonzero(points.pass_index == k) for k in range(points.n_passes)]
    total = sum(followed(q[rows], seconds[rows[:-1]], robot).sum() for rows in ground)
    return Figures(np.ptp(q, axis=0), float(turned[on_wheel].sum()), 0.0, float(total))
