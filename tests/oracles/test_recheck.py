"""Printed bounds proven anew by a checker that shares no code with opl.

`python -m benchmarks.certificate` does the same for whole parts.
"""

import ast
import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import benchmarks
from benchmarks.certificate import bodies_of, certificate_of, certified, job_of
from benchmarks.recheck import recheck
from benchmarks.recheck_bodies import Bodies
from benchmarks.recheck_depth import Wheel
from benchmarks.recheck_walls import COARSE, Machine
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import forward_kinematics
from opl.least.optimal import OptimalSearch
from tests.oracles.test_optimal import SETTINGS, recursive, v_row
from tests.support.planned import problem_of

FOLDER = Path(benchmarks.__path__[0])
CHECKER = (
    "intervals", "recheck", "recheck_arms", "recheck_bodies",
    "recheck_depth", "recheck_pass", "recheck_sides", "recheck_walls",
)  # fmt: skip


@cache
def searched():
    """Return the search of one row of the V part, done, and its certificate."""
    search = OptimalSearch(v_row(), SETTINGS, recursive(v_row))
    while not search.finished:
        search.step()
    certificate = certificate_of(v_row(), search.proof.walls, search.lower_bound)
    return search, json.loads(json.dumps(certificate))


def test_the_bound_of_a_row_of_the_v_part_is_proven_anew():
    holds, subproblems = recheck(searched()[1])
    assert holds
    assert subproblems < 1000


def test_the_printed_bound_of_the_v_part_as_shipped_is_proven_anew():
    certificate = certified("v_shape")
    assert set(certificate["pass_index"]) == set(range(5))
    holds, subproblems = recheck(json.loads(json.dumps(certificate)))
    assert holds
    assert subproblems < 1000


def test_a_bound_above_a_motion_that_exists_is_not_proven():
    search, certificate = searched()
    claim = 1.005 * search.plan.path.joint_range_sum
    assert not recheck({**certificate, "bound": claim})[0]


def test_a_bound_does_not_hold_without_what_it_rests_on():
    _, certificate = searched()
    assert not recheck({**certificate, "walls": certificate["walls"][:1]})[0]


def test_a_bound_that_rests_on_barriers_is_proven_anew_with_them_alone():
    certificate = json.loads(json.dumps(certified("s_shape:1")))
    assert recheck(certificate)[0]
    assert not recheck({**certificate, "barriers": []})[0]
    end = float(len(certificate["pass_index"]) - 1)
    longer = next((first, end, t) for first, last, t in certificate["barriers"] if last < end)
    with pytest.raises(ValueError, match="are not shut"):
        recheck({**certificate, "barriers": [longer]})


def test_a_triangle_that_is_too_deep_is_looked_at_however_little_it_is():
    """None is left out for a way out of the wheel that seems short enough."""
    random = np.random.default_rng(3)
    size = {"width": 0.05, "radius": 0.1, "max_roll": 0.5}
    shown = 0
    for _ in range(200):
        triangle = random.normal(size=(3, 3)) * random.uniform(0.0, 0.05)
        claim = {"wheel": size, "triangles": [triangle.tolist()]}
        some = Wheel({**claim, "penetration": 0.0})
        _, depth = some._witnesses(triangle - np.array([0.0, 0.0, size["radius"]]))
        if depth > 1e-4:
            wheel = Wheel({**claim, "penetration": 0.999 * depth})
            assert list(wheel.deep_points(wheel.triangles, 0.0))
            shown += 1
    assert shown > 50


def test_the_checker_uses_nothing_of_opl():
    for name in CHECKER:
        tree = ast.parse((FOLDER / f"{name}.py").read_text(encoding="utf-8"))
        modules = [
            module
            for node in ast.walk(tree)
            for module in (
                [node.module]
                if isinstance(node, ast.ImportFrom)
                else [alias.name for alias in node.names]
                if isinstance(node, ast.Import)
                else []
            )
        ]
        assert modules
        own = {f"benchmarks.{other}" for other in CHECKER}
        assert all(
            module in own or module.split(".")[0] not in ("opl", "benchmarks") for module in modules
        )


