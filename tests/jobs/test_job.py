"""Job files: what is refused, before anything is planned or written, and with what words."""

import math

import numpy as np
import pytest
import trimesh

from opl.cell.robot_loading import known_robots
from opl.errors import InputError
from opl.geometry.frames import inverse
from opl.job.load import load_job
from tests.support.jobs import (
    GONE,
    V_JOB,
    V_SHAPE,
    document,
    opl,
    write_job,
    write_robot,
    write_surface,
)

WHEEL_POSE = document()["wheel"]["T_base_contact0_mm"]


def changed(matrix, row, column, value):
    rows = [list(entries) for entries in matrix]
    rows[row][column] = value
    return rows


def one_message(job, *options, status=2):
    """Run a job that is refused; return the one message, after checking that nothing came of it."""
    out = job.parent / "made" / "here"
    ended = opl("run", job, "--out", out, *options)
    assert ended.status == status, ended
    assert ended.out == ""
    assert not out.parent.exists()
    assert "Traceback" not in ended.err
    first, *further = ended.err.splitlines()
    assert first.startswith(f"error: {job}: ")
    assert all(line.startswith("  ") for line in further)
    return ended.err.removeprefix(f"error: {job}: ").rstrip("\n")


# values


def test_values_are_in_si(tmp_path):
    job = load_job(write_job(tmp_path, quick=False))
    wheel = job.cell.wheel
    assert (wheel.width, wheel.radius) == (0.05, 0.15)
    assert wheel.max_roll == pytest.approx(math.pi / 4)
    assert job.passes.max_bow_height == pytest.approx(5e-5)
    assert job.search.max_contact_error == pytest.approx(1e-4)
    assert job.process.home == pytest.approx(np.deg2rad([15, -45, -50, 0, 50, -180]))
    assert job.process.feed == pytest.approx(0.02)


def test_rounded_matrices_are_made_proper(tmp_path):
    job = load_job(write_job(tmp_path))
    for T in (job.cell.wheel.T_base_contact0, job.cell.T_flange_workpiece):
        assert np.abs(inverse(T) @ T - np.eye(4)).max() < 1e-12
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0, abs=1e-12)
    assert job.cell.wheel.T_base_contact0[:3, 3] == pytest.approx([0.8903631, 0.2356854, 0.3231888])


def test_files_are_found_beside_the_job(tmp_path, monkeypatch):
    write_job(tmp_path / "part")
    monkeypatch.chdir(tmp_path)
    assert load_job(tmp_path / "part" / "job.yaml").cell.part.volume > 0.0


def test_a_robot_of_ones_own_lies_beside_the_job(tmp_path):
    write_robot(tmp_path / "mine", {"S": (-90, 90)})
    robot = load_job(write_job(tmp_path, {"robot": "mine"})).cell.robot
    assert np.rad2deg(robot.lower[0]) == pytest.approx(-90)


def test_every_job_that_comes_with_opl_is_valid():
    for path in V_SHAPE.parent.glob("*/job.yaml"):
        assert load_job(path).source.label == str(path)
    assert V_JOB.is_file()


def test_a_job_may_name_its_own_joint_accelerations(tmp_path):
    assert load_job(write_job(tmp_path)).cell.robot.acceleration_assumed
    own = {"process.max_acceleration_deg_s2": [100, 200, 300, 400, 500, 600]}
    robot = load_job(write_job(tmp_path, own)).cell.robot
    assert np.rad2deg(robot.max_acceleration) == pytest.approx([100, 200, 300, 400, 500, 600])
    assert not robot.acceleration_assumed


