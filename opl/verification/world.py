"""The cell in PyBullet: robot, part, fixture, wheel and obstacles as bodies that can be posed.

Nothing here is shared with `opl.cell.collision`: PyBullet reads the URDF itself, poses the links
itself and measures distances itself. The part is a concave triangle mesh, not its convex hull,
which Bullet allows only for bodies without mass that are placed by pose. Between two such meshes
Bullet finds nothing at all, so every other mesh is a compound of its triangles, each a convex body.
Meshes are in pieces, of which those that cannot be the nearest are not measured.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from opl.cell.workcell import PART, WorkCell
from opl.geometry.frames import Array, transform
from opl.geometry.mesh import TriangleMesh
from opl.verification.arm import BASE_LINK, as_placed, as_pose
from opl.verification.bodies import MARGIN, Bodies, Solid
from opl.verification.drum import Drum
from opl.verification.engine import SCALE
from opl.verification.meshes import is_inside

# Bullet rounds the edges of a link's boxes and cylinders by its own margin, a thousandth of its
# lengths, so that they seem farther away than they are: 0.085 mm was seen. It is added to what is
# needed. Links of meshes are blown up by that margin: they seem nearer
LINK_ROUNDING = 1e-4  # [m]
# Bullet's distance of a mesh from the wheel is too small by up to 0.012 mm, its depth by 0.05 mm:
# 2000 random configurations each in the V and S cells, against the exact distance
GAP_ACCURACY = 1e-4  # [m]


@dataclass(frozen=True)
class SolidPair:
    """Two solids that must stay apart.

    Attributes:
        first: One of them.
        second: The other.
        clearance: How far they must stay apart in [m].
        rounding: How much nearer than Bullet says they can be, in [m].
    """

    first: Solid
    second: Solid
    clearance: float
    rounding: float = 0.0

    @property
    def counts(self) -> bool:
        """Whether its distance counts as a clearance, beyond that the two must not touch.

        Solids of the arm with one or two joints between them are near each other by their build.
        """
        return self.clearance > 0.0 or abs(self.first.moved_by - self.second.moved_by) > 2

    def moved_by(self, joint: int) -> bool:
        """Return whether a joint moves one of them against the other."""
        less, more = sorted((self.first.moved_by, self.second.moved_by))
        return less <= joint < more


class World(Bodies):
    """A physics server with the cell in it; use as a context manager."""

    def __init__(self, cell: WorkCell) -> None:
        super().__init__(cell)
        self._cell = cell
        self._links = [Solid(self._link_name(BASE_LINK), self._robot, BASE_LINK)]
        for count, index in enumerate(self._joints, start=1):
            self._links.append(Solid(self._link_name(index), self._robot, index, count))
        # the part is the first of the held bodies
        part = self._add_mesh(PART, cell.part.triangles, self._concave)
        held = [(part, self._part_at_flange)]
        held += [(self._add(body), as_placed(body.T_parent_body)) for body in cell.fixture]
        self._held = [(replace(solid, moved_by=len(self._joints)), at) for solid, at in held]
        self._part, _ = self._held[0]
        wheel = cell.wheel_body()
        self._wheel = self._add(wheel, stands=True)
        self._drum = Drum(wheel.T_parent_body, cell.wheel.radius, cell.wheel.width)
        self._obstacles = [self._add(body, stands=True) for body in cell.obstacles]
        self.move_to(np.zeros(len(self._joints)))

    def __enter__(self) -> World:
        return self

    def pairs(self) -> list[SolidPair]:
        """Return every pair that must stay apart; part and wheel may touch and are not in it."""
        rules, found = self._cell.pairs, []
        for pair in self._pairs():
            names = frozenset((pair.first.name, pair.second.name))
            if names not in rules.allowed:
                clearance = rules.required.get(names, pair.clearance)
                found.append(replace(pair, clearance=clearance))
        return found

    def part_and_wheel(self) -> SolidPair:
        """Return the pair that may touch; how far apart the two must be on free moves."""
        return SolidPair(self._part, self._wheel, self._cell.part_from_wheel)

    def _pairs(self) -> Iterator[SolidPair]:
        links, clearance = self._links, self._cell.required_clearance
        for k, link in enumerate(links):
            # neighbouring links share a bearing
            yield from (
                SolidPair(link, other, 0.0, 2.0 * LINK_ROUNDING) for other in links[k + 2 :]
            )
            if k > 0:  # the base does not move, nor does what stands around it
                for other in (self._wheel, *self._obstacles):
                    yield SolidPair(link, other, clearance, LINK_ROUNDING)
            if k < len(links) - 1:  # the fixture is bolted to the last link
                # and turns close in front of the last but one
                needed = 0.0 if k == len(links) - 2 else clearance
                yield from (SolidPair(link, held, needed, LINK_ROUNDING) for held, _ in self._held)
        for held, _ in self._held:
            yield from (SolidPair(held, other, clearance) for other in self._obstacles)
            if held.name != PART:
                yield SolidPair(held, self._wheel, clearance)

    def move_to(self, q: Array) -> Array:
        """Pose robot, part and fixture; return T_base_workpiece as PyBullet sees it, (4, 4)."""
        flange = self._turned(q)
        placed = [self._joined(*flange, *at_flange) for _, at_flange in self._held]
        for (held, _), at in zip(self._held, placed, strict=True):
            self._move(held, at)
        self._T_base_workpiece = as_pose(*placed[0])
        return self._T_base_workpiece

    def gap(self, within: float, counts: float = np.inf) -> float:
        """Return the distance of the part from the wheel in [m], as `distance`.

        Measured patch by patch, the nearest bound first, and none that cannot be nearer than what
        was measured. Once the part is known to be within, only distances less than ``counts`` are
        the smallest there is; others are those of some patch.
        """
        patches = self._pieces[self._part.body].patches
        beside = patches.beside(self._drum, self._T_base_workpiece)
        bounds, nearest = beside.boxes, np.inf
        for k in bounds.argsort():
            wanted = min(nearest, within if nearest > within else counts) + 2.0 * MARGIN
            if bounds[k] > wanted:
                break
            if beside.of_corners(k) > wanted or beside.is_beyond(k, wanted + GAP_ACCURACY):
                continue
            ahead = min(nearest, max(within, 0.0))
            nearest = min(nearest, self._from_piece(self._part, k, self._wheel, ahead))
        return nearest

    def surrounding(self) -> list[str]:
        """Return the meshes around flange or part as posed: distances are those of surfaces."""
        state = self._link_state(self._robot, self._flange, computeForwardKinematics=True)
        points = [
            np.array(state[4]) / SCALE,
            transform(self._T_base_workpiece, self._cell.part.vertices[0]),
        ]
        found = []
        for body in self._cell.obstacles:
            if isinstance(body.shape, TriangleMesh) and body.shape.is_closed:
                corners = transform(body.T_parent_body, body.shape.triangles)
                if any(is_inside(corners, point) for point in points):
                    found.append(body.name)
        return found

    def distance_to_wheel(self, p_base: Array) -> float:
        """Return how far a point is from the wheel's surface in [m], negative inside."""
        return float(self._drum.distances(p_base[None])[0][0])

    def levers(self, pairs: Sequence[SolidPair]) -> Array:
        """Return how far a turn of each joint by 1 rad can bring pairs together, in [m], (k, 6).

        A bound for all configurations: the arm stretched out from that joint to the one that the
        farther body of the pair hangs on, and the body stretched out beyond it.
        """
        self.move_to(np.zeros(len(self._joints)))
        states = [self._link_state(self._robot, joint) for joint in self._joints]
        origins = [np.array(state[4]) / SCALE for state in states]
        lengths = np.linalg.norm(np.diff(origins, axis=0), axis=1)
        radii = {}
        for solid in (*self._links[1:], *(held for held, _ in self._held)):
            origin = origins[solid.moved_by - 1]
            box = np.array(self._box(solid))
            away = np.abs(box - origin).max(axis=0)
            radii[solid] = float(np.linalg.norm(away))
        found = np.zeros((len(pairs), len(self._joints)))
        for row, pair in zip(found, pairs, strict=True):
            less, more = sorted((pair.first, pair.second), key=lambda solid: solid.moved_by)
            for joint in range(less.moved_by, more.moved_by):
                row[joint] = lengths[joint : more.moved_by - 1].sum() + radii[more]
        return found

    def _link_name(self, index: int) -> str:
        if index == BASE_LINK:
            return str(self._client.getBodyInfo(self._robot)[0].decode())
        return str(self._client.getJointInfo(self._robot, index)[12].decode())
