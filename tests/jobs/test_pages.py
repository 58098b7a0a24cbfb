"""The pages of runs, cutter points, cells and batches, as texts."""

import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

import opl
from opl.run.batch_page import batch_page
from opl.run.delivery import deliver
from tests.support.jobs import POST, document, write_job, write_trough
from tests.support.jobs import opl as run_opl


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    home = tmp_path_factory.mktemp("good")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", "1700000000")
        run = opl.run_job(opl.load_job(write_job(home)))
    deliver(run, home / "out" / "V_SHAPE")
    return run, home


@pytest.fixture(scope="module")
def blocked(tmp_path_factory):
    obstacles = [*document()["obstacles"], POST]
    job = write_job(tmp_path_factory.mktemp("blocked"), {"obstacles": obstacles})
    return opl.run_job(opl.load_job(job))


def data_of(page):
    """Return what the script of a page draws."""
    (found,) = re.findall('<script type="application/json" id="page-data">(.*)</script>', page)
    return json.loads(found)


def page_of(good):
    return (good[1] / "out" / "V_SHAPE" / "report.html").read_text(encoding="utf-8")


def test_a_page_asks_for_nothing_and_its_policy_forbids_it(good):
    page = page_of(good)
    assert "default-src 'none'" in page
    body = page[: page.rindex("<script>")]  # the bundle of three.js names addresses in comments
    assert not re.search(r"""(?:src|href)=["'](?!data:)""", body)
    assert "@import" not in page and "url(" not in page[: page.index("</style>")]


def test_pictures_drawn_beside_the_verification_are_the_same_to_the_byte(good, monkeypatch):
    run, home = good
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    other = opl.run_job(opl.load_job(home / "job.yaml"), workers=2)
    assert other.files == run.files and list(other.files) == list(run.files)
    assert opl.run_page(other, opl.make_report(other)) == page_of(good)


def test_the_page_says_what_the_result_says(good):
    run, page = good[0], page_of(good)
    report = opl.make_report(run)
    for figure in (
        f"{report.verification.min_clearance_mm:.3f} mm",
        f"{report.path.joint_range_sum_rad:.6f}",
        f"{report.path.lower_bound_rad:.6f} rad",
        f"{report.cycle.total_s:.3f}",
        *report.program.sha256.values(),
        *report.inputs.values(),
        f"made by opl {report.opl}, replayed in {report.verification.engine}",
        *(f"<td>{part.seconds:.3f}</td>" for part in report.cycle.parts),
    ):
        assert figure in page
    assert "pulse ratios of R, B, T" in page and "wherever the robot stands" in page
    # times of the machine would make two runs differ
    assert "seconds" not in data_of(page)


def test_the_same_run_gives_the_same_page(good):
    report = opl.make_report(good[0])
    assert opl.run_page(good[0], report) == page_of(good)


def test_the_trace_is_the_proven_motion(good):
    run, home = good
    trace = json.loads((home / "out" / "V_SHAPE" / "V_SHAPE_motion.json").read_text())
    verified = run.proven.motion
    assert trace["q_rad"] == [[round(value, 9) + 0.0 for value in q] for q in verified.motion.q]
    assert trace["time_s"][-1] == pytest.approx(verified.timed.seconds, abs=1e-6)
    assert trace["kind"] == [kind.value for kind in verified.motion.kind]
    assert trace["t"][0] is None and trace["pass"][-1] is None


def test_charts_are_delivered_as_png_where_asked_for_and_go_with_the_next_run(good, tmp_path):
    deliver(opl.with_png(good[0]), tmp_path / "out")
    names = {"V_SHAPE_contact.png", "V_SHAPE_joints.png"}
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    for name in names:
        content = (tmp_path / "out" / name).read_bytes()
        assert content[:4] == b"\x89PNG"
        assert hashlib.sha256(content).hexdigest() == result["program"]["sha256"][name]
    deliver(good[0], tmp_path / "out")
    assert names.isdisjoint(path.name for path in (tmp_path / "out").iterdir())


def test_what_the_replay_found_least_or_largest_leads_to_its_configuration(good):
    run, page = good[0], page_of(good)
    found, marks = opl.make_report(run).verification, data_of(page)["marks"]
    assert np.allclose(np.rad2deg(marks["nearest"]["q"]), found.min_clearance_at.joints_deg)
    assert 'data-mark="nearest"' in page and found.min_clearance_at.place in page


def test_every_move_has_its_line_in_the_listing(good):
    run, data = good[0], data_of(page_of(good))
    assert data["program"]["lines"]["shape"] == [len(run.program.moves), 3]


