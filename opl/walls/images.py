"""Images of a posture: full turns and flips of the wrist that bring the arm to the same place.

What is known of one posture is known of its images. Full turns are counted from seams, angles at
which no posture of a family lies.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from opl.cell.full_turns import FULL_TURN
from opl.cell.inverse_kinematics import Arm
from opl.cell.robot import Robot
from opl.cell.spherical_wrist import SphericalWristArm
from opl.files.kernels import kernel
from opl.geometry.frames import Array
from opl.planning.nodes import SEAM_GAP
from opl.search.box import JointBox
from opl.search.walls import Image

TOUCHING = 1e-9  # [turns] a limit that is only touched counts


@dataclass(frozen=True)
class Seams:
    """Where the angles of each posture are cut open, to count full turns.

    Attributes:
        start: Least angle in [rad] of each family and joint, shape (8, 6).
        kept: Whether no pass changes the count: its angles leave a gap there, and nowhere jump
            towards it, shape (8, 6).
        low: Least angle that occurs, less what may occur between nodes, in [rad], shape (8, 6).
        high: Greatest angle that occurs, likewise.
    """

    start: Array
    kept: np.ndarray
    low: Array
    high: Array


def seams_of(q: Array) -> Seams:
    """Find the widest gaps in the angles of each inverse solution.

    Args:
        q: Principal angles in [rad], NaN where there are none, shape (N, M, 8, 6).
    """
    start, kept = np.full((8, 6), -np.pi), np.zeros((8, 6), dtype=bool)
    margin = SEAM_GAP / 2.0
    margins = np.zeros((8, 6))
    # one joint at a time: what is made of all at once is a copy of all
    for family, joint in np.ndindex(8, 6):
        found = q[:, :, family, joint]
        angles = np.sort(found, axis=None)
        angles = angles[~np.isnan(angles)]
        if not len(angles):
            continue
        gaps = np.diff(angles, append=angles[0] + 2.0 * np.pi)
        widest = int(np.argmax(gaps))
        jump = max(_largest_jump(np.diff(found, axis=axis)) for axis in (0, 1))
        kept[family, joint] = gaps[widest] > SEAM_GAP and jump < margin
        start[family, joint] = angles[widest] + gaps[widest] / 2.0
        if kept[family, joint]:
            margins[family, joint] = gaps[widest] / 2.0 - margin
    low, high = start + margins, start + 2.0 * np.pi - margins
    return Seams(start, kept, low, high)


def _largest_jump(change: Array) -> float:
    """Return the largest change of an angle between neighbouring nodes in [rad], any shape."""
    around = np.abs(change - 2.0 * np.pi * np.round(change / (2.0 * np.pi)))
    return float(np.nan_to_num(around).max(initial=0.0))


def wrist_flips(arm: Arm) -> list[tuple[Array, Array]]:
    """Return sign and shift that make each flip of the wrist of the posture without one."""
    same = (np.ones(6), np.zeros(6))
    if not isinstance(arm, SphericalWristArm):
        return [same]
    sign, shift = np.ones(6), np.zeros(6)
    sign[4] = -1.0
    shift[4] = 2.0 * arm.offsets[4] * arm.signs[4]
    shift[3] = shift[5] = np.pi
    return [same, (sign, shift)]


class Images:
    """The images of the postures of a robot that one motion can have.

    Args:
        robot: For the closed form and the limits.
        seams: Where full turns are counted from.
        largest: Boxes of this size or more in [rad] are of no interest.
    """

    def __init__(self, robot: Robot, seams: Seams, largest: float) -> None:
        self.seams = seams
        self._robot = robot
        self._largest = largest
        self._images: dict[int, list[Image]] = {}

    @cached_property
    def families(self) -> tuple[int, ...]:
        """The postures of which all others are images."""
        wrist = isinstance(self._robot.arm, SphericalWristArm)
        return tuple(range(4)) if wrist else tuple(range(8))

    @cached_property
    def flips(self) -> list[tuple[Array, Array]]:
        """Sign and shift that make a posture with the wrist flipped of one without."""
        return wrist_flips(self._robot.arm)

    @cached_property
    def limits(self) -> tuple[JointBox, ...]:
        """Limits of postures without a flip that the robot makes with each flip of the wrist."""
        lower, upper = self._robot.lower, self._robot.upper
        return tuple(
            JointBox(
                np.where(sign > 0.0, lower - shift, shift - upper),
                np.where(sign > 0.0, upper - shift, shift - lower),
            )
            for sign, shift in self.flips
        )

    def of(self, family: int) -> list[Image]:
        """Return the images of a posture, the posture itself first."""
        if family not in self._images:
            self._images[family] = self._images_of(family)
        return self._images[family]

    def _images_of(self, family: int) -> list[Image]:
        counts = [
            np.stack(np.meshgrid(*per_joint, indexing="ij"), axis=-1).reshape(-1, 6)
            for per_joint in self._relative_turns(family)
        ]
        kept = self.seams.kept[family]
        return [
            Image(sign, shift + 2.0 * np.pi * count, (flip, *np.where(kept, count, 0).tolist()))
            for flip, (sign, shift) in enumerate(self.flips)
            for count in counts[flip][np.argsort(np.abs(counts[flip]).sum(axis=1), kind="stable")]
        ]

    def _relative_turns(self, family: int) -> list[list[np.ndarray]]:
        """Return by how many full turns one posture of a motion can differ from another.

        For each flip that may lie between the two, and each joint; both keep the limits.
        """
        robot, seams = self._robot, self.seams
        where = []  # sign, shift without and with full turns of every place of each joint
        for sign, shift in self.flips:
            ends = sign * seams.low[family] + shift, sign * seams.high[family] + shift
            first = np.ceil((robot.lower - np.maximum(*ends)) / (2.0 * np.pi) - TOUCHING)
            last = np.floor((robot.upper - np.minimum(*ends)) / (2.0 * np.pi) + TOUCHING)
            where.append((sign, shift, first, last))
        relative: list[list[np.ndarray]] = []
        for flip, (_, between) in enumerate(self.flips):
            found: list[set[int]] = [{0} if flip == 0 else set() for _ in range(6)]
            for one, (sign, shift, first, last) in enumerate(where):
                _, other_shift, other_first, other_last = where[one ^ flip]
                for joint in range(6):
                    for k in range(int(first[joint]), int(last[joint]) + 1):
                        for n in range(int(other_first[joint]), int(other_last[joint]) + 1):
                            away = other_shift[joint] - shift[joint] + 2.0 * np.pi * (n - k)
                            turns = (sign[joint] * away - between[joint]) / (2.0 * np.pi)
                            found[joint].add(round(turns))
            sign, shift = self.flips[flip]
            low, high = seams.low[family], seams.high[family]
            for joint, counts in enumerate(found):
                images = sorted(sign[joint] * np.array([low[joint], high[joint]]) + shift[joint])
                for n in list(counts):
                    turned = images[0] + 2.0 * np.pi * n, images[1] + 2.0 * np.pi * n
                    if max(turned[0] - high[joint], low[joint] - turned[1]) >= self._largest:
                        counts.remove(n)
            relative.append([np.array(sorted(counts), dtype=int) for counts in found])
        return relative

    def within_limits(self, q: Array) -> np.ndarray:
        """Return which of some postures of a family have an image within the limits, shape (n,)."""
        return image_within_limits(self._robot, self.flips, q)


def image_within_limits(robot: Robot, flips: list[tuple[Array, Array]], q: Array) -> np.ndarray:
    """Return which postures in [rad] full turns or a flip can bring within the limits, shape (n,).

    The flips are as of `wrist_flips`.
    """
    allowed = np.empty(len(q), dtype=bool)
    sign, shift = (np.array(given) for given in zip(*flips, strict=True))
    # compiled for arrays that can be written to
    lower, upper, q = np.array(robot.lower), np.array(robot.upper), np.require(q, None, ["C", "W"])
    _keep_limits(q, sign, shift, lower, upper, allowed)
    return allowed


@kernel(
    "void(float64[:,::1],float64[:,::1],float64[:,::1],float64[::1],float64[::1],boolean[::1])",
    early=True,
)
def _keep_limits(q, sign, shift, lower, upper, allowed):  # type: ignore[no-untyped-def]
    """Set which postures, shape (n, 6), any of k flips and full turns bring within limits, (n,)."""
    for k in range(len(q)):
        allowed[k] = False
        for flip in range(len(sign)):
            kept = True
            for joint in range(q.shape[1]):
                moved = q[k, joint] * sign[flip, joint] + shift[flip, joint]
                turns = np.ceil((lower[joint] - moved) / FULL_TURN)
                kept = kept and moved + FULL_TURN * turns <= upper[joint]
            allowed[k] = allowed[k] or kept
