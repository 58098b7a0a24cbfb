"""How a surface bends in a given direction.

Curvature is positive where the surface bends away from its normal, as a ball does.
"""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.nurbs import NurbsSurface


def curvature_tensor(surface: NurbsSurface, uv: Array, x: Array, y: Array) -> Array:
    """Return the second fundamental form in two orthonormal tangent directions.

    The diagonal holds the normal curvatures along x and y (do Carmo, section 3.2).

    Args:
        surface: The surface.
        uv: Parameters, shape (..., 2).
        x: First unit tangent, shape (..., 3).
        y: Second unit tangent, normal to the first, shape (..., 3).

    Returns:
        Symmetric matrices in [1/m], with respect to the normal du x dv, shape (..., 2, 2).

    Raises:
        DegenerateNormalError: Where the surface has no normal.
    """
    S = surface.derivatives(uv, 2)
    n = surface.unit_normal(uv, S)
    tangents = np.stack([S[..., 1, 0, :], S[..., 0, 1, :]], axis=-2)
    first = tangents @ np.swapaxes(tangents, -1, -2)
    # of each direction the components along du and dv
    mixed = np.linalg.solve(first, tangents @ np.stack([x, y], axis=-1))
    L, M, N = (-np.sum(S[..., k, m, :] * n, axis=-1) for k, m in ((2, 0), (1, 1), (0, 2)))
    second = np.stack([np.stack([L, M], axis=-1), np.stack([M, N], axis=-1)], axis=-2)
    return np.swapaxes(mixed, -1, -2) @ second @ mixed
