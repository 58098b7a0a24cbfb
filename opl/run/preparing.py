"""From cutter points to what a search needs, refused where no search could help."""

from __future__ import annotations

from opl.cell.enclosing import enclosing_bodies
from opl.cell.robot import forward_kinematics
from opl.cell.wheel_distance import signed_wheel_distance
from opl.cell.workcell import PART, SECOND_OPINION_OF_A_LINK, WHEEL
from opl.errors import InputError
from opl.files.beside import Later
from opl.geometry.toolpath import CutterPoints
from opl.job import keys
from opl.job.values import Job
from opl.planning.fixed_contact import keep_contact, runs_of
from opl.planning.problem import GrindingProblem, build_problem
from opl.planning.reasons import unreachable_points
from opl.planning.scene import PlanningScene, planning_scene
from opl.run.searches import from_paper_start
from opl.run.values import Prepared, Surfaced
from opl.run.watch import Stage, Watch


def prepare(surfaced: Surfaced, watch: Watch | None = None) -> Prepared:
    """Build the node matrix and the clearance layer.

    Raises:
        InputError: If the arm reaches some cutter point at no contact position, or collides at
            home.
        Cancelled: If the run was cancelled.
    """
    watch = watch or Watch()
    job = surfaced.job
    problem = problem_in(planning_scene(job.cell), job, surfaced.points, watch)
    unreachable = unreachable_points(problem)
    if len(unreachable):
        raise InputError(
            job.source.at(keys.SURFACE),
            f"out of reach of {job.cell.robot.title} at every contact position: cutter points "
            f"{runs_of(unreachable)} of {len(surfaced.points)}; check {job.around.wheel_key} and "
            f"{keys.FIXTURE_POSE}",
        )
    _check_home(problem, job)
    return Prepared(
        surfaced, problem, Later(keep_contact, problem), Later(from_paper_start, problem)
    )


def problem_in(
    scene: PlanningScene, job: Job, points: CutterPoints, watch: Watch | None = None
) -> GrindingProblem:
    """Return what is to be planned.

    Args:
        scene: The scene of the cell of the job, or of one that differs from it.
        job: How the path is searched, and how fast it is run.
        points: The cutter points.
        watch: Follows the run.
    """
    watch = watch or Watch()
    positions = scene.cell.wheel.positions(job.search.n_contact_positions)
    return build_problem(
        scene,
        points,
        positions,
        job.search.interpolation,
        job.process,
        lambda stage: watch.stage(Stage(stage)),
    )


def _check_home(problem: GrindingProblem, job: Job) -> None:
    """Refuse a home where something collides or is too near.

    Raises:
        InputError: If it is; names the pairs.
    """
    cell, home = job.cell, job.process.home
    inside = enclosing_bodies(cell, home)
    if inside:
        pairs = ", ".join(" inside of ".join(pair) for pair in inside)
        raise InputError(job.around.home_key, f"at home one is in the other: {pairs}")
    hits = list(problem.scene.collision.colliding_pairs(home))
    # at home part and wheel must not touch
    Ts_contact0_workpiece = cell.Ts_contact0_workpiece(forward_kinematics(cell.robot, home[None]))
    needed = cell.part_from_wheel
    part = problem.scene.part
    if signed_wheel_distance(part, cell.wheel, Ts_contact0_workpiece, needed)[0] < needed:
        hits.append((PART, WHEEL))
    if hits:
        pairs = ", ".join(" and ".join(pair) for pair in hits)
        kept = f"{1e3 * cell.required_clearance:g} mm ({keys.CLEARANCE})"
        kept += " or their own clearance" if cell.pairs.required else ""
        raise InputError(
            job.around.home_key,
            f"at home these are nearer to each other than {kept} or collide: {pairs}; links are "
            f"planned {1e3 * SECOND_OPINION_OF_A_LINK:g} mm farther away",
        )
