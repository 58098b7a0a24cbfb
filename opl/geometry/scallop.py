"""How far apart rows may be so that the wheel leaves no higher ridges between them."""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.passes import MachinedSurface, longest_side

# the surface is looked at about this often across its longest side
_LOOKS = 60

# steeper places than this between planes and surface do not shorten the pitch any further
_LEAST_SLOPE = 0.5


def scallop_pitch(curvature: Array, height: float, wheel_radius: float) -> Array:
    """Return the distance of two rows along the surface in [m] that leave a ridge of a height.

    Between two contacts of a wheel of radius R on a circle of radius r the ridge stands h above it:
    seen from the circle's centre, it lies where both wheels meet, so that
    cos(angle / 2) = ((R + r)^2 + (r + h)^2 - R^2) / (2 (R + r) (r + h)), and the rows are r angle
    apart. In a hollow R + r becomes the difference of both.

    Args:
        curvature: Of the surface across the rows in [1/m], positive where it is round, shape (...).
        height: h in [m].
        wheel_radius: R in [m].

    Returns:
        Shape (...); infinite in a hollow that the wheel fills.
    """
    curvature = np.asarray(curvature, dtype=np.float64)
    flat = np.abs(curvature) < 1e-6
    r = 1.0 / np.where(flat, 1.0, curvature)  # negative in a hollow
    centres, ridge = wheel_radius + r, r + height
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = (centres**2 + ridge**2 - wheel_radius**2) / (2.0 * centres * ridge)
        bent = 2.0 * np.abs(r) * np.arccos(np.clip(cosine, -1.0, 1.0))
    straight = 2.0 * np.sqrt(max(2.0 * wheel_radius * height - height**2, 0.0))
    filled = curvature <= -1.0 / wheel_radius
    return np.where(flat, straight, np.where(filled, np.inf, bent))


def ridge_height(curvature: Array, pitch: float, wheel_radius: float) -> Array:
    """Return how high the ridge stands that rows leave between them, `scallop_pitch` turned round.

    Args:
        curvature: Of the surface across the rows in [1/m], positive where it is round, shape (...).
        pitch: Distance of two rows along the surface in [m].
        wheel_radius: In [m].

    Returns:
        In [m], shape (...); 0 in a hollow that the wheel fills, NaN where the rows are farther
        apart than two wheels that meet.
    """
    curvature = np.asarray(curvature, dtype=np.float64)
    flat = np.abs(curvature) < 1e-6
    r = 1.0 / np.where(flat, 1.0, curvature)
    half, centres = pitch / np.abs(r) / 2.0, wheel_radius + r
    with np.errstate(invalid="ignore"):
        bent = centres * np.cos(half) - np.sqrt(wheel_radius**2 - (centres * np.sin(half)) ** 2) - r
        straight = wheel_radius - np.sqrt(wheel_radius**2 - pitch**2 / 4.0)
    filled = curvature <= -1.0 / wheel_radius
    return np.where(flat, straight, np.where(filled, 0.0, bent))


def row_pitch(
    surface: MachinedSurface, plane_normal: Array, height: float, wheel_radius: float
) -> float:
    """Return the distance of the planes in [m] that keeps a scallop height on a whole surface.

    Args:
        surface: The surface to grind.
        plane_normal: Normal of the planes, of any length, shape (3,).
        height: Largest height of a ridge in [m].
        wheel_radius: Radius of the wheel in [m].

    Raises:
        ValueError: If no place of the surface limits the pitch.
    """
    normal = np.asarray(plane_normal, dtype=np.float64) / np.linalg.norm(plane_normal)
    curvature, slope = surface.curvature_across(longest_side(surface) / _LOOKS, normal)
    pitch = scallop_pitch(curvature, height, wheel_radius) * np.maximum(slope, _LEAST_SLOPE)
    least = float(pitch.min(initial=np.inf))
    if not np.isfinite(least):
        raise ValueError("the surface is nowhere rounder than the wheel")
    return least
