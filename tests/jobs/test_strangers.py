"""The random jobs of benchmarks/strangers.py are jobs, and the same seed draws the same ones."""

import re
from dataclasses import replace

import numpy as np
import pytest
import trimesh

import opl
from benchmarks.stranger_jobs import draw_job
from benchmarks.stranger_parts import FAMILIES, WALLED, draw_part
from opl.geometry.mesh import load_mesh
from opl.run.searches import search_path
from tests.support.planned import problem_of

# a process for each of their files, as in a run, but none that loads the readers first
pytestmark = pytest.mark.usefixtures("warm_processes", "no_pictures")


@pytest.mark.parametrize("family", [*FAMILIES, *WALLED])
def test_a_drawn_surface_lies_on_its_closed_solid(family, tmp_path):
    part = draw_part(family, np.random.default_rng(5), (120.0, 40.0))
    part.write(tmp_path)
    mesh = load_mesh(tmp_path / "part.stl", "mm")  # refused unless closed and free of crossings
    corners = 1e3 * mesh.vertices[mesh.faces]
    for T in part.frames(np.array([1.0, 0.0, 0.0]), (3, 5)):
        p, normal = 1e3 * T[:3, 3], T[:3, 2]
        nearest = trimesh.triangles.closest_point(corners, np.tile(p, (len(corners), 1)))
        assert np.linalg.norm(nearest - p, axis=1).min() < 0.05
        assert winding(corners, p - normal) > 0.9
        assert winding(corners, p + normal) < 0.1


def winding(corners, point):
    """Return how often a closed mesh goes around a point: solid angles of its triangles."""
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    over = np.einsum("ij,ij->i", a, np.cross(b, c))
    under = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return np.arctan2(over, under).sum() / (2.0 * np.pi)


def test_drawn_jobs_are_cut_into_passes_and_repeat_byte_by_byte(tmp_path):
    drawn = 0
    for index in range(3):
        texts = []
        for again in range(2):
            folder = tmp_path / f"{index}_{again}"
            folder.mkdir()
            stranger = draw_job(11, index, 0, folder)
            if stranger is None:
                break
            texts.append({path.name: path.read_bytes() for path in folder.iterdir()})
        else:
            assert texts[0] == texts[1]
            surfaced = opl.cut_surface(opl.load_job(stranger.job))
            assert stranger.points / 3 < len(surfaced.points) < 5 * stranger.points
            drawn += 1
    assert drawn > 0


def test_uncommon_jobs_repeat_and_are_read_or_refused_by_a_key(tmp_path):
    read, scanned = 0, 0
    for index in range(8):
        texts = []
        for again in range(2):
            folder = tmp_path / f"{index}_{again}"
            folder.mkdir()
            if (stranger := draw_job(11, index, 0, folder, uncommon=True)) is not None:
                # a STEP file has its date
                files = [path for path in folder.iterdir() if path.suffix != ".step"]
                texts.append({path.name: path.read_bytes() for path in files})
        if stranger is None:
            continue
        assert texts[0] == texts[1]
        scanned += "scan.stl" in texts[0]
        try:
            assert len(opl.cut_surface(opl.load_job(stranger.job)).points) > 0
            read += 1
        except opl.InputError as error:
            key = str(error).split("job.yaml: ")[1]
            assert key.startswith(("passes.", "process.", "workpiece."))
    assert read > 3 and scanned > 0


@pytest.mark.parametrize(
    "drawn",
    [
        # where passes end, leads leave the clearance and hardly more: the samples of a box, which
        # leave 0.3 mm more where they can, see nothing free there
        (20261129, 9, 1),
        # all along a pass, no track gets past where joints turn too far; sought in boxes that are
        # not yet proven to be the least
        (20262302, 7, 0),
        (20262301, 18, 0),  # sweeps lead past where they do, and then no further
        (20263305, 17, 1),  # only in larger boxes, with places cut finer
        (20263601, 15, 0),  # what is swept leaves its box between two places, to be cut finer there
    ],
)
def test_the_least_motion_is_found_where_it_was_not(drawn, tmp_path):
    draw_job(*drawn, tmp_path)
    job = opl.load_job(tmp_path / "job.yaml")
    plan = search_path(job.search, problem_of(job)).plan
    assert plan.lower_bound >= plan.path.joint_range_sum * (1.0 - 1e-3)


