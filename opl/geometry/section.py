"""What determines a curve on a face: here a plane that cuts it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array, from_axes, in_mm
from opl.geometry.nurbs import NurbsSurface

# points of a curve lie this near to their plane [m], on the surface they lie exactly; the search
# for them ends well below
ON_PLANE = 1e-9
CONVERGED = 1e-12
MAX_NEWTON_STEPS = 60

# sine of the angle between surface and plane below which they touch rather than cut
_TOUCHING = 1e-6


@dataclass(frozen=True, eq=False)
class Trace(ABC):
    """A condition that the points of a curve on a surface satisfy.

    Attributes:
        surface: The surface.
        outward: 1.0 if du x dv points outward, -1.0 if inward.
    """

    surface: NurbsSurface
    outward: float

    @abstractmethod
    def frames(self, uv: Array) -> Array:
        """Return Ts_workpiece_cutter, shape (..., 4, 4), of parameters (..., 2) of the curve.

        Raises:
            DegenerateNormalError: Where the surface has no normal.
        """

    @abstractmethod
    def closest(self, uv: Array, targets: Array, tangents: Array) -> Array:
        """Return the parameters of the points of the curve abreast of given points.

        Args:
            uv: First guesses, shape (k, 2).
            targets: Points near the curve in [m], shape (k, 3).
            tangents: Directions of the curve there, shape (k, 3).

        Raises:
            ValueError: Where there is no such point in the domain.
        """

    def bending(self, uv: Array) -> Array:
        """Return the curvature in [1/m] in the frames' axes x and y, shape (k, 2, 2)."""
        R = self.frames(uv)[:, :3, :3]
        return self.outward * self.surface.curvature_tensor(uv, R[:, :, 0], R[:, :, 1])


@dataclass(frozen=True, eq=False)
class Section(Trace):
    """A plane n . p = offset through a surface.

    Attributes:
        plane_normal: Unit normal n of the plane, shape (3,).
        offset: Distance of the plane from the origin along n in [m].
    """

    plane_normal: Array
    offset: float

    def frames(self, uv: Array) -> Array:
        """Return Ts_workpiece_cutter, shape (..., 4, 4): z outward normal, x = z cross n.

        The tangent of the curve is normal to both the surface's and the plane's normal, so x is
        exact where z is.

        Raises:
            DegenerateNormalError: Where the surface has no normal.
            ValueError: Where the plane touches the surface, so that the curve has no tangent.
        """
        z = self.outward * self.surface.normal(uv)
        x = np.cross(z, self.plane_normal)
        points = self.surface.point(uv)
        touching = np.linalg.norm(x, axis=-1) < _TOUCHING
        if touching.any():
            raise ValueError(
                f"the plane {1e3 * self.offset:.4g} mm along its normal touches the surface at "
                f"{in_mm(points[touching][0])} and does not cut it there"
            )
        return from_axes(z, x, points)

    def closest(self, uv: Array, targets: Array, tangents: Array) -> Array:
        """See `Trace.closest`; Newton's method on two equations.

        The point lies on the plane, and its difference to the target is normal to the tangent.

        Raises:
            ValueError: Where there is no such point in the domain.
        """
        lower, upper = self.surface.domain
        for _ in range(MAX_NEWTON_STEPS):
            S = self.surface.derivatives(uv, 1)
            points, gradients = S[:, 0, 0], np.stack([S[:, 1, 0], S[:, 0, 1]], axis=1)
            along = np.sum((points - targets) * tangents, axis=1)
            residuals = np.stack([points @ self.plane_normal - self.offset, along], axis=1)
            jacobian = np.stack(
                [gradients @ self.plane_normal, np.einsum("kij,kj->ki", gradients, tangents)],
                axis=1,
            )
            # the pseudo-inverse, as the matrix may be singular at a guess
            step = np.linalg.pinv(jacobian) @ residuals[..., None]
            previous, uv = uv, np.clip(uv - step[..., 0], lower, upper)
            if np.all(np.abs(uv - previous) <= CONVERGED * (upper - lower)):
                break
        distance = np.abs(self.surface.point(uv) @ self.plane_normal - self.offset)
        if (distance > ON_PLANE).any():
            raise self.lost(targets[np.argmax(distance)])
        return uv

    def lost(self, point: Array) -> ValueError:
        """Return the error that a curve cannot be followed near a point [m]."""
        return ValueError(
            f"the plane {1e3 * self.offset:.4g} mm along its normal: its curve on the surface "
            f"cannot be followed near {in_mm(point)}; is the surface smooth there?"
        )
