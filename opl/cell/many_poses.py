"""Inverse solutions of many poses: by compiled code, on all cores, or by numpy.

What solves one pose, in scalars, solves many in arrays: compiled code is not loaded for a few.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from opl.cell.full_turns import FULL_TURN
from opl.cell.triangle import STRETCH_TOLERANCE
from opl.files.kernels import Kernel, kernel, kernels_are_loaded, threads_are_allowed
from opl.geometry.frames import Array

FEW = 4000  # poses that are not worth more than one thread: others wait for a while in vain
# of kernels that solve poses, shape (n, 4, 4), into configurations, shape (n, 8, 6)
POSES = (
    "void(float64[:,:,::1],float64[::1],float64[::1],float64[::1],float64[::1],float64[:,:,::1])"
)


def solve_poses(
    one: Callable[..., None],
    few: Kernel,
    many: Kernel,
    Ts_base_flange: Array,
    free: Array,
    sizes: Array,
    offsets: tuple[float, ...],
    signs: tuple[int, ...],
) -> Array:
    """Return all configurations that put the flange at poses, limits not regarded.

    The same to the last digit by compiled code, on all cores where there are many poses, and by
    numpy until any compiled code is loaded.

    Args:
        one: Solves poses given as arrays, (8, 6, n).
        few: Solves poses one after the other.
        many: Solves them on all cores.
        Ts_base_flange: Shape (n, 4, 4).
        free: Angle of the joint that a singular pose leaves free, in [rad], shape (n,).
        sizes: Of the arm, as the kernels take them.
        offsets: Zero of each joint in [rad], six.
        signs: 1 or -1, six.

    Returns:
        In (-pi, pi] [rad], shape (n, 8 slots, 6); NaN out of reach.
    """
    joints = np.array(offsets), np.array(signs, dtype=float)
    if not kernels_are_loaded():
        T = np.moveaxis(Ts_base_flange, 0, -1)
        found = np.empty((8, 6, len(Ts_base_flange)))
        one(*T[:3].reshape(12, -1), free, sizes, *joints, found)
        return np.ascontiguousarray(np.moveaxis(found, -1, 0))
    q = np.empty((len(Ts_base_flange), 8, 6))
    solve = many if len(q) > FEW and threads_are_allowed() else few
    # compiled for arrays that can be written to
    Ts = np.array(Ts_base_flange, dtype=float, order="C")
    solve(Ts, np.ascontiguousarray(free), sizes, *joints, q)
    return q


@kernel(for_arrays=np.where)
def either(condition, one, other):  # type: ignore[no-untyped-def]
    """Return one of two numbers."""
    return one if condition else other


@kernel()
def principal_angle(angle):  # type: ignore[no-untyped-def]
    """Turn an angle into (-pi, pi], as `opl.cell.full_turns.principal`."""
    return np.minimum(angle - FULL_TURN * np.ceil(angle / FULL_TURN - 0.5), np.pi)


@kernel()
def root(square, scale):  # type: ignore[no-untyped-def]
    """Return the root of what may be below 0 by round-off; NaN of what is below it by more."""
    return np.sqrt(either(square < -STRETCH_TOLERANCE * scale, np.nan, np.maximum(square, 0.0)))