# what is refused


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"wheel.width_mm": GONE}, "wheel.width_mm: is missing"),
        ({"wheel": GONE}, "wheel: is missing"),
        (
            {"wheel.width_mm": "50 mm"},
            "wheel.width_mm: must be a number, without its unit, got '50 mm'",
        ),
        (
            {"wheel.colour": "red"},
            "wheel.colour: unknown key; known here: T_base_contact0_mm, max_belt_penetration_mm, "
            "max_roll_deg, pendant, radius_mm, touched, width_mm",
        ),
        (
            {"obstacles.0.colour": "red"},
            "obstacles.0.colour: unknown key; known here: at_mm, box_mm, cylinder_mm, mesh, "
            "mesh_unit, name, rotation_deg",
        ),
        ({"wheel.width_mm": 0}, "wheel.width_mm: must be more than 0, got 0"),
        ({"wheel.width_mm": -3}, "wheel.width_mm: must be more than 0, got -3"),
        ({"wheel.width_mm": 1e23}, "wheel.width_mm: must be at most 2000, got 1.0e+23"),
        ({"clearance_mm": 1e9}, "clearance_mm: must be at most 1000, got 1000000000.0"),
        ({"passes.max_step_mm": 1e-9}, "passes.max_step_mm: must be at least 0.01, got 1.0e-09"),
        (
            {"search.contact_positions": 100_000},
            "search.contact_positions: must be at most 2000, got 100000",
        ),
        (
            {"search.max_contact_step": 1e-9},
            "search.max_contact_step: must be at least 0.05, got 1.0e-09",
        ),
        (
            {"passes.pitch_mm": 0.01, "passes.rows": GONE},
            "passes.pitch_mm: makes 2001 rows with their repeats, at most 2000 are laid",
        ),
        (
            {"passes.max_step_mm": 0.01},
            "passes.max_step_mm: 0.01 mm makes about 23354 cutter points; at most 20000 are",
        ),
        (
            {"passes.pitch_mm": 0.02, "passes.rows": 150, "passes.max_chord_error_mm": 0.0001},
            "passes.max_chord_error_mm: 0.0001 mm makes about",
        ),
        (
            {"search.contact_positions": 2000, "passes.max_step_mm": 0.2},
            "search.contact_positions: 2000 at each of",
        ),
        ({"wheel.max_roll_deg": 120}, "wheel.max_roll_deg: must be at most 90, got 120"),
        ({"search.contact_positions": 1}, "search.contact_positions: must be at least 2, got 1"),
        (
            {"search.contact_positions": 2.5},
            "search.contact_positions: must be a whole number, got 2.5",
        ),
        (
            {"wheel.T_base_contact0_mm": changed(WHEEL_POSE, 0, 3, math.nan)},
            "wheel.T_base_contact0_mm.0.3: must be finite, got .nan",
        ),
        (
            {"fixture.T_flange_workpiece_mm": changed(WHEEL_POSE, 2, 1, math.inf)},
            "fixture.T_flange_workpiece_mm.2.1: must be finite, got .inf",
        ),
        (
            {"wheel.T_base_contact0_mm": changed(WHEEL_POSE, 0, 2, 1.3)},
            "wheel.T_base_contact0_mm: is 0.3 away from a rotation, at most 0.02 is taken for "
            "rounding",
        ),
        (
            {"wheel.T_base_contact0_mm": WHEEL_POSE[:3]},
            "wheel.T_base_contact0_mm: must have at least 4 values, got 3",
        ),
        (
            {"wheel.T_base_contact0_mm": {"x": 1}},
            "wheel.T_base_contact0_mm: must be a list, got {'x': 1}",
        ),
        (
            {"robot": "mh99"},
            f"robot: unknown robot 'mh99'; known: {', '.join(known_robots())}, or a folder with a "
            "robot.yaml",
        ),
        (
            {"process.home_deg": [15, -45, -50, 0, 50, 500]},
            "process.home_deg: joint T must be in -455 to 455, got 500",
        ),
        (
            {"passes.rows": 50},
            "passes.rows: 50 rows of pitch 5 mm do not fit; between margins of 2.5 mm on 25 mm "
            "there is room for 5",
        ),
        ({"passes.plane_normal": [0, 0, 0]}, "passes.plane_normal: must not be zero"),
        (
            {"passes.order": "spiral"},
            "passes.order: must be 'one_way', 'zigzag', 'both' or 'shortest', got 'spiral'",
        ),
        (
            {"search.max_contact_error_mm": 0.3},
            "search.max_contact_error_mm: must be larger than passes.max_chord_error_mm, which is "
            "part of it, got 0.3 and 0.3",
        ),
        (
            {"process.approach_mm": 3, "process.approach_turn_deg": 90},
            "process.approach_mm: must lead the part as far off the wheel as free moves keep it, "
            "5 mm (clearance_mm, or pair_clearances of the cell); 3 mm lead it 4 mm off at the",
        ),
        ({"name": "my part"}, "name: must be 1 to 28 capital letters, digits, _ or -"),
        ({"name": "A\n"}, "name: must be 1 to 28 capital letters, digits, _ or -"),
        (
            {"obstacles": [{"name": "post", "at_mm": [0, 0, 0]}]},
            "obstacles.0: needs either box_mm (edges along x, y, z) or cylinder_mm (radius, length",
        ),
        (
            {"obstacles": [{"name": "wheel", "at_mm": [0, 0, 0], "box_mm": [1, 1, 1]}]},
            "obstacles.0.name: is the name of something else in the cell, got 'wheel'",
        ),
    ],
)
def test_a_bad_value_is_refused_with_its_key(tmp_path, changes, told):
    message = one_message(write_job(tmp_path, changes))
    assert message.startswith(told)
    assert "\n" not in message


