"""Whole jobs in cells where something is in the way between home and wheel."""

import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from jobs import document, opl, write_job
from scipy.spatial.transform import Rotation

from opl.cell.robot import forward, load_robot

# a plate of the machine's frame above the wheel, across the straight way from home
HOOD = {"name": "hood", "box_mm": [456, 245, 30], "at_mm": [827, 277, 734]}
DATE = "1700000000"
SIDEWAYS = [-60, -45, -50, 0, 50, -180]  # a home far from the wheel


def with_bodies(*bodies):
    return {"obstacles": [*document()["obstacles"], *bodies]}


@cache
def under_the_hood():
    """Run the job under the hood; return how it ended, the job file and the folder."""
    home = Path(mkdtemp())
    job = write_job(home / "j", {**with_bodies(HOOD), "name": "HOOD"})
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", DATE)
        return opl("run", job, "--out", home / "out"), job, home / "out"


def air_moves(folder):
    """Return how many moves of the table are free moves."""
    rows = (folder / "HOOD.csv").read_text(encoding="utf-8").splitlines()
    return sum(",home," in row or ",link," in row for row in rows)


def test_a_frame_across_the_straight_way_is_led_around_and_proven():
    ended, _, out = under_the_hood()
    assert ended.status == 0, ended.err
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert result["status"] == "ok"
    assert result["verification"]["collisions"] == 0
    assert result["verification"]["min_clearance_mm"] >= 5.0
    # home, the way to the approach and the way home: more than these three by what is led around
    assert air_moves(out) > 3


def test_a_program_with_postures_on_the_way_is_read_back_and_proven():
    _, job, out = under_the_hood()
    ended = opl("verify", job, out / "HOOD.JBI")
    assert ended.status == 0, ended.err


def test_another_process_writes_the_same_bytes(tmp_path):
    _, job, out = under_the_hood()
    command = f"from opl.cli import main; main(['run', {str(job)!r}, '--out', {str(tmp_path)!r}])"
    environment = {**os.environ, "SOURCE_DATE_EPOCH": DATE}
    subprocess.run(
        [sys.executable, "-c", command], check=True, capture_output=True, env=environment
    )
    for name in ("HOOD.JBI", "HOOD.csv"):
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes()


def cage():
    """Return walls around the part at home, the one behind it open for the stem only."""
    cell = load_robot("mh24")
    T_base_flange = forward(cell, np.deg2rad(np.array(SIDEWAYS, dtype=float)))
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
    monkeypatch.setattr("opl.planning.links.MOST_ASKED", 3000)
    job = write_job(tmp_path / "j", {**with_bodies(*cage()), "process.home_deg": SIDEWAYS})
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 3
    told = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    message, *ways, advice = told["reasons"]
    assert message.endswith("there is no way through the air")
    assert ways[0].startswith("way from home: ")
    assert " and cage " in ways[0]
    assert advice.startswith("would help: another home posture, or cage ")
    assert all(line in ended.err for line in told["reasons"])
    # nothing at the wheel is to blame, so nothing there was tried
    assert told["remedies"] == []
