"""The joints of a URDF one after the other, placed as pinocchio places them, to the last digit.

Pinocchio takes longer to load than most commands take that move no solid.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np

from opl.cell.chain import ANY_AXIS, Chain, product
from opl.cell.urdf_tree import UrdfTree
from opl.geometry.frames import Array

_REVOLUTE, _FIXED = "revolute", "fixed"
_SAME_AXIS = 1e-12  # within which pinocchio takes an axis for x, y or z


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint: what it joins, where it lies on its parent and along which axis it moves.

    Attributes:
        name: Its name.
        kind: The type of the URDF, as ``revolute`` or ``fixed``.
        parent: Link that it is on.
        child: Link that it carries.
        xyz: Its origin on the parent in [m], shape (3,).
        rpy: Roll, pitch and yaw there in [rad], shape (3,).
        axis: In its own frame, of any length, shape (3,).
    """

    name: str
    kind: str
    parent: str
    child: str
    xyz: Array
    rpy: Array
    axis: Array


@dataclass(frozen=True)
class UrdfChain:
    """Joints that move, and the links they carry.

    Attributes:
        joints: All joints that move, as they are met from the root on.
        links: The root link and what each of these joints moves.
        all_links: These and those that are fixed to them.
        chain: From `base` to `flange`; None if these are not there, or the joints in between are
            not all that move, all revolute, each on what the one before moves.
    """

    joints: tuple[UrdfJoint, ...]
    links: tuple[str, ...]
    all_links: frozenset[str]
    chain: Chain | None


def read_chain(tree: UrdfTree, base: str, flange: str) -> UrdfChain:
    """Return what leads from one link of a URDF to another."""
    hanging: dict[str, list[UrdfJoint]] = {}
    for joint in map(_joint, tree.joints()):
        hanging.setdefault(joint.parent, []).append(joint)
    moving: list[UrdfJoint] = []
    placed: list[Array] = []  # in the frame of the joint before
    at = {tree.root_link: (0, np.eye(4))}  # each link by the joints before it, on the last of them
    in_a_row = True
    waiting = [tree.root_link]
    while waiting:
        link = waiting.pop()
        number, T_joint_link = at[link]
        for joint in hanging.get(link, ()):
            T = np.zeros((4, 4))
            product.plain(T_joint_link, _placement(joint), T)
            T[3, 3] = 1.0
            if joint.kind == _FIXED:
                at[joint.child] = number, T
            else:
                in_a_row = in_a_row and joint.kind == _REVOLUTE and number == len(moving)
                moving.append(joint)
                placed.append(T)
                at[joint.child] = len(moving), np.eye(4)
            waiting.append(joint.child)
    chain = None
    nowhere = -1, np.eye(4)
    ends = at.get(base, nowhere), at.get(flange, nowhere)
    if in_a_row and moving and [number for number, _ in ends] == [0, len(moving)]:
        axes = [_axis(joint) for joint in moving]
        numbers = np.array([number for number, _ in axes])
        directions = np.array([direction for _, direction in axes])
        chain = Chain(np.array(placed), numbers, directions, ends[0][1], ends[1][1])
    links = (tree.root_link, *(joint.child for joint in moving))
    return UrdfChain(tuple(moving), links, frozenset(at), chain)


def _joint(element: ET.Element) -> UrdfJoint:
    def text(child: str, key: str, default: str) -> str:
        found = element.find(child)
        return default if found is None else found.get(key, default)

    def numbers(child: str, key: str, default: str) -> Array:
        return np.array(text(child, key, default).split(), dtype=float)

    return UrdfJoint(
        name=element.get("name", ""),
        kind=element.get("type", ""),
        parent=text("parent", "link", ""),
        child=text("child", "link", ""),
        xyz=numbers("origin", "xyz", "0 0 0"),
        rpy=numbers("origin", "rpy", "0 0 0"),
        axis=numbers("axis", "xyz", "1 0 0"),
    )


def _axis(joint: UrdfJoint) -> tuple[int, Array]:
    """Return the number of the axis of a joint, and its direction, shape (3,)."""
    direction = joint.axis / math.sqrt(sum(float(part) ** 2 for part in joint.axis))
    for number, unit in enumerate(np.eye(3)):
        if np.linalg.norm(joint.axis - unit) <= _SAME_AXIS:
            return number, unit
    return ANY_AXIS, direction


def _placement(joint: UrdfJoint) -> Array:
    """Return where a joint is on the link before it, shape (4, 4), by a quaternion as urdfdom."""
    (cr, cp, cy), (sr, sp, sy) = (
        [turn(float(angle) / 2.0) for angle in joint.rpy] for turn in (math.cos, math.sin)
    )
    x = sr * cp * cy - cr * sp * sy
    y = cr * sp * cy + sr * cp * sy
    z = cr * cp * sy - sr * sp * cy
    w = cr * cp * cy + sr * sp * sy
    length = math.sqrt(x * x + y * y + z * z + w * w)
    x, y, z, w = x / length, y / length, z / length, w / length
    tx, ty, tz = 2.0 * x, 2.0 * y, 2.0 * z
    T = np.eye(4)
    T[:3, :3] = (
        (1.0 - (ty * y + tz * z), ty * x - tz * w, tz * x + ty * w),
        (ty * x + tz * w, 1.0 - (tx * x + tz * z), tz * y - tx * w),
        (tz * x - ty * w, tz * y + tx * w, 1.0 - (tx * x + ty * y)),
    )
    T[:3, 3] = joint.xyz
    return T
