"""Bodies in PyBullet, and how far apart they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array, transform
from opl.geometry.mesh import TriangleMesh
from opl.geometry.shapes import Body, Box, Cylinder
from opl.verification.arm import BASE_LINK, Arm, At, as_placed, as_pose
from opl.verification.engine import SCALE, pybullet
from opl.verification.meshes import concave_shape, triangle_body
from opl.verification.patches import Patches
from opl.verification.pieces import Pieces

Numbers = tuple[int, int]  # Bullet's, of a body and its link

# Bullet rounds the edges of cylinders by their margin and blows up meshes by it: the default of
# 1 mm is as much as the contact itself
MARGIN = 1e-5  # [m]


@dataclass(frozen=True)
class Solid:
    """One thing that can be touched: a body, or a link of the robot."""

    name: str
    body: int
    link: int
    moved_by: int = 0  # number of joints, the first ones, that move it


class Bodies(Arm):
    """A physics server with the robot and other bodies in it; use as a context manager."""

    def __init__(self, cell: WorkCell) -> None:
        super().__init__(cell)
        self._closest_points = self._client.getClosestPoints
        self._place = self._client.resetBasePositionAndOrientation
        self._pieces: dict[int, Pieces] = {}  # of a mesh, by the number of the first
        self._standing: dict[Solid, tuple[Array, Array]] = {}

    def distance(self, first: Solid, second: Solid, within: float) -> float:
        """Return the distance in [m], negative in penetration, inf beyond ``within``."""
        if first.body not in self._pieces:
            first, second = second, first
        if first.body not in self._pieces:
            return self._measured(_numbers(first), _numbers(second), within)
        bounds = self._pieces[first.body].from_box(*self._box(second))
        return _nearest(bounds, within, lambda k, ahead: self._from_piece(first, k, second, ahead))

    def _from_piece(self, mesh: Solid, k: int, other: Solid, within: float) -> float:
        """Return the distance of a piece of a mesh from another solid, as `distance`."""
        piece = self._pieces[mesh.body].placed(k), BASE_LINK
        if other.body not in self._pieces:
            return self._measured(piece, _numbers(other), within)
        others = self._pieces[other.body]
        return _nearest(
            others.from_box(*self._around(*piece)),
            within,
            lambda j, ahead: self._measured(piece, (others.placed(j), BASE_LINK), ahead),
        )

    def _measured(self, first: Numbers, second: Numbers, within: float) -> float:
        """Return what Bullet says of two bodies, as `distance`."""
        bodies, links = (first[0], second[0]), (first[1], second[1])
        contacts = self._closest_points(*bodies, SCALE * within, *links)
        return min((contact[8] for contact in contacts), default=np.inf) / SCALE

    def _box(self, solid: Solid) -> tuple[Array, Array]:
        """Return the lowest and the highest coordinates of a solid in the base frame."""
        if solid in self._standing:
            return self._standing[solid]
        if (pieces := self._pieces.get(solid.body)) is None:
            return self._around(*_numbers(solid))
        boxes = [self._around(pieces.placed(k)) for k in range(len(pieces.bodies))]
        lows, highs = zip(*boxes, strict=True)
        return np.min(lows, axis=0), np.max(highs, axis=0)

    def _around(self, body: int, link: int = BASE_LINK) -> tuple[Array, Array]:
        """Return those that Bullet tells of a body, a little too far out."""
        low, high = self._client.getAABB(body, link)
        return np.array(low) / SCALE, np.array(high) / SCALE

    def _add_mesh(self, name: str, triangles: Array, add: Callable[[Array], int]) -> Solid:
        """Add a mesh in pieces, each of which is given to be added by its triangles, (n, 3, 3)."""
        patches = Patches.of(triangles)
        solids = [self._as_solid(name, add(patch)) for patch in patches.triangles]
        numbers = [solid.body for solid in solids]
        self._pieces[numbers[0]] = Pieces(patches, numbers, self._place)
        return solids[0]

    def _concave(self, triangles: Array) -> int:
        return self._body(concave_shape(self._client, triangles.reshape(-1, 3)))

    def _add(self, body: Body, stands: bool = False) -> Solid:
        """Add a body, given in the base frame if it stands there, else where something holds it."""
        client = self._client
        if isinstance(body.shape, Box):
            half = [SCALE * edge / 2.0 for edge in body.shape.size]
            shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half)
            solid = self._as_solid(body.name, self._body(shape))
        elif isinstance(body.shape, Cylinder):
            shape = client.createCollisionShape(
                pybullet.GEOM_CYLINDER,
                radius=SCALE * body.shape.radius,
                height=SCALE * body.shape.length,
            )
            solid = self._as_solid(body.name, self._body(shape))
        else:
            solid = self._add_mesh(
                body.name, body.shape.triangles, lambda patch: triangle_body(client, patch)
            )
        if stands:
            self._move(solid, as_placed(body.T_parent_body))
            self._standing[solid] = _box_around(body)
        return solid

    def _move(self, solid: Solid, at: At) -> None:
        """Bring a body to a pose."""
        if (pieces := self._pieces.get(solid.body)) is None:
            self._place(solid.body, *at)
        else:
            pieces.move_to(at, as_pose(*at))

    def _body(self, shape: int) -> int:
        return int(self._client.createMultiBody(baseMass=0.0, baseCollisionShapeIndex=shape))

    def _as_solid(self, name: str, body: int) -> Solid:
        self._client.changeDynamics(body, BASE_LINK, collisionMargin=SCALE * MARGIN)
        return Solid(name, body, BASE_LINK)


def _numbers(solid: Solid) -> Numbers:
    return solid.body, solid.link


def _nearest(
    bounds: Iterator[tuple[float, int]], within: float, measured: Callable[[int, float], float]
) -> float:
    """Return the distance of the nearest piece, as `Bodies.distance`.

    Args:
        bounds: Lower bounds of the distances in [m] and the pieces, the least first.
        within: The farthest distance of interest in [m].
        measured: The distance of a piece, inf beyond another farthest distance.
    """
    nearest = np.inf
    for bound, k in bounds:
        ahead = min(nearest, within)
        if bound > max(ahead, 0.0) + 2.0 * MARGIN:  # what may touch may be of any depth
            break
        nearest = min(nearest, measured(k, ahead))
    return nearest


def _box_around(body: Body) -> tuple[Array, Array]:
    """Return the lowest and the highest coordinates of a body in the frame it is given in."""
    T, shape = body.T_parent_body, body.shape
    if isinstance(shape, TriangleMesh):
        corners = transform(T, shape.vertices)
        return corners.min(axis=0), corners.max(axis=0)
    if isinstance(shape, Box):
        half = np.array(shape.size) / 2.0
    else:
        half = np.array([shape.radius, shape.radius, shape.length / 2.0])
    reach = np.abs(T[:3, :3]) @ half
    return T[:3, 3] - reach, T[:3, 3] + reach
