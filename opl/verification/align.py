"""Configurations and cutter points in order: which configuration grinds which cutter point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opl.files.kernels import kernel
from opl.geometry.frames import Array, rotation_angle
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import MM_PER_M
from opl.verification.contact import Touches

MISSED = 100.0  # what a cutter point that is left out costs; all else costs a few units in a pass
TWICE = 2.0  # what a configuration that grinds more than one cutter point costs, within a pass
AT_END = 4.0  # times the distance, where a pass begins or ends: a written position is exact there
ELSEWHERE = 10.0  # what a pass that begins or ends at no written position costs at either end
PASSED = 0.3  # what a cutter point costs that is ground on the way and not where one is written
TOO_SOON = 2.0  # what a second costs by which a cutter point is reached sooner than at the feed
PER_POSITION = 0.01  # cost of a change of t by one belt unit
STEP_SLACK = 0.1  # belt units that t may change beyond the rule: rounding
HORIZON = 4096  # touches looked back at


@dataclass(frozen=True, eq=False)
class Course:
    """The cutter points in order; N items each.

    Attributes:
        pass_index: Pass of each.
        seconds: When each is reached at the feed, from the start of its pass, in [s].
        turned: How far the surface has gone on and turned until there, in belt units: by as much t
            may change although the part hardly moves.
    """

    pass_index: NDArray[np.int64]
    seconds: Array
    turned: Array

    @classmethod
    def of(cls, points: CutterPoints, feed: float) -> Course:
        """Return the course of cutter points at a feed in [m/s]."""
        Ts = points.Ts_workpiece_cutter
        apart = MM_PER_M * np.linalg.norm(np.diff(Ts[:, :3, 3], axis=0), axis=1)
        turned = apart + np.rad2deg(rotation_angle(Ts[:-1], Ts[1:]))
        sums = np.concatenate([[0.0], np.cumsum(turned)])
        return cls(points.pass_index, points.arc_length / feed, sums)


@kernel(
    "void(int64[::1],int64[::1],float64[::1],float64[::1],float64[::1],int64[::1],float64[::1],"
    "float64[::1],boolean[::1],float64,float64[::1],int64[::1])"
)
def _choose(  # type: ignore[no-untyped-def]
    configuration, point, t, time, own, pass_index, at_feed, turned, at_end, max_step, best,
    came_from,
):  # fmt: skip
    """Find for each touch after which one it is cheapest, and what it costs up to there.

    The first five are of the touches, shape (k,), the next four of the cutter points, shape (n,).
    ``best`` is what each touch costs as the first one, and then what it costs; ``came_from`` is -1,
    and then the touch before, shape (k,).
    """
    for m in range(1, len(best)):
        at = point[m]
        for before in range(max(0, m - HORIZON), m):
            last = point[before]
            cost = best[before] + own[m] + MISSED * (at - last - 1)
            if last >= at or cost >= best[m]:  # nothing else costs less than 0
                continue
            apart = configuration[m] - configuration[before]
            if pass_index[at] == pass_index[last]:
                change = abs(t[m] - t[before])
                # on the flat one configuration may grind two cutter points at different t
                allowed = max_step * apart + (turned[at] - turned[last]) + STEP_SLACK
                if apart > 0 and change > allowed:
                    continue
                cost += PER_POSITION * change
                if apart == 0 and not at_end[at]:
                    earlier = came_from[before]
                    if earlier < 0 or configuration[earlier] != configuration[before]:
                        cost += TWICE
                sooner = at_feed[at] - at_feed[last] - (time[m] - time[before])
                cost += TOO_SOON * max(sooner, 0.0)
            elif apart == 0:
                continue
            if cost < best[m]:
                best[m], came_from[m] = cost, before


def align(
    touches: Touches,
    course: Course,
    tolerance: float,
    max_contact_step: float,
    written: NDArray[np.bool_],
    time: Array,
) -> NDArray[np.intp]:
    """Choose touches that grind as many cutter points as can be, once and in order.

    Of several choices the one is taken that lies nearest to the contact model, keeps to the feed
    and moves least over the wheel: a flat part of a surface touches the flat of the wheel in many
    places at once.

    Args:
        touches: Candidates.
        course: The cutter points.
        tolerance: Distance from the contact model in [m] that counts for one unit.
        max_contact_step: Largest change of t between neighbouring configurations of a pass, beyond
            what the surface turns.
        written: Which touches are at a position that is written, shape (k,).
        time: When each touch is, in [s], shape (k,).

    Returns:
        Indices of the chosen touches in order.
    """
    n = len(touches)
    if not n:
        return np.empty(0, dtype=np.intp)
    configuration, point, t = touches.configuration, touches.point, touches.contact_position
    pass_index, at_feed = course.pass_index, course.seconds
    at_end = (np.diff(pass_index, prepend=-1) != 0) | (np.diff(pass_index, append=-1) != 0)
    own = touches.distance / tolerance * np.where(at_end[point], AT_END, 1.0)
    own = own + np.where(written, 0.0, PASSED)
    own = own + np.where(at_end[point] & ~written, ELSEWHERE, 0.0)
    best = own + MISSED * point  # as the first one that is ground
    came_from = np.full(n, -1)
    candidates = configuration, point, t, time, own
    along = np.array(pass_index), at_feed, course.turned, at_end
    _choose(*candidates, *along, float(max_contact_step), best, came_from)
    last = int((best + MISSED * (len(pass_index) - 1 - point)).argmin())
    chosen = [last]
    while came_from[chosen[-1]] >= 0:
        chosen.append(int(came_from[chosen[-1]]))
    return np.array(chosen[::-1], dtype=np.intp)
