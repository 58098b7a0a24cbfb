"""How far the contact may move between neighbouring cutter points is kept, whatever is searched."""

from dataclasses import replace

import numpy as np
import pytest

import opl
from benchmarks.stranger_jobs import draw_job
from opl.job.methods import Method, Objective
from opl.planning.multi_start import held_back, try_recursive
from opl.planning.settings import Start
from opl.run.remedies import find_remedies
from opl.run.searches import search_path
from opl.run.surfacing import cut_surface
from tests.support.jobs import write_job
from tests.support.planned import problem_of


def largest_change(path):
    """Return how far t moves between neighbouring cutter points of a pass at the most."""
    changes = []
    for number in range(int(path.cutter_point[-1])):
        here, there = (np.flatnonzero(path.cutter_point == k) for k in (number, number + 1))
        if path.pass_index[here[-1]] == path.pass_index[there[0]]:
            t = path.contact_position
            changes.append(abs(t[there[0]] - t[here[-1]]))
    return max(changes)


def with_change(job, most, **search):
    rule = replace(job.search.interpolation, max_contact_change=most)
    return replace(job, search=replace(job.search, interpolation=rule, **search))


@pytest.mark.parametrize(
    ("method", "objective"),
    [
        (Method.RECURSIVE, Objective.RANGE),
        (Method.OPTIMAL, Objective.RANGE),
        (Method.OPTIMAL, Objective.TRAVEL),
        (Method.OPTIMAL, Objective.WEIGHTED),
    ],
)
def test_every_search_keeps_it(method, objective, tmp_path):
    job = opl.load_job(write_job(tmp_path))
    little = replace(job.search.optimal, max_subproblems=500)  # what is found keeps it at any time
    job = replace(job, search=replace(job.search, optimal=little))
    free = search_path(replace(job.search, method=method, objective=objective), problem_of(job))
    assert largest_change(free.plan.path) > 12.0
    limited = with_change(job, 12.0, method=method, objective=objective)
    kept = search_path(limited.search, problem_of(limited))
    assert largest_change(kept.plan.path) <= 12.0 + 1e-9
    assert largest_change(kept.recursive.path) <= 12.0 + 1e-9


def test_between_contact_positions_less_than_their_distance_is_found_too(tmp_path):
    draw_job(20261318, 54, 0, tmp_path)
    job = with_change(opl.load_job(tmp_path / "job.yaml"), 0.3)
    found = search_path(job.search, problem_of(job))
    assert largest_change(found.recursive.path) == 0.0  # the field has nothing so near
    assert 0.0 < largest_change(found.plan.path) <= 0.3
    assert found.plan.gap <= 1e-3


@pytest.fixture
def barely_open(tmp_path):
    """Return a job whose limits leave little but the path of least joint range sum."""
    job = opl.load_job(write_job(tmp_path))
    q = search_path(job.search, problem_of(job)).plan.motion.q
    robot = replace(job.cell.robot, lower=q.min(axis=0) - 0.02, upper=q.max(axis=0) + 0.02)
    return replace(job, cell=replace(job.cell, robot=robot))


def test_where_it_shuts_the_field_the_search_goes_on_and_the_key_is_named(barely_open):
    assert search_path(barely_open.search, problem_of(barely_open)).plan is not None
    job = with_change(barely_open, 0.5)
    problem = problem_of(job)
    assert held_back(problem, try_recursive(problem, Start.BEST, None).matrices)
    little = replace(job.search, optimal=replace(job.search.optimal, max_subproblems=1000))
    with pytest.raises(opl.NoPathError, match=r"40 contact positions .* search.max_contact_change"):
        search_path(little, problem)


def test_a_larger_one_that_opens_the_job_is_told(barely_open):
    job = with_change(barely_open, 0.5)
    remedies = find_remedies(job, cut_surface(job).points)
    (told,) = [line for line in remedies.found if "search.max_contact_change" in line]
    larger = float(told.split("search.max_contact_change ")[1].split(" instead of 0.5")[0])
    opened = with_change(barely_open, larger)
    assert search_path(opened.search, problem_of(opened)).plan is not None
