"""Matrices that make the same motion at another place of joint space.

The other flip of the wrist mirrors one joint and shifts two; a full turn of a wrist axis shifts
one. The joint ranges stay the same, the distances from the limits and the collisions may not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from opl.cell.robot import Robot
from opl.cell.spherical_wrist import SphericalWristArm
from opl.cell.workcell import WorkCell
from opl.files.kernels import kernel
from opl.geometry.frames import Array
from opl.planning.nodes import NodeMatrix
from opl.planning.open_matrix import OpenMatrix, Track
from opl.planning.turned import Moved

ROUNDING = 1e-9  # of full turns
SAME_SUM = 1e-6  # [rad] two tracks whose joint range sums differ by less are equally good


def everywhere(
    cell: WorkCell,
    t: Array,
    q: Array,
    chosen: np.ndarray,
    flips: Sequence[tuple[np.ndarray, Array, Array]],
) -> list[NodeMatrix]:
    """Return the matrices that make some postures anywhere within the limits.

    Those farthest from the limits first.

    Args:
        cell: The cell.
        t: Contact positions of each place in belt units, shape (n, m).
        q: Postures at them in [rad], shape (n, m, 6).
        chosen: Which of these are made, shape (n, m).
        flips: Of each flip of the wrist the IK branch of each place, shape (n,), and sign and shift
            of the joints, shape (6,).
    """
    robot, index = cell.robot, np.arange(q.shape[1])
    found: list[tuple[float, int, NodeMatrix]] = []
    per_place = chosen.sum(axis=1)
    if not per_place.all():
        return []
    begin, postures = np.cumsum(per_place) - per_place, q[chosen]
    for ik_branch, sign, shift in flips:
        moved = postures * sign + shift
        # every place has a posture at or beyond the lower limit, and one at or before the upper
        low = np.minimum.reduceat(moved, begin).max(axis=0)
        high = np.maximum.reduceat(moved, begin).min(axis=0)
        first = np.ceil((robot.lower - high) / (2.0 * np.pi) - ROUNDING)
        last = np.floor((robot.upper - low) / (2.0 * np.pi) + ROUNDING)
        counts = [np.arange(a, b + 1) for a, b in zip(first, last, strict=True)]
        farthest = moved.min(axis=0), moved.max(axis=0)
        for count in np.stack(np.meshgrid(*counts, indexing="ij"), axis=-1).reshape(-1, 6):
            turns = 2.0 * np.pi * count
            margin = np.minimum(
                farthest[0] + turns - robot.lower, robot.upper - (farthest[1] + turns)
            )
            exists = chosen
            if cell.limits or (margin < 0.0).any():
                within = cell.within_limits(moved + turns)
                if not np.logical_or.reduceat(within, begin).all():
                    continue
                exists = chosen.copy()
                exists[chosen] = within
            near = float((1.0 / np.maximum(margin, 1e-3)).sum())
            made = Moved(q, exists, sign, shift, turns)
            found.append((near, len(found), NodeMatrix(ik_branch, made, t, index)))
    return [nodes for _, _, nodes in sorted(found, key=lambda entry: entry[:2])]


def flipped_alike(robot: Robot, ik_branch: np.ndarray) -> np.ndarray:
    """Return numbers of IK branches, the same for those that differ in the flip of the wrist.

    What moves with the flange moves alike on both, from joint position to joint position as well.
    """
    return ik_branch % 4 if isinstance(robot.arm, SphericalWristArm) else ik_branch


def twins(matrices: list[OpenMatrix], track: Track, robot: Robot) -> list[Track]:
    """Return the tracks with the same contact positions and joint range sum, best margin first.

    The other flip of the wrist, or a full turn of a wrist axis, makes the same motion at another
    distance from the joint limits. ``track`` itself is among them.
    """
    nodes = matrices[track.matrix].nodes
    positions = nodes.position_index[track.rows]
    total = nodes.range_sum(track.rows)
    found = []
    for index, matrix in enumerate(matrices):
        for rows in _followers(matrix.nodes, positions):
            if abs(matrix.nodes.range_sum(rows) - total) < SAME_SUM and matrix.allows(rows):
                q = matrix.nodes.along(rows)
                margins = np.minimum(q - robot.lower, robot.upper - q).min(axis=0)
                nearness = float((1.0 / np.maximum(margins, 1e-3)).sum())
                found.append((nearness, Track(index, rows)))
    found.sort(key=lambda item: item[0])
    return [twin for _, twin in found] or [track]


def _followers(nodes: NodeMatrix, positions: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the tracks of a matrix with given contact positions, one for each turn of the wrist."""
    if len(np.unique(nodes.position_index)) == len(nodes.position_index):
        # one row for each contact position
        row_of = np.full(positions.max() + 1, -1)
        known = nodes.position_index <= positions.max()
        row_of[nodes.position_index[known]] = np.flatnonzero(known)
        rows = row_of[positions]
        if (rows >= 0).all() and nodes.exists[np.arange(len(rows)), rows].all():
            yield rows
        return
    order = np.argsort(nodes.position_index, kind="stable")
    first, end = np.searchsorted(nodes.position_index[order], [positions, positions + 1])
    columns = np.repeat(np.arange(len(positions)), end - first)
    alike = np.concatenate([order[a:b] for a, b in zip(first.tolist(), end.tolist(), strict=True)])
    begin = np.append(0, np.cumsum(end - first))
    for followed in _nearest_on(nodes.at(columns, alike), begin):
        if followed[-1] >= 0:
            yield alike[followed]


@kernel("int64[:,::1](float64[:,::1],int64[::1])", early=True, makes_arrays=True)
def _nearest_on(q, begin):  # type: ignore[no-untyped-def]
    """Return the postures that are nearest from column to column, from each of the first on.

    ``begin`` says where those of each column begin in ``q``; those that are not there are NaN, and
    -1 follows where nothing is near.
    """
    found = np.full((begin[1], len(begin) - 1), -1)
    for start in range(begin[1]):
        here = start
        if np.isnan(q[here, 0]):
            continue
        found[start, 0] = here
        for column in range(1, len(begin) - 1):
            least, nearest = np.inf, -1
            for there in range(begin[column], begin[column + 1]):
                away = np.abs(q[there] - q[here]).sum()
                if away < least:  # never for NaN
                    least, nearest = away, there
            if nearest < 0:
                break
            here = nearest
            found[start, column] = here
    return found
