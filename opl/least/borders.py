"""Places on the wheel where the program could not name the configuration, moved beside them.

In a language of poses a joint that stands at half a turn is named as well as another one a full
turn away. The contact slides or rolls on the wheel by as little as it takes: the part is ground at
the same point all the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from opl.cell.full_turns import nearest_turn
from opl.geometry.frames import Array
from opl.motion.path import GrindingPath
from opl.planning.nodes import inverse_solutions
from opl.planning.plan import Plan
from opl.planning.problem import GrindingProblem
from opl.planning.track_check import Free, check_path

# Which configurations, shape (n, 6) in [rad], a program names without doubt, even if joints were
# off by a margin in [rad].
Nameable = Callable[[Array, float], NDArray[np.bool_]]
MARGIN = np.deg2rad(0.05)
# The same where there is a choice: a frame that is touched up moves all joints.
TOUCH_UP = np.deg2rad(3.0)
# How far the contact is moved in belt units, in both senses, the least that does.
_STEPS = np.array([0.02, 0.05, 0.1, 0.2, 0.4, 0.8])


def clear_of_borders(problem: GrindingProblem, plan: Plan, nameable: Nameable) -> Plan:
    """Return a plan whose configurations on the wheel the program can name, as far as that goes.

    What cannot be moved, or not without touching something, stays: writing the program refuses it
    by name.

    Args:
        problem: What was planned.
        plan: The plan.
        nameable: Which configurations the program names without doubt.
    """
    path = _moved(problem, plan.path, nameable)
    allowed = max(_contact_change(plan.path), problem.interpolation.max_contact_change)
    if path is plan.path or _contact_change(path) > allowed:
        return plan
    found = check_path(problem, path)
    return replace(plan, path=path, motion=found.motion) if isinstance(found, Free) else plan


def _contact_change(path: GrindingPath) -> float:
    """Return how far the contact moves between neighbouring cutter points at the most."""
    at = np.flatnonzero(path.cutter_point == np.rint(path.cutter_point))
    same = np.diff(path.pass_index[at]) == 0
    return float(np.abs(np.diff(path.contact_position[at]))[same].max(initial=0.0))


def _moved(problem: GrindingProblem, path: GrindingPath, nameable: Nameable) -> GrindingPath:
    """Return the path with the contact moved where the configuration could not be named."""
    cell, rule = problem.cell, problem.interpolation
    q, t = path.q.copy(), path.contact_position.copy()
    last = cell.wheel.last_position
    offsets = np.stack([_STEPS, -_STEPS], axis=1).ravel()
    for k in np.flatnonzero(~nameable(path.q, MARGIN)):
        places = t[k] + offsets
        frame = problem.points.frames_at(path.cutter_point[[k]])
        found = inverse_solutions(cell, frame[:, None], places)[0]
        turned = nearest_turn(found[:, path.ik_branches[path.pass_index[k]]], q[k])
        usable = (np.abs(places) <= last) & ~np.isnan(turned).any(axis=1)
        usable[usable] = cell.within_limits(turned[usable]) & nameable(turned[usable], MARGIN)
        for near in (k - 1, k + 1):
            if 0 <= near < len(q) and path.pass_index[near] == path.pass_index[k]:
                step = np.abs(turned - q[near]).max(axis=1)
                usable &= np.nan_to_num(step, nan=np.inf) <= rule.max_joint_step
        if usable.any():
            best = int(np.flatnonzero(usable)[0])
            q[k], t[k] = turned[best], places[best]
    if (t == path.contact_position).all():
        return path
    return replace(path, q=q, contact_position=t)
