"""How far apart pairs of bodies are at the least, for many configurations in one call.

Along any direction two bodies that do not reach each other are apart by what is between them there,
so a few likely directions give a lower bound of their distance. Boxes and cylinders are taken as
they are, anything else as the box around it.
"""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from opl.cell.separating import separate, separate_parts
from opl.files.kernels import threads_are_allowed
from opl.geometry.frames import Array

MORE = 0.05  # [m] that a bound is improved beyond what is asked: for that long it is left alone
PLAIN = coal.Box, coal.Cylinder  # shapes that are taken as they are
PART = 1024  # configurations that a thread goes through at a time


@dataclass(frozen=True, eq=False)
class Bodies:
    """Solids on a chain of joints.

    Attributes:
        Ts_before_joint: Pose of each joint at angle 0 in the frame of the one before, (j, 4, 4).
        axes: Unit axis of each joint in its own frame, shape (j, 3).
        joint: Of each body the number of the joint that moves it, 0 for none, shape (b,).
        Ts_joint_body: Middle and axes of each body in the frame of that joint, shape (b, 4, 4).
        sizes: Half the edges of a box; radius, half length and -1 of a cylinder about z; in [m],
            shape (b, 3).
        plain: Which are boxes or cylinders, not held by a box, shape (b,).
        levers: How far anything of each body can be from the axis of each joint that moves it, at
            any configuration, in [m]; 0 for the others; shape (b, j).
    """

    Ts_before_joint: Array
    axes: Array
    joint: np.ndarray
    Ts_joint_body: Array
    sizes: Array
    plain: np.ndarray
    levers: Array

    @classmethod
    def of(cls, model: pin.Model, geometry: pin.GeometryModel) -> Bodies:
        """Return the bodies of a model whose joints all turn, one after the other."""
        data = model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        joints = range(1, model.nq + 1)
        Ts = np.array([model.jointPlacements[k].homogeneous for k in joints])
        axes = np.array([data.oMi[k].rotation.T @ data.J[3:, k - 1] for k in joints])
        objects = geometry.geometryObjects
        boxes = [_box(body) for body in objects]
        levers = np.zeros((len(objects), model.nq))
        for lever, body, (T_joint_body, size) in zip(levers, objects, boxes, strict=True):
            # of the middle, or of the origin of the next joint, in the frame of a joint; and how
            # far anything of the body can be from there
            place, rest = T_joint_body[:3, 3], float(np.linalg.norm(np.maximum(size, 0.0)))
            for k in range(body.parentJoint - 1, -1, -1):
                lever[k] = float(np.linalg.norm(np.cross(axes[k], place))) + rest
                rest += float(np.linalg.norm(place))
                place = Ts[k, :3, 3]
        moved_by = np.array([body.parentJoint for body in objects], dtype=np.int64)
        sizes = np.array([size for _, size in boxes])
        plain = np.array([isinstance(body.geometry, PLAIN) for body in objects])
        return cls(Ts, axes, moved_by, np.array([T for T, _ in boxes]), sizes, plain, levers)


