"""Approaches and retracts that are as long as they are free."""

from dataclasses import replace

import numpy as np
import pytest

from opl.motion.motion import MoveKind
from opl.motion.whole_motion import UnreachableApproachError, lead, whole_motion
from opl.planning.track_check import Free, check_path
from tests.support.planned import small_plan, small_problem, with_problem_cell


def asked_for(problem, path, kind):
    end = path.pass_ends()[0][0] if kind is MoveKind.APPROACH else path.pass_ends()[-1][1]
    return problem.points, problem.process, end


def found_of(problem, path, kind=MoveKind.RETRACT):
    return problem.scene.free_leads.find(*asked_for(problem, path, kind))


def whole_of(problem, path, kind=MoveKind.RETRACT):
    return lead(problem.cell, *asked_for(problem, path, kind))


def with_lower_limit(problem, joint, least):
    lower = problem.cell.robot.lower.copy()
    lower[joint] = least
    robot = replace(problem.cell.robot, lower=lower)
    return with_problem_cell(problem, replace(problem.cell, robot=robot))


def test_a_lead_that_is_free_is_as_long_as_the_job_says():
    problem = small_problem()
    for kind in (MoveKind.APPROACH, MoveKind.RETRACT):
        path = small_plan().path
        np.testing.assert_array_equal(found_of(problem, path, kind), whole_of(problem, path, kind))


def test_a_lead_ends_before_a_limit_where_a_free_move_may_begin():
    problem, path = small_problem(), small_plan().path
    whole = whole_of(problem, path)
    least = whole[-1, 2] + 0.3 * (whole[0, 2] - whole[-1, 2])
    shut = with_lower_limit(problem, 2, least)
    with pytest.raises(UnreachableApproachError):
        whole_motion(shut.cell, shut.points, path, shut.process)
    found = found_of(shut, path)
    assert 0 < len(found) < len(whole)
    assert found[:, 2].min() >= least
    assert shut.scene.free_moves.blocked_at(found[-1]) is None
    checked = check_path(shut, path)
    assert isinstance(checked, Free)
    retract = [q for q, kind in zip(checked.motion.q, checked.motion.kind, strict=True)
               if kind is MoveKind.RETRACT]  # fmt: skip
    np.testing.assert_array_equal(np.array(retract[-len(found) :]), found)


def test_a_free_lead_at_whose_end_no_free_move_may_begin_ends_before(monkeypatch):
    problem, path = small_problem(), small_plan().path
    fresh, whole = with_problem_cell(problem, problem.cell), whole_of(problem, path)
    away = np.abs(whole - whole[-1]).max(axis=1)

    def blocked(q):
        near = np.abs(q - whole[-1]).max() < away[-4]  # so is the end of each shorter run
        return ("R_link", "wheel") if near else None

    monkeypatch.setattr(fresh.scene.free_moves, "blocked_at", blocked)
    found = found_of(fresh, path)
    assert 0 < len(found) <= len(whole) - 3
    assert blocked(found[-1]) is None


def test_a_lead_of_which_nothing_is_free_is_refused():
    problem, path = small_problem(), small_plan().path
    whole = whole_of(problem, path)
    shut = with_lower_limit(problem, 2, whole[0, 2] + 1e-6)
    checked = check_path(shut, path)
    assert str(checked.error).endswith("limits of U")


def test_leads_of_a_path_are_those_of_each_end_alone():
    problem, path = small_problem(), small_plan().path
    whole = whole_of(problem, path)
    # leads are cut short there
    shut = with_lower_limit(problem, 2, whole[-1, 2] + 0.3 * (whole[0, 2] - whole[-1, 2]))
    together = shut.scene.free_leads.of_path(shut.points, path, shut.process)
    lengths = set()
    for pair, ends in zip(together, path.pass_ends(), strict=True):
        for found, end in zip(pair, ends, strict=True):
            alone = with_problem_cell(problem, shut.cell).scene.free_leads
            np.testing.assert_array_equal(found, alone.find(shut.points, shut.process, end))
            lengths.add(len(found))
    assert 0 < min(lengths) < max(lengths) < len(whole)
