"""Certificates of printed bounds, and whether they hold. By hand: python -m benchmarks.certificate.

A proof is searched with the code of opl, what it rests on is written down, and `recheck` proves the
bound anew from that alone: walls, arm, part and wheel, and the bodies that must not collide where
the bound rests on that.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import coal
import numpy as np

from benchmarks.recheck import recheck
from opl.cell.collision import CollisionScene
from opl.cell.robot_loading import load_robot
from opl.geometry.frames import Array, transform
from opl.job.load import load_job
from opl.job.values import Job
from opl.least.optimal import OptimalSearch
from opl.planning.multi_start import plan_recursive
from opl.planning.problem import GrindingProblem
from opl.planning.scene import planning_scene
from opl.run.preparing import problem_in
from opl.run.surfacing import cut_surface
from opl.search.walls import Wall
from opl.walls.barriers import all_sides

WORKPIECES = Path(__file__).resolve().parent.parent / "workpieces"
CASES = (
    "v_shape:1", "v_shape", "s_shape:1", "s_shape", "faucet", "turbine_blade",
    "bent_tube", "v_in_cell", "v_shape:1@ur10e", "v_shape@ur10e",
)  # fmt: skip
HOMES = {"ur10e": (0.0, -110.0, 110.0, -90.0, -90.0, 0.0)}  # [deg]


def certificate_of(
    problem: GrindingProblem, walls: list[Wall], bound: float, minds_collisions: bool = False
) -> dict[str, Any]:
    """Return a bound in [rad] and what it rests on, as numbers, lists and names of JSON.

    Args:
        problem: What was planned.
        walls: Of the proof.
        bound: What was proven.
        minds_collisions: Whether it rests on collisions of the robot as well.
    """
    cell, part = problem.cell, problem.cell.part
    robot, wheel = cell.robot, cell.wheel
    bodies = {"bodies": bodies_of(problem.scene.collision)} if minds_collisions else {}
    return {
        **bodies,
        "bound": bound,
        "robot": {
            "arm": asdict(robot.arm),
            "lower": robot.lower.tolist(),
            "upper": robot.upper.tolist(),
        },
        "wheel": {
            "width": wheel.width,
            "radius": wheel.radius,
            "max_roll": wheel.max_roll,
            "T_base_contact0": wheel.T_base_contact0.tolist(),
        },
        "T_flange_workpiece": cell.T_flange_workpiece.tolist(),
        "penetration": cell.planned_penetration,
        "triangles": part.vertices[part.faces].tolist(),
        "Ts_workpiece_cutter": problem.points.Ts_workpiece_cutter.tolist(),
        "pass_index": problem.points.pass_index.tolist(),
        "barriers": [
            (one.first, one.last, one.contact_position)
            for one in dict.fromkeys(
                one
                for sides in all_sides(problem)
                for side in sides
                for one in (*side.above, *side.below)
            )
        ],
        "walls": [wall.chain for wall in walls],
    }


def bodies_of(scene: CollisionScene) -> dict[str, Any]:
    """Return the bodies of a scene, and its pairs."""
    bodies = scene._bodies
    corners = [
        transform(body.placement.homogeneous, _corners(body.geometry))
        for body in scene._geometry.geometryObjects
    ]
    pairs = zip(scene._geometry.collisionPairs, scene._margins, strict=True)
    return {
        "Ts_before_joint": bodies.Ts_before_joint.tolist(),
        "axes": bodies.axes.tolist(),
        "joint": bodies.joint.tolist(),
        "Ts_joint_body": bodies.Ts_joint_body.tolist(),
        "sizes": bodies.sizes.tolist(),
        "corners": [places.tolist() for places in corners],
        "pairs": [(pair.first, pair.second, float(far)) for pair, far in pairs],
    }


def _corners(shape: coal.CollisionGeometry) -> Array:
    """Return the corners of a mesh, shape (n, 3); none of a box or a cylinder."""
    if isinstance(shape, coal.BVHModelBase):
        return np.array([shape.vertex(k) for k in range(shape.num_vertices)])
    if isinstance(shape, coal.ConvexBase):
        return np.array([shape.point(k) for k in range(shape.num_points)])
    assert isinstance(shape, (coal.Box, coal.Cylinder)), f"no witness is sought in a {shape}"
    return np.empty((0, 3))


def job_of(case: str) -> Job:
    """Return the job of a case: a shipped part, or a job file, as it is or with so many rows.

    ``v_shape:1@ur10e`` is one row of the V part, on another arm that has a home here.
    """
    rest, _, arm = case.partition("@")
    part, _, rows = rest.partition(":")
    job = load_job(Path(part) if part.endswith(".yaml") else WORKPIECES / part / "job.yaml")
    if rows:
        job = replace(job, passes=replace(job.passes, rows=int(rows)))
    if arm:
        cell = replace(job.cell, robot=load_robot(arm))
        job = replace(job, cell=cell, process=replace(job.process, home=np.deg2rad(HOMES[arm])))
    return job


def certified(case: str) -> dict[str, Any]:
    """Return the certificate of the bound that is printed for a case."""
    job = job_of(case)
    problem = problem_in(planning_scene(job.cell), job, cut_surface(job).points)
    search = OptimalSearch(problem, job.search.optimal, plan_recursive(problem))
    while not search.finished:
        search.step()
    walls, minds_collisions = search.proof.walls, search.forbidden is not None
    return certificate_of(problem, walls, search.lower_bound, minds_collisions)


def check(case: str) -> bool:
    """Print the bound of a case, and whether it is proven anew; return the latter."""
    certificate = certified(case)
    start = time.process_time()
    holds, subproblems = recheck(json.loads(json.dumps(certificate)))
    print(
        f"{case}: at least {certificate['bound']:.5f} rad"
        f"{', where the robot collides left out' if 'bodies' in certificate else ''}: "
        f"{'' if holds else 'NOT '}proven anew, over {len(certificate['walls'])} walls in "
        f"{subproblems} subproblems, {time.process_time() - start:.1f} s of processor",
        flush=True,
    )
    return holds


def main() -> None:
    """Check the cases that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", default=CASES, help=f"such as {', '.join(CASES)}")
    agreed = [check(case) for case in parser.parse_args().cases]
    raise SystemExit(0 if all(agreed) else 1)


if __name__ == "__main__":
    main()
