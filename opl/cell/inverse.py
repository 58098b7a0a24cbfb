"""Inverse kinematics in closed form for six-axis arms with a spherical wrist.

The arm, in the angles theta1 to theta6 of its drawing (offsets and signs of the maker come last).
With all of them zero it stands straight up: links along z, every joint axis along y or z.

    flange        |  c4 above the wrist centre
    wrist centre  o  axes 4 (z), 5 (y) and 6 (z) meet; c3 above axis 3 and a2 ahead of it
    axis 3 (y)    o  c2 above axis 2
    axis 2 (y)    o  c1 above the base frame and a1 ahead of axis 1
    axis 1 (z)    |  b is how far the wrist centre lies to the left of the plane of axis 1

So, with p the wrist centre,

    R_base_flange = Rz(theta1) Ry(theta2 + theta3) Rz(theta4) Ry(theta5) Rz(theta6),
    p = p_base_flange - c4 z_flange.

The position of p fixes theta1 to theta3 in a triangle; the orientation left over fixes theta4 to
theta6. Two answers each at shoulder, elbow and wrist make eight postures, in slots
``4 * flip + 2 * back + elbow`` that keep their meaning along a path. The parameters are those of
Brandstoetter, Angerer and Hofbaur (2014); the derivation beside the code is our own.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from opl.geometry.frames import Array

N_BRANCHES = 8

# A cosine this far beyond 1 is taken for round-off of an arm in line. A stretched arm then misses
# the pose by less than 1e-9 of its length, a folded MH24 by 10 nm.
_STRETCH_TOLERANCE = 1e-9
# Below this sine of theta5, axes 4 and 6 are one axis. Taking the wrist for straight there turns
# the flange by no more than this in [rad]; just above it theta4 still stands out of round-off.
_WRIST_TOLERANCE = 1e-12


@dataclass(frozen=True)
class SphericalWristArm:
    """The geometry of a six-axis arm whose last three axes meet in the wrist centre.

    Attributes:
        a1: From axis 1 to axis 2, ahead, in [m].
        a2: From axis 3 to the forearm axis, ahead, in [m]; negative where the forearm, once
            level, lies above axis 3.
        b: From the plane of axis 1 to the wrist centre, to the left, in [m].
        c1: From the base frame up to axis 2 in [m].
        c2: From axis 2 to axis 3 in [m].
        c3: From axis 3 to the wrist centre, along the forearm axis, in [m].
        c4: From the wrist centre to the flange face in [m].
        offsets: Zero of each joint in [rad], six.
        signs: 1, or -1 where a joint counts against the drawing: q = (theta + offset) * sign, six.
    """

    a1: float
    a2: float
    b: float
    c1: float
    c2: float
    c3: float
    c4: float
    offsets: tuple[float, ...]
    signs: tuple[int, ...]


def inverse(
    arm: SphericalWristArm, Ts_base_flange: Array, q4_at_singularity: Array | float = 0.0
) -> Array:
    """Return all postures that bring the flange to poses, limits not regarded.

    Args:
        arm: The geometry.
        Ts_base_flange: Shape (..., 4, 4).
        q4_at_singularity: Position of joint 4 in [rad] where the pose leaves it free because axes 4
            and 6 are one axis; joint 6 follows from it. One value, or one a pose, shape (...).

    Returns:
        Joint positions in (-pi, pi] [rad], shape (..., 8, 6). Slots without a posture are NaN in
        all six joints. Where two slots fall together (stretched arm, straight wrist, wrist centre
        on axis 1) both are given.
    """
    shape = np.shape(Ts_base_flange)[:-2]
    # axes and origin of n poses, coordinates first and contiguous: numpy is fastest along n
    columns = np.reshape(Ts_base_flange, (-1, 4, 4))[:, :3].transpose(2, 1, 0)
    x, y, z, p = np.ascontiguousarray(columns, dtype=float)
    q4 = np.broadcast_to(q4_at_singularity, shape).reshape(-1)
    theta1, theta2, theta3 = _position(arm, p - arm.c4 * z)
    theta4, theta5, theta6, half_turn = _orientation(
        theta1, theta2 + theta3, x, y, z, q4 * arm.signs[3] - arm.offsets[3]
    )
    theta1 = np.where(np.isnan(theta2), np.nan, theta1)
    q = np.empty((q4.size, 2, 2, 2, 6))  # pose, flip, back, elbow, joint
    for flip, wrist in enumerate(
        [(theta4, theta5, theta6), (theta4 + half_turn, -theta5, theta6 + half_turn)]
    ):
        for joint, theta in enumerate((theta1, theta2, theta3, *wrist)):
            turned = _principal((theta + arm.offsets[joint]) * arm.signs[joint])
            q[:, flip, :, :, joint] = np.moveaxis(turned, -1, 0)
    return q.reshape(*shape, N_BRANCHES, 6)


def turns(lower: Array, upper: Array) -> Array:
    """Return the full turns after which a principal angle can lie within the limits.

    A joint whose range only touches the end of a further turn (S at exactly +-180 degrees) does not
    get that turn.

    Args:
        lower: Smallest joint positions in [rad], shape (6,).
        upper: Largest joint positions in [rad], shape (6,).

    Returns:
        Multiples of 2 pi to add to q, in [rad], shape (k, 6): fewest turns first, so zero leads,
        where it is among them; among equals in ascending order.
    """
    touching = 1e-9  # [turns]
    first = np.floor(lower / (2.0 * np.pi) + 0.5 + touching).astype(int)
    last = np.ceil(upper / (2.0 * np.pi) - 0.5 - touching).astype(int)
    ranges = [range(low, high + 1) for low, high in zip(first, last, strict=True)]
    numbers = sorted(product(*ranges), key=lambda number: (sum(map(abs, number)), number))
    return 2.0 * np.pi * np.array(numbers, dtype=float)


def branch_name(slot: int) -> str:
    """Return what a slot means, in words.

    Front: the wrist centre lies ahead of axis 1, in the plane of the arm. Elbow up: axis 3 lies
    above the line from axis 2 to the wrist centre (behind that line, where the wrist is between
    axes 1 and 2). No flip: theta5 is not negative; B of a Motoman arm counts the other way and is
    not positive, so that the hand bows down where R is zero.
    """
    flip, back, elbow = slot // 4, slot // 2 % 2, slot % 2
    return ", ".join(
        [
            "back" if back else "front",
            # the same bend of axis 3 points the other way once the arm reaches over backwards
            "elbow down" if elbow != back else "elbow up",
            "flip" if flip else "no flip",
        ]
    )


def _position(arm: SphericalWristArm, p: Array) -> tuple[Array, Array, Array]:
    """Return theta1, theta2 and theta3 that put the wrist centre at p.

    Seen from above, in the frame turned by theta1, p lies ``ahead`` of axis 1 and b to the left.
    Seen from the side, axis 2, axis 3 and p form a triangle: its sides are c2, the forearm
    hypot(a2, c3), and the distance of p from axis 2.

    Args:
        arm: The geometry.
        p: Wrist centres in the base frame in [m], shape (3, n).

    Returns:
        theta1, shape (2 back, 1, n); theta2 and theta3, shape (2 back, 2 elbow, n), NaN out of
        reach. All in [rad].
    """
    ahead = np.sqrt(_from_zero(p[0] ** 2 + p[1] ** 2 - arm.b**2, arm.b**2))
    ahead = np.stack([ahead, -ahead])[:, None]  # front, back
    theta1 = np.arctan2(p[1], p[0]) - np.arctan2(arm.b, ahead)

    forearm, forearm_tilt = np.hypot(arm.a2, arm.c3), np.arctan2(arm.a2, arm.c3)
    forward, up = ahead - arm.a1, p[2] - arm.c1  # from axis 2
    # law of cosines; the bend is the angle between upper arm and forearm, 0 when in line
    cos_bend = (forward**2 + up**2 - arm.c2**2 - forearm**2) / (2.0 * arm.c2 * forearm)
    sin_bend = np.sqrt(_from_zero(1.0 - cos_bend**2, 2.0))
    sin_bend = np.concatenate([sin_bend, -sin_bend], axis=1)  # the two elbows
    bend = np.arctan2(sin_bend, cos_bend)
    # seen from axis 2, p stands off the upper arm by the angle that the bent forearm subtends
    theta2 = np.arctan2(forward, up) - np.arctan2(forearm * sin_bend, arm.c2 + forearm * cos_bend)
    return theta1, theta2, bend - forearm_tilt


def _orientation(
    theta1: Array, tilt: Array, x: Array, y: Array, z: Array, theta4_free: Array
) -> tuple[Array, Array, Array, Array]:
    """Return theta4, theta5 and theta6 that give the flange its axes x, y, z.

    Along e1, e2, e3, the columns of Rz(theta1) Ry(tilt), the flange axis z has the coordinates
    (cos theta4 sin theta5, sin theta4 sin theta5, cos theta5). Axis 5 points along
    -sin theta4 e1 + cos theta4 e2, and its coordinates along x and y are sin theta6 and cos theta6.
    Theta6 is measured against that axis 5, not found from z: near the straight wrist theta4 is
    hardly known, and their sum comes out right only if both rest on the same theta4.

    Turning axis 4 by half a turn and bending the wrist the other way gives the same axes. A
    straight wrist has no other way; both slots then keep theta4_free.

    Args:
        theta1: Angle of axis 1 in [rad], shape (2 back, 1, n).
        tilt: theta2 + theta3 in [rad], shape (2 back, 2 elbow, n).
        x: Axes in the base frame, shape (3, n).
        y: As x.
        z: As x.
        theta4_free: theta4 of the straight wrist in [rad], shape (n,).

    Returns:
        theta4, theta5 >= 0, theta6, and what to add to theta4 and theta6 where theta5 turns
        negative: pi, or 0 for a straight wrist. All in [rad], shape (2 back, 2 elbow, n).
    """
    cos1, sin1, cos_tilt, sin_tilt = np.cos(theta1), np.sin(theta1), np.cos(tilt), np.sin(tilt)

    def in_plane(v: Array) -> Array:
        return cos1 * v[0] + sin1 * v[1]  # along the heading of the arm

    def along_e1(v: Array) -> Array:
        return cos_tilt * in_plane(v) - sin_tilt * v[2]

    def along_e2(v: Array) -> Array:
        return cos1 * v[1] - sin1 * v[0]

    def along_e3(v: Array) -> Array:
        return sin_tilt * in_plane(v) + cos_tilt * v[2]

    z1, z2 = along_e1(z), along_e2(z)
    sin5 = np.sqrt(z1**2 + z2**2)
    straight = sin5 < _WRIST_TOLERANCE
    sin5 = np.where(straight, 0.0, sin5)
    length = np.where(straight, 1.0, sin5)
    cos4 = np.where(straight, np.cos(theta4_free), z1 / length)
    sin4 = np.where(straight, np.sin(theta4_free), z2 / length)
    sin6 = cos4 * along_e2(x) - sin4 * along_e1(x)
    cos6 = cos4 * along_e2(y) - sin4 * along_e1(y)
    return (
        np.arctan2(sin4, cos4),
        np.arctan2(sin5, along_e3(z)),
        np.arctan2(sin6, cos6),
        np.where(straight, 0.0, np.pi),
    )


def _principal(angle: Array) -> Array:
    """Return angles turned into (-pi, pi]."""
    angle = angle - 2.0 * np.pi * np.ceil(angle / (2.0 * np.pi) - 0.5)
    # round-off must not carry a joint past pi, which may be its limit
    return np.minimum(angle, np.pi)


def _from_zero(value: Array, scale: float) -> Array:
    """Return values with those below 0 by round-off as 0, and the others below 0 as NaN."""
    return np.where(value < -_STRETCH_TOLERANCE * scale, np.nan, np.maximum(value, 0.0))
