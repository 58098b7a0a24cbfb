"""The workbench in FreeCAD itself, against a real service: a command of its own, see .ci/run.

python -m pytest -n 0 tests/freecad/check_workbench.py
"""

import io
import json
import os
import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import opl
from opl.cell.robot import forward_kinematics
from opl.files.resources import folder
from tests.support.jobs import document
from tests.support.jobs import opl as command
from tests.support.serving import serving
from tests.support.step_parts import write_v_step

WALK = Path(__file__).with_name("walk.py")
LIMIT = 300.0  # [s] for a walk

pytestmark = pytest.mark.skipif(
    shutil.which("freecadcmd") is None, reason="freecadcmd is not installed"
)


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """Return a folder with the user data of FreeCAD, the workbench, and the V part as STEP."""
    home = tmp_path_factory.mktemp("desk")
    mod = home / ".local" / "share" / "FreeCAD" / "Mod"
    mod.mkdir(parents=True)
    assert command("plugin", mod).status == 0
    write_v_step(home / "v_shape.step")
    return home


@pytest.fixture(scope="module")
def service(desk):
    with serving(desk / "store", "--workers", "1") as client:
        yield client


def walked(desk, service, script, program=("freecadcmd",), **given):
    """Run a script in FreeCAD; return what it told."""
    told = desk / "told.json"
    told.unlink(missing_ok=True)
    document_path, programs = desk / "walk.FCStd", desk / "programs"
    document_path.unlink(missing_ok=True)
    shutil.rmtree(programs, ignore_errors=True)
    of_v = document()
    whole = {
        "address": service._address,
        "step": str(desk / "v_shape.step"),
        "document": str(document_path),
        "programs": str(programs),
        "told": str(told),
        "placements": {
            "ContactFrame": of_v["wheel"]["T_base_contact0_mm"],
            "Flange": of_v["fixture"]["T_flange_workpiece_mm"],
        },
        **given,
    }
    quick = {
        "Rows": 1, "MaxChordError": 0.05, "MaxStep": 8.0, "ContactPositions": 60,
        "MaxContactStep": 3.0, "MaxContactError": 0.1, "MaxBeltPenetration": 1.0,
        "Approach": 20.0, "Margin": 2.5, "Home": of_v["process"]["home_deg"],
        "AcceptUnverifiedPulses": ["R", "B", "T"],
    }  # fmt: skip
    whole["properties"] = {**quick, **given.get("properties", {})}
    ended = subprocess.run(
        [*program, str(script)],
        env={
            **os.environ,
            "HOME": str(desk),
            "PYTHONPATH": str(WALK.parent),
            "OPL_WALK": json.dumps(whole),
            "QTWEBENGINE_DISABLE_SANDBOX": "1",  # FreeCAD's start page, where CI is root
        },
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert told.is_file(), ended.stdout + ended.stderr
    seen = json.loads(told.read_text(encoding="utf-8"))
    assert "failed" not in seen, seen.get("failed")
    return seen


@pytest.fixture(scope="module")
def window(desk, service):
    """Walk through the window, on a screen of its own; OPL_PICTURES keeps its pictures."""
    missing = [name for name in ("freecad", "xvfb-run", "import") if shutil.which(name) is None]
    if missing:
        pytest.skip(f"{', '.join(missing)} not installed")
    seen = walked(
        desk,
        service,
        WALK.with_name("walk_window.py"),
        ("xvfb-run", "-a", "-s", "-screen 0 1400x900x24", "freecad"),
        faces=["Face1", "Face2", "Face3"],
    )
    if folder := os.environ.get("OPL_PICTURES"):
        for picture in desk.glob("*.png"):
            shutil.copy(picture, folder)
    return seen


@pytest.fixture(scope="module")
def walk(desk, service):
    return walked(desk, service, WALK, cell=str(folder("workpieces") / "cells" / "belt_cell.yaml"))


def test_a_step_part_becomes_a_program(walk, desk):
    assert walk["status"] == "ok" and len(walk["faces"]) == 3, walk["message"]
    assert (desk / "programs" / "V_STEP.JBI").read_bytes().startswith(b"/JOB\r\n//NAME V_STEP\r\n")
    assert sorted(walk["saved"]) == sorted(map(str, (desk / "programs").iterdir()))


def test_its_progress_was_seen(walk):
    stages = {stage for task, state, stage in walk["states"] if task == "run"}
    assert {"search", "verification", "export"} <= stages
    assert {task for task, _, _ in walk["states"]} == {"points", "run"}


def test_opl_proves_the_program_for_the_job_that_the_document_keeps(walk, desk, tmp_path):
    # the files that were sent, taken out of the document's archive
    with zipfile.ZipFile(desk / "walk.FCStd") as document_file:
        (inner,) = [name for name in document_file.namelist() if "RunKept" in name]
        with zipfile.ZipFile(io.BytesIO(document_file.read(inner))) as kept:
            kept.extractall(tmp_path)
    job = opl.load_job(tmp_path / "job" / "job.yaml")
    assert opl.prove_program(job, [desk / "programs" / "V_STEP.JBI"]).proven
    assert (tmp_path / "V_STEP.JBI").read_bytes() == (desk / "programs" / "V_STEP.JBI").read_bytes()


def test_the_document_shows_it_again_when_it_is_opened(walk):
    status, figures, kept = walk["reopened"]
    assert status == "ok" and figures == walk["figures"] and "rad" in figures
    assert walk["other"] == []  # the files that would be sent now are those that were
    assert {"V_STEP.JBI", "V_STEP_motion.json", "job/part.step", "result.json"} <= set(kept)


def test_a_result_older_than_its_job_is_told(walk):
    assert walk["changed"] == "changed"


def test_a_cell_file_travels_with_what_it_names(walk):
    status, message, solids, kept = walk["of_cell_file"]
    assert status == "points", message
    assert {"cell/belt_cell.yaml", "cell/machine_frame.stl", "cell/gripper.stl"} <= set(kept)
    assert {"machine frame", "fence left", "adapter", "wheel", "Stem"} <= set(solids)


def test_the_part_is_shown_where_the_robot_holds_it(walk, desk):
    times = json.loads((desk / "programs" / "V_STEP_motion.json").read_text())
    robot, held = opl.load_robot("mh24"), np.array(document()["fixture"]["T_flange_workpiece_mm"])
    assert len(walk["moments"]) == 4 and walk["moments"][2][0] > 1.0
    for moment, posture, pose, _ in walk["moments"]:
        q = [np.interp(moment, times["time_s"], one) for one in np.transpose(times["q_rad"])]
        assert np.deg2rad(posture) == pytest.approx(np.array(q), abs=1e-6)
        flange = forward_kinematics(robot, np.array(q))
        flange[:3, 3] *= 1e3
        # the fixture's matrix has four digits and is made orthonormal
        assert np.array(pose) == pytest.approx(flange @ held, abs=1e-2)
    assert walk["moments"][2][3].count("cutter point") == 1, walk["moments"][2]


# with its window


def red(path):
    """Return how many pixels of the 3D view in a picture of the screen are red."""
    view = plt.imread(path)[120:800, 300:1200, :3]
    return int(((view[..., 0] > 0.3) & (view[..., 1:].max(axis=2) < 0.35 * view[..., 0])).sum())


def test_the_panel_is_no_wider_than_the_column_of_tasks(window):
    panel, column = window["width"]
    assert panel <= column
    end_of_last, titles, panel = window["titles"]
    assert end_of_last < titles <= panel


def test_faces_that_are_clicked_on_become_a_job_in_the_panel(window):
    assert window["commands"] == ["Opl_NewJob", "Opl_OpenJob"]
    assert window["taken"] == [25.0, "WINDOW", ["Stem"], ["Face1", "Face2", "Face3"]]
    assert window["before"] == "not run yet"


def test_the_panel_follows_a_run_to_its_motion(window):
    status, said = window["points"]
    assert status == "points" and "cutter points in 1 passes" in said
    assert window["status"] == "ok"
    assert any("run: running, verification" in said for said in window["seen"])
    assert "clearance" in window["where"]
    assert window["hidden"] == [False, True]


def test_a_document_that_is_opened_again_has_its_scenes(window):
    assert window["icons"] == [True, True]
    of_job, of_motion = window["scene"]
    assert of_job > 3 and of_motion == 7
    assert window["again"][0] == "ok" and "program proven" in window["again"][1]


def test_a_refusal_is_told_with_its_place_marked(window, desk):
    assert "changed since it was run" in window["changed"]
    status, message, marks = window["refused"]
    assert status == "no_path" and "cutter point" in message
    runs = re.findall(r"cutter points? (\d+)(?: to (\d+))? \(pass", message)
    assert len(runs) > 1  # all of them are marked, not only the first
    assert marks == [k for a, b in runs for k in range(int(a), int(b or a) + 1)]
    # and seen: red in the 3D view, where before the run only the flange's axis was; a ball has
    # about 50 pixels, and a third of them lie behind the part
    assert red(desk / "marks.png") > red(desk / "points.png") + 25 * len(marks)


def test_a_run_is_cancelled_from_the_panel(window):
    assert window["cancelled"] == "cancelled"
