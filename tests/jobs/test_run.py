"""A run of a job: what its stages make, how it is watched and cancelled, where it is refused."""

import threading
from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest

import opl
from opl.run.remedies import Remedies
from opl.run.result import to_json
from opl.verification.replay import Verification
from tests.support.jobs import POST, write_job

pytestmark = pytest.mark.usefixtures("no_pictures")

QUICK = {"search.method": "recursive"}


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    return opl.load_job(write_job(tmp_path_factory.mktemp("job"), QUICK))


@pytest.fixture(scope="module")
def watched(job):
    """A run, and what was reported of its progress."""
    seen = []
    watch = opl.Watch(lambda stage, fraction: seen.append((stage, fraction)))
    return opl.run_job(job, watch), seen


# progress


def test_every_stage_reports_from_its_begin_to_its_end(watched):
    run, seen = watched
    stages = [(stage, [f for _, f in part]) for stage, part in groupby(seen, lambda one: one[0])]
    assert [stage.value for stage, _ in stages] == [
        "cutter_points", "nodes", "clearance", "search", "motion", "verification", "export",
        "read_back", "comparison", "export",
    ]  # fmt: skip
    for _, fractions in stages:
        assert fractions[0] == 0.0 and fractions[-1] == 1.0 and fractions == sorted(fractions)
    assert len(dict(stages)[opl.Stage.VERIFICATION]) > 3
    assert list(run.seconds) == list(dict.fromkeys(stage for stage, _ in seen))
    assert all(spent > 0.0 for spent in run.seconds.values())


def test_a_run_is_cancelled_by_its_progress_function(job):
    seen = []

    def stop(stage, fraction):
        seen.append((stage, fraction))
        if stage is opl.Stage.VERIFICATION and fraction > 0.0:
            watch.cancel()

    watch = opl.Watch(stop)
    with pytest.raises(opl.Cancelled, match="cancelled during stage verification"):
        opl.run_job(job, watch)
    stage, fraction = seen[-1]
    assert stage is opl.Stage.VERIFICATION and fraction < 1.0


def test_a_run_is_cancelled_from_another_thread(job):
    watch, begun = opl.Watch(lambda stage, fraction: begun.set()), threading.Event()
    other = threading.Thread(target=lambda: begun.wait() and watch.cancel())
    other.start()
    with pytest.raises(opl.Cancelled):
        opl.run_job(job, watch)
    other.join()


def test_a_search_ends_with_the_best_so_far_and_the_run_goes_on_with_it(tmp_path):
    def stop(stage, fraction):
        if stage is opl.Stage.SEARCH and watch.so_far is not None:
            seen.append(watch.so_far)
            watch.take_best()

    job = opl.load_job(write_job(tmp_path, {"search.method": "optimal"}))
    seen, watch = [], opl.Watch(lambda *given: stop(*given))
    assert watch.so_far is None
    run = opl.run_job(job, watch)
    path = opl.make_report(run).path
    last = watch.so_far
    assert run.status == "ok" and last.value is not None and len(seen) >= 1
    assert path.joint_range_sum_rad == pytest.approx(last.value, abs=1e-6)
    assert path.lower_bound_rad == pytest.approx(last.lower_bound, abs=1e-6)
    assert path.open_because.startswith("the search was ended")


def test_what_the_progress_function_raises_ends_the_run(job):
    def stumble(stage, fraction):
        raise KeyError("of the caller")

    with pytest.raises(KeyError, match="of the caller"):
        opl.run_job(job, opl.Watch(stumble))


def test_the_search_for_remedies_can_be_cancelled(tmp_path):
    job = opl.load_job(write_job(tmp_path, {**QUICK, "obstacles": [POST]}))
    seen = []

    def stop(stage, fraction):
        if stage is opl.Stage.REMEDIES:
            seen.append(fraction)
            if len(seen) == 3:
                watch.cancel()

    watch = opl.Watch(stop)
    with pytest.raises(opl.Cancelled, match="remedies"):
        opl.run_job(job, watch)
    assert len(seen) == 3


