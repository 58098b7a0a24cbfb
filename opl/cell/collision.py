"""Whether robot, held part or fixture touch anything at a configuration, by pinocchio and coal.

Part against wheel is not checked here: that pair may touch, and has a closed form in
`opl.cell.wheel_distance`. A collision is a yes or a no, never a cost.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from copy import copy
from functools import cached_property

import coal
import numpy as np
import pinocchio as pin

from opl.cell.cell_geometry import BodyPair as BodyPair
from opl.cell.cell_geometry import cell_geometry
from opl.cell.separation import Bodies, Separation
from opl.cell.workcell import SECOND_OPINION, SECOND_OPINION_OF_A_LINK, WorkCell
from opl.geometry.frames import Array, read_only, transform

ROUND_OFF = 1e-6  # [m] of coal: bodies farther apart by more than this do not collide for it
FIRST_BLOCK = 8  # configurations that are looked at together where the first that collides ends it
BLOCK = 4096  # configurations that are looked at in one call
# what takes as long as coal does for a configuration, measured: a call, and to tell one without it
A_CALL, TOLD = 2.0, 0.1


class CollisionScene:
    """The cell as geometry, ready for collision checks of all pairs of `cell_geometry`."""

    def __init__(self, cell: WorkCell) -> None:
        solids = cell_geometry(cell)
        self._model, self._geometry = solids.model, solids.geometry
        self._n_links, self._T_base_world = solids.n_links, solids.T_base_world
        self._pairs, self._needed = solids.pairs, solids.needed
        self._bodies = Bodies.of(self._model, self._geometry)
        meshes = [
            isinstance(body.geometry, coal.BVHModelBase) for body in self._geometry.geometryObjects
        ]
        self._has_mesh = [
            meshes[pair.first] or meshes[pair.second] for pair in self._geometry.collisionPairs
        ]
        self._margins = self._needed
        self._work = [0.0]  # of all scenes made of this one
        self._prepare(self._margins, range(0))

    @property
    def queries(self) -> float:
        """What this scene and those made of it were asked, as configurations coal looked at."""
        return self._work[0]

    def _prepare(self, margins: Array, unchecked: Iterable[int]) -> None:
        """Make ready for checks with these margins in [m], without some of the pairs."""
        self._data = self._model.createData()
        self._geometry_data = self._geometry.createData()
        for request, margin in zip(self._geometry_data.collisionRequests, margins, strict=True):
            request.security_margin = float(margin)
            request.enable_contact = False
            # the default of 1 mm goes on to measure distances of pairs nearly in contact
            request.break_distance = 0.0
        _begin_anew(self._geometry_data)
        self._wider: dict[float, CollisionScene] = {}
        # coal looks only at pairs that are not certainly farther apart than this
        self._enough = np.array(margins) + ROUND_OFF
        self._enough[list(unchecked)] = -np.inf
        self._separation = self.separation(np.arange(len(margins)))
        # and need not look where a pair of plain solids is certainly nearer than that
        surely = np.where(self._separation.plain, self._enough - 2.0 * ROUND_OFF, -np.inf)
        self._surely = surely[None]

    def for_second_opinion(self) -> CollisionScene:
        """Return the scene with as much more clearance as the replay may find less.

        What this scene calls free, the replay of the verification calls free too.
        """
        scene = copy(self)
        links = [
            (pair.first < self._n_links) + (pair.second < self._n_links)
            for pair in self._geometry.collisionPairs
        ]
        reserves = np.maximum(np.array(links) * SECOND_OPINION_OF_A_LINK, SECOND_OPINION)
        scene._margins = self._margins + reserves
        scene._prepare(scene._margins, range(0))
        return scene

    def wider(self, reserve: float) -> CollisionScene:
        """Return the scene with more clearance [m] for all pairs; made once."""
        if reserve not in self._wider:
            scene = copy(self)
            scene._margins = self._margins + reserve
            scene._prepare(scene._margins, range(0))
            self._wider[reserve] = scene
        return self._wider[reserve]

    def against_surroundings(self, reserve: float) -> CollisionScene:
        """Return the scene with more clearance [m], only for pairs with what does not move."""
        scene = copy(self)
        joints = [geometry.parentJoint for geometry in self._geometry.geometryObjects]
        both_move = (
            index
            for index, pair in enumerate(self._geometry.collisionPairs)
            if joints[pair.first] > 0 and joints[pair.second] > 0
        )
        scene._prepare(self._margins + reserve, both_move)
        return scene

    @cached_property
    def levers(self) -> Array:
        """How far from each joint's axis anything it moves can ever be, in [m], shape (6,).

        When joint k turns by d [rad], no point moves farther than d times lever k.
        """
        model = self._model
        data = model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        levers = np.zeros(model.nq)
        rest = 0.0  # farthest that anything is from the origin of the joint after this one
        for joint in range(model.nq, 0, -1):
            axis = data.oMi[joint].rotation.T @ data.J[3:, joint - 1]
            spheres = [
                (
                    geometry.placement.act(geometry.geometry.aabb_center),
                    geometry.geometry.aabb_radius,
                )
                for geometry in self._geometry.geometryObjects
                if geometry.parentJoint == joint
            ]
            if joint < model.nq:
                spheres.append((model.jointPlacements[joint + 1].translation, rest))
            levers[joint - 1] = max(
                float(np.linalg.norm(np.cross(axis, centre))) + radius for centre, radius in spheres
            )
            rest = max(float(np.linalg.norm(centre)) + radius for centre, radius in spheres)
        return read_only(levers)

    def collides(self, q: Array) -> np.ndarray:
        """Return which configurations in [rad], shape (n, 6), collide; shape (n,) of bool."""
        blocks = [self._look(q[first : first + BLOCK]) for first in range(0, len(q), BLOCK)]
        return np.concatenate(blocks) if blocks else np.zeros(0, dtype=bool)

    def first_colliding(self, q: Array) -> int:
        """Return which configuration in [rad], shape (n, 6), is the first to collide, n for none.

        Those behind it are not asked about.
        """
        begin, count = 0, FIRST_BLOCK
        while begin < len(q):
            hits = self._look(q[begin : begin + count])
            if hits.any():
                return begin + int(hits.argmax())
            begin, count = begin + count, 2 * count
        return len(q)

    def _look(self, q: Array) -> np.ndarray:
        """Return which configurations collide, as `collides` does."""
        near, found = self._separation.near_or_met(
            q, self._enough, self._enough[None], self._surely
        )
        for k in self._looked_at(near.any(axis=1) & ~found):
            found[k] = next(self._hits(q[k], near[k]), None) is not None
        return found

    def _looked_at(self, doubtful: np.ndarray) -> list[int]:
        """Return which configurations coal is to look at, and count the work of all."""
        found: list[int] = doubtful.nonzero()[0].tolist()
        self._work[0] += A_CALL + TOLD * len(doubtful) + len(found)
        return found

    def collides_throughout(self, q: Array, turned: Array) -> np.ndarray:
        """Return which configurations collide, and still do however little further they turn.

        Two bodies do not come apart by more than the joints between them turn times their levers.
        Those that would have to sink into each other for it to be sure are left out where one of
        them is a mesh: that is not looked for.

        Args:
            q: In [rad], shape (n, 6).
            turned: How far each joint may turn from there in [rad], shape (n, 6).
        """
        apart = turned @ self._separation.levers.T
        near, stay = self._separation.near_or_met(
            q, self._enough, self._enough - apart, self._surely - apart
        )
        for k in self._looked_at(near.any(axis=1) & ~stay):
            stay[k] = self._stay(q[k], near[k], apart[k])
        return stay

    def _stay(self, q: Array, near: np.ndarray, apart: Array) -> bool:
        """Return whether one of the pairs marked collides even with so much less clearance."""
        self.place(q)
        for index in np.flatnonzero(near).tolist():
            request = self._geometry_data.collisionRequests[index]
            margin = request.security_margin
            if margin < apart[index] and self._has_mesh[index]:
                continue
            request.security_margin = margin - float(apart[index])
            hit = pin.computeCollision(self._geometry, self._geometry_data, index)
            request.security_margin = margin
            if hit:
                return True
        return False

    def colliding_pairs(self, q: Array) -> list[BodyPair]:
        """Return the names of every pair in collision at one configuration, shape (6,)."""
        near = self._separation.near(q[None], self._enough)[0]
        return list(dict.fromkeys(self._pairs[index] for index in self._hits(q, near)))

    def _hits(self, q: Array, near: np.ndarray) -> Iterator[int]:
        """Yield which of the pairs marked, shape (p,), collide at a configuration."""
        self.place(q)
        for index in near.nonzero()[0].tolist():
            if pin.computeCollision(self._geometry, self._geometry_data, index):
                yield index

    def separation(self, indices: np.ndarray) -> Separation:
        """Return what bounds the distances of some pairs, given by their indices, shape (p,)."""
        pairs = [self._geometry.collisionPairs[int(index)] for index in indices]
        return Separation(self._bodies, np.array([(pair.first, pair.second) for pair in pairs]))

    @property
    def kept_apart(self) -> np.ndarray:
        """Indices of the pairs that have to keep a distance, not only not to touch."""
        return np.flatnonzero(self._needed > 0.0)

    def pair(self, index: int) -> BodyPair:
        """Return the names of a pair."""
        return self._pairs[index]

    def place(self, q: Array) -> None:
        """Bring the solids to where they are at one configuration in [rad], shape (6,)."""
        pin.updateGeometryPlacements(
            self._model, self._data, self._geometry, self._geometry_data, q
        )

    def distance(self, index: int) -> float:
        """Return how far a pair is apart as placed in [m], 0 or less in collision."""
        return float(pin.computeDistance(self._geometry, self._geometry_data, index).min_distance)

    def nearest_points(self, index: int) -> Array:
        """Return where a pair was nearest when last measured, base frame, [m], shape (2, 3)."""
        found = self._geometry_data.distanceResults[index]
        places = np.array([found.getNearestPoint1(), found.getNearestPoint2()])
        return transform(self._T_base_world, places)


def _begin_anew(data: pin.GeometryData) -> None:
    """Have coal begin each look as if it was the first.

    pinocchio has it begin where the last one ended, and the last digits of an answer then depend on
    what was looked at before: a configuration at its margin was free once and in collision once.
    """
    with warnings.catch_warnings():
        # there is no other switch yet for what pinocchio has switched on
        warnings.simplefilter("ignore", DeprecationWarning)
        for request in (*data.collisionRequests, *data.distanceRequests):
            request.enable_cached_gjk_guess = False
