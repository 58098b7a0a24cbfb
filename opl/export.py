"""From a verified motion to the texts of its files: program, table, pictures."""

from __future__ import annotations

import os
from datetime import datetime, timezone

from opl.errors import InputError
from opl.geometry.frames import transform
from opl.geometry.mesh import box_corners
from opl.motion.motion import VerifiedMotion
from opl.outcome import Outcome
from opl.planning.problem import GrindingProblem
from opl.planning.states import NodeState, node_states
from opl.program.moves import Program
from opl.program.write import StraightLimit
from opl.program.write import write_program as write_files
from opl.report.pictures import contact_chart, joint_chart


def write_program(outcome: Outcome, verified: VerifiedMotion) -> Program:
    """Render the job files and the table of a verified motion."""
    job, found = outcome.job, outcome.verification
    assert found is not None
    vertices = transform(job.cell.T_flange_workpiece, job.cell.part.vertices)
    # what the proven path leaves of the allowed contact error
    limit = StraightLimit(
        box_corners(vertices), job.search.max_contact_error - found.max_contact_error
    )
    program, files = write_files(
        verified, job.name, job.cell.robot, job.program, limit, job_date(), ["OPL"]
    )
    outcome.files.update(files)
    return program


def draw(outcome: Outcome, problem: GrindingProblem) -> None:
    """Draw the contact chart and the joint angles."""
    plan, fixed, points, job = outcome.plan, outcome.fixed, outcome.points, outcome.job
    assert plan is not None and fixed is not None and points is not None
    path = plan.path
    outcome.files[f"{job.name}_contact.svg"] = contact_chart(
        title=f"{job.name}: where the part touches the wheel",
        contact_positions=problem.field.contact_positions,
        states=node_states(problem, path.ik_branch),
        state_names=[state.value for state in NodeState],
        pass_index=points.pass_index,
        flat_end=job.cell.wheel.flat_end,
        path_cutter_point=path.cutter_point,
        path_contact_position=path.contact_position,
        path_pass=path.pass_index,
    )
    robot = job.cell.robot
    outcome.files[f"{job.name}_joints.svg"] = joint_chart(
        title=f"{job.name}: joint angles along the path",
        joint_names=robot.joint_names,
        lower=robot.lower,
        upper=robot.upper,
        found_cutter_point=path.cutter_point,
        found_q=path.q,
        found_pass=path.pass_index,
        fixed_q=fixed.q,
        pass_index=points.pass_index,
    )


def job_date() -> datetime:
    """Return SOURCE_DATE_EPOCH, which makes runs repeatable to the byte, or the time now."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if epoch is None:
        return datetime.now()
    try:
        return datetime.fromtimestamp(int(epoch), tz=timezone.utc)
    except (ValueError, OverflowError, OSError) as error:
        message = f"must be seconds since 1970, got {epoch!r}"
        raise InputError("SOURCE_DATE_EPOCH", message) from error
