"""The stages of a run, each beside a library that does the same on the same input."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import numpy as np
import pinocchio as pin

import opl
from benchmarks.jobs import WORKPIECES, v_document
from benchmarks.measuring import MICRO, SECOND, Row, timed
from opl.cell.collision import CollisionScene
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import forward_kinematics
from opl.files.kernels import load_kernels
from opl.job.values import Job
from opl.planning.depths import wheel_distances
from opl.planning.multi_start import plan_recursive
from opl.planning.problem import GrindingProblem, build_problem
from opl.planning.scene import planning_scene
from opl.planning.survey import widest_branch
from opl.verification.replay import replay

V_ROW = 234.0  # [mm] of one row, about
SAMPLE = 2000  # of what is held against a reference that takes one thing at a time


def stage_rows(runs: int) -> Iterator[Row]:
    """Measure every stage on the V part: inverse kinematics to the replay."""
    load_kernels()  # as they are in a run
    job = v_job()
    points = opl.cut_surface(job).points
    scene = planning_scene(job.cell)
    positions = job.cell.wheel.positions(job.search.n_contact_positions)

    def built(rows: Any) -> GrindingProblem:
        return build_problem(scene, rows, positions, job.search.interpolation, job.process)

    yield from _kinematics(job, runs)
    problem = built(points)
    yield from _collisions(problem, runs)
    layer = timed(lambda: wheel_distances(scene, points, positions), runs)
    n_nodes = problem.cuts.size
    yield Row(f"distance of part and wheel, {n_nodes} nodes", SECOND, layer)
    small = built(opl.cut_surface(v_job(passes={"rows": 1})).points)
    found = timed(lambda: plan_recursive(small), runs)
    yield Row("recursive search, V one row, with collisions", SECOND, found, bar=0.2)
    planned = opl.plan_path(opl.cut_surface(v_job(search={"method": "recursive"})))
    if isinstance(planned, opl.Planned):
        motion = planned.timing.timed
        spent = timed(
            lambda: replay(job.cell, points, motion, job.search.max_contact_error), min(runs, 3)
        )
        yield Row(f"verification in PyBullet, V {len(points)} points", SECOND, spent)


def equal_field(n_points: int, n_positions: int) -> GrindingProblem:
    """Return the problem of one row of the V with so many cutter points and contact positions."""
    job = v_job(passes={"rows": 1, "max_step_mm": V_ROW / n_points})
    points = opl.cut_surface(job).points
    positions = job.cell.wheel.positions(n_positions)
    scene = planning_scene(job.cell)
    return build_problem(scene, points, positions, job.search.interpolation, job.process)


def v_job(**changes: dict[str, Any]) -> Job:
    """Return the V job with other values in some of its sections."""
    return opl.load_job(v_document(**changes), folder=WORKPIECES / "v_shape")


def _kinematics(job: Job, runs: int) -> Iterator[Row]:
    robot = job.cell.robot
    q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (50_000, 6))
    Ts = forward_kinematics(robot, q)
    ours = timed(lambda: inverse_kinematics(robot.arm, Ts), runs, len(Ts))
    eaik = _present("eaik.IK_URDF")
    name, theirs = "", None
    if eaik is not None:
        solver = eaik.UrdfRobot(str(robot.urdf), [])
        few = list(Ts[:SAMPLE])
        name, theirs = "EAIK", timed(lambda: [solver.IK(T) for T in few], runs, len(few))
    yield Row("inverse kinematics, all branches, a pose", MICRO, ours, name, theirs, 1e-6)
    yield Row(
        "forward kinematics, a configuration",
        MICRO,
        timed(lambda: forward_kinematics(robot, q[:SAMPLE]), runs, SAMPLE),
    )


def _collisions(problem: GrindingProblem, runs: int) -> Iterator[Row]:
    scene = problem.scene.collision
    branch = widest_branch(problem)
    q = problem.angles(branch, np.arange(len(problem.points)))
    at = ~np.isnan(q[..., 0]) & ~problem.cuts
    nodes = q[at]
    ours = timed(lambda: scene.collides(nodes), runs, len(nodes))
    theirs = timed(_one_by_one(scene, nodes[:SAMPLE]), runs, min(SAMPLE, len(nodes)))
    name = "pinocchio and coal, a posture at a time"
    yield Row("collisions of the robot at a node of V", MICRO, ours, name, theirs)
    points, positions = problem.points, problem.field.contact_positions

    def whole_map() -> None:
        wheel_distances(problem.scene, points, positions)
        scene.collides(nodes)

    bar = 0.35
    yield Row("collision map of V, all cells", SECOND, timed(whole_map, runs), bar=bar)


def _one_by_one(scene: CollisionScene, q: Any) -> Callable[[], object]:
    """Return the check of every configuration by the broad phase of pinocchio."""
    model, geometry = scene._model, scene._geometry
    data, geometry_data = model.createData(), geometry.createData()
    for request, margin in zip(geometry_data.collisionRequests, scene._margins, strict=True):
        request.security_margin = float(margin)
        request.break_distance = 0.0
    manager = pin.BroadPhaseManager_NaiveCollisionManager(model, geometry, geometry_data)
    return lambda: [pin.computeCollisions(model, data, manager, one, True) for one in q]


def _present(module: str) -> Any:
    try:
        return import_module(module)
    except ImportError:
        return None
