"""Solids with a closed form for distance, normal and curvature; their NURBS and their meshes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from opl.geometry.mesh import TriangleMesh
from opl.geometry.nurbs import NurbsSurface
from opl.geometry.passes import Passes, lay_passes
from opl.geometry.patchwork import Face, Patchwork
from tests.support.surfaces import arc

ORIGINS = np.s_[:, :3, 3]
DEFAULTS = {"pitch": 5e-3, "max_bow_height": 0.05e-3, "largest_step": 4e-3}


@dataclass(frozen=True)
class Closed:
    """A solid in closed form; distance is positive outside."""

    name: str
    surface: NurbsSurface
    distance: Callable
    normal: Callable
    curvatures: Callable


def lay(surface, plane_normal, **changes):
    if isinstance(surface, NurbsSurface):
        surface = Patchwork((Face(surface),))
    return lay_passes(surface, Passes(np.asarray(plane_normal, float), **{**DEFAULTS, **changes}))


def _circle(whole):
    """Return control points, weights and knots of an arc of 2 rad or of four quarters."""
    if not whole:
        points, weights = arc(1.0, 0.3, 2.3)
        return points, weights, np.repeat([0.0, 1.0], 3)
    angles = 0.25 * np.pi * np.arange(9)
    weights = np.array([1.0, np.sqrt(0.5)] * 4 + [1.0])
    points = np.stack([np.cos(angles), np.sin(angles)], axis=1) / weights[:, None]
    return points, weights, np.array([0.0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4])


def revolved(profile, profile_weights, profile_knots, degree, whole=False):
    """Return the surface of a profile (r, z) turned about z; du x dv points away from the axis
    where z grows with v."""
    points, weights, knots = _circle(whole)
    net = np.array([[[r * x, r * y, z] for r, z in profile] for x, y in points])
    return NurbsSurface(2, degree, knots, profile_knots, net, np.outer(weights, profile_weights))


LINE = np.array([0.0, 0.0, 1.0, 1.0])


def plane():
    net = np.array([[[x, y, 0.0] for y in (0.0, 0.03)] for x in (0.0, 0.05)])
    surface = NurbsSurface(1, 1, LINE, LINE, net, np.ones((2, 2)))
    up = np.array([0.0, 0.0, 1.0])
    return Closed(
        "plane",
        surface,
        lambda p: p[..., 2],
        lambda p: np.broadcast_to(up, p.shape),
        lambda p: np.zeros((*p.shape[:-1], 2)),
    )


def _radial(p):
    r = np.linalg.norm(p[..., :2], axis=-1, keepdims=True)
    return np.concatenate([p[..., :2] / r, np.zeros_like(r)], axis=-1), r[..., 0]


def cylinder(radius=0.03, length=0.04, whole=False):
    surface = revolved([(radius, 0.0), (radius, length)], [1.0, 1.0], LINE, 1, whole)
    return Closed(
        "cylinder",
        surface,
        lambda p: _radial(p)[1] - radius,
        lambda p: _radial(p)[0],
        lambda p: np.stack([0.0 * p[..., 0], 0.0 * p[..., 0] + 1.0 / radius], axis=-1),
    )


def cone(low=0.03, high=0.015, length=0.04, whole=False):
    surface = revolved([(low, 0.0), (high, length)], [1.0, 1.0], LINE, 1, whole)
    slant = np.hypot(length, low - high)
    c, s = length / slant, (low - high) / slant

    def normal(p):
        return c * _radial(p)[0] + s * np.array([0.0, 0.0, 1.0])

    return Closed(
        "cone",
        surface,
        lambda p: c * (_radial(p)[1] - low) + s * p[..., 2],
        normal,
        lambda p: np.stack([0.0 * p[..., 0], c / _radial(p)[1]], axis=-1),
    )


def sphere(radius=0.03, whole=False):
    if whole:
        quarter = np.array([0.0, -1, 1, -1, 1, 0, 1, 1, 0, 1]).reshape(-1, 2) * radius
        weights, knots = [1.0, np.sqrt(0.5), 1.0, np.sqrt(0.5), 1.0], [0.0, 0, 0, 1, 1, 2, 2, 2]
        surface = revolved(quarter, weights, np.array(knots), 2, True)
    else:
        points, weights = arc(radius, -0.6, 0.9)
        surface = revolved(points, weights, np.repeat([0.0, 1.0], 3), 2)
    return Closed(
        "sphere",
        surface,
        lambda p: np.linalg.norm(p, axis=-1) - radius,
        lambda p: p / np.linalg.norm(p, axis=-1, keepdims=True),
        lambda p: np.full((*p.shape[:-1], 2), 1.0 / radius),
    )


def torus(radius=0.04, tube=0.012, whole=False):
    if whole:
        circle, weights, knots = _circle(True)
    else:
        circle, weights = arc(1.0, -1.1, 1.0)
        knots = np.repeat([0.0, 1.0], 3)
    profile = tube * circle + [radius, 0.0]
    surface = revolved(profile, weights, knots, 2, whole)

    def spoke(p):
        out, r = _radial(p)
        return p - radius * out, r

    def curvatures(p):
        d, r = spoke(p)
        cosine = (r - radius) / np.linalg.norm(d, axis=-1)
        return np.stack([0.0 * r + 1.0 / tube, cosine / r], axis=-1)

    return Closed(
        "torus",
        surface,
        lambda p: np.linalg.norm(spoke(p)[0], axis=-1) - tube,
        lambda p: spoke(p)[0] / np.linalg.norm(spoke(p)[0], axis=-1, keepdims=True),
        curvatures,
    )


def tessellated(surface, n=60, m=40):
    """Return the triangles between n x m parameters of a surface, outside along du x dv."""
    lower, upper = surface.domain
    u, v = (np.linspace(a, b, k + 1) for a, b, k in zip(lower, upper, (n, m), strict=True))
    vertices = surface.point(np.stack(np.meshgrid(u, v, indexing="ij"), -1)).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    a = (i * (m + 1) + j).ravel()
    b, c, d = a + m + 1, a + m + 2, a + 1
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return TriangleMesh(vertices, faces)