# values


def test_the_stages_one_by_one_make_the_program_of_the_whole_run(job, watched, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    surfaced = opl.cut_surface(job)
    planned = opl.plan_path(surfaced)
    proven = opl.verify_motion(planned)
    run = opl.write_program(proven)
    assert isinstance(run, opl.Written)
    assert run.proven is proven and proven.planned is planned and planned.surfaced is surfaced
    whole = watched[0]
    names = ["V_SHAPE.JBI", "V_SHAPE.csv", "V_SHAPE_motion.json"]
    assert list(run.files) == list(whole.files) == names
    assert run.files["V_SHAPE.csv"] == whole.files["V_SHAPE.csv"]


def test_a_value_cannot_be_changed(watched):
    with pytest.raises(AttributeError):
        watched[0].program = None


def test_the_report_is_the_result_in_plain_numbers(watched):
    run, _ = watched
    report = opl.make_report(run)
    path = run.proven.planned.plan.path
    assert report.path.joint_range_sum_rad == pytest.approx(path.joint_range_sum, abs=1e-6)
    assert report.program.files == ["V_SHAPE.JBI", "V_SHAPE.csv", "V_SHAPE_motion.json"]
    assert report.seconds["total"] == pytest.approx(sum(run.seconds.values()), abs=1e-4)
    error = [abs(one.written_s / one.wanted_s - 1.0) for one in report.program.passes]
    told = [abs(one.error_percent) for one in report.program.passes]
    assert told == pytest.approx([100.0 * value for value in error], abs=0.02)
    with pytest.raises(TypeError, match="set has no place in JSON"):
        to_json({"job": {1}})


# refusals: what was reached, and why there is no program


def refused(run, status, reached, cause):
    assert isinstance(run, opl.Refused) and run.status == status
    assert isinstance(run.reached, reached) and isinstance(run.cause, cause)
    assert not hasattr(run, "program") and not hasattr(run, "files")
    report = opl.make_report(run)
    assert report.status == status and list(report.reasons) == list(run.reasons) != []
    assert report.program is None and report.cycle is None
    assert all(reason in str(run.error) for reason in run.reasons)
    return report


def test_without_a_path_the_comparison_is_reached(tmp_path, monkeypatch):
    told = Remedies(("a larger wheel",), ("another width: 6 tried, none opens the job",))
    monkeypatch.setattr("opl.run.stages.find_remedies", lambda *arguments: told)
    job = opl.load_job(write_job(tmp_path, {**QUICK, "obstacles": [POST]}))
    run = opl.run_job(job)
    report = refused(run, "no_path", opl.Prepared, opl.NoPathError)
    assert report.path is None and report.verification is None and report.fixed is not None
    assert report.remedies == told.found and "a larger wheel" in str(run.error)
    assert report.tried_in_vain == told.in_vain
    assert run.error.exit_status == 3


def test_a_belt_that_dwells_too_long_leaves_the_plan_and_no_program(job):
    process = replace(job.process, max_dwell=1e-6, contact_speed=0.5)
    report = refused(
        opl.run_job(replace(job, process=process)), "no_path", opl.Planned, opl.NoPathError
    )
    assert report.path is not None and report.feed.lowered and report.verification is None


def test_a_replay_with_findings_is_reported_without_a_program(watched, monkeypatch):
    planned = watched[0].proven.planned
    timed = planned.timed
    q = timed.motion.q.copy()
    q[len(q) // 2] += np.deg2rad(5.0)
    timed = replace(timed, motion=replace(timed.motion, q=q))
    run = opl.verify_motion(replace(planned, timed=timed))
    report = refused(run, "unsafe", opl.Planned, Verification)
    assert report.verification.file is None and run.error.exit_status == 4
