"""What would make an impossible job possible: single changes, each tried by planning again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from opl.geometry.frames import from_roll_pitch_yaw
from opl.geometry.toolpath import CutterPoints
from opl.job import keys
from opl.job.values import Job
from opl.planning.multi_start import try_recursive
from opl.planning.plan import Found
from opl.planning.problem import GrindingProblem
from opl.planning.reasons import free_at
from opl.planning.scene import planning_scene
from opl.planning.settings import Start
from opl.run.preparing import problem_in

MM = 1e3
# the work is bounded by counts, so that the same job always gets the same answer
MOST_CHECKS = 10  # of motions for each change: more would be no easy remedy
MOST_IN_ALL = 60  # of motions for all changes together
PROBED_COLUMNS = 8  # cutter points that must have a free node before a change is planned again

# smallest first: of each kind the first that opens the job is reported
MORE_ROLL_DEG = (5.0, 10.0, 20.0, 30.0, 45.0)
LONGER_APPROACH_MM = (20.0, 50.0, 100.0)
OTHER_WIDTH_MM = (-5.0, 10.0, -10.0, -20.0, 25.0, -30.0)
MORE_CONTACT_CHANGE = (2.0, 5.0, 20.0, 100.0)  # times
MORE_PENETRATION_MM = (0.25, 0.5, 1.0, 2.0)
ROUND_THE_RIM_DEG = (15.0, -15.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0, 180.0)
TURNED_FIXTURE_DEG = (10.0, -10.0, 20.0, -20.0, 45.0, -45.0, 90.0, -90.0, 180.0)

Change = tuple[str, Job]


@dataclass(frozen=True)
class Remedies:
    """What would open a job, and what was tried for nothing.

    Attributes:
        found: The smallest change of each kind that opens it, one line each; where the tries ended
            early, one that says so.
        in_vain: Kinds of changes of which none that was tried opens it, one line each.
    """

    found: tuple[str, ...] = ()
    in_vain: tuple[str, ...] = ()


def find_remedies(
    job: Job,
    points: CutterPoints,
    at_leads: bool = False,
    progress: Callable[[float], None] = lambda fraction: None,
) -> Remedies:
    """Return the smallest single changes that open a job, each planned again.

    Args:
        job: A job for which no path was found.
        points: Its cutter points.
        at_leads: Whether approaches and retracts were among what stopped it.
        progress: Called before each change with the part of the checks that is used up, 0 to 1.
    """
    columns = np.unique(np.linspace(0, len(points) - 1, PROBED_COLUMNS).astype(int))
    some = CutterPoints(
        points.Ts_workpiece_cutter[columns],
        np.zeros(len(columns), dtype=np.int64),
        points.arc_length[columns],
    )
    found, in_vain = list[str](), list[str]()
    left = MOST_IN_ALL
    for what, kind in {**(AT_LEADS if at_leads else {}), **KINDS}.items():
        changes = list(kind(job))
        for change, other in changes:
            progress(1.0 - left / MOST_IN_ALL)
            scene = planning_scene(other.cell)
            if not _open_at(problem_in(scene, other, some)):
                continue
            if left <= 0:
                found.append(f"not all changes were tried: {MOST_IN_ALL} motions were checked")
                return Remedies(tuple(found), tuple(in_vain))
            most_checks = min(MOST_CHECKS, left)
            outcome = try_recursive(problem_in(scene, other, points), Start.BEST, most_checks)
            if isinstance(outcome, Found):
                left -= outcome.plan.checks
                found.append(
                    f"would be possible with {change} (planned again: joint range sum "
                    f"{outcome.plan.path.joint_range_sum:.3f} rad, not verified)"
                )
                break
            left -= most_checks
        else:
            if changes:
                in_vain.append(f"{what}: {len(changes)} tried, none opens the job")
    return Remedies(tuple(found), tuple(in_vain))


def _with_cell(job: Job, **changed: Any) -> Job:
    return replace(job, cell=replace(job.cell, **changed))


def _with_wheel(job: Job, **changed: Any) -> Job:
    return _with_cell(job, wheel=replace(job.cell.wheel, **changed))


def _more_contact_change(job: Job) -> Iterator[Change]:
    rule, most = job.search.interpolation, 2.0 * job.cell.wheel.last_position
    now = rule.max_contact_change
    before = now
    for more in (now * times for times in MORE_CONTACT_CHANGE):
        if before < most:  # else it limits nothing
            interpolation = replace(rule, max_contact_change=more)
            change = f"{keys.SEARCH_CONTACT_CHANGE} {more:g} instead of {now:g}"
            yield change, replace(job, search=replace(job.search, interpolation=interpolation))
        before = more


def _more_roll(job: Job) -> Iterator[Change]:
    now = float(np.rad2deg(job.cell.wheel.max_roll))
    for more in MORE_ROLL_DEG:
        if now + more <= 90.0:
            change = f"{keys.WHEEL_MAX_ROLL} {now + more:g} instead of {now:g}"
            yield change, _with_wheel(job, max_roll=float(np.deg2rad(now + more)))


def _longer_approach(job: Job) -> Iterator[Change]:
    now = job.process.approach_length * MM
    for longer in LONGER_APPROACH_MM:
        if longer > now:
            process = replace(job.process, approach_length=longer / MM)
            change = f"{keys.PROCESS_APPROACH} {longer:g} instead of {now:g}"
            yield change, replace(job, process=process)


def _other_width(job: Job) -> Iterator[Change]:
    now = job.cell.wheel.width * MM
    for more in OTHER_WIDTH_MM:
        if now + more > 0.0:
            change = f"{keys.WHEEL_WIDTH} {now + more:g} instead of {now:g}"
            yield change, _with_wheel(job, width=(now + more) / MM)


def _more_penetration(job: Job) -> Iterator[Change]:
    now = job.cell.max_belt_penetration * MM
    for more in MORE_PENETRATION_MM:
        change = f"{keys.WHEEL_MAX_BELT_PENETRATION} {now + more:g} instead of {now:g}"
        yield change, _with_cell(job, max_belt_penetration=(now + more) / MM)


def _other_side(job: Job) -> Iterator[Change]:
    """Grind elsewhere on the rim: contact frame 0 turned about the axle of the wheel."""
    axle = np.array([0.0, 0.0, job.cell.wheel.radius])  # a point of it in contact frame 0
    for turn in ROUND_THE_RIM_DEG:
        T_contact0_turned = from_roll_pitch_yaw(np.deg2rad([turn, 0.0, 0.0]), axle)
        T_contact0_turned[:3, 3] -= T_contact0_turned[:3, :3] @ axle
        T_base_contact0 = job.cell.wheel.T_base_contact0 @ T_contact0_turned
        change = (
            f"the contact on another side of the wheel, {turn:g} degrees round its rim "
            f"({keys.WHEEL_POSE} turned about the axle)"
        )
        yield change, _with_wheel(job, T_base_contact0=T_base_contact0)


def _fed_in_reverse(job: Job) -> Iterator[Change]:
    """Hold the part turned half round against the belt: the frame turned about its normal."""
    T_contact0_turned = from_roll_pitch_yaw(np.array([0.0, 0.0, np.pi]), np.zeros(3))
    T_base_contact0 = job.cell.wheel.T_base_contact0 @ T_contact0_turned
    change = (
        f"the part fed in the opposite direction across the wheel ({keys.WHEEL_POSE} turned 180 "
        "degrees about its z)"
    )
    yield change, _with_wheel(job, T_base_contact0=T_base_contact0)


def _turned_fixture(job: Job) -> Iterator[Change]:
    for turn in TURNED_FIXTURE_DEG:
        about_z = np.array([0.0, 0.0, np.deg2rad(turn)])
        T_flange_turned = from_roll_pitch_yaw(about_z, np.zeros(3))
        change = f"the fixture turned {turn:g} degrees about z of the flange"
        T_flange_workpiece = T_flange_turned @ job.cell.T_flange_workpiece
        yield change, _with_cell(job, T_flange_workpiece=T_flange_workpiece)


# tried in this order, each kind by itself; the first only where leads stopped motions
AT_LEADS: dict[str, Callable[[Job], Iterator[Change]]] = {
    f"a longer {keys.PROCESS_APPROACH}": _longer_approach
}
KINDS: dict[str, Callable[[Job], Iterator[Change]]] = {
    f"a larger {keys.SEARCH_CONTACT_CHANGE}": _more_contact_change,
    f"a larger {keys.WHEEL_MAX_ROLL}": _more_roll,
    f"another {keys.WHEEL_WIDTH}": _other_width,
    f"a larger {keys.WHEEL_MAX_BELT_PENETRATION}": _more_penetration,
    "the contact on another side of the wheel": _other_side,
    "the part fed in the opposite direction across the wheel": _fed_in_reverse,
    "the fixture turned about z of the flange": _turned_fixture,
}


def _open_at(problem: GrindingProblem) -> bool:
    """Return whether each cutter point has a free node, all of them in one node matrix at least."""
    every = (problem.free_nodes(nodes).any(axis=1).all() for nodes in problem.field.matrices)
    return any(every) and all(free_at(problem, column) for column in range(len(problem.points)))
