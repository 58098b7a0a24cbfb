"""Contact frame 0 of a wheel from points that the robot touched with a calibrated tip.

Each kind of point has its place in contact frame 0, where z points into the wheel and x along
its axle to the left, as seen from the front with y up:

    left_edge, right_edge   corner of rim and side, at the height where the part shall touch
    front                   on the rim, at the height where the part shall touch
    axle                    on the axis of the axle, such as the centre hole of its end
    rim                     anywhere on the rim
    left_side, right_side   anywhere on the flat side of the wheel

Three points are enough: left_edge, right_edge, axle. They check the wheel's width and radius, but
turn the axle by a degree for each millimetre that an edge is off. Better: three points far apart on
one side, three or more around the rim, one in front. All points count alike in a least-squares fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from opl.geometry.frames import Array, inverse, pose, rotation_angle, transform
from opl.geometry.rotations import from_rotation_vector, turn_of_change

KINDS = ("left_edge", "right_edge", "front", "axle", "rim", "left_side", "right_side")
DEGREES_OF_FREEDOM = 6
# what a point may be off before it moves the frame by more than a hundred times as much
_FEEBLE = 0.01
# [m], [rad] places of the wheel that are no nearer to each other are two
_OTHER_PLACE = 1e-3
_MOTIONS = [f"{how} {axis}" for how in ("turned about", "moved along") for axis in "xyz"]


class TouchedError(ValueError):
    """Touched points do not determine where the wheel is."""


@dataclass(frozen=True)
class TouchedFit:
    """Where the wheel is, by its touched points.

    Attributes:
        T_base_contact0: Contact frame 0, in the frame of the points, shape (4, 4).
        labels: Name of each point: its kind and, from 1, its number.
        residuals: How far each point is from where it should be in [m], shape (n,).
        spare: Equations more than needed; with none, residuals are 0 whatever was touched.
        origin_per_error: Largest shift of the origin per error of the points, both in [m].
        turn_per_error: Largest turn of the frame per error of the points in [rad/m].
    """

    T_base_contact0: Array
    labels: tuple[str, ...]
    residuals: Array
    spare: int
    origin_per_error: float
    turn_per_error: float


def fit_touched(
    points: Mapping[str, Sequence[Sequence[float]]],
    width: float,
    radius: float,
    largest_residual: float,
) -> TouchedFit:
    """Fit contact frame 0 to touched points.

    Args:
        points: Positions of the tip in [m] by kind, one of `KINDS`.
        width: Of the wheel in [m].
        radius: Of the wheel where it was touched in [m].
        largest_residual: A point that is farther from its place is an error, in [m].

    Raises:
        TouchedError: If the points do not fix the frame, contradict each other, or fit at two
            places.
    """
    rows = _Equations(points, width, radius)
    if rows.count < DEGREES_OF_FREEDOM:
        raise TouchedError(
            f"{rows.count} equations from {len(rows.labels)} points, {DEGREES_OF_FREEDOM} are "
            "needed: touch left_edge, right_edge and axle, or more"
        )
    fits = [_fit(rows, start) for start in _starts(rows)]
    off = [rows.residuals(rows.seen_from(T_base_contact0)) for T_base_contact0 in fits]
    best = int(np.argmin([np.square(residuals).sum() for residuals in off]))
    T_base_contact0, residuals = fits[best], off[best]
    p_contact0 = rows.seen_from(T_base_contact0)
    # an undetermined frame is refused first: that it fits may be chance
    jacobian = rows.jacobian(p_contact0)
    scale = np.array([radius] * 3 + [1.0] * 3)
    _, strength, directions = np.linalg.svd(jacobian / scale)
    if strength[-1] < _FEEBLE:
        # about the axle it is both turned and moved by as much: told is the turn
        free = _MOTIONS[int(np.round(np.abs(directions[-1]), 6).argmax())]
        raise TouchedError(f"the points leave open how far the wheel is {free} of contact frame 0")
    worst = int(np.round(residuals, 9).argmax())  # of equal ones the first
    if residuals[worst] > largest_residual:
        listed = ", ".join(
            f"{label} {1e3 * away:.2f}" for label, away in zip(rows.labels, residuals, strict=True)
        )
        raise TouchedError(
            f"{rows.labels[worst]} is {1e3 * residuals[worst]:.2f} mm from where the other points "
            f"put it, {1e3 * largest_residual:g} mm allowed; residuals in mm: {listed}"
        )
    for other, residuals_there in zip(fits, off, strict=True):
        apart = max(
            float(np.linalg.norm(other[:3, 3] - T_base_contact0[:3, 3])),
            radius * float(rotation_angle(other, T_base_contact0)),
        )
        if apart > _OTHER_PLACE and residuals_there.max() <= largest_residual:
            raise TouchedError(
                "the points fit at two places of the wheel; touch the axle, or one more point"
            )
    errors = np.linalg.pinv(jacobian)
    return TouchedFit(
        T_base_contact0,
        rows.labels,
        residuals,
        rows.count - DEGREES_OF_FREEDOM,
        origin_per_error=float(np.linalg.norm(errors[3:], ord=2)),
        turn_per_error=float(np.linalg.norm(errors[:3], ord=2)),
    )


class _Equations:
    """The equations of the points: each row one value, 0 where the frame fits."""

    def __init__(
        self, points: Mapping[str, Sequence[Sequence[float]]], width: float, radius: float
    ) -> None:
        self._half = half = width / 2.0
        # offsets of x, y, z from the place of the point; None where it is free
        self._places: dict[str, tuple[float | None, ...]] = {
            "left_edge": (half, 0.0, 0.0),
            "right_edge": (-half, 0.0, 0.0),
            "front": (None, 0.0, 0.0),
            "axle": (None, 0.0, radius),
            "rim": (None, None, None, radius),
            "left_side": (half, None, None),
            "right_side": (-half, None, None),
        }
        self._radius = radius
        kinds = [kind for kind in KINDS for _ in points.get(kind, ())]
        numbers = [number for kind in KINDS for number, _ in enumerate(points.get(kind, ()), 1)]
        self.labels = tuple(f"{kind} {n}" for kind, n in zip(kinds, numbers, strict=True))
        self._on_rim = np.isin(kinds, ("front", "rim"))
        self._on_side = np.isin(kinds, ("left_side", "right_side"))
        touched = [p_base for kind in KINDS for p_base in points.get(kind, ())]
        self.p_base: Array = np.array(touched, dtype=float).reshape(-1, 3)
        rows = [
            (point, axis, value)
            for point, kind in enumerate(kinds)
            for axis, value in enumerate(self._places[kind])
            if value is not None
        ]
        # axis 3 stands for the distance from the axle
        self.of_point, self.axis = np.array([row[:2] for row in rows], dtype=int).reshape(-1, 2).T
        self.target = np.array([value for _, _, value in rows])

    @property
    def count(self) -> int:
        return len(self.target)

    def normals(self, p_contact0: Array) -> Array:
        """Return the direction in which each value grows, shape (count, 3)."""
        radial = p_contact0[self.of_point] - [0.0, 0.0, self._radius]
        radial[:, 0] = 0.0
        radial /= np.maximum(np.linalg.norm(radial, axis=1, keepdims=True), 1e-12)
        return np.asarray(np.where((self.axis == 3)[:, None], radial, np.eye(4, 3)[self.axis]))

    def values(self, p_contact0: Array) -> Array:
        """Return how far each row is from 0 in [m], shape (count,)."""
        p = p_contact0[self.of_point]
        from_axle = np.hypot(p[:, 1], p[:, 2] - self._radius)
        measured = np.column_stack([p, from_axle])
        return np.asarray(measured[np.arange(self.count), self.axis] - self.target)

    def jacobian(self, p_contact0: Array) -> Array:
        """Return the change of each value with turns about and moves along x, y, z: (count, 6)."""
        normals = self.normals(p_contact0)
        return np.hstack([np.cross(normals, p_contact0[self.of_point]), -normals])

    def seen_from(self, T_base_contact0: Array) -> Array:
        """Return the points in contact frame 0, shape (n, 3)."""
        return transform(inverse(T_base_contact0), self.p_base)

    def residuals(self, p_contact0: Array) -> Array:
        """Return how far each point is from its place in [m], shape (n,).

        A point on the rim lies within the width, one on a side within the radius. That is no
        equation, but distinguishes the two sides of a plane.
        """
        squares = np.bincount(self.of_point, np.square(self.values(p_contact0)), len(self.labels))
        beside = np.abs(p_contact0[:, 0]) - self._half
        beyond = np.hypot(p_contact0[:, 1], p_contact0[:, 2] - self._radius) - self._radius
        outside = np.select([self._on_rim, self._on_side], [beside, beyond], 0.0)
        return np.asarray(np.sqrt(squares + np.square(np.maximum(outside, 0.0))))


def _starts(rows: _Equations) -> list[Array]:
    """Return 24 poses to start from: frames along the axes, their origins from the points."""
    starts = []
    for order, signs in product(
        ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)),
        product((1.0, -1.0), repeat=3),
    ):
        R = np.eye(3)[list(order)] * np.array(signs)[:, None]
        if np.linalg.det(R) < 0.0:
            continue
        plain = rows.axis < 3
        normals = np.eye(3)[rows.axis[plain]] @ R.T
        wanted = np.einsum("ij,ij->i", normals, rows.p_base[rows.of_point[plain]])
        p = np.linalg.lstsq(normals, wanted - rows.target[plain], rcond=None)[0]
        starts.append(pose(R, p))
    return starts


def _fit(rows: _Equations, T_base_start: Array) -> Array:
    """Return the pose that a least-squares fit ends at."""
    from scipy.optimize import least_squares

    def moved(change: Array) -> Array:
        turn = from_rotation_vector(change[:3])
        return T_base_start @ pose(turn, change[3:])

    def values(change: Array) -> Array:
        return rows.values(rows.seen_from(moved(change)))

    def slopes(change: Array) -> Array:
        T_base_moved = moved(change)
        own = rows.jacobian(rows.seen_from(T_base_moved))  # about and along its own axes
        R = T_base_start[:3, :3].T @ T_base_moved[:3, :3]
        return np.hstack([own[:, :3] @ turn_of_change(change[:3]), own[:, 3:] @ R.T])

    fit = least_squares(values, np.zeros(6), slopes, method="lm", xtol=1e-12, ftol=1e-15)
    return moved(fit.x)
