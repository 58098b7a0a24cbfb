"""Configurations and cutter points in order: which configuration grinds which cutter point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from opl.verification.contact import Touches

MISSED = 100.0  # what a cutter point that is left out costs; all else costs a few units in a pass
TWICE = 2.0  # what a configuration that grinds the next cutter point too costs
PER_POSITION = 0.01  # cost of a change of t by one belt unit
STEP_SLACK = 0.1  # belt units that t may change beyond the rule: rounding
HORIZON = 4096  # touches looked back at


def align(
    touches: Touches, pass_index: NDArray[np.int64], tolerance: float, max_contact_step: float
) -> NDArray[np.intp]:
    """Choose touches that grind as many cutter points as can be, once and in order.

    Of several choices the one is taken that lies nearest to the contact model and moves least over
    the wheel: a flat part of a surface touches the flat of the wheel in many places at once.

    Args:
        touches: Candidates.
        pass_index: Pass of each cutter point, shape (N,).
        tolerance: Largest distance of a touch from the contact model in [m].
        max_contact_step: Largest change of t between neighbouring configurations of a pass.

    Returns:
        Indices of the chosen touches in order.
    """
    n = len(touches)
    if not n:
        return np.empty(0, dtype=np.intp)
    configuration, point, t = touches.configuration, touches.point, touches.contact_position
    own = touches.distance / tolerance
    best = own + MISSED * point  # as the first one that is ground
    came_from = np.full(n, -1)
    for m in range(1, n):
        before = slice(max(0, m - HORIZON), m)
        apart = configuration[m] - configuration[before]
        skipped = point[m] - point[before] - 1
        same_pass = pass_index[point[m]] == pass_index[point[before]]
        change = np.where(same_pass, np.abs(t[m] - t[before]), 0.0)
        cost = best[before] + own[m] + MISSED * skipped + PER_POSITION * change
        cost = cost + np.where(apart == 0, TWICE, 0.0)
        # on the flat one configuration may grind two cutter points at different t
        too_far = (apart > 0) & (change > max_contact_step * apart + STEP_SLACK)
        cost[(skipped < 0) | too_far | ((apart == 0) & ~same_pass)] = np.inf
        cheapest = int(cost.argmin())
        if cost[cheapest] < best[m]:
            best[m], came_from[m] = cost[cheapest], before.start + cheapest
    last = int((best + MISSED * (len(pass_index) - 1 - point)).argmin())
    chosen = [last]
    while came_from[chosen[-1]] >= 0:
        chosen.append(int(came_from[chosen[-1]]))
    return np.array(chosen[::-1], dtype=np.intp)
