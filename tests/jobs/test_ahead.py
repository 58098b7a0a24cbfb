"""A job that is read and cut in a copy of the process: the same job, points and refusals."""

import pickle
import shutil
import subprocess
import sys

import numpy as np
import pytest

import opl
from opl.errors import SettingError
from tests.support.jobs import V_JOB

# what reads and checks files: everything with a model of what is in them needs the second
READS = {"pydantic", "opl.files.documents", "opl.files.quantities", "opl.files.yaml_text"}


def loaded_by(script, *arguments):
    """The modules that a process has loaded at the end of a script."""
    ended = subprocess.run(
        [sys.executable, "-c", f"import sys\n{script}\nprint(*sys.modules)", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(ended.stdout.splitlines()[-1].split())


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
@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("passes:", "pases:", "pases: unknown key"),  # by the job alone
        ("robot: mh24", "robot: none", "unknown robot 'none'"),  # with what it names
        ("home_deg: [15,", "home_deg: [720,", "joint S must be in -180 to 180"),
    ],
)
def test_a_job_that_cannot_be_used_is_refused_with_the_same_words(
    tmp_path, old, new, told, workers
):
    job = shutil.copytree(V_JOB.parent, tmp_path / "v") / V_JOB.name
    job.write_text(V_JOB.read_text().replace(old, new))
    with pytest.raises(opl.InputError, match=told) as alone:
        opl.load_job(job)
    with pytest.raises(opl.InputError) as refused, opl.job_ahead(job, None, workers):
        pass
    assert str(refused.value) == str(alone.value)


@pytest.mark.parametrize("kind", [opl.InputError, SettingError])
def test_a_refusal_is_passed_on_whole(kind):
    error = pickle.loads(pickle.dumps(kind("job.yaml: name", "is missing")))
    assert type(error) is kind and error.where == "job.yaml: name"
    assert str(error) == "job.yaml: name: is missing"


def test_values_of_a_job_and_what_plans_load_nothing_that_reads(tmp_path):
    passed = tmp_path / "surfaced"
    passed.write_bytes(pickle.dumps(opl.cut_surface(opl.load_job(V_JOB))))
    script = """
import pickle
with open(sys.argv[1], "rb") as file:
    surfaced = pickle.load(file)
import opl.run.stages, opl.run.reporting, opl.run.delivery
"""
    loaded = loaded_by(script, passed)
    assert {"numpy", "opl.job.values", "opl.run.delivery"} <= loaded
    assert not loaded & {"yaml", *READS}


def test_a_process_with_a_copy_reads_no_job_itself():
    script = """
import opl
from pathlib import Path
with opl.job_ahead(Path(sys.argv[1]), workers=2) as (job, surfaced):
    assert len(surfaced.value().points)
"""
    loaded = loaded_by(script, V_JOB)
    assert {"opl.run.delivery", "numba"} <= loaded
    assert not loaded & {"opl.job.load", "scipy.interpolate", *READS}


def test_a_job_is_refused_before_all_is_loaded_that_plans(tmp_path):
    job = tmp_path / "job.yaml"
    job.write_text("nmae: V\n")
    script = """
import opl
from pathlib import Path
try:
    with opl.job_ahead(Path(sys.argv[1]), workers=2):
        pass
except opl.InputError as error:
    assert "nmae: unknown key" in str(error)
"""
    loaded = loaded_by(script, job)
    assert "opl.run.searches" in loaded
    assert not loaded & {"numba", "pybullet", "opl.run.stages", *READS}


def test_a_surface_is_passed_on_without_what_evaluates_it_and_evaluates_to_the_same():
    surface = opl.load_job(V_JOB).surface.faces[0].surface
    uv = np.full(2, 0.3)
    point = surface.point(uv)
    content = pickle.dumps(surface)
    assert b"scipy" not in content
    np.testing.assert_array_equal(pickle.loads(content).point(uv), point)
