"""The inverse solutions and their derivatives along a motion of the flange, enclosed.

The closed forms of `spherical_wrist` and `parallel_axes` are square roots and quotients up to the
last step, the arc tangent. So their derivatives can be enclosed over a whole piece of a motion,
without a sample and without an estimate. Where a piece touches a singularity or the end of the
reach, nothing is known there of the derivatives that it concerns, only where the joints are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from opl.cell.inverse_kinematics import Arm
from opl.cell.parallel_axes import ParallelAxesArm
from opl.cell.spherical_wrist import SphericalWristArm
from opl.geometry.frames import Array
from opl.geometry.jets import Jet, Turning, turning

SURELY = 1e-6  # of cosines and square metres: more than what the closed form takes for round-off
Axes = tuple[Jet, Jet, Jet]  # coordinates of a vector in the base frame
Solutions = tuple[tuple[Turning, ...], np.ndarray]  # theta1 to theta6; where there is none of them


@dataclass(frozen=True)
class FlangeJets:
    """A motion of the flange over n cells of its variable.

    Attributes:
        x: Axis of the flange in the base frame.
        y: As x.
        z: As x.
        p: Its origin in [m].
    """

    x: Axes
    y: Axes
    z: Axes
    p: Axes


@dataclass(frozen=True)
class JointDerivatives:
    """Enclosures of s inverse solutions over n cells, not finite where nothing is known.

    Attributes:
        middle: Middle of what holds the angle in [rad], up to full turns, shape (s, 6, n).
        radius: Half of what holds it, shape (s, 6, n).
        first: Largest size of the first derivative in [rad] per unit, shape (s, 6, n).
        second_low: Least second derivative, shape (s, 6, n).
        second_high: Greatest second derivative, shape (s, 6, n).
        none: Where there is certainly no posture in the whole cell, shape (s, n).
    """

    middle: Array
    radius: Array
    first: Array
    second_low: Array
    second_high: Array
    none: np.ndarray


def joint_derivatives(arm: Arm, flange: FlangeJets, slots: Sequence[int]) -> JointDerivatives:
    """Enclose the derivatives of inverse solutions, those of slots as in `inverse_kinematics`."""
    number = np.array(slots)[:, None]
    back, elbow, flip = (np.where(number & bit, -1.0, 1.0) for bit in (2, 1, 4))
    if isinstance(arm, SphericalWristArm):
        joints, none = _spherical_wrist(arm, flange, back, elbow, flip)
    else:
        joints, none = _parallel_axes(arm, flange, back, elbow, flip)
    shape = len(slots), 6, *np.shape(flange.p[0].value.middle)
    middle, radius, first, low, high = (np.empty(shape) for _ in range(5))
    for joint, (theta, offset, sign) in enumerate(zip(joints, arm.offsets, arm.signs, strict=True)):
        turned = theta.plus(offset).scaled(sign)
        middle[:, joint], radius[:, joint] = turned.value.middle, turned.value.radius
        first[:, joint] = np.abs(turned.first.middle) + turned.first.radius
        low[:, joint], high[:, joint] = turned.second.low, turned.second.high
    return JointDerivatives(middle, radius, first, low, high, none)


# back, elbow and flip of each slot: 1, or -1 where they turn the other way, shape (s, 1)


def _spherical_wrist(
    arm: SphericalWristArm, flange: FlangeJets, back: Array, elbow: Array, flip: Array
) -> Solutions:
    forearm, tilt_zero = float(np.hypot(arm.a2, arm.c3)), float(np.arctan2(arm.a2, arm.c3))
    wrist = _moved(flange.p, flange.z, -arm.c4)
    up = wrist[2].plus(-arm.c1)
    cos1, sin1, ahead, theta1, beside = _heading(wrist, arm.b, back)
    forward = ahead.plus(-arm.a1)
    z_ahead, z_left = _turned(flange.z, cos1, sin1)
    x_ahead, _ = _turned(flange.x, cos1, sin1)
    y_ahead, _ = _turned(flange.y, cos1, sin1)
    theta2, bend, (cos_link, sin_link), beyond = _triangle(forward, up, arm.c2, forearm, elbow)
    theta3 = bend.plus(-tilt_zero)
    # the forearm axis stands off the line to the wrist by the angle of its offset
    c, s = float(np.cos(tilt_zero)), float(np.sin(tilt_zero))
    cos_tilt = cos_link.scaled(c) + sin_link.scaled(s)
    sin_tilt = sin_link.scaled(c) - cos_link.scaled(s)
    z1 = cos_tilt * z_ahead - sin_tilt * flange.z[2]
    z3 = sin_tilt * z_ahead + cos_tilt * flange.z[2]
    x3 = sin_tilt * x_ahead + cos_tilt * flange.x[2]
    y3 = sin_tilt * y_ahead + cos_tilt * flange.y[2]
    turned = np.where(flip < 0.0, np.pi, 0.0)
    theta4 = turning(z_left, z1).plus(turned)
    theta5 = turning((z1 * z1 + z_left * z_left).root(), z3).scaled(flip)
    theta6 = turning(y3, -x3).plus(turned)
    return (theta1, theta2, theta3, theta4, theta5, theta6), beside | beyond


def _parallel_axes(
    arm: ParallelAxesArm, flange: FlangeJets, back: Array, elbow: Array, flip: Array
) -> Solutions:
    w = _moved(flange.p, flange.z, -arm.c5)
    cos1, sin1, ahead, theta1, beside = _heading(w, arm.b, back)
    z_ahead, z_left = _turned(flange.z, cos1, sin1)
    x_ahead, _ = _turned(flange.x, cos1, sin1)
    y_ahead, _ = _turned(flange.y, cos1, sin1)
    sin5 = (z_ahead * z_ahead + flange.z[2] * flange.z[2]).root()
    theta5 = turning(sin5, z_left).scaled(flip)
    cos_tilt = (z_ahead / sin5).scaled(-flip)
    sin_tilt = (flange.z[2] / sin5).scaled(flip)
    theta6 = turning(
        -(sin_tilt * x_ahead + cos_tilt * flange.x[2]),
        -(sin_tilt * y_ahead + cos_tilt * flange.y[2]),
    )
    forward = ahead.plus(-arm.a1) - sin_tilt.scaled(arm.c4)
    up = w[2].plus(-arm.c1) - cos_tilt.scaled(arm.c4)
    theta2, theta3, _, beyond = _triangle(forward, up, arm.c2, arm.c3, elbow)
    theta4 = turning(sin_tilt, cos_tilt) - theta2 - theta3
    return (theta1, theta2, theta3, theta4, theta5, theta6), beside | beyond


def _moved(p: Axes, along: Axes, length: float) -> Axes:
    a, b, c = (origin + axis.scaled(length) for origin, axis in zip(p, along, strict=True))
    return a, b, c


def _turned(v: Axes, cos1: Jet, sin1: Jet) -> tuple[Jet, Jet]:
    """Return how far a vector points ahead and to the left of the plane of the arm."""
    return cos1 * v[0] + sin1 * v[1], cos1 * v[1] - sin1 * v[0]


def _heading(p: Axes, lateral: float, back: Array) -> tuple[Jet, Jet, Jet, Turning, np.ndarray]:
    """Return cosine and sine of theta1, how far ahead of axis 1 the point lies, and theta1.

    And where it is nearer to axis 1 than the plane of the arm passes by.
    """
    away = p[0] * p[0] + p[1] * p[1]
    ahead = away.plus(-lateral * lateral).root().scaled(back)
    cos1 = (p[0] * ahead + p[1].scaled(lateral)) / away
    sin1 = (p[1] * ahead - p[0].scaled(lateral)) / away
    beside = away.value.high < lateral * lateral - SURELY
    return cos1, sin1, ahead, turning(sin1, cos1), np.asarray(beside)


def _triangle(
    forward: Jet, up: Jet, upper_arm: float, forearm: float, elbow: Array
) -> tuple[Turning, Turning, tuple[Jet, Jet], np.ndarray]:
    """Return theta2, the bend at axis 3, cosine and sine of the tilt of the forearm.

    And where the far end is out of reach.
    """
    away = forward * forward + up * up
    double = 2.0 * upper_arm * forearm
    cos_bend = away.plus(-(upper_arm**2) - forearm**2).scaled(1.0 / double)
    beyond = (cos_bend.value.low > 1.0 + SURELY) | (cos_bend.value.high < -1.0 - SURELY)
    sin_bend = (-(cos_bend * cos_bend)).plus(1.0).root().scaled(elbow)
    bend = turning(sin_bend, cos_bend)
    # seen from axis 2: along the upper arm, and across it
    along, across = cos_bend.scaled(forearm).plus(upper_arm), sin_bend.scaled(forearm)
    cos2 = (up * along + forward * across) / away
    sin2 = (forward * along - up * across) / away
    cos_link, sin_link = cos2 * cos_bend - sin2 * sin_bend, sin2 * cos_bend + cos2 * sin_bend
    return turning(sin2, cos2), bend, (cos_link, sin_link), np.asarray(beyond)
