"""Why not, and what would help: changes that open an impossible job are planned again."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from opl.errors import NoPathError
from opl.job.load import load_job
from opl.run.preparing import prepare
from opl.run.remedies import Remedies, _fed_in_reverse, _other_side, find_remedies
from opl.run.searches import search_path
from opl.run.surfacing import cut_surface
from tests.support.jobs import POST, opl, write_job, write_trough
from tests.support.planned import v_job

pytestmark = pytest.mark.usefixtures("no_pictures")


def test_a_narrower_wheel_opens_a_trough_and_is_told(tmp_path):
    # 30 mm wide, 15 mm deep: the flat of 50 mm cannot get in, a narrower one can
    job = write_trough(tmp_path / "t", width_mm=44.0, depth_mm=1.5)
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 3
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["status"] == "no_path"
    assert result["remedies"], result["reasons"]
    for remedy in result["remedies"]:
        assert remedy.startswith("would be possible with ")
        assert remedy in ended.err


def test_a_longer_approach_is_told_where_leads_end_too_near_to_the_wheel(tmp_path, monkeypatch):
    short = {"clearance_mm": 10, "process.approach_mm": 10, "process.approach_run_mm": 1}
    small = {"passes.rows": 2, "passes.max_step_mm": 40, "search.contact_positions": 25}
    job = load_job(write_job(tmp_path / "short", {**small, **short}))
    surfaced = cut_surface(job)
    with pytest.raises(NoPathError, match="approach: part and wheel") as caught:
        search_path(job.search, prepare(surfaced).problem)
    assert caught.value.at_leads
    monkeypatch.setattr("opl.run.remedies.KINDS", {})
    (told,) = find_remedies(job, surfaced.points, at_leads=True).found
    assert "possible with process.approach_mm 20 instead of 10 " in told
    assert find_remedies(job, surfaced.points) == Remedies()  # tried where leads stop motions
    longer = write_job(tmp_path / "longer", {**small, **short, "process.approach_mm": 20})
    assert opl("run", longer, "--out", tmp_path / "out").status == 0


def test_a_post_before_the_wheel_is_avoided_on_another_side_of_it(tmp_path):
    path = write_job(tmp_path, {"obstacles": [POST]})
    job = load_job(path)
    remedies = find_remedies(job, cut_surface(job).points)
    told = remedies.found
    assert "a larger wheel.max_roll_deg: 5 tried, none opens the job" in remedies.in_vain
    assert not any("another side" in line for line in remedies.in_vain)
    (remedy,) = [line for line in told if "on another side of the wheel" in line]
    # tried from outside: the frame that the remedy names, written into the job
    degrees = float(remedy.split(" degrees round")[0].rsplit(" ", 1)[1])
    T = np.array(v_job().cell.wheel.T_base_contact0)
    axle = T[:3, 3] + 150e-3 * T[:3, 2]
    about = Rotation.from_rotvec(np.deg2rad(degrees) * T[:3, 0]).as_matrix()
    turned = np.eye(4)
    turned[:3, :3] = about @ T[:3, :3]
    turned[:3, 3] = axle - 150e-3 * turned[:3, 2]
    turned[:3, 3] *= 1e3
    frame = {"wheel.T_base_contact0_mm": turned.tolist()}
    changed = write_job(tmp_path / "turned", {"obstacles": [POST], **frame})
    assert opl("run", changed, "--out", tmp_path / "out").status == 0


@pytest.mark.parametrize("kind", [_other_side, _fed_in_reverse])
def test_another_side_moves_the_contact_and_leaves_the_wheel_where_it_is(kind):
    cell = v_job().cell
    now = cell.wheel.T_base_contact0
    axle = now[:3, 3] + cell.wheel.radius * now[:3, 2]
    for _, changed in kind(v_job()):
        T = changed.cell.wheel.T_base_contact0
        np.testing.assert_allclose(T[:3, 3] + cell.wheel.radius * T[:3, 2], axle, atol=1e-12)
        assert abs(T[:3, 0] @ now[:3, 0]) == pytest.approx(1.0)
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
        assert not np.allclose(T, now)
