"""The robot in PyBullet: where its flange and the held part are, read from the URDF anew."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.geometry.rotations import quaternion
from opl.verification.engine import SCALE, pybullet, start

BASE_LINK = -1  # Bullet's number of the link that does not move
At = tuple[Sequence[float], Sequence[float]]  # a pose as Bullet has it: position, x y z w


class Arm:
    """A physics server with the robot in it; use as a context manager."""

    def __init__(self, cell: WorkCell) -> None:
        self._client = start()
        # the client looks names up each time
        self._turn_joints = self._client.resetJointStatesMultiDof
        self._link_state = self._client.getLinkState
        self._joined = self._client.multiplyTransforms
        # else a file is taken for an earlier one of its name
        self._client.setPhysicsEngineParameter(enableFileCaching=0)
        self._robot = self._client.loadURDF(
            str(cell.robot.urdf),
            basePosition=[0.0, 0.0, -SCALE * cell.robot.base_height],
            globalScaling=SCALE,
            useFixedBase=True,
            # else Bullet inscribes prisms of 32 sides in cylinders
            flags=pybullet.URDF_USE_IMPLICIT_CYLINDER,
        )
        self._joints: list[int] = []
        self._flange = BASE_LINK
        for index in range(self._client.getNumJoints(self._robot)):
            info = self._client.getJointInfo(self._robot, index)
            if info[2] == pybullet.JOINT_REVOLUTE:
                self._joints.append(index)
            if info[12].decode() == "tool0":
                self._flange = index
        self._part_at_flange = as_placed(cell.T_flange_workpiece)

    def __enter__(self) -> Arm:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.disconnect()

    def parts_at(self, q: Array) -> Array:
        """Return T_base_workpiece as PyBullet sees it at configurations (n, 6), (n, 4, 4)."""
        found = np.empty((len(q), 4, 4))
        for k, flange in enumerate(map(self._turned, q)):
            found[k] = as_pose(*self._joined(*flange, *self._part_at_flange))
        return found

    def _turned(self, q: Array) -> At:
        """Turn the joints; return where the flange is."""
        self._turn_joints(self._robot, self._joints, q[:, None].tolist())
        state = self._link_state(self._robot, self._flange, computeForwardKinematics=True)
        return state[4], state[5]


def as_placed(T: Array) -> At:
    """Return a pose as Bullet takes it."""
    return (SCALE * T[:3, 3]).tolist(), quaternion(T[:3, :3]).tolist()


def as_pose(position: Sequence[float], xyzw: Sequence[float]) -> Array:
    """Return a pose as Bullet gives it, shape (4, 4)."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = pybullet.getMatrixFromQuaternion(xyzw)
    x, y, z = (along / SCALE for along in position)
    rows = (xx, xy, xz, x), (yx, yy, yz, y), (zx, zy, zz, z), (0.0, 0.0, 0.0, 1.0)
    return np.array(rows)