def test_a_unit_in_the_key_that_is_not_known_is_told_with_the_one_that_is(tmp_path):
    job = write_job(tmp_path, {"wheel.width_mm": GONE, "wheel.width_cm": 5})
    assert one_message(job).split("\n") == [
        "2 faults",
        "  wheel.width_mm: is missing",
        "  wheel.width_cm: unknown key; known here: T_base_contact0_mm, max_belt_penetration_mm, "
        "max_roll_deg, pendant, radius_mm, touched, width_mm",
    ]


def test_a_surface_out_of_reach_is_refused(tmp_path):
    far = changed(WHEEL_POSE, 0, 3, WHEEL_POSE[0][3] + 5000)
    message = one_message(write_job(tmp_path, {"wheel.T_base_contact0_mm": far}))
    assert message == (
        "workpiece.surface: out of reach of Motoman MH24 at every contact position: cutter points "
        "0-18 of 19; check wheel.T_base_contact0_mm and fixture.T_flange_workpiece_mm"
    )


def test_a_home_in_collision_is_refused_with_the_pairs(tmp_path):
    block = {"name": "block", "box_mm": [100, 100, 100], "at_mm": [480, 130, 740]}
    message = one_message(write_job(tmp_path, {"obstacles": [block]}))
    assert message.startswith(
        "process.home_deg: at home these are nearer to each other than 5 mm (clearance_mm) or "
        "collide: "
    )
    assert "T_link and block" in message


def test_a_home_with_the_part_in_the_wheel_is_refused(tmp_path):
    at_home = load_job(write_job(tmp_path)).cell  # the wheel is put where the part is at home
    from opl.cell.robot import forward_kinematics

    T = forward_kinematics(at_home.robot, np.deg2rad(document()["process"]["home_deg"]))
    pose = T @ at_home.T_flange_workpiece
    pose[:3, 3] = 1e3 * (pose @ [0, -0.0246, 0.09, 1.0])[:3]
    changes = {"wheel.T_base_contact0_mm": pose.tolist(), "fixture.bodies": []}
    assert "part and wheel" in one_message(write_job(tmp_path, changes))


@pytest.mark.parametrize(
    ("key", "file", "told"),
    [
        ("mesh", "none.stl", "cannot be read: No such file or directory"),
        ("mesh", "surface.json", "must be one of .stl, .ply, .obj"),
        ("surface", "none.json", "cannot be read: No such file or directory"),
    ],
)
def test_a_file_that_cannot_be_read_is_told_with_the_key_that_names_it(tmp_path, key, file, told):
    message = one_message(write_job(tmp_path, {f"workpiece.{key}": file}))
    assert message == f"workpiece.{key}: {tmp_path / file}: {told}"


def test_an_open_mesh_is_refused(tmp_path):
    job = write_job(tmp_path)
    box = trimesh.creation.box((50, 50, 50))
    trimesh.Trimesh(box.vertices, box.faces[:-1]).export(tmp_path / "v_shape.stl")
    assert one_message(job) == (
        f"workpiece.mesh: {tmp_path / 'v_shape.stl'}: is not closed: 3 edges are not those of "
        "two triangles, one of them near (25, 0, 25) mm; a solid without holes is needed"
    )


