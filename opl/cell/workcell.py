"""The cell as a value: robot, wheel, held part, what stands around, and how far apart all stay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from opl.cell.robot import Robot
from opl.geometry.frames import Array, inverse, pose, read_only
from opl.geometry.mesh import TriangleMesh
from opl.geometry.shapes import Body, Cylinder
from opl.geometry.wheel import ContactWheel

WHEEL = "wheel"
PART = "part"
# [m] how much nearer the second opinion may see two bodies than they are: PyBullet was seen to
# differ by 0.05 mm; it blows links of meshes up by 0.1 mm, and is held to rounding the edges of any
# link by as much
SECOND_OPINION = 1e-4
SECOND_OPINION_OF_A_LINK = 2e-4
# [rad] configurations are rounded to what a program can express before they are proven; pulses and
# digits are finer than this, for each joint in the sum
ROUNDING = np.deg2rad(0.01)

PairOfNames = frozenset[str]


@dataclass(frozen=True)
class PairRules:
    """Rules for single pairs, by the names of links and bodies.

    Attributes:
        allowed: Pairs that may touch; they are not looked at.
        required: Distance in [m] that a pair must keep, instead of that of the cell.
    """

    allowed: frozenset[PairOfNames] = frozenset()
    required: Mapping[PairOfNames, float] = field(default_factory=dict)

    def between(self, first: str, second: str, otherwise: float) -> float | None:
        """Return how far two named bodies must stay apart in [m], None if they may touch.

        Without a rule for this pair it is the distance ``otherwise`` in [m].
        """
        pair = frozenset((first, second))
        return None if pair in self.allowed else self.required.get(pair, otherwise)

    def widened(self, by: float) -> PairRules:
        """Return rules that require so much more distance in [m]."""
        return replace(self, required={pair: far + by for pair, far in self.required.items()})


@dataclass(frozen=True, eq=False)
class JointLimit:
    """A range that a joint, or a weighted sum of joints, must stay in, beside the robot's own.

    The robot keeps its own ranges, because its controller distinguishes full turns by them. The
    hose along the forearm, though, does not care which of two axes winds it up: R + T together may
    turn only so far. Such a limit is linear in the joints, so where both ends of a linear joint
    move keep it, the whole move does. The planner uses these; the replay computes its own sums.

    Attributes:
        name: What messages call it, such as ``R`` or ``R+T``.
        coefficients: Weight of each joint, shape (6,).
        lower: Smallest sum in [rad].
        upper: Largest sum in [rad].
    """

    name: str
    coefficients: Array
    lower: float
    upper: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", read_only(self.coefficients))

    def holds(self, q: Array) -> np.ndarray:
        """Return which ``q``, shape (..., 6) in [rad], keep it; none with NaN; shape (...)."""
        total = q @ self.coefficients
        margin = ROUNDING * np.abs(self.coefficients).sum()
        return np.asarray((total >= self.lower + margin) & (total <= self.upper - margin))


@dataclass(frozen=True)
class WorkCell:
    """One robot with a part in its gripper in front of one belt wheel.

    Attributes:
        robot: The arm; its base frame is the frame of the cell.
        wheel: The belt wheel.
        obstacles: Bodies fixed in the cell, given in the base frame.
        part: The held part, in the workpiece frame.
        fixture: Bodies between flange and part, given in the flange frame.
        T_flange_workpiece: How the fixture holds the part, shape (4, 4).
        max_belt_penetration: How deep the part may sink into the belt in [m].
        required_clearance: Distance to keep from everything else in [m].
        pairs: The pairs that keep another distance, or none.
        limits: Limits of joints and sums of joints beside the robot's own.
    """

    robot: Robot
    wheel: ContactWheel
    obstacles: tuple[Body, ...]
    part: TriangleMesh
    fixture: tuple[Body, ...]
    T_flange_workpiece: Array
    max_belt_penetration: float
    required_clearance: float
    pairs: PairRules = field(default_factory=PairRules)
    limits: tuple[JointLimit, ...] = ()

    @property
    def planned_penetration(self) -> float:
        """How deep the planner lets the part sink into the belt in [m].

        Less than the largest one, so that the second opinion, whose distances differ by up to
        `SECOND_OPINION`, agrees.
        """
        return max(self.max_belt_penetration - SECOND_OPINION, self.max_belt_penetration / 2.0)

    @property
    def part_from_wheel(self) -> float:
        """Distance that the part keeps from the wheel on free moves in [m]."""
        needed = self.pairs.between(PART, WHEEL, self.required_clearance)
        assert needed is not None, "part and wheel may touch"
        return needed

    def widened(self, by: float) -> WorkCell:
        """Return a cell in which everything must stay so much farther apart, in [m]."""
        clearance = self.required_clearance + by
        return replace(self, required_clearance=clearance, pairs=self.pairs.widened(by))

    def within_limits(self, q: Array) -> np.ndarray:
        """Return which configurations, shape (..., 6) in [rad], keep every limit, shape (...)."""
        lower, upper = self.robot.lower, self.robot.upper
        kept = np.ones(q.shape[:-1], dtype=bool)
        for joint in range(q.shape[-1]):  # one by one: to ask for all of a few takes numpy longer
            kept &= (q[..., joint] >= lower[joint]) & (q[..., joint] <= upper[joint])
        for limit in self.limits:
            kept &= limit.holds(q)
        return np.asarray(kept)

    def broken_limits(self, q: Array) -> list[str]:
        """Return the names of the limits that any of the configurations, shape (..., 6), breaks."""
        q = q.reshape(-1, 6)
        beyond = ((q < self.robot.lower) | (q > self.robot.upper)).any(axis=0)
        names = [self.robot.joint_names[joint] for joint in np.flatnonzero(beyond)]
        names += [limit.name for limit in self.limits if not limit.holds(q).all()]
        return list(dict.fromkeys(names))

    def Ts_base_flange(self, t: Array | float, Ts_workpiece_cutter: Array) -> Array:
        """Return the flange poses that bring cutter points onto contact positions, shape (...).

        Cutter and contact coincide, so the neighbouring names cancel (equations 2 and 3 of the
        paper, in column-vector order).
        """
        Ts_base_contact = self.wheel.T_base_contact(t)
        return Ts_base_contact @ inverse(Ts_workpiece_cutter) @ inverse(self.T_flange_workpiece)

    def Ts_contact0_workpiece(self, Ts_base_flange: Array) -> Array:
        """Return where the part is, seen from contact frame 0 of the wheel, shape (..., 4, 4)."""
        return inverse(self.wheel.T_base_contact0) @ Ts_base_flange @ self.T_flange_workpiece

    def wheel_body(self) -> Body:
        """Return the wheel as a solid in the base frame: its axis is x of contact frame 0."""
        return wheel_solid(self.wheel, WHEEL)


def wheel_solid(wheel: ContactWheel, name: str) -> Body:
    """Return a wheel as a named cylinder in the base frame."""
    axis_z_is_contact0_x = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    T_contact0_axle = pose(axis_z_is_contact0_x, np.array([0.0, 0.0, wheel.radius]))
    return Body(name, Cylinder(wheel.radius, wheel.width), wheel.T_base_contact0 @ T_contact0_axle)
