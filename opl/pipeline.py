"""From a job to proven files: the stages in order."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime, timezone

from opl.cell.clearance import sample_tree
from opl.cell.collision import CollisionScene
from opl.cell.robot import forward
from opl.errors import InputError, NoPathError
from opl.geometry.mesh import surface_samples
from opl.geometry.nurbs import DegenerateNormalError
from opl.geometry.toolpath import CutterPoints, equal_section_passes
from opl.job import Job, Order
from opl.planning.fixed import FixedContact, keep_contact, runs_of
from opl.planning.layer import wheel_layer
from opl.planning.motion import VerifiedMotion
from opl.planning.nodes import build_nodes
from opl.planning.plan import Plan, plan_recursive
from opl.planning.problem import GrindingProblem
from opl.planning.reasons import unreachable_points
from opl.planning.starts import Start
from opl.planning.states import NodeState, node_states
from opl.planning.timing import timed
from opl.program.inform import render_jobs
from opl.program.moves import Program, plan_moves
from opl.program.pulses import PulseScale
from opl.program.table import render_table
from opl.report.pictures import contact_chart, joint_chart
from opl.verification.replay import Verification, replay

Progress = Callable[[str, float], None]


@dataclass
class Outcome:
    """What became of a job, as far as it came.

    Attributes:
        job: The job.
        status: ``ok``, ``no_path`` or ``unsafe``.
        seconds: Time of each stage.
        points: The cutter points.
        fixed: The contact-fixed path.
        plan: The found path and its motion.
        paper_start: The path found from the paper's own start node, or None if there is none.
        verification: What the replay found.
        program: The moves of the program.
        refusal: Why there is no path, if so.
        files: Texts to be written, by file name.
    """

    job: Job
    status: str = "ok"
    seconds: dict[str, float] = field(default_factory=dict)
    points: CutterPoints | None = None
    fixed: FixedContact | None = None
    plan: Plan | None = None
    paper_start: Plan | None = None
    verification: Verification | None = None
    program: Program | None = None
    refusal: NoPathError | None = None
    files: dict[str, str] = field(default_factory=dict)


def run(job: Job, progress: Progress = lambda stage, fraction: None) -> Outcome:
    """Plan, prove and render a job.

    Args:
        job: The job.
        progress: Told the stage and the part of it that is done.

    Raises:
        InputError: If the job's surface cannot be cut into passes, or lies out of reach.
        OplError: If the program cannot be written for the controller.
    """
    outcome = Outcome(job)
    clock = _Clock(outcome.seconds, progress)
    with clock("cutter_points"):
        outcome.points = points = cutter_points(job)
    problem = pose_problem(job, points, clock)
    with clock("comparison"):
        outcome.fixed = keep_contact(problem)
    try:
        with clock("search"):
            outcome.plan = plan = plan_recursive(problem, job.start)
    except NoPathError as error:
        outcome.status, outcome.refusal = "no_path", error
        return outcome
    with clock("comparison"):
        outcome.paper_start = _from_paper_start(problem)
    with clock("motion"):
        motion = timed(plan.motion, points, job.pace, job.cell.robot.max_speed)
    with clock("verification"):
        outcome.verification = verification = replay(
            job.cell, points, motion, job.max_contact_error, clock.share
        )
    if verification.verified is None:
        outcome.status = "unsafe"
        return outcome
    with clock("export"):
        outcome.program = write_program(outcome, verification.verified)
        draw(outcome, problem)
    return outcome


def cutter_points(job: Job) -> CutterPoints:
    """Cut the job's surface into passes.

    Raises:
        InputError: If that cannot be done; names the key that is to blame.
    """
    passes = job.passes
    try:
        return equal_section_passes(
            job.surface,
            passes.plane_normal,
            pitch=passes.pitch,
            margin=passes.margin,
            rows=passes.rows,
            max_bow_height=passes.max_bow_height,
            largest_step=passes.largest_step,
            zigzag=passes.order is Order.ZIGZAG,
            reversed_normal=job.reversed_normal,
        )
    except DegenerateNormalError as error:
        raise InputError(f"{job.path}: workpiece.surface", str(error)) from error
    except ValueError as error:
        raise InputError(f"{job.path}: passes", str(error)) from error


def pose_problem(job: Job, points: CutterPoints, clock: _Clock) -> GrindingProblem:
    """Build the node matrix and the clearance layer.

    Raises:
        InputError: If the arm reaches some cutter point at no contact position.
    """
    contact_positions = job.cell.wheel.positions(job.n_contact_positions)
    with clock("nodes"):
        field = build_nodes(job.cell, points, contact_positions)
    with clock("clearance"):
        samples = sample_tree(surface_samples(job.cell.part, job.sample_spacing))
        layer = wheel_layer(job.cell, samples, points, contact_positions)
        scene = CollisionScene(job.cell)
    problem = GrindingProblem(
        job.cell, scene, samples, points, field, layer, job.interpolation, job.pace
    )
    unreachable = unreachable_points(problem)
    if len(unreachable):
        raise InputError(
            f"{job.path}: workpiece.surface",
            f"out of reach of {job.cell.robot.title} at every contact position: cutter points "
            f"{runs_of(unreachable)} of {len(points)}; check wheel.T_base_contact0_mm and "
            "fixture.T_flange_workpiece_mm",
        )
    hits = scene.colliding_pairs(job.pace.home)
    if hits:
        pairs = ", ".join(" and ".join(pair) for pair in hits)
        raise InputError(f"{job.path}: process.home_deg", f"at home these collide: {pairs}")
    return problem


def _from_paper_start(problem: GrindingProblem) -> Plan | None:
    try:
        return plan_recursive(problem, Start.NEAREST)
    except NoPathError:
        return None


def write_program(outcome: Outcome, verified: VerifiedMotion) -> Program:
    """Render the job files and the table of a verified motion."""
    job, robot = outcome.job, outcome.job.cell.robot
    scale = PulseScale(
        robot.joint_names,
        robot.pulses_per_radian,
        robot.lower,
        robot.upper,
        robot.unverified_pulses,
    )
    program = plan_moves(verified, job.name, robot.max_speed, ["OPL"], robot.joint_names)
    outcome.files.update(
        render_jobs(program, scale, job_date(), tool=job.tool, template=job.template)
    )
    Ts_base_flange = forward(robot, verified.motion.q)
    outcome.files[f"{job.name}.csv"] = render_table(verified, program, scale, Ts_base_flange)
    return program


def draw(outcome: Outcome, problem: GrindingProblem) -> None:
    """Draw the contact chart and the joint angles."""
    plan, fixed, points, job = outcome.plan, outcome.fixed, outcome.points, outcome.job
    assert plan is not None and fixed is not None and points is not None
    path = plan.path
    outcome.files[f"{job.name}_contact.svg"] = contact_chart(
        title=f"{job.name}: where the part touches the wheel",
        contact_positions=problem.field.contact_positions,
        states=node_states(problem, path.branch),
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
    if not epoch.isdecimal():
        raise InputError("SOURCE_DATE_EPOCH", f"must be seconds since 1970, got {epoch!r}")
    return datetime.fromtimestamp(int(epoch), tz=timezone.utc)


class _Clock:
    """Measures the stages and passes their progress on."""

    def __init__(self, seconds: dict[str, float], progress: Progress) -> None:
        self._seconds = seconds
        self._progress = progress
        self._stage = ""

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        self._stage = stage
        self._progress(stage, 0.0)
        start = time.perf_counter()
        try:
            yield
        finally:
            spent = time.perf_counter() - start
            self._seconds[stage] = self._seconds.get(stage, 0.0) + spent
            self._progress(stage, 1.0)

    def share(self, fraction: float) -> None:
        self._progress(self._stage, fraction)
