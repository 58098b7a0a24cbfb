"""Where a motion over the wheel leaves the contact model between two of its configurations.

The joint line from one to the next bows, and the places that it passes do not lie on one line
either: the error may be larger there than at both, most of all where cutter points are far apart.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from opl.cell.robot import forward_kinematics
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array, inverse
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import MM_PER_M, ContactWheel
from opl.motion.line_error import LEVER, ROLLS, SLIDES
from opl.motion.motion import Motion

BETWEEN = np.array([0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875])  # of the way, looked at
# of the error allowed: lines that can bow no more are not looked at; where lines are chosen, as
# much is left at both ends
NO_BOW = 0.02


def bowed_lines(
    cell: WorkCell, points: CutterPoints, motion: Motion, allowed: float
) -> list[tuple[int, int]]:
    """Return the lines on the wheel that are farther off between places than is allowed.

    Places and contact positions between two configurations are taken to change evenly, and lines
    that can bow by no more than `NO_BOW` of what is allowed are not looked at.

    Args:
        cell: The cell.
        points: The cutter points.
        motion: The motion, those not written on the lines of those that are.
        allowed: Largest error in [m], angles counted along `LEVER`.

    Returns:
        The written configurations at both ends of each, by their indices, ascending.
    """
    on_wheel, index = motion.on_wheel, motion.pass_index
    goes_on = on_wheel[:-1] & on_wheel[1:] & (index[:-1] == index[1:])
    before = np.flatnonzero(goes_on & (_most_bowed(cell, motion) > NO_BOW * allowed))
    q = _between(motion.q, before)
    place, t = _between(motion.cutter_point, before), _between(motion.contact_position, before)
    Ts_base_place = (
        forward_kinematics(cell.robot, q) @ cell.T_flange_workpiece @ points.frames_at(place)
    )
    Ts_contact_place = inverse(cell.wheel.T_base_contact(t)) @ Ts_base_place
    off = off_contact(cell.wheel, Ts_contact_place, t)
    bowed = before[(off > allowed).any(axis=1)]
    line = np.unique(np.searchsorted(motion.positions, bowed, side="right") - 1)
    ends = motion.positions[line], motion.positions[line + 1]
    return list(zip(*(end.tolist() for end in ends), strict=True))


def _most_bowed(cell: WorkCell, motion: Motion) -> Array:
    """Return how far off lines from each configuration to the next may bow in [m], shape (n - 1,).

    Of joint lines as if all joints were as far from the contact as the base is, and of the contact
    rolling about an edge.
    """
    reach = float(np.linalg.norm(cell.wheel.T_base_contact(np.zeros(1))[0, :3, 3]))
    turned = np.abs(np.diff(motion.q, axis=0)).sum(axis=1)
    rolled = np.deg2rad(np.abs(np.diff(motion.contact_position)))
    return np.asarray((reach * turned**2 + cell.wheel.radius * rolled**2) / 8.0)


def off_contact(wheel: ContactWheel, Ts_contact_place: Array, t: Array) -> Array:
    """Return how far frames are from contact frames in [m], shape (...), small angles by `LEVER`.

    The frames are seen from the contact frames at t, shape (..., 4, 4); the contact may slide or
    roll on from there.
    """
    R = Ts_contact_place[..., :3, :3]
    turned = R[..., [2, 0, 1], [1, 2, 0]] - R[..., [1, 2, 0], [2, 0, 1]]
    off = np.concatenate([Ts_contact_place[..., :3, 3], LEVER / 2.0 * turned], axis=-1)
    which, room = freedom(wheel, t)
    free = np.take_along_axis(off, which[..., None], axis=-1)
    left = free - np.clip(free, room[..., :1], room[..., 1:])
    np.put_along_axis(off, which[..., None], left, axis=-1)
    return np.asarray(np.linalg.norm(off, axis=-1))


def freedom(wheel: ContactWheel, t: Array) -> tuple[NDArray[np.int64], Array]:
    """Return what the contact may do at contact positions, and how far either way.

    `SLIDES` or `ROLLS`, shape (...), and distances in [m], angles along `LEVER`, shape (..., 2).
    """
    flat, last = wheel.flat_end, wheel.last_position
    rolls = np.abs(t) > flat
    sliding = np.stack([t - flat, t + flat], axis=-1) / MM_PER_M
    first, beyond = np.where(t > 0.0, flat, -last), np.where(t > 0.0, last, -flat)
    rolling = np.deg2rad(np.stack([first - t, beyond - t], axis=-1)) * LEVER
    return np.where(rolls, ROLLS, SLIDES), np.where(rolls[..., None], rolling, sliding)


def _between(values: Array, before: NDArray[np.intp]) -> Array:
    """Return values between those at some configurations and at the next, shape (n, k, ...)."""
    here, there = values[before][:, None], values[before + 1][:, None]
    share = BETWEEN.reshape(-1, *(1,) * (values.ndim - 1))
    return np.asarray(here + share * (there - here))
