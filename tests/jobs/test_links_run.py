"""Whole jobs in cells where something is in the way between home and wheel."""

import csv
import json
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from opl.cell.robot import forward_kinematics
from opl.cell.robot_loading import load_robot
from opl.job.load import load_job
from opl.run.delivery import deliver
from opl.run.preparing import prepare
from opl.run.searches import search_path
from opl.run.stages import run_job
from opl.run.surfacing import cut_surface
from tests.support.fcl_scene import margin_along
from tests.support.jobs import document, opl, write_job

pytestmark = pytest.mark.usefixtures("no_pictures")

# a plate of the machine's frame above the wheel, across the straight move from home
HOOD = {"name": "hood", "box_mm": [456, 245, 30], "at_mm": [827, 277, 734]}
# two passes the same way, so that the robot comes back under the plate between them
BACK_UNDER_IT = {
    "name": "HOOD",
    "passes.rows": 2,
    "passes.order": "one_way",
    "search.method": "recursive",
    "search.contact_positions": 12,
    "search.max_contact_step": 20,
    "search.max_contact_error_mm": 1.5,
    "passes.max_chord_error_mm": 1.0,
    "passes.max_step_mm": 60,
    # so near the wheel that ways in the air graze the plate
    "process.approach_mm": 10,
}
SIDEWAYS = [-60, -45, -50, 0, 50, -180]  # a home far from the wheel


def with_bodies(*bodies):
    return {"obstacles": [*document()["obstacles"], *bodies]}


@cache
def under_the_hood():
    """Run the job under the hood; return what became of it, the job file and the folder."""
    home = Path(mkdtemp())
    job = write_job(home / "j", {**with_bodies(HOOD), **BACK_UNDER_IT})
    run = run_job(load_job(job))
    deliver(run, home / "out")
    return run, job, home / "out"


def table(folder):
    """Return the kind of each move of the program, and its configurations in [rad]."""
    with (folder / "HOOD.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    joints = [name for name in rows[0] if name.endswith("_deg")][:6]
    q = np.deg2rad([[float(row[name]) for name in joints] for row in rows])
    return [row["kind"] for row in rows], q


def test_a_frame_across_the_straight_way_is_led_around_and_proven():
    _, _, out = under_the_hood()
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert result["status"] == "ok"
    assert result["verification"]["collisions"] == 0
    assert result["verification"]["min_clearance_mm"] >= 5.0
    # home and the ways to the first approach and home: more than these by what is led around
    assert table(out)[0].count("home") > 3


def test_a_plate_between_two_passes_is_led_around():
    run, _, out = under_the_hood()
    kinds, q = table(out)
    first, last = kinds.index("link") - 1, len(kinds) - 1 - kinds[::-1].index("link")
    assert kinds[first] == "retract" and set(kinds[first + 1 : last + 1]) == {"link"}
    way, cell = q[first : last + 1], run.surfaced.job.cell
    assert len(way) > 2
    assert margin_along(cell, way[[0, -1]], 2.0) < 0.0
    assert margin_along(cell, way, 2.0) > 0.0


def test_a_program_with_configurations_on_the_way_is_read_back_and_proven():
    _, job, out = under_the_hood()
    ended = opl("verify", job, out / "HOOD.JBI")
    assert ended.status == 0, ended.err


def planned(job):
    """Return the configurations of the motion of a job, as bytes; for another process."""
    loaded = load_job(Path(job))
    problem = prepare(cut_surface(loaded)).problem
    return search_path(loaded.search, problem).plan.motion.q.tobytes()


def test_another_process_finds_the_same_ways():
    run, job, _ = under_the_hood()
    script = f"from tests.jobs import test_links_run as t;print(t.planned({str(job)!r}).hex())"
    result = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[2],
    ).stdout
    assert bytes.fromhex(result) == run.proven.planned.plan.motion.q.tobytes()


def cage():
    """Return walls around the part at home, the one behind it open for the stem only."""
    cell = load_robot("mh24")
    T_base_flange = forward_kinematics(cell, np.deg2rad(np.array(SIDEWAYS, dtype=float)))
    low, high, hole, wall = [-130, -130, 40], [130, 150, 240], 35, 10
    (x0, y0, z0), (x1, y1, z1) = low, high
    spans = {
        "left": ([x0 - wall, y0, z0], [x0, y1, z1]),
        "right": ([x1, y0, z0], [x1 + wall, y1, z1]),
        "bottom": ([x0, y0 - wall, z0], [x1, y0, z1]),
        "top": ([x0, y1, z0], [x1, y1 + wall, z1]),
        "front": ([x0, y0, z1], [x1, y1, z1 + wall]),
        "back left": ([x0, y0, z0 - wall], [-hole, y1, z0]),
        "back right": ([hole, y0, z0 - wall], [x1, y1, z0]),
        "back bottom": ([-hole, y0, z0 - wall], [hole, -hole, z0]),
        "back top": ([-hole, hole, z0 - wall], [hole, y1, z0]),
    }
    rotation = Rotation.from_matrix(T_base_flange[:3, :3]).as_euler("xyz", degrees=True)
    bodies = []
    for name, (first, last) in spans.items():
        middle = 0.5 * (np.array(first) + np.array(last))
        at = T_base_flange[:3, :3] @ middle + 1e3 * T_base_flange[:3, 3]
        bodies.append(
            {
                "name": f"cage {name}",
                "box_mm": [float(b - a) for a, b in zip(first, last, strict=True)],
                "at_mm": at.tolist(),
                "rotation_deg": rotation.tolist(),
            }
        )
    return bodies


def test_a_home_that_nothing_leads_out_of_is_refused_and_the_pair_named(tmp_path, monkeypatch):
    monkeypatch.setattr("opl.motion.free_move_search.MOST_CHECKED", 3000)
    job = write_job(tmp_path / "j", {**with_bodies(*cage()), "process.home_deg": SIDEWAYS})
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 3
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    message, *moves, advice = result["reasons"]
    assert message.endswith("no collision-free move to, from or between them was found")
    assert moves[0].startswith("free move from home: ")
    assert " and cage " in moves[0]
    assert advice.startswith("would help: another home configuration, or cage ")
    assert all(line in ended.err for line in result["reasons"])
    # nothing at the wheel is to blame, so nothing there was tried
    assert result["remedies"] == []
