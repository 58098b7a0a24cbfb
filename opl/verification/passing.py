"""Where on its way from one written configuration to the next a part may be ground.

A cutter point need not be ground where a position is written: mostly a move passes it. Moves near
the wheel are cut into samples, and between two of them a configuration is put in wherever a cutter
point comes nearest to the contact model. What is found there is measured there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array, transform
from opl.geometry.mesh import box_corners
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import ContactWheel
from opl.verification.arm import Arm
from opl.verification.contact import LEVER, contact_positions, near_wheel

STEP = 1e-3  # [m] that no corner of the part's box moves farther from one sample to the next
TURN = np.deg2rad(0.5)  # that no joint turns farther
APART = 0.01  # of a sample: what is nearer to its ends is taken for them
AT_EDGE = 1.5  # belt units from where the flat or the wheel ends: t may change so in a sample
SLIDES, ROLLS, STAYS = 0, 4, -1  # what the contact may do: along x, about y, or neither
NEAR = 2.0  # times what is allowed: what a configuration that is put in is hoped to be off at most


@dataclass(frozen=True, eq=False)
class Samples:
    """Configurations of moves, those that were given among them.

    Attributes:
        q: Joint positions in [rad], shape (n, 6).
        share: Of the given move that each ends, what leads to it from the one before, shape (n,).
        Ts_contact0_workpiece: Where the part is at each, shape (n, 4, 4).
        source: The given configuration that the move ends at, as an index, shape (n,).
        given: Indices of those that were given, in order.
        near: Indices of those at which something may be ground, in order.
    """

    q: Array
    share: Array
    Ts_contact0_workpiece: Array
    source: NDArray[np.intp]
    given: NDArray[np.intp]
    near: NDArray[np.intp]


def sample(
    arm: Arm,
    wheel: ContactWheel,
    points: CutterPoints,
    part_vertices: Array,
    q: Array,
    allowed: float,
) -> Samples:
    """Sample moves where they may grind.

    Args:
        arm: Knows where the part is.
        wheel: The wheel.
        points: The cutter points that may be ground.
        part_vertices: Of the held part in [m], shape (k, 3).
        q: Joint positions in [rad], joined by linear joint interpolation, shape (n, 6).
        allowed: Farthest that a ground point may be from the contact model in [m].
    """
    Ts = _places(arm, wheel, q)
    corners = box_corners(part_vertices)
    at_corners = transform(Ts[:, None], corners)
    moved = np.linalg.norm(np.diff(at_corners, axis=0), axis=-1).max(axis=1, initial=0.0)
    p_contact0 = points.Ts_workpiece_cutter[:, :3, 3]
    away = np.array([np.abs(wheel.signed_distance(transform(T, p_contact0))).min() for T in Ts])
    reach = 1.5 * moved + STEP  # what turns on its way is somewhat longer on it
    close = (away[:-1] <= reach) | (away[1:] <= reach)
    turned = np.abs(np.diff(q, axis=0)).max(axis=1)
    counts = np.where(close, np.maximum(np.ceil(np.maximum(moved / STEP, turned / TURN)), 1), 1)
    move = np.repeat(np.arange(1, len(q)), counts.astype(int))
    step = np.arange(len(move)) - np.searchsorted(move, move) + 1
    at = np.concatenate([[0.0], move - 1 + step / counts[move - 1]])  # whole where given
    at, Ts = _with(arm, wheel, q, np.arange(len(q)).astype(float), Ts, at)
    put_in = _passed(wheel, points, Ts, at, np.flatnonzero(close), allowed)
    at, Ts = _with(arm, wheel, q, at, Ts, np.union1d(at, put_in))
    source = np.ceil(at).astype(np.intp)
    ends = np.concatenate([[False], close])
    near = ends[source] | (at == source) & np.concatenate([close, [False]])[source]
    return Samples(
        _on_lines(q, at),
        np.diff(at, prepend=0.0),
        Ts,
        source,
        np.flatnonzero(at == source),
        np.flatnonzero(near),
    )


def _places(arm: Arm, wheel: ContactWheel, q: Array) -> Array:
    return np.asarray(np.linalg.solve(wheel.T_base_contact0, arm.parts_at(q)))


def _on_lines(q: Array, at: Array) -> Array:
    """Return the configurations at fractional indices; at whole ones they are those given."""
    before = np.minimum(at.astype(int), len(q) - 1)
    after = np.minimum(before + 1, len(q) - 1)
    return np.asarray(q[before] + (at - before)[:, None] * (q[after] - q[before]))


def _with(
    arm: Arm, wheel: ContactWheel, q: Array, known: Array, Ts: Array, at: Array
) -> tuple[Array, Array]:
    """Return fractional indices and where the part is there; for the known ones that is known."""
    found = np.empty((len(at), 4, 4))
    old = np.isin(at, known)
    found[old] = Ts[np.searchsorted(known, at[old])]
    found[~old] = _places(arm, wheel, _on_lines(q, at[~old]))
    return at, found


def _passed(
    wheel: ContactWheel,
    points: CutterPoints,
    Ts_contact0_workpiece: Array,
    at: Array,
    close: NDArray[np.intp],
    allowed: float,
) -> Array:
    """Return where between two samples cutter points come nearest to the contact model.

    Not where one keeps to it from sample to sample: a flat part of a surface on the flat.
    """
    passed = np.flatnonzero(np.isin(np.ceil(at[1:]).astype(int) - 1, close))
    within = STEP + NEAR * allowed
    number, point = near_wheel(wheel, points, Ts_contact0_workpiece[passed], within)
    k, Ts = passed[number], points.Ts_workpiece_cutter[point]
    start, end = Ts_contact0_workpiece[k] @ Ts, Ts_contact0_workpiece[k + 1] @ Ts
    t = contact_positions(wheel, (start + end) / 2.0)
    on_flat = np.abs(t) <= wheel.flat_end
    freedom = np.where(on_flat, SLIDES, ROLLS)
    share, good = _nearest(wheel, start, end, t, freedom, allowed)
    # beside the end of the flat it may slide at one end of the way and roll at the other
    beside = np.flatnonzero(np.abs(np.abs(t) - wheel.flat_end) <= AT_EDGE)
    # next to the last contact position it may slide or roll no farther
    ending = np.flatnonzero(np.abs(t) >= wheel.last_position - AT_EDGE)
    ends = (
        (beside, wheel.flat_end, np.where(on_flat[beside], ROLLS, SLIDES)),
        (ending, wheel.last_position, np.full(len(ending), STAYS)),
    )
    before, shares = [k[good]], [share[good]]
    for own, t_end, other in ends:
        at_end = np.copysign(t_end, t[own])
        share, good = _nearest(wheel, start[own], end[own], at_end, other, allowed)
        before.append(k[own[good]])
        shares.append(share[good])
    k, share = np.concatenate(before), np.concatenate(shares)
    return np.asarray(at[k] + share * (at[k + 1] - at[k]))


def _nearest(
    wheel: ContactWheel,
    start: Array,
    end: Array,
    t: Array,
    freedom: NDArray[np.int64],
    allowed: float,
) -> tuple[Array, NDArray[np.bool_]]:
    """Return where on their way frames come nearest to the contact model.

    Args:
        wheel: The wheel.
        start: Frames in contact frame 0, shape (n, 4, 4).
        end: Where they come to.
        t: Contact positions near by, shape (n,).
        freedom: What the contact may do there: `SLIDES`, `ROLLS` or `STAYS`, shape (n,).
        allowed: Farthest in [m] that one may be from the contact model.

    Returns:
        Fractions of the way, not limited to it, and which of them are to be looked at: between the
        ends, near to the model, and not within what is allowed at both ends; each of shape (n,).
    """
    Ts_contact0_contact = wheel.T_contact0_contact(t)
    first, last = (_off(Ts_contact0_contact, one) for one in (start, end))
    moves = np.flatnonzero(freedom != STAYS)
    for one in (first, last):
        one[moves, freedom[moves]] = 0.0
    way = last - first
    length = np.square(way).sum(axis=1)
    share = -(first * way).sum(axis=1) / np.where(length > 0.0, length, 1.0)
    nearest = np.linalg.norm(first + share[:, None] * way, axis=1)
    kept = np.maximum(np.linalg.norm(first, axis=1), np.linalg.norm(last, axis=1)) <= allowed
    good = (share > APART) & (share < 1.0 - APART) & (nearest <= NEAR * allowed) & ~kept
    return share, good


def _off(Ts_contact0_contact: Array, Ts_contact0_cutter: Array) -> Array:
    """Return how far frames are from contact frames, seen from those: [m], shape (n, 6).

    Angles count along `LEVER`.
    """
    R = Ts_contact0_contact[:, :3, :3]
    apart = Ts_contact0_cutter[:, :3, 3] - Ts_contact0_contact[:, :3, 3]
    turn = 0.5 * np.cross(R, Ts_contact0_cutter[:, :3, :3], axis=1).sum(axis=2)
    both = np.stack([apart, LEVER * turn], axis=1)
    return np.asarray(np.einsum("nji,nkj->nki", R, both).reshape(-1, 6))