def test_a_refused_job_begins_where_it_is_blocked(blocked):
    page = opl.run_page(blocked, opl.make_report(blocked))
    start = data_of(page)["marks"]["start"]
    named = re.search(r"cutter points? (\d+)(?: to (\d+))?", blocked.reasons[1])
    assert int(named[1]) <= start["point"] <= int(named[2] or named[1])
    assert "No path: no program was written" in page
    for line in (*blocked.reasons, *blocked.remedies, *blocked.in_vain):
        assert line.split(":")[0] in page
    assert "of these: part and post" in page and "collides with what stands around" in page


def test_a_motion_that_the_replay_refuses_begins_at_its_first_finding(tmp_path, monkeypatch):
    monkeypatch.setattr("opl.motion.collision_check.MoveCheck.colliding", lambda *arguments: [])
    monkeypatch.setattr("opl.planning.track_check.linked", lambda motion, links: motion)
    obstacles = [*document()["obstacles"], POST]
    run = opl.run_job(opl.load_job(write_job(tmp_path, {"obstacles": obstacles})))
    assert run.status == "unsafe"
    page = opl.run_page(run, opl.make_report(run))
    marks = data_of(page)["marks"]
    motion, first = run.reached.timing.timed.motion, run.cause.findings[0]
    assert motion.place(marks["start"]["move"]) == first.where
    assert set(marks["start"]["hit"]) == set(first.message.split(":")[0].split(" and "))
    assert 'data-mark="reason-0"' in page


def test_hostile_names_stay_text(tmp_path):
    name = "<script>alert(1)</script>"
    obstacles = [*document()["obstacles"], {**POST, "name": name, "at_mm": [-900, -900, 0]}]
    job = opl.load_job(write_job(tmp_path, {"obstacles": obstacles, "search.method": "recursive"}))
    run = opl.run_job(job)
    page = opl.run_page(run, opl.make_report(run))
    assert name not in page and "&lt;script&gt;alert(1)" in page
    assert name in [solid["name"] for solid in data_of(page)["cell"]["solids"]]


def test_a_page_is_found_by_job_folder_and_program(good, monkeypatch, tmp_path):
    home = good[1]
    monkeypatch.chdir(home)
    folder = Path("out") / "V_SHAPE"
    for target in ("job.yaml", folder, folder / "V_SHAPE.JBI"):
        ended = run_opl("view", "--path", target)
        assert (ended.status, ended.out) == (0, f"{folder / 'report.html'}\n"), ended.err
    (tmp_path / "report.html").write_text("")
    for name in ("V_SHAPE.JBI", "result.json"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    with (tmp_path / "V_SHAPE.JBI").open("a") as program:
        program.write("END\r\n")
    ended = run_opl("view", tmp_path / "V_SHAPE.JBI")
    assert ended.status == 2 and "is not the program that" in ended.err


def test_a_page_that_is_not_there_says_how_it_is_made(tmp_path):
    for target, told in (
        (tmp_path, f"{tmp_path / 'report.html'}: no such file; made by: opl run"),
        (write_trough(tmp_path / "t"), "out/TROUGH/report.html: no such file; made by: opl run"),
        (tmp_path / "none", "none: no such file or folder"),
    ):
        ended = run_opl("view", target)
        assert ended.status == 2 and told in ended.err, ended.err


def test_without_a_browser_the_path_is_printed(good, monkeypatch):
    monkeypatch.setattr("webbrowser.open", lambda address: False)
    page = good[1] / "out" / "V_SHAPE"
    ended = run_opl("view", page)
    assert ended.status == 0 and str(page / "report.html") in ended.err


def test_points_and_cells_have_pages(tmp_path):
    job = write_job(tmp_path / "j")
    ended = run_opl("points", job, "--out", tmp_path / "out")
    assert f"wrote {tmp_path / 'out' / 'V_SHAPE_points.html'}" in ended.out
    data = data_of((tmp_path / "out" / "V_SHAPE_points.html").read_text(encoding="utf-8"))
    assert [solid["name"] for solid in data["cell"]["solids"]] == ["part"]
    assert data["points"]["pass"]["shape"] == [19] and set(data["paints"]) == {"pass", "ridge"}


def test_the_page_of_a_batch_names_every_job_and_leads_to_their_pages(good, tmp_path):
    run, home = good
    rows = [
        opl.BatchRow(home / "job.yaml", "ok", 0, home / "out/V_SHAPE", "", opl.make_report(run)),
        opl.BatchRow(Path("bad & <b>.yaml"), "bad input", 2, None, "why <not>", None),
    ]
    page = batch_page(rows, home / "out")
    assert 'href="V_SHAPE/report.html"' in page and "1 of 2 jobs have a program" in page
    assert "bad &amp; &lt;b&gt;.yaml" in page and "why &lt;not&gt;" in page
