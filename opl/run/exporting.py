"""From a verified motion to the texts of its files: program, table, pictures."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import datetime, timezone
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from opl.errors import InputError
from opl.files.digests import STAMP, stamped
from opl.geometry.frames import transform
from opl.geometry.mesh import box_corners
from opl.job.values import Job
from opl.planning.plan import Plan
from opl.planning.survey import NodeState, NodeSurvey
from opl.program.export import StraightLimit, export_program
from opl.program.moves import Program
from opl.proof.digest import inputs_mark
from opl.report.trace import motion_trace
from opl.run.values import Prepared, Proven, Refused, Run

if TYPE_CHECKING:  # matplotlib takes long to load: whoever draws does
    from opl.report.canvas import Picture


def render_program(
    proven: Proven, stops: frozenset[int] = frozenset()
) -> tuple[Program, Mapping[str, str]]:
    """Return the program of a verified motion; its files, table and trace by file name.

    The robot also stops at the configurations of the motion with the indices `stops`.
    """
    job = proven.surfaced.job
    vertices = transform(job.cell.T_flange_workpiece, job.cell.part.vertices)
    # what the proven path leaves of the allowed contact error
    left = job.search.max_contact_error - proven.verification.max_contact_error
    limit = StraightLimit(box_corners(vertices), left)
    comments = ["OPL", inputs_mark(job.inputs), STAMP, *_home_moved(job)]
    program, files = export_program(
        proven.motion, job.name, job.cell.robot, job.program, limit, job_date(), comments, stops
    )
    trace = motion_trace(proven.motion, job.name, job.cell.robot.joint_names)
    return program, {name: stamped(text) for name, text in files.items()} | {
        f"{job.name}_motion.json": trace
    }


def _home_moved(job: Job) -> list[str]:
    """Return the lines that tell a person where home is not that of the job."""
    asked, given = np.rad2deg(job.around.home), np.rad2deg(job.process.home)
    return [
        f"HOME {name} {given[k]:.2f}, NOT {asked[k]:.2f}"
        for k, name in enumerate(job.cell.robot.joint_names)
        if given[k] != asked[k]
    ]


def load_pictures() -> None:
    """Load what draws, so that no picture waits for it."""
    import_module("opl.report.pictures")


def draw_charts(prepared: Prepared, plan: Plan, survey: NodeSurvey) -> Mapping[str, str]:
    """Return the contact chart and the joint angles as SVG, by file name."""
    from opl.report.canvas import svg

    charts = _charts(prepared, plan, survey)
    return {f"{name}.svg": svg(figure, title) for name, title, figure in charts}


def with_png(run: Run) -> Run:
    """Return a run whose charts are delivered as PNG too; a refused one as it is."""
    from opl.report.canvas import png

    if isinstance(run, Refused):
        return run
    planned = run.proven.planned
    charts = _charts(planned.prepared, planned.plan, planned.survey)
    return replace(run, pictures={f"{name}.png": png(figure) for name, _, figure in charts})


def _charts(
    prepared: Prepared, plan: Plan, survey: NodeSurvey
) -> Iterator[tuple[str, str, Picture]]:
    """Yield file name, title and figure of each chart."""
    from opl.report.pictures import contact_chart, joint_chart

    surfaced, path = prepared.surfaced, plan.path
    job, pass_index = surfaced.job, surfaced.points.pass_index
    title = f"{job.name}: where the part touches the wheel"
    contact = contact_chart(
        title=title,
        contact_positions=prepared.problem.field.contact_positions,
        states=survey.states,
        state_names=[state.value for state in NodeState],
        pass_index=pass_index,
        flat_end=job.cell.wheel.flat_end,
        path=path,
        held_at=[one.place for one in plan.holders],
    )
    yield f"{job.name}_contact", title, contact
    title = f"{job.name}: joint angles along the path"
    joints = joint_chart(
        title=title,
        robot=job.cell.robot,
        path=path,
        fixed_q=prepared.fixed.q,
        pass_index=pass_index,
    )
    yield f"{job.name}_joints", title, joints


def job_date() -> datetime:
    """Return SOURCE_DATE_EPOCH, which makes runs repeatable to the byte, or the time now.

    Raises:
        InputError: If that variable holds no time.
    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if epoch is None:
        return datetime.now()
    try:
        return datetime.fromtimestamp(int(epoch), tz=timezone.utc)
    except (ValueError, OverflowError, OSError) as error:
        message = f"must be seconds since 1970, got {epoch!r}"
        raise InputError("SOURCE_DATE_EPOCH", message) from error