def test_where_no_box_comes_for_long_few_subproblems_do_if_bounds_tell_what_is_split(tmp_path):
    """Postures at three ends of passes move along a valley: distances tell little there."""
    draw_job(20264401, 18, 1, tmp_path)
    job = opl.load_job(tmp_path / "job.yaml")
    little = replace(job.search.optimal, max_subproblems=4000)
    plan = search_path(replace(job.search, optimal=little), problem_of(job)).plan
    assert plan.lower_bound >= plan.path.joint_range_sum * (1.0 - 1e-3)


def test_with_little_work_a_motion_is_sought_in_larger_boxes_before_it_is_done(tmp_path):
    """The bound rises slowly, and no box proposed meanwhile holds a motion."""
    draw_job(20261203, 10, 0, tmp_path)
    job = opl.load_job(tmp_path / "job.yaml")
    little = replace(job.search.optimal, max_subproblems=2000)
    plan = search_path(replace(job.search, optimal=little), problem_of(job)).plan
    assert plan.open_because == "the work allowed for the proof was done before it was complete"
    assert plan.lower_bound >= 0.92 * plan.path.joint_range_sum


def test_where_nearly_all_is_free_there_is_a_motion_though_no_box_near_the_bound_has_one(tmp_path):
    """The bound stays far below what is found; a third of the field, in one posture, is free."""
    draw_job(20263702, 11, 1, tmp_path, uncommon=True)
    job = opl.load_job(tmp_path / "job.yaml")
    little = replace(job.search.optimal, max_subproblems=1000)
    plan = search_path(replace(job.search, optimal=little), problem_of(job)).plan
    assert plan.open_because == "the work allowed for the proof was done before it was complete"
    assert 0.0 < plan.lower_bound < plan.path.joint_range_sum < 1.0


@pytest.mark.parametrize(
    "drawn",
    [
        (20262805, 7, 0),  # with what is beyond the limits, its walls would be crossed
        (20263203, 69, 0),  # where chains are shut is told only by a closer look at collisions
    ],
)
def test_walls_prove_that_a_filleted_box_has_no_motion(drawn, tmp_path):
    draw_job(*drawn, tmp_path)
    job = opl.load_job(tmp_path / "job.yaml")
    with pytest.raises(opl.NoPathError, match="it is proven that no motion"):
        search_path(job.search, problem_of(job))


def test_a_cutter_point_at_which_nothing_is_free_proves_at_once_that_there_is_no_motion(tmp_path):
    """A whole pass holds the arm in the floor; what is split without knowing that has no end."""
    draw_job(20263601, 88, 0, tmp_path)
    job = opl.load_job(tmp_path / "job.yaml")
    little = replace(job.search.optimal, max_subproblems=200)
    with pytest.raises(opl.NoPathError, match="proven: no motion along these passes"):
        search_path(replace(job.search, optimal=little), problem_of(job))


def test_leads_that_sink_between_their_configurations_are_not_tried_one_by_one(tmp_path):
    """A channel that is bowed: its leads run along a wall, as deep in the belt as is allowed."""
    draw_job(20262601, 38, 0, tmp_path, families=["channel", "step"])
    job = opl.load_job(tmp_path / "job.yaml")
    plan = search_path(job.search, problem_of(job)).plan
    assert plan.lower_bound >= plan.path.joint_range_sum * (1.0 - 1e-3)


@pytest.mark.parametrize(
    ("seed", "index", "attempt"),
    [
        (20261315, 7, 0),  # a cylinder: its joints rest within a pass, and where one ends
        (20261315, 8, 1),  # a filleted box: some moves are as small as the digits of a position
        (20261316, 22, 0),  # a cutter point is passed where the contact can roll no farther
    ],
)
def test_programs_that_were_refused_after_they_were_planned_are_written(
    seed, index, attempt, tmp_path
):
    draw_job(seed, index, attempt, tmp_path)
    run = opl.run_job(opl.load_job(tmp_path / "job.yaml"))
    assert run.status == "ok"


def test_a_pass_that_rests_on_the_wheel_is_refused_with_its_time(tmp_path):
    draw_job(20261317, 3, 0, tmp_path)
    run = opl.run_job(opl.load_job(tmp_path / "job.yaml"))
    assert run.status == "no_path"
    assert "rest on the wheel" in run.reasons[0]
    assert "search.max_contact_change" in run.reasons[0]
    told = re.match(r"pass 1: (\S+) s of moves on the wheel, (\S+) s at the feed", run.reasons[1])
    moves, at_feed = map(float, told.groups())
    assert moves < at_feed == 5.06
