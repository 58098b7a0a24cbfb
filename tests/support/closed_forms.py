"""Inverse kinematics from elsewhere, and joint positions compared apart from full turns."""

import numpy as np
import py_opw_kinematics
from scipy.spatial.transform import Rotation


def difference(q, q_other):
    """Return the largest difference of a joint apart from full turns, inf where q is NaN."""
    distance = np.abs(np.remainder(q - q_other + np.pi, 2 * np.pi) - np.pi).max(axis=-1)
    return np.where(np.isnan(distance), np.inf, distance)


def opw_solutions(arm, Ts):
    """Return py-opw-kinematics' solutions for each pose, in [rad]."""
    model = py_opw_kinematics.KinematicModel(
        **{name: getattr(arm, name) for name in ("a1", "a2", "b", "c1", "c2", "c3", "c4")},
        offsets=arm.offsets,
        flip_axes=tuple(sign < 0 for sign in arm.signs),
    )
    # its releases for Python 3.10 take Euler angles where later ones take a rigid transform
    if hasattr(py_opw_kinematics, "EulerConvention"):
        convention = py_opw_kinematics.EulerConvention("XYZ", extrinsic=True, degrees=False)
        robot = py_opw_kinematics.Robot(model, convention)
        eulers = Rotation.from_matrix(Ts[:, :3, :3]).as_euler("xyz")
        poses = [(T[:3, 3].tolist(), euler.tolist()) for T, euler in zip(Ts, eulers, strict=True)]
    else:
        from scipy.spatial.transform import RigidTransform

        robot = py_opw_kinematics.Robot(model, degrees=False)
        poses = [RigidTransform.from_matrix(T) for T in Ts]
    return [np.array(robot.inverse(each)).reshape(-1, 6) for each in poses]
