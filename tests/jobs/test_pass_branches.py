"""Passes each on an IK branch of their own, where that keeps the joint range sum small."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import yaml

from opl.cell.full_turns import principal
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import forward_kinematics
from opl.job.load import load_job
from opl.least.least_range import plan_optimal
from opl.planning.multi_start import plan_recursive
from opl.planning.survey import survey_nodes
from opl.run.searches import search_path
from tests.support.jobs import opl, write_ball, write_robot
from tests.support.planned import problem_of

pytestmark = pytest.mark.usefixtures("no_pictures")
B = 4


@cache
def ball_job():
    with TemporaryDirectory() as home:
        return load_job(write_ball(Path(home)))


@cache
def ball():
    return problem_of(ball_job())


@cache
def ball_plan():
    return search_path(ball_job().search, ball()).plan


def test_the_motion_is_planned_written_and_proven_from_its_file(tmp_path):
    job = write_ball(tmp_path)
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    path = json.loads((tmp_path / "out" / "result.json").read_text())["path"]
    branches = path["branch"].split("; ")
    assert sorted(one.rpartition(" on pass ")[0] for one in branches) == [
        "front, elbow up, flip", "front, elbow up, no flip",
    ]  # fmt: skip
    assert [one.rpartition(" on pass ")[2] for one in branches] == ["1", "2"]
    assert path["gap"] <= 1e-3
    assert f"branch {path['branch']}\n" in ended.out
    verified = opl("verify", job, tmp_path / "out" / "BALL.JBI")
    assert verified.status == 0, verified.err
    assert "2 passes" in verified.out and verified.out.endswith("proven\n")


def test_every_configuration_is_on_the_branch_of_its_pass():
    path, arm = ball_plan().path, ball().cell.robot.arm
    assert path.ik_branches[0] ^ path.ik_branches[1] == 4  # the wrist to the other side
    solutions = inverse_kinematics(arm, forward_kinematics(ball().cell.robot, path.q), path.q)
    found = solutions[np.arange(len(path.q)), path.ik_branches[path.pass_index]]
    np.testing.assert_allclose(principal(found - path.q), 0.0, atol=1e-7)
    for end in (end for ends in path.pass_ends() for end in ends):
        assert end.ik_branch == path.ik_branches[ball().points.pass_index[end.cutter_point]]


@pytest.mark.parametrize("limit", ["lower", "upper"])
def test_no_motion_with_the_wrist_to_one_side_comes_near(limit):
    job = ball_job()
    robot = job.cell.robot
    one_side = replace(robot, **{limit: np.where(np.arange(6) == B, 0.0, getattr(robot, limit))})
    problem = problem_of(replace(job, cell=replace(job.cell, robot=one_side)))
    plan = plan_optimal(problem, job.search.optimal, plan_recursive(problem))
    assert len(set(plan.path.ik_branches.tolist())) == 1
    assert plan.lower_bound > 1.5 * ball_plan().path.joint_range_sum


NARROW = {"R": (-15, 15), "T": (-20, 20)}  # the wrist cannot turn half around between the passes


def test_passes_that_no_branch_grinds_together_have_a_path(tmp_path):
    job = write_ball(tmp_path)
    write_robot(tmp_path / "arm", NARROW)
    content = yaml.safe_load(job.read_text())
    job.write_text(yaml.safe_dump({**content, "robot": "arm"}))
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert "on pass 1; " in result["path"]["branch"]
    assert result["path"]["gap"] <= 1e-3
    assert "recursive" not in result["compared"]
    recursive = opl("run", job, "--method", "recursive", "--out", tmp_path / "other")
    assert "no path" in recursive.err


def test_the_survey_is_of_the_branch_of_each_pass():
    problem, path = ball(), ball_plan().path
    branches = path.ik_branches[problem.points.pass_index]
    survey = survey_nodes(problem, branches, np.zeros(6))
    for branch in path.ik_branches.tolist():
        alone = survey_nodes(problem, branch, np.zeros(6))
        own = branches == branch
        np.testing.assert_array_equal(survey.states[own], alone.states[own])
        np.testing.assert_array_equal(survey.q[own], alone.q[own])