class Separation:
    """Lower bounds of the distances of pairs of bodies, from one configuration to the next.

    Since a bound was found, a distance cannot have shrunk by more than the joints between the two
    bodies turned times their levers: what is far apart is left alone for as long as it must be.
    """

    def __init__(self, bodies: Bodies, pairs: np.ndarray) -> None:
        """Begin with nothing known.

        Args:
            bodies: The bodies.
            pairs: Numbers of two bodies each, shape (p, 2).
        """
        self._solids = (
            bodies.Ts_before_joint,
            bodies.axes,
            bodies.joint,
            bodies.Ts_joint_body,
            bodies.sizes,
            bodies.levers,
        )
        pairs = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        # the one that is moved by fewer joints first
        lower_first = bodies.joint[pairs].argsort(axis=1, kind="stable")
        pairs = np.ascontiguousarray(np.take_along_axis(pairs, lower_first, axis=1))
        first, second = pairs.T
        self.plain = bodies.plain[pairs].all(axis=1)  # pairs of plain bodies, shape (p,)
        number = np.arange(len(bodies.axes))
        between = (number >= bodies.joint[first, None]) & (number < bodies.joint[second, None])
        # by how much a pair can come apart while a joint turns by 1 rad, in [m], shape (p, j)
        self.levers = np.where(between, bodies.levers[second], 0.0)
        # one after the other those of which the same joints move one body and not the other
        ends = bodies.joint[pairs]
        order = np.lexsort(ends.T)
        ends = ends[order]
        starts = np.flatnonzero(np.diff(ends, axis=0, prepend=-1).any(axis=1))
        beyond = np.append(starts[1:], len(pairs))[: len(starts)].astype(np.int64)
        groups = np.column_stack([starts, beyond, ends[starts]])
        group_levers = np.array(
            [self.levers[order[a:b]].max(axis=0) for a, b in groups[:, :2]]
        ).reshape(-1, len(bodies.axes))
        self._paired = pairs, order, groups, group_levers
        self._last = np.zeros(len(bodies.axes))
        self._best = np.zeros(len(pairs), dtype=np.int64)  # direction of each pair
        self.apart = np.full(len(pairs), -np.inf)  # at the last configuration, at the least, in [m]

    def near(self, q: Array, enough: Array) -> np.ndarray:
        """Return which pairs may be as near as that; all others are certainly farther apart.

        Args:
            q: Configurations in [rad]; the nearer they follow each other, the faster; shape (n, j).
            enough: Distances of the pairs in [m], shape (p,).

        Returns:
            Shape (n, p) of bool.
        """
        nothing = np.full((1, len(enough)), -np.inf)
        return self.near_or_met(q, enough, enough[None], nothing)[0]

    def near_or_met(
        self, q: Array, enough: Array, closer: Array, surely: Array
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return which pairs may be as near as asked, and at which configurations one surely is.

        What is asked is the same at all configurations or not: ``closer`` and ``surely`` are of
        shape (1, p) or (n, p).

        Args:
            q: Configurations as of `near`.
            enough: What is farther apart than this is left alone for long, in [m], shape (p,).
            closer: Which pairs may be as near as this is told, below 0 if they have to sink into
                each other; no more than ``enough``; in [m].
            surely: Distances that pairs of plain bodies may surely be within in [m], -inf for pairs
                that are not asked about.

        Returns:
            Shape (n, p) of bool, not complete where a pair is as near as asked; shape (n,) of bool.
        """
        near: np.ndarray = np.zeros((len(q), len(self.apart)), dtype=bool)
        met: np.ndarray = np.zeros(len(q), dtype=bool)
        given = (
            np.array(q, dtype=float, order="C"),  # compiled for arrays that can be written to
            self._solids,
            self._paired,
            enough,
            closer,
            surely,
            MORE,
        )
        if len(q) < 2 * PART or not threads_are_allowed():
            separate(*given, self._last, self.apart, self._best, near, met)
            return near, met
        # each part begins with nothing known, whatever the number of threads
        n_parts = -(-len(q) // PART)
        last = np.zeros((n_parts, len(self._last)))
        apart = np.full((n_parts, len(self.apart)), -np.inf)
        best = np.tile(self._best, (n_parts, 1))
        separate_parts(*given, last, apart, best, near, met, PART)
        self._last[:], self.apart[:], self._best[:] = last[-1], apart[-1], best[-1]
        return near, met


def _box(body: pin.GeometryObject) -> tuple[Array, Array]:
    """Return T_joint_body and size of a body as `Bodies` has them."""
    shape = body.geometry
    shape.computeLocalAABB()  # levers rest on it, too
    if isinstance(shape, coal.Cylinder):
        middle, size = np.zeros(3), np.array([shape.radius, shape.halfLength, -1.0])
    else:
        middle, size = shape.aabb_local.center(), np.array(
            [shape.aabb_local.width(), shape.aabb_local.height(), shape.aabb_local.depth()]
        ) / 2.0  # fmt: skip
    placement = body.placement * pin.SE3(np.eye(3), middle)
    return placement.homogeneous, size
