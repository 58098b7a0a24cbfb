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
from benchmarks.certificate import certificate_of, certified
from benchmarks.recheck import recheck
from benchmarks.recheck_walls import COARSE, Machine
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.planning.optimal import OptimalSearch
from tests.oracles.test_optimal import SETTINGS, recursive, v_row

FOLDER = Path(benchmarks.__path__[0])
CHECKER = ("intervals", "recheck", "recheck_walls")


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
    certificate, printed = certified("v_shape")
    assert certificate["bound"] == printed
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


@pytest.mark.parametrize("place", [0, 30, 59])
def test_every_free_posture_lies_in_a_cell_of_the_checker(place):
    problem, (_, certificate) = v_row(), searched()
    last = problem.cell.wheel.last_position
    cells = Machine(certificate, COARSE).wall([(place, -last), (place, last)])
    t = np.linspace(-1.0, 1.0, 1001) * problem.cell.wheel.last_position
    Ts = problem.cell.Ts_base_flange(t, problem.points.Ts_workpiece_cutter[place])
    q = inverse_kinematics(problem.cell.robot.arm, Ts)
    nodes = problem.field.contact_positions
    near = np.clip(np.searchsorted(nodes, t), 1, len(nodes) - 1)
    free = ~(problem.cuts[place, near - 1] | problem.cuts[place, near])
    held = 0
    for family in range(4):
        middle = (cells.low + cells.high) / 2.0
        own = cells.family == family
        for posture in q[free & ~np.isnan(q[:, family, 0]), family]:
            if not problem.cell.within_limits(posture):
                continue
            away = posture - middle[own]
            away -= 2.0 * np.pi * np.round(away / (2.0 * np.pi))
            assert (np.abs(away) <= (cells.high - cells.low)[own] / 2.0).all(axis=1).any()
            held += 1
    assert held > 100
