"""The V job planned, whole and small. Everything slow is made once."""

from dataclasses import replace
from functools import cache

import numpy as np

from opl.cell.collision import CollisionScene
from opl.files.resources import folder
from opl.geometry.toolpath import CutterPoints
from opl.job.load import load_job
from opl.motion.timing import time_motion
from opl.planning.multi_start import plan_recursive
from opl.planning.scene import planning_scene
from opl.run.preparing import problem_in
from opl.run.surfacing import cut_surface
from opl.verification.replay import replay

V_JOB = folder("workpieces") / "v_shape" / "job.yaml"


@cache
def v_job():
    return load_job(V_JOB)


def with_positions(job, count):
    """Return a job with another number of contact positions."""
    return replace(job, search=replace(job.search, n_contact_positions=count))


@cache
def small_job():
    """Return the V job with two of its rows and fewer contact positions."""
    job = v_job()
    return with_positions(replace(job, passes=replace(job.passes, rows=2)), 60)


def problem_of(job, points_of=None):
    """Return the problem of a job, or of a slice of its cutter points."""
    points = cut_surface(job).points
    if points_of is not None:
        points = CutterPoints(
            points.Ts_workpiece_cutter[points_of],
            points.pass_index[points_of] - points.pass_index[points_of][0],
            points.arc_length[points_of],
        )
    return problem_in(planning_scene(job.cell), job, points)


@cache
def v_problem():
    return problem_of(v_job())


@cache
def v_plan():
    return plan_recursive(v_problem())


@cache
def small_problem():
    return problem_of(small_job())


@cache
def small_plan():
    return plan_recursive(small_problem())


def timed(problem, motion):
    """Return a motion with its times."""
    return time_motion(motion, problem.points, problem.process, problem.cell.robot).timed


def small_motion():
    """Return a free motion over the two rows."""
    return small_plan().motion


@cache
def small_timed():
    return timed(small_problem(), small_motion())


@cache
def v_timed():
    return timed(v_problem(), v_plan().motion)


@cache
def tiny_problem():
    """Return the end of one pass and the beginning of the next, and a home not far away."""
    problem = problem_of(with_positions(small_job(), 30), points_of=slice(50, 70))
    on_the_way = plan_recursive(problem).motion.q[1]  # where the first approach begins
    home = on_the_way + np.array([0.3, -0.2, 0.0, 0.2, 0.1, 0.2])
    return replace(problem, process=replace(problem.process, home=home))


@cache
def tiny_timed():
    return timed(tiny_problem(), plan_recursive(tiny_problem()).motion)


def tiny_motion():
    return tiny_timed().motion


def replay_tiny(timed=None, cell=None):
    """Replay the tiny motion, or another one, or in another cell."""
    problem, allowed = tiny_problem(), small_job().search.max_contact_error
    return replay(cell or problem.cell, problem.points, timed or tiny_timed(), allowed)


def with_problem_cell(problem, cell):
    """Return a problem in another cell; nodes, part and wheel layer stay."""
    return with_scene(problem, cell=cell, collision=CollisionScene(cell).for_second_opinion())


def with_scene(problem, **changes):
    """Return a problem whose scene has another cell, collision geometry or part."""
    return replace(problem, scene=replace(problem.scene, **changes))
