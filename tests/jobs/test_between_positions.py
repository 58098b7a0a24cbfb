"""Where no contact position of the field will do, one between them may; else none is proven."""

from dataclasses import replace

import pytest

import opl
from opl.planning.multi_start import plan_recursive, try_recursive
from opl.planning.plan import Exhausted
from opl.planning.settings import Start
from opl.run.searches import search_path
from tests.support.jobs import write_job
from tests.support.planned import problem_of

NARROW = 0.005  # [rad] beyond the least motion that joints may turn


@pytest.fixture(scope="module")
def narrow(tmp_path_factory):
    """Return a job whose joint limits leave little but its least motion, and that motion."""
    job = opl.load_job(write_job(tmp_path_factory.mktemp("job")))
    plan = search_path(job.search, problem_of(job)).plan
    lower, upper = plan.motion.q.min(axis=0) - NARROW, plan.motion.q.max(axis=0) + NARROW
    robot = replace(job.cell.robot, lower=lower, upper=upper)
    return replace(job, cell=replace(job.cell, robot=robot)), plan


def test_a_motion_between_the_contact_positions_is_found(narrow):
    job, least = narrow
    problem = problem_of(job)
    assert isinstance(try_recursive(problem, Start.BEST, None), Exhausted)
    found = search_path(job.search, problem)
    assert found.recursive is None
    assert found.plan.gap <= 1e-3
    assert found.plan.lower_bound <= least.path.joint_range_sum
    assert job.cell.within_limits(found.plan.path.q).all()


def test_the_recursive_search_says_where_it_looked(narrow):
    job, _ = narrow
    with pytest.raises(opl.NoPathError) as caught:
        plan_recursive(problem_of(job))
    assert caught.value.reasons[-1] == "looked for at 40 contact positions, not between them"


def test_limits_that_leave_no_motion_are_proven_to(narrow):
    job, least = narrow
    lower = least.motion.q.min(axis=0)
    lower[1] = least.path.q[:, 1].max() + 0.01  # all of the pass lies below
    upper = job.cell.robot.upper.copy()
    upper[1] = lower[1] + 0.1
    shut = replace(
        job, cell=replace(job.cell, robot=replace(job.cell.robot, lower=lower, upper=upper))
    )
    with pytest.raises(opl.NoPathError, match="no path") as caught:
        search_path(shut.search, problem_of(shut))
    assert caught.value.reasons[-1].startswith("proven: no motion along these passes, at any ")