def test_a_file_that_is_no_mesh_is_refused(tmp_path):
    job = write_job(tmp_path)
    (tmp_path / "v_shape.stl").write_text("solid nothing\nendsolid\n")
    assert one_message(job).startswith(f"workpiece.mesh: {tmp_path / 'v_shape.stl'}: ")


def test_a_surface_without_a_normal_is_refused_with_the_place(tmp_path):
    job = write_job(tmp_path)
    # on the flat bottom of the solid; the surface stands still where v begins
    edges = [[[x, -54.0, 18.5654], [x, -54.0, 18.5654], [x, -26.0, 18.5654]] for x in (12.5, -12.5)]
    write_surface(
        tmp_path / "surface.json",
        knots_u=[0, 0, 1, 1],
        knots_v=[0, 0, 0, 1, 1, 1],
        control_points_mm=edges,
        weights=[[1.0] * 3, [1.0] * 3],
    )
    message = one_message(write_job_with_surface(job, {}))
    assert message.startswith("workpiece.surface: the surface has no normal at (u, v) = (")
    assert "-54, 18.57) mm: du x dv is zero" in message


def write_job_with_surface(job, changes):
    """Write the job again, but keep the surface that lies beside it."""
    surface = (job.parent / "surface.json").read_bytes()
    write_job(job.parent, {"passes.rows": GONE, **changes})
    (job.parent / "surface.json").write_bytes(surface)
    return job


def test_a_bad_surface_file_is_told_with_its_own_key(tmp_path):
    job = write_job(tmp_path)
    write_surface(tmp_path / "surface.json", weights=[[1.0] * 9, [1.0] * 8])
    assert one_message(job) == (
        f"workpiece.surface: {tmp_path / 'surface.json'}: weights: must be rows of one length, got "
        "[9, 8]"
    )


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "is empty"),
        ("- name: V\n- robot: mh24\n", "must hold keys and values, holds [{'name': 'V'}"),
        ("name: V\nwheel: {a: 1\nb: 2\n", "line 3, column 2: while parsing a flow mapping, did"),
        ("name: V\nname: W\n", "line 2, column 1: key 'name' is given twice"),
    ],
)
def test_a_file_that_is_no_job_is_refused(tmp_path, text, told):
    job = tmp_path / "job.yaml"
    job.write_text(text, encoding="utf-8")
    assert one_message(job).startswith(told)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    assert one_message(tmp_path / "none.yaml") == "cannot be read: No such file or directory"
    (tmp_path / "folder").mkdir()
    assert one_message(tmp_path / "folder") == "cannot be read: Is a directory"


def test_many_faults_read_as_a_list(tmp_path):
    changes = {
        "name": "x",
        "wheel.width_mm": "5 cm",
        "wheel.radius_mm": GONE,
        "obstacles.1.box_mm": [1, 2],
        "search.contact_positions": 1,
    }
    assert one_message(write_job(tmp_path, changes)).split("\n") == [
        "5 faults",
        "  name: must be 1 to 28 capital letters, digits, _ or -, got 'x'",
        "  wheel.width_mm: must be a number, without its unit, got '5 cm'",
        "  wheel.radius_mm: is missing",
        "  obstacles.1.box_mm: must have at least 3 values, got 2",
        "  search.contact_positions: must be at least 2, got 1",
    ]


def test_load_raises_one_kind_of_error(tmp_path):
    with pytest.raises(InputError) as caught:
        load_job(write_job(tmp_path, {"wheel.width_mm": -1}))
    assert caught.value.where == str(tmp_path / "job.yaml")


@pytest.mark.parametrize("epoch", ["soon", "-1e3", str(10**30)])
def test_a_bad_source_date_is_refused_before_the_work(tmp_path, monkeypatch, epoch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", epoch)
    ended = opl("run", write_job(tmp_path), "--out", tmp_path / "out")
    assert ended.status == 2
    assert ended.err.startswith("error: SOURCE_DATE_EPOCH: must be seconds since 1970, got '")
    assert not (tmp_path / "out").exists()
