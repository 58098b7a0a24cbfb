"""Surfaces whose shape is known in closed form. Lengths in metres, angles in radians."""

from __future__ import annotations

import numpy as np

from opl.geometry.machined import load_faces
from opl.geometry.nurbs import NurbsSurface

CLAMPED = {degree: np.repeat([0.0, 1.0], degree + 1) for degree in (1, 2, 3)}


def plane_patch(width=0.04, length=0.03):
    """u along x from 0 to width, v along y from 0 to length."""
    corners = [[[x, y, 0.0] for y in (0.0, length)] for x in (0.0, width)]
    return NurbsSurface(1, 1, CLAMPED[1], CLAMPED[1], np.array(corners), np.ones((2, 2)))


def arc(radius, first, last):
    """Return the three control points (cosine, sine) and weights of an arc below 180 degrees."""
    half = 0.5 * (last - first)
    angles = np.array([first, first + half, last])
    radii = radius * np.array([1.0, 1.0 / np.cos(half), 1.0])
    points = radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return points, np.array([1.0, np.cos(half), 1.0])


def cylinder_patch(radius=0.05, first=0.3, last=2.1, width=0.03):
    """u along the arc about z, from +x towards +y, v along z from 0: du x dv points outward."""
    points, weights = arc(radius, first, last)
    net = np.array([[[x, y, z] for z in (0.0, width)] for x, y in points])
    return NurbsSurface(2, 1, CLAMPED[2], CLAMPED[1], net, np.stack([weights, weights], axis=1))


def sphere_patch(radius=0.05, longitude=(0.2, 1.9), latitude=(-0.6, 0.9)):
    """u along the longitude, v along the latitude: du x dv points outward."""
    around, around_weights = arc(1.0, *longitude)
    upward, upward_weights = arc(radius, *latitude)
    net = np.array([[[r * x, r * y, z] for r, z in upward] for x, y in around])
    weights = np.outer(around_weights, upward_weights)
    return NurbsSurface(2, 2, CLAMPED[2], CLAMPED[2], net, weights)


def graph(heights, size=0.1):
    """Return the bicubic surface z(x, y) over a square, with x = size u and y = size v exactly.

    heights: control heights, shape (n, n). Linear x and y come from the Greville abscissae.
    """
    n = len(heights)
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, n - 2), np.ones(3)])
    greville = np.array([knots[i + 1 : i + 4].mean() for i in range(n)])
    x, y = np.meshgrid(size * greville, size * greville, indexing="ij")
    net = np.stack([x, y, heights], axis=-1)
    return NurbsSurface(3, 3, knots, knots, net, np.ones((n, n)))


def random_surface(rng):
    """Return a rational surface of random degrees, knots, points and weights."""
    degrees = rng.integers(1, 5, size=2)
    counts = degrees + rng.integers(1, 6, size=2)
    knots = [
        np.concatenate([np.zeros(p + 1), np.sort(rng.random(n - p - 1)), np.ones(p + 1)])
        for p, n in zip(degrees, counts, strict=True)
    ]
    net, weights = rng.random((*counts, 3)), rng.uniform(0.3, 3.0, counts)
    return NurbsSurface(int(degrees[0]), int(degrees[1]), *knots, net, weights)


def parameters(surface, n=200, seed=0):
    """Return random parameters inside the domain and its four corners, shape (n + 4, 2)."""
    lower, upper = surface.domain
    inside = np.random.default_rng(seed).uniform(lower, upper, (n, 2))
    corners = [[u, v] for u in (lower[0], upper[0]) for v in (lower[1], upper[1])]
    return np.vstack([inside, corners])


def load_surface(path):
    """Return the NURBS surface of a file with a single face."""
    return load_faces(path)[0].surface


def principal_curvatures(surface, uv):
    """Return the smallest and the largest normal curvature in [1/m], shape (..., 2)."""
    du, normal = surface.derivatives(uv, 1)[..., 1, 0, :], surface.normal(uv)
    x = du / np.linalg.norm(du, axis=-1, keepdims=True)
    return np.linalg.eigvalsh(surface.curvature_tensor(uv, x, np.cross(normal, x)))


def profile_distance(points):
    """Return how far points (y, z) in [mm] lie outside the profile of the V part, shape (n,)."""
    radius, turn, flank = 61.774, 1.132, 46.843
    p, h = np.abs(points[:, 0] + 24.572), points[:, 1] - (96.5 - radius)
    beyond = np.arctan2(p, h) > turn
    along = p * np.cos(turn) - h * np.sin(turn)
    assert along.max() < flank + 1e-4
    return np.where(beyond, p * np.sin(turn) + h * np.cos(turn), np.hypot(p, h)) - radius
