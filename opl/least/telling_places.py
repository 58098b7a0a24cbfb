"""Which places of a pass tell most of what a track along it costs.

Between two places a way is charged for no more than the way straight from posture to posture. A
track over many places tells where that falls short: where a joint turns back, or has not the time
that it needs.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from opl.geometry.frames import Array
from opl.least.own_track import OwnTrack
from opl.planning.problem import GrindingProblem
from opl.search.way_cells import WayPrices

LITTLE = 1e-4  # of what a track costs: no places are put in for less


def way_prices(problem: GrindingProblem, travel: float, time: float, places: Array) -> WayPrices:
    """Return what ways from place to place of a pass are charged for.

    Args:
        problem: What is to be planned.
        travel: Price of a radian of joint travel.
        time: Price of a second.
        places: Fractional cutter points, shape (n,).
    """
    points, process = problem.points, problem.process
    arc = np.abs(np.diff(np.interp(places, np.arange(len(points)), points.arc_length)))
    max_speed = problem.cell.robot.max_speed
    return WayPrices(travel, time, arc / process.feed, max_speed, process.contact_speed)


def telling_places(prices: WayPrices, track: OwnTrack, places: Array, most: int) -> Array:
    """Return more places of a track, those first that tell most of what it costs.

    Args:
        prices: What the track is charged for.
        track: The track.
        places: Some of its places, the first and the last among them, shape (n,).
        most: How many more to return at the most.

    Returns:
        Fewer where all stretches between places tell nearly all of their cost.
    """
    n = len(track.places)
    until = np.concatenate([[0.0], np.cumsum(prices.seconds)])

    def straight(one: np.ndarray | int, other: np.ndarray | int) -> Array:
        turned, slid = track.q[other] - track.q[one], track.t[other] - track.t[one]
        return prices.of(turned, slid, until[other] - until[one])

    cost = np.concatenate([[0.0], np.cumsum(straight(np.arange(n - 1), np.arange(1, n)))])

    def shortfall(first: int, last: int) -> tuple[float, int, int]:
        """Return by how much a stretch costs more than straight from end to end, and its ends."""
        return float(cost[last] - cost[first] - straight(first, last)), first, last

    known = np.searchsorted(track.places, places)
    left = [shortfall(*ends) for ends in pairwise(known.tolist())]
    told: list[int] = []
    while left and len(told) < most:
        left.sort(key=lambda one: (-one[0], one[1]))
        short, first, last = left.pop(0)
        if short <= LITTLE * cost[-1]:
            break
        between = np.arange(first + 1, last)
        more = straight(first, between) + straight(between, last) - straight(first, last)
        best = int(np.argmax(more))
        if more[best] <= LITTLE * short:  # it takes two places to tell that a joint turns back
            share = ((between - first) / (last - first))[:, None]
            chord = track.q[first] + share * (track.q[last] - track.q[first])
            best = int(np.argmax(np.abs(track.q[between] - chord).sum(axis=1)))
        middle = int(between[best])
        told.append(middle)
        left += [shortfall(first, middle), shortfall(middle, last)]
    return np.sort(track.places[told])
