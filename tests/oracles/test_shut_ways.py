"""Between which cutter points a part is taken for shut, against places a hundredth apart."""

import numpy as np
import pytest

from benchmarks.stranger_jobs import draw_job
from opl.job.load import load_job
from opl.job.methods import Method
from opl.least.least_range import plan_optimal
from opl.planning.depths import nearer_nodes
from tests.support.planned import problem_of

PLACES = 101


@pytest.fixture(scope="module")
def crest(tmp_path_factory):
    """Return a random job, and its first pass around a crest of its wavy surface.

    Before the crest the wheel can touch on one side only, behind it on the other: it can get from
    one to the other on the crest alone, between two cutter points, where all of it fits in.
    """
    drawn = draw_job(20263805, 7, 1, tmp_path_factory.mktemp("crest"))
    job = load_job(drawn.job)
    return job, problem_of(job, slice(34, 47))


def bands(flags):
    ends = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return ends.reshape(-1, 2).tolist()


def test_a_band_that_is_shut_cuts_into_the_wheel_all_the_way_somewhere(crest):
    _, problem = crest
    both = problem.cuts[:-1] & problem.cuts[1:]
    grid = np.broadcast_to(problem.field.contact_positions, (PLACES, both.shape[1]))
    opened = 0
    for edge in range(len(both)):
        places = edge + np.linspace(0.0, 1.0, PLACES)
        asked = np.broadcast_to(both[edge], grid.shape)
        deep = nearer_nodes(problem.scene, problem.points.at_places(places), grid, asked)
        for first, end in bands(both[edge]):
            here = problem.shut[edge, first:end]
            all_the_way = deep[:, first:end].all(axis=0)
            assert all_the_way.any() or not here.any()
            # and what is open half-way is no part of it: cutter points are 2 mm apart
            assert not here[~deep[PLACES // 2, first:end]].any()
            if all_the_way.any():
                assert here[all_the_way].all()
            opened += not here.any()
        assert not problem.shut[edge, ~both[edge]].any()
    assert 0 < opened < 3


def test_a_motion_crosses_the_wheel_on_the_crest(crest):
    job, problem = crest
    assert job.search.method is Method.OPTIMAL
    plan = plan_optimal(problem, job.search.optimal, None)
    assert plan.gap < 2e-3
    t = plan.path.contact_position
    flat = problem.cell.wheel.flat_end
    assert t.min() < -0.3 * flat and t.max() > 0.3 * flat
