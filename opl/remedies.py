"""What would make an impossible job possible: single changes, each tried by planning again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from opl.cell.clearance import part_tree
from opl.cell.collision import CollisionScene
from opl.cell.workcell import WorkCell
from opl.geometry.frames import from_roll_pitch_yaw
from opl.geometry.toolpath import CutterPoints
from opl.job import Job
from opl.planning.layer import wheel_layer
from opl.planning.nodes import build_nodes
from opl.planning.plan import try_recursive
from opl.planning.problem import GrindingProblem
from opl.planning.starts import Start

MM = 1e3
MOST_CHECKS = 30  # of motions for each change: more would be no easy remedy

# smallest first: of each kind the first that opens the job is told
MORE_ROLL_DEG = (5.0, 10.0, 20.0, 30.0, 45.0)
OTHER_WIDTH_MM = (-5.0, 10.0, -10.0, -20.0, 25.0, -30.0)
MORE_ALLOWANCE_MM = (0.25, 0.5, 1.0, 2.0)
TURNED_FIXTURE_DEG = (10.0, -10.0, 20.0, -20.0, 45.0, -45.0, 90.0, -90.0, 180.0)

Change = tuple[str, WorkCell]


def find_remedies(job: Job, points: CutterPoints) -> list[str]:
    """Return the smallest single changes that open a job, one line each, each planned again.

    Args:
        job: A job for which no path was found.
        points: Its cutter points.
    """
    kinds: list[Callable[[WorkCell], Iterator[Change]]] = [
        _more_roll,
        _other_width,
        _more_allowance,
        _turned_fixture,
    ]
    found = []
    for kind in kinds:
        for told, cell in kind(job.cell):
            total = _plan_again(job, cell, points)
            if total is not None:
                found.append(
                    f"would be possible with {told} (planned again: joint range sum "
                    f"{total:.3f} rad, not verified)"
                )
                break
    return found


def _more_roll(cell: WorkCell) -> Iterator[Change]:
    now = float(np.rad2deg(cell.wheel.max_roll))
    for more in MORE_ROLL_DEG:
        if now + more <= 90.0:
            wheel = replace(cell.wheel, max_roll=float(np.deg2rad(now + more)))
            told = f"wheel.max_roll_deg {now + more:g} instead of {now:g}"
            yield told, replace(cell, wheel=wheel)


def _other_width(cell: WorkCell) -> Iterator[Change]:
    now = cell.wheel.width * MM
    for more in OTHER_WIDTH_MM:
        if now + more > 0.0:
            wheel = replace(cell.wheel, width=(now + more) / MM)
            yield f"wheel.width_mm {now + more:g} instead of {now:g}", replace(cell, wheel=wheel)


def _more_allowance(cell: WorkCell) -> Iterator[Change]:
    now = cell.contact_allowance * MM
    for more in MORE_ALLOWANCE_MM:
        told = f"wheel.contact_allowance_mm {now + more:g} instead of {now:g}"
        yield told, replace(cell, contact_allowance=(now + more) / MM)


def _turned_fixture(cell: WorkCell) -> Iterator[Change]:
    for turn in TURNED_FIXTURE_DEG:
        about_z = np.array([0.0, 0.0, np.deg2rad(turn)])
        T_flange_turned = from_roll_pitch_yaw(about_z, np.zeros(3))
        told = f"the fixture turned {turn:g} degrees about z of the flange"
        yield told, replace(cell, T_flange_workpiece=T_flange_turned @ cell.T_flange_workpiece)


def _plan_again(job: Job, cell: WorkCell, points: CutterPoints) -> float | None:
    """Return the joint range sum in [rad] that a changed cell permits, None if there is no path."""
    positions = cell.wheel.positions(job.search.n_contact_positions)
    part = part_tree(cell.part)
    problem = GrindingProblem(
        cell,
        CollisionScene(cell),
        part,
        points,
        build_nodes(cell, points, positions),
        wheel_layer(cell, part, points, positions),
        job.search.interpolation,
        job.pace,
    )
    open_everywhere = (
        problem.free_nodes(nodes).any(axis=1).all() for nodes in problem.field.branches
    )
    if not any(open_everywhere):
        return None
    plan = try_recursive(problem, Start.BEST, MOST_CHECKS)
    return None if plan is None else plan.path.joint_range_sum
