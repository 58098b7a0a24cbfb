"""Random jobs of which the least joint travel was far from what was found, or from its bound."""

import pytest

import opl
from benchmarks.stranger_jobs import draw_job
from opl.run.searches import search_path
from tests.support.planned import problem_of


@pytest.mark.parametrize(
    ("seed", "index", "attempt", "most"),
    [
        (20262001, 29, 0, 0.02),  # a hollow: the part sinks between cutter points, past barriers
        (20262001, 14, 0, 0.01),  # a torus: the cheapest branch is not that of many cutter points
        (20262002, 12, 0, 0.001),  # a blade: its retract does not exist where travel is least
        (20264803, 8, 0, 0.001),  # a wavy part: joints are held still along its passes
        (20262001, 28, 0, 0.0),  # a cylinder that rests
    ],
)
def test_what_is_found_is_near_to_its_bound(seed, index, attempt, most, tmp_path):
    drawn = draw_job(seed, index, attempt, tmp_path, "travel")
    job = opl.load_job(drawn.job)
    problem = problem_of(job)
    found = search_path(job.search, problem).plan.objective
    assert found.gap <= most
