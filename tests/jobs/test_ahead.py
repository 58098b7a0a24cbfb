"""A job that is read and cut in a copy of the process: the same job, points and refusals."""

import pickle

import numpy as np
import pytest

import opl
from tests.support.jobs import V_JOB


@pytest.mark.parametrize("workers", [1, 2])
def test_the_job_and_its_points_are_those_of_one_process(workers):
    alone = opl.cut_surface(opl.load_job(V_JOB, method="recursive"))
    with opl.job_ahead(V_JOB, "recursive", workers) as (job, surfaced):
        cut = surfaced.value()
    assert job.name == alone.job.name and job.inputs == alone.job.inputs
    assert cut.job.search.method == alone.job.search.method
    assert pickle.dumps(cut.inspection) == pickle.dumps(alone.inspection)
    np.testing.assert_array_equal(cut.points.Ts_workpiece_cutter, alone.points.Ts_workpiece_cutter)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_job_that_cannot_be_used_is_refused_with_the_same_words(tmp_path, workers):
    job = tmp_path / "job.yaml"
    job.write_text("name: V\nrobot: none\n")
    with pytest.raises(opl.InputError) as alone:
        opl.load_job(job)
    with pytest.raises(opl.InputError) as refused, opl.job_ahead(job, None, workers):
        pass
    assert str(refused.value) == str(alone.value)


def test_a_surface_is_passed_on_without_what_evaluates_it_and_evaluates_to_the_same():
    surface = opl.load_job(V_JOB).surface.faces[0].surface
    uv = np.full(2, 0.3)
    point = surface.point(uv)
    content = pickle.dumps(surface)
    assert b"scipy" not in content
    np.testing.assert_array_equal(pickle.loads(content).point(uv), point)
