"""Certificates of printed bounds, and whether they hold. By hand: python -m benchmarks.certificate.

A proof is searched with the code of opl, what it rests on is written down, and `recheck` proves the
bound anew from that alone.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from benchmarks.recheck import recheck
from opl.cell.spherical_wrist import SphericalWristArm
from opl.job.load import load_job
from opl.planning.multi_start import plan_recursive
from opl.planning.optimal import OptimalSearch
from opl.planning.problem import GrindingProblem
from opl.planning.scene import planning_scene
from opl.run.preparing import problem_in
from opl.run.surfacing import cut_surface
from opl.search.walls import Wall

WORKPIECES = Path(__file__).resolve().parent.parent / "workpieces"
CASES = ("v_shape:1", "v_shape", "s_shape:1", "s_shape", "faucet", "turbine_blade")


def certificate_of(problem: GrindingProblem, walls: list[Wall], bound: float) -> dict[str, Any]:
    """Return a bound in [rad] and what it rests on, as numbers, lists and names of JSON.

    Args:
        problem: What was planned, on an arm with a spherical wrist.
        walls: Of the proof; robot collisions did not matter to it.
        bound: What was proven.
    """
    cell, part = problem.cell, problem.cell.part
    robot, wheel = cell.robot, cell.wheel
    assert isinstance(robot.arm, SphericalWristArm)
    return {
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
        "walls": [wall.chain for wall in walls],
    }


def certified(part: str, rows: int | None = None) -> tuple[dict[str, Any], float]:
    """Return the certificate of a shipped part, and the bound that is printed.

    It is of the part as shipped, or with so many rows.

    Where the proof went on to leave out what makes the robot collide, the certificate is of what
    was proven before: `recheck` knows no robot's shape.
    """
    job = load_job(WORKPIECES / part / "job.yaml")
    if rows is not None:
        job = replace(job, passes=replace(job.passes, rows=rows))
    problem = problem_in(planning_scene(job.cell), job, cut_surface(job).points)
    search = OptimalSearch(problem, job.search.optimal, plan_recursive(problem))
    bound = 0.0
    while not search.finished:
        search.step()
        if not search.minds_collisions:
            bound = search.lower_bound
    return certificate_of(problem, search.proof.walls, bound), search.lower_bound


def check(case: str) -> bool:
    """Print what was proven by the search, and whether that is proven anew; return the latter."""
    part, _, rows = case.partition(":")
    certificate, printed = certified(part, int(rows) if rows else None)
    start = time.process_time()
    holds, subproblems = recheck(json.loads(json.dumps(certificate)))
    print(
        f"{part}, {rows or 'all'} rows: at least {printed:.5f} rad, {certificate['bound']:.5f} of "
        "them with no regard to collisions of the robot: these are "
        f"{'' if holds else 'NOT '}proven anew, "
        f"over {len(certificate['walls'])} walls in {subproblems} subproblems, "
        f"{time.process_time() - start:.1f} s of processor",
        flush=True,
    )
    return holds


def main() -> None:
    """Check the cases; parts may be named as arguments, with rows like ``v_shape:1``."""
    agreed = [check(case) for case in sys.argv[1:] or CASES]
    raise SystemExit(0 if all(agreed) else 1)


if __name__ == "__main__":
    main()
