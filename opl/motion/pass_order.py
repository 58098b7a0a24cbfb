"""In which order and direction passes take the least time between them, from home to home.

The order has to be known before a path is searched, and to whoever proves its program. So it is
reckoned with the contact in the middle of the wheel, from cell and passes alone: the search moves
the contact elsewhere, and the times with it. No order changes which joints a pass needs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.cell.full_turns import nearest_turn, principal
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.geometry.order import least_tour, shortest_links
from opl.motion.process_settings import ProcessSettings


def quickest_order(
    cell: WorkCell, process: ProcessSettings, passes: Sequence[Array]
) -> list[tuple[int, int]]:
    """Return an order of passes with little time of straight free moves, home included.

    Where no posture reaches all passes in the middle of the wheel, the shortest links of the part
    are taken instead.

    Args:
        cell: The cell.
        process: Where home is, and whether the robot comes there between passes.
        passes: Cutter frames of each pass in order, shapes (k, 4, 4).

    Returns:
        The passes, each with 1 if it is travelled forwards and -1 if backwards; for few passes
        none takes less time, see `least_tour`.
    """
    ends = _ends_of(cell, process.home, passes)
    if ends is None:
        return shortest_links(passes)
    home = _seconds(cell, ends, process.home)
    links = home[:, None] + home if process.home_between else _seconds(cell, ends[:, None], ends)
    return least_tour(links, home)


def _seconds(cell: WorkCell, q: Array, other: Array) -> Array:
    """Return the time of joint moves at top speed in [s]."""
    return np.asarray((np.abs(q - other) / cell.robot.max_speed).max(axis=-1))


def _ends_of(cell: WorkCell, home: Array, passes: Sequence[Array]) -> Array | None:
    """Return the configurations at both ends of each pass in the middle of the wheel.

    Of the postures that reach all of them the one within the limits with the least joint range sum,
    its full turns next to home.

    Returns:
        Joint positions in [rad], shape (2 n, 6); None if no posture reaches them.
    """
    frames = np.concatenate(list(passes))
    # the robot's own reference for joints that may be anywhere is where it comes from
    slots = inverse_kinematics(cell.robot.arm, cell.Ts_base_flange(0.0, frames), home)
    cuts = np.cumsum([len(one) for one in passes])[:-1]
    found: list[tuple[bool, float, Array]] = []
    for branch in range(slots.shape[1]):
        if np.isnan(slots[:, branch]).any():
            continue
        tracks, near = [], home
        for q in np.split(slots[:, branch], cuts):
            track = q[0] + np.cumsum(principal(np.diff(q, axis=0, prepend=q[:1])), axis=0)
            middle = track.mean(axis=0)
            tracks.append(track + nearest_turn(middle, near) - middle)
            near = tracks[-1].mean(axis=0)
        whole = np.concatenate(tracks)
        beyond = not bool(cell.within_limits(whole).all())
        ends = np.concatenate([track[[0, -1]] for track in tracks])
        found.append((beyond, float(np.ptp(whole, axis=0).sum()), ends))
    return min(found, key=lambda one: one[:2])[2] if found else None