@cache
def ur10e_row():
    """Return the middle row of the V part on the UR10e."""
    return problem_of(job_of("v_shape:1@ur10e"))


@pytest.mark.parametrize(("make", "place"), [(v_row, 0), (v_row, 30), (v_row, 59), (ur10e_row, 30)])
def test_every_free_posture_lies_in_a_cell_of_the_checker(make, place):
    problem = make()
    certificate = json.loads(json.dumps(certificate_of(problem, [], 1.0)))
    last = problem.cell.wheel.last_position
    machine = Machine(certificate, COARSE)
    cells = machine.wall([(place, -last), (place, last)])
    t = np.linspace(-1.0, 1.0, 1001) * problem.cell.wheel.last_position
    Ts = problem.cell.Ts_base_flange(t, problem.points.Ts_workpiece_cutter[place])
    q = inverse_kinematics(problem.cell.robot.arm, Ts)
    nodes = problem.field.contact_positions
    near = np.clip(np.searchsorted(nodes, t), 1, len(nodes) - 1)
    free = ~(problem.cuts[place, near - 1] | problem.cuts[place, near])
    held = 0
    low, high = [], []
    for _, sign, shift in machine.arm.flips():
        moved = cells.moved(sign, shift, 0)
        low.append(moved.low)
        high.append(moved.high)
    low, high = np.concatenate(low), np.concatenate(high)
    for posture in q[free & ~np.isnan(q).any(axis=(1, 2))].reshape(-1, 6)[::3]:
        if not problem.cell.within_limits(posture):
            continue
        away = posture - (low + high) / 2.0
        away -= 2.0 * np.pi * np.round(away / (2.0 * np.pi))
        assert (np.abs(away) <= (high - low) / 2.0).all(axis=1).any()
        held += 1
    assert held > 100


@pytest.mark.parametrize("make", [v_row, ur10e_row], ids=["MH24", "UR10e"])
def test_bodies_that_surely_collide_do(make):
    scene, robot = make().scene.collision, make().cell.robot
    bodies = Bodies(json.loads(json.dumps(bodies_of(scene))))
    random = np.random.default_rng(4)
    q = random.uniform(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi), (1500, 6))
    turned = random.uniform(0.0, 0.02, q.shape)
    _, near = bodies.collide(q, np.zeros_like(q))
    surely, _ = bodies.collide(q, turned)
    assert (near <= scene.collides(q)).all()
    assert near.sum() > 0.9 * scene.collides(q).sum()
    assert surely.sum() > 0.5 * near.sum()
    for share in random.uniform(-1.0, 1.0, (8, *q.shape)):
        assert scene.collides((q + share * turned)[surely]).all()


def test_a_bound_may_rest_on_what_collides():
    search, certificate = searched()
    bodies = json.loads(json.dumps(bodies_of(v_row().scene.collision)))
    claim = {**certificate, "walls": certificate["walls"][:2]}
    # nothing that matters to this row
    assert not recheck({**claim, "bodies": bodies})[0]
    # one body more, where the wrist is, that must keep off what is held
    q = search.plan.path.q
    middle = forward_kinematics(v_row().cell.robot, q)[:, :3, 3].mean(axis=0)
    T_base_body = np.eye(4)
    T_base_body[:3, 3] = middle
    T_base_body[2, 3] += v_row().cell.robot.base_height
    wall = {
        **bodies,
        "joint": [*bodies["joint"], 0],
        "Ts_joint_body": [*bodies["Ts_joint_body"], T_base_body.tolist()],
        "sizes": [*bodies["sizes"], [1.0, 1.0, 1.0]],
        "corners": [*bodies["corners"], []],
        "pairs": [(bodies["joint"].index(6), len(bodies["joint"]), 0.0)],
    }
    assert recheck({**claim, "bodies": wall})[0]
