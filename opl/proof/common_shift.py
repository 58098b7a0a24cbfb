"""The one shift of the wheel by which a motion would grind as it should.

A wheel that was touched anew, or a program of another cell, moves all contacts alike. What a person
wants to know then is that shift, and not how far each of a hundred contacts is off.

Where a cutter point comes near the contact model, it differs from it by the shift, except for what
its motion and the slide or roll of the contact position can make up for: these directions are taken
out of the difference. The shift is the least squares solution of all that is left, each cutter
point at the sample of the motion where least is left of it. What no cutter point shows, such as a
shift along the axle of a wheel that touches with its flat only, stays zero.

Nothing is said of a shift unless the motion, recognised anew beside the shifted wheel, grinds every
cutter point as the contact model says.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from opl.cell.robot import forward_kinematics
from opl.cell.workcell import WorkCell
from opl.findings import Finding, Level
from opl.geometry.frames import Array, inverse, pose, transform
from opl.geometry.mesh import box_corners
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import ContactWheel
from opl.verification.contact import contact_positions
from opl.verification.kinematic_checks import missing_points
from opl.verification.recognise import Rule, recognise

FARTHEST = 1.5e-3  # [m] that contacts are looked for away from the contact model
STEP = 2e-3  # [m] that no cutter point moves farther from one sample to the next
LEVER = 0.05  # [m] from the ground point; weighs angles against distances
SLOPE = np.deg2rad(6.0)  # that frames may be turned apart to be compared
USUAL = 5e-5  # [m]: what is left over and much larger counts less
ROUNDS = 12
SEEN = 0.02  # of a direction, on average over the cutter points, to be observable


@dataclass(frozen=True, eq=False)
class Shift:
    """Where the wheel would have to be.

    Attributes:
        p_contact0: How far the wheel moves, seen from contact frame 0, in [m], shape (3,).
        observed: Unit vectors along which it is seen at all, shape (k, 3).
    """

    p_contact0: Array
    observed: Array


@dataclass(frozen=True, eq=False)
class _Near:
    """Cutter points near the wheel at samples of a motion; k items each.

    Attributes:
        point: Index of the cutter point.
        off: From the contact model, angles along `LEVER`, in the contact frame, shape (k, 6).
        way: How that changes to the next sample, shape (k, 6).
        shown: What a shift of the wheel seen from contact frame 0 makes of it, shape (k, 6, 3).
    """

    point: NDArray[np.intp]
    off: Array
    way: Array
    shown: Array


def common_shift(
    cell: WorkCell,
    points: CutterPoints,
    q: Array,
    duration: Array,
    stations: NDArray[np.intp],
    rule: Rule,
) -> Finding | None:
    """Return the shift of the wheel that explains why a motion does not grind as it should.

    The arguments are those of `recognise`. None if there is no such shift.
    """
    shift = fit_shift(cell, points, q)
    if shift is None:
        return None
    wheel = cell.wheel
    T_base_contact0 = wheel.T_base_contact0 @ pose(np.eye(3), shift.p_contact0)
    there = replace(cell, wheel=replace(wheel, T_base_contact0=T_base_contact0))
    found = recognise(there, points, q, duration, stations, rule)
    if found.findings or missing_points(points, found.timed.motion):
        return None
    message = (
        f"{_in_words(-shift.p_contact0)}: where the program would have it, all "
        f"{len(points)} cutter points are ground within {1e3 * rule.max_contact_error:g} mm of "
        "the contact model"
    )
    hidden = [f"{'xyz'[k]}" for k in range(3) if np.linalg.norm(shift.observed[:, k]) < 0.5]
    message += f"; along {' and '.join(hidden)} no contact shows it" if hidden else ""
    return Finding(Level.ERROR, "contact", "wheel", message)


def _in_words(shift: Array) -> str:
    """Return where the wheel is instead of where it was planned; z points from the part into it."""
    x, y, z = np.round(1e3 * shift, 2) + 0.0  # no -0.00
    length = 1e3 * np.linalg.norm(shift)
    where = "nearer than planned" if z < 0.0 else "farther away than planned"
    if abs(z) <= 0.5 * length:
        where = "aside of where it was planned"
    place = f"x {x:.2f}, y {y:.2f}, z {z:.2f} mm in contact frame 0"
    return f"the wheel seems {length:.2f} mm {where} ({place})"


def fit_shift(cell: WorkCell, points: CutterPoints, q: Array) -> Shift | None:
    """Return the shift of the wheel at which a motion comes nearest to grinding all cutter points.

    Args:
        cell: The cell.
        points: The cutter points.
        q: Joint positions in [rad], joined by linear joint interpolation, shape (n, 6).

    Returns:
        The shift, None where fewer than half of the cutter points come near the wheel. Nothing is
        said of how well it fits.
    """
    near = _near(cell, points, q)
    if len(np.unique(near.point)) * 2 < len(points):
        return None
    shift, seen = np.zeros(3), np.zeros((3, 3))
    for _ in range(ROUNDS):
        left, shown = _left_over(near, shift)
        weight = 1.0 / (1.0 + np.square(left / USUAL).sum(axis=1))
        normal = np.einsum("k,kij,kil->jl", weight, shown, shown) / weight.sum()
        pull = np.einsum("k,kij,ki->j", weight, shown, left) / weight.sum()
        values, vectors = np.linalg.eigh(normal)
        seen = vectors[:, values > SEEN].T
        shift = shift + seen.T @ ((seen @ pull) / values[values > SEEN])
    return Shift(shift, seen)


def _left_over(near: _Near, shift: Array) -> tuple[Array, Array]:
    """Return what is left of the difference of each cutter point, at the sample with least of it.

    Returns:
        What is left of it after a shift in [m], shape (n, 6), and what a further shift shows of
        itself in it, shape (n, 6, 3).
    """
    off = near.off - near.shown @ shift
    length = np.linalg.norm(near.way, axis=1, keepdims=True)
    along = np.divide(near.way, length, out=np.zeros_like(near.way), where=length > 0.0)
    passed = np.abs(np.einsum("ki,ki->k", off, along)) <= length[:, 0]
    left = off - along * np.einsum("ki,ki->k", off, along)[:, None]
    amount = np.where(passed, np.linalg.norm(left, axis=1), np.inf)
    order = np.lexsort((amount, near.point))
    first = order[np.unique(near.point[order], return_index=True)[1]]
    first = first[np.isfinite(amount[first])]
    shown = near.shown[first]
    shown = shown - along[first][:, :, None] * np.einsum("ki,kij->kj", along[first], shown)[:, None]
    return left[first], shown


def _near(cell: WorkCell, points: CutterPoints, q: Array) -> _Near:
    wheel, Ts_workpiece_cutter = cell.wheel, points.Ts_workpiece_cutter
    T_contact0_base = inverse(wheel.T_base_contact0)
    Ts = T_contact0_base @ forward_kinematics(cell.robot, q) @ cell.T_flange_workpiece
    p_workpiece = Ts_workpiece_cutter[:, :3, 3]
    corners = transform(Ts[:, None], box_corners(p_workpiece))
    moved = np.linalg.norm(np.diff(corners, axis=0), axis=-1).max(axis=1)
    away = [np.abs(wheel.signed_distance(transform(T, p_workpiece))).min() for T in Ts]
    close = np.minimum(away[:-1], away[1:]) <= 2.0 * moved + FARTHEST
    found = []
    for k in np.flatnonzero(close):
        share = np.linspace(0.0, 1.0, int(np.ceil(moved[k] / STEP)) + 1)[:, None]
        between = forward_kinematics(cell.robot, q[k] + share * (q[k + 1] - q[k]))
        Ts_contact0_workpiece = T_contact0_base @ between @ cell.T_flange_workpiece
        for T, T_next in pairwise(Ts_contact0_workpiece):
            found.append(_compared(wheel, Ts_workpiece_cutter, T, T_next))
    empty = (np.empty(0, dtype=np.intp), np.empty((0, 6)), np.empty((0, 6)), np.empty((0, 6, 3)))
    columns = zip(empty, *found, strict=True)
    return _Near(*(np.concatenate(column) for column in columns))


def _compared(
    wheel: ContactWheel, Ts_workpiece_cutter: Array, T_contact0_workpiece: Array, T_next: Array
) -> tuple[NDArray[np.intp], Array, Array, Array]:
    """Return the fields of `_Near` at a sample, given where the part is there and at the next."""
    p_contact0 = transform(T_contact0_workpiece, Ts_workpiece_cutter[:, :3, 3])
    point = np.flatnonzero(np.abs(wheel.signed_distance(p_contact0)) <= FARTHEST)
    Ts, Ts_next = (T @ Ts_workpiece_cutter[point] for T in (T_contact0_workpiece, T_next))
    t = contact_positions(wheel, Ts)
    Ts_contact0_contact = wheel.T_contact0_contact(t)
    off, at_next = (_off(Ts_contact0_contact, one) for one in (Ts, Ts_next))
    shown = np.zeros((len(point), 6, 3))
    shown[:, :3] = np.swapaxes(Ts_contact0_contact[:, :3, :3], 1, 2)
    # the contact position slides on the flat, and rolls about an edge
    free = np.arange(len(point)), np.where(np.abs(t) > wheel.flat_end, 4, 0)
    for one in (off, at_next, shown):
        one[free] = 0.0
    alike = np.linalg.norm(off[:, 3:], axis=1) <= LEVER * SLOPE
    return point[alike], off[alike], (at_next - off)[alike], shown[alike]


def _off(Ts_contact0_contact: Array, Ts_contact0_cutter: Array) -> Array:
    """Return how far frames are from contact frames, seen from those, in [m], shape (k, 6)."""
    R = Ts_contact0_contact[:, :3, :3]
    apart = Ts_contact0_cutter[:, :3, 3] - Ts_contact0_contact[:, :3, 3]
    turn = 0.5 * np.cross(R, Ts_contact0_cutter[:, :3, :3], axis=1).sum(axis=2)
    both = np.stack([apart, LEVER * turn], axis=1)
    return np.asarray(np.einsum("kji,knj->kni", R, both).reshape(-1, 6))
