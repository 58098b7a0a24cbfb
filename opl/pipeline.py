"""From a job to proven files: the stages in order."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from opl.cell.collision import CollisionScene, enclosing_bodies
from opl.cell.robot import forward_kinematics
from opl.cell.wheel_distance import PartTree, part_tree, signed_wheel_distance
from opl.cell.workcell import PART, SECOND_OPINION_OF_A_LINK, WHEEL
from opl.errors import InputError, NoPathError, NoWayError
from opl.export import draw, job_date, write_program
from opl.field.layer import wheel_layer
from opl.field.nodes import build_nodes
from opl.geometry.toolpath import CutterPoints
from opl.job.load import Job
from opl.motion.feed import dwell_refusal, slow_stretches
from opl.motion.timing import time_motion
from opl.outcome import Outcome
from opl.planning.fixed import keep_contact, runs_of
from opl.planning.problem import GrindingProblem
from opl.planning.reasons import unreachable_points
from opl.proof.read_back import in_file_digits, read_back
from opl.remedies import find_remedies
from opl.searches import compare, from_paper_start, search_path
from opl.surfacing import cut_surface
from opl.verification.replay import replay

Progress = Callable[[str, float], None]
Clock = Callable[[str], AbstractContextManager[None]]  # measures the stage it is called with


def run(job: Job, progress: Progress = lambda stage, fraction: None) -> Outcome:
    """Plan, prove and render a job.

    Args:
        job: The job.
        progress: Told the stage and the part of it that is done.

    Raises:
        InputError: If the job's surface cannot be cut into passes, or lies out of reach.
        OplError: If the program cannot be written for the controller.
    """
    job_date()  # before the work, that it may not be in vain
    outcome = Outcome(job)
    clock = _Clock(outcome.seconds, progress)
    with clock("cutter_points"):
        surfacing = cut_surface(job)
        outcome.points = points = surfacing.points
        outcome.warnings = surfacing.warnings
    problem = pose_problem(job, points, clock)
    with clock("comparison"):
        outcome.fixed = keep_contact(problem)
    try:
        with clock("search"):
            outcome.plan = plan = search_path(outcome, problem)
    except NoPathError as error:
        outcome.status, outcome.refusal = "no_path", error
        if isinstance(error, NoWayError):
            return outcome  # on the wheel nothing has to change
        with clock("remedies"):
            outcome.remedies = find_remedies(job, points)
        return outcome
    with clock("comparison"):
        outcome.paper_start = from_paper_start(problem)
        outcome.compared = compare(outcome)
    with clock("motion"):
        # what is proven is what the digits of the program can say
        told = in_file_digits(plan.motion, job)
        timing = time_motion(told, points, job.pace, job.cell.robot)
        outcome.slow = slow_stretches(timing, job.pace)
    outcome.refusal = dwell_refusal(outcome.slow, job.pace)
    if outcome.refusal is not None:
        outcome.status = "no_path"
        return outcome
    with clock("verification"):
        outcome.verification = verification = replay(
            job.cell, points, timing.motion, job.search.max_contact_error, clock.share
        )
    if verification.verified is None:
        outcome.status = "unsafe"
        return outcome
    with clock("export"):
        outcome.program = write_program(outcome, verification.verified)
        draw(outcome, problem)
    with clock("read_back"):
        outcome.file = proof = read_back(
            job, points, plan.motion, verification.verified, outcome.program, outcome.files
        )
    if proof is not None and not proof.proven:
        outcome.status = "unsafe"
        outcome.files.clear()
        outcome.program = None
    return outcome


def cutter_points(job: Job) -> CutterPoints:
    """Cut the job's surface into passes.

    Raises:
        InputError: If that cannot be done; names the key that is to blame.
    """
    return cut_surface(job).points


def pose_problem(job: Job, points: CutterPoints, clock: Clock) -> GrindingProblem:
    """Build the node matrix and the clearance layer.

    Args:
        job: The job.
        points: Its cutter points.
        clock: Measures the stages.

    Raises:
        InputError: If the arm reaches some cutter point at no contact position, or collides at
            home.
    """
    contact_positions = job.cell.wheel.positions(job.search.n_contact_positions)
    with clock("nodes"):
        field = build_nodes(job.cell, points, contact_positions)
    with clock("clearance"):
        part = part_tree(job.cell.part)
        layer = wheel_layer(job.cell, part, points, contact_positions)
        scene = CollisionScene(job.cell).for_second_opinion()
    problem = GrindingProblem(
        job.cell, scene, part, points, field, layer, job.search.interpolation, job.pace
    )
    unreachable = unreachable_points(problem)
    if len(unreachable):
        raise InputError(
            f"{job.path}: workpiece.surface",
            f"out of reach of {job.cell.robot.title} at every contact position: cutter points "
            f"{runs_of(unreachable)} of {len(points)}; check {job.around.wheel_key} and "
            "fixture.T_flange_workpiece_mm",
        )
    inside = enclosing_bodies(job.cell, job.pace.home)
    if inside:
        pairs = ", ".join(" inside of ".join(pair) for pair in inside)
        raise InputError(job.around.home_key, f"at home one is in the other: {pairs}")
    hits = [*scene.colliding_pairs(job.pace.home), *_part_near_wheel(job, part)]
    if hits:
        pairs = ", ".join(" and ".join(pair) for pair in hits)
        needed = f"{1e3 * job.cell.required_clearance:g} mm (clearance_mm)"
        needed += " or their own clearance" if job.cell.pairs.required else ""
        told = f"at home these are nearer to each other than {needed} or collide: {pairs}"
        told += f"; links are planned {1e3 * SECOND_OPINION_OF_A_LINK:g} mm farther away"
        raise InputError(job.around.home_key, told)
    return problem


def _part_near_wheel(job: Job, part: PartTree) -> list[tuple[str, str]]:
    """Return part and wheel if they are too near at home, where they do not touch on purpose."""
    home = job.pace.home[None]
    Ts_contact0_workpiece = job.cell.Ts_contact0_workpiece(forward_kinematics(job.cell.robot, home))
    needed = job.cell.part_from_wheel
    distance = signed_wheel_distance(part, job.cell.wheel, Ts_contact0_workpiece, needed)[0]
    return [(PART, WHEEL)] if distance < needed else []


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
