"""Cell files: what they say, what is refused, and the same job on arm after arm."""

import copy
import csv
import json
import shutil

import numpy as np
import pytest
import trimesh
import yaml
from scipy.spatial.transform import Rotation

from opl.cell.robot import link_names
from opl.cell.robot_loading import load_robot
from opl.errors import InputError
from opl.files.resources import folder
from opl.geometry.frames import pose, rotation_angle, transform
from opl.geometry.mesh import TriangleMesh
from opl.job.cell import load_cell
from opl.job.load import load_job
from tests.support.jobs import GONE, QUICK, opl, write_job
from tests.support.schema_check import schema_faults

pytestmark = pytest.mark.usefixtures("no_pictures")

WORKPIECES = folder("workpieces")
CELL = WORKPIECES / "cells" / "belt_cell.yaml"
CONTACT0 = [
    [0.007, 0, 1, 890.3631],
    [1, -0.0012, -0.007, 235.6854],
    [0.0012, 1, 0, 323.1888],
    [0, 0, 0, 1],
]
WHEEL = {"T_base_contact0_mm": CONTACT0, "width_mm": 50, "radius_mm": 150, "max_roll_deg": 45}
PLAIN = {
    "robot": "mh24",
    "wheels": [WHEEL],
    "obstacles": [{"name": "post", "box_mm": [50, 50, 50], "at_mm": [0, 1500, 0]}],
    "gripper": [{"name": "jaw", "cylinder_mm": [22, 100], "at_mm": [0, 0, 50]}],
    "home_deg": [15, -45, -50, 0, 50, -180],
}


def changed(content, changes):
    """Return a document with changes: values by dotted key path."""
    content = copy.deepcopy(content)
    for path, value in changes.items():
        *parents, key = [int(part) if part.isdecimal() else part for part in path.split(".")]
        place = content
        for parent in parents:
            place = place[parent]
        if value is GONE:
            del place[key]
        else:
            place[key] = value
    return content


def write_cell(home, changes=(), content=PLAIN, file="cell.yaml"):
    """Write a cell file; return it."""
    home.mkdir(parents=True, exist_ok=True)
    path = home / file
    path.write_text(yaml.safe_dump(changed(content, dict(changes)), sort_keys=False), "utf-8")
    return path


def write_both(home, of_cell=(), of_job=()):
    """Write a cell file and a quick job that names it; return the job file."""
    write_cell(home, of_cell)
    own = {"robot": GONE, "wheel": GONE, "obstacles": GONE, "clearance_mm": GONE}
    quick = {key: value for key, value in QUICK.items() if not key.startswith("wheel")}
    job = {"cell": "cell.yaml", "process.home_deg": GONE, "fixture.bodies": GONE}
    return write_job(home, {**quick, **own, **job, **dict(of_job)}, quick=False)


def refusal(path):
    with pytest.raises(InputError) as refused:
        load_cell(path)
    return str(refused.value)


# what it says


def test_the_cell_that_comes_with_opl_is_in_the_base_frame():
    cell = load_cell(CELL)
    (wheel,) = cell.wheels
    direct = load_job(WORKPIECES / "v_shape" / "job.yaml").cell
    np.testing.assert_allclose(wheel.wheel.T_base_contact0, direct.wheel.T_base_contact0, atol=1e-9)
    bodies = {body.name: body for body in cell.obstacles}
    assert bodies["floor"].T_parent_body[2, 3] == pytest.approx(-0.505 - 0.011)
    frame = bodies["machine frame"]
    assert isinstance(frame.shape, TriangleMesh)
    corners = transform(frame.T_parent_body, frame.shape.vertices)
    np.testing.assert_allclose(corners.min(axis=0), [1.5, -0.0175, -0.505], atol=1e-6)
    np.testing.assert_allclose(corners.max(axis=0), [1.9, 0.4825, 0.695], atol=1e-6)
    assert [limit.name for limit in cell.limits] == ["R", "R+T"]
    assert cell.limits[1].coefficients.tolist() == [0, 0, 0, 1, 0, 1]
    rules = cell.pairs.rules("belt grinder", ())
    assert rules.required[frozenset(["B_link", "machine frame"])] == pytest.approx(0.02)
    assert rules.required[frozenset(["T_link", "fence left"])] == pytest.approx(0.05)
    assert rules.allowed == {frozenset(["gripper", "part"])}


def test_a_job_in_a_cell_without_frills_is_the_job_that_says_it_all_itself(tmp_path):
    own = load_job(write_job(tmp_path / "own", {"obstacles": PLAIN["obstacles"]}, quick=False)).cell
    shared = load_job(write_both(tmp_path / "shared")).cell
    np.testing.assert_array_equal(own.wheel.T_base_contact0, shared.wheel.T_base_contact0)
    assert (own.required_clearance, own.max_belt_penetration) == (
        shared.required_clearance,
        shared.max_belt_penetration,
    )
    for mine, theirs in zip(
        (*own.obstacles, *own.fixture), (*shared.obstacles, *shared.fixture), strict=True
    ):
        assert mine.shape == theirs.shape
        np.testing.assert_allclose(mine.T_parent_body, theirs.T_parent_body, atol=1e-12)


@pytest.mark.parametrize("robot", ["mh24", "gp12", "kr16"])
def test_what_stands_in_the_cell_stays_when_the_arm_is_exchanged(robot, tmp_path):
    joints = len(load_robot(robot).joint_names)
    face = {"at_mm": [100, -200, 300], "rotation_deg": [0, 0, 90]}
    wheel = {**WHEEL, "T_cell_contact0_mm": CONTACT0}
    del wheel["T_base_contact0_mm"]
    changes = {"robot": robot, "mounting_face": face, "wheels": [wheel], "home_deg": [0.0] * joints}
    cell = load_cell(write_cell(tmp_path, changes))
    height = load_robot(robot).base_height
    np.testing.assert_allclose(cell.T_cell_base[:3, 3], [0.1, -0.2, 0.3 + height])
    np.testing.assert_allclose(cell.T_cell_base[:3, 0], [0, 1, 0], atol=1e-12)
    T_cell_contact0 = cell.T_cell_base @ cell.wheels[0].wheel.T_base_contact0
    np.testing.assert_allclose(T_cell_contact0[:3, 3], [0.8903631, 0.2356854, 0.3231888])
    post = cell.T_cell_base @ cell.obstacles[0].T_parent_body
    np.testing.assert_allclose(post, pose(np.eye(3), np.array([0, 1.5, 0])), atol=1e-12)


def touched_from(T, error=0.0):
    """Return left edge, right edge and axle of a wheel, in mm, off along x of its frame."""
    places = {"left_edge": (25 + error, 0, 0), "right_edge": (-25, 0, 0), "axle": (80, 0, 150)}
    return {
        kind: [(1e3 * transform(T, 1e-3 * np.array(p, dtype=float))).tolist()]
        for kind, p in places.items()
    }


def test_matrix_pendant_and_touched_points_tell_the_same_place(tmp_path):
    by_matrix = load_cell(write_cell(tmp_path)).wheels[0]
    T = by_matrix.wheel.T_base_contact0
    ended = opl("cell", tmp_path / "cell.yaml", "--json")
    shown = json.loads(ended.out)["wheels"][0]["pendant"]
    assert shown["xyz_mm"] == [890.3631, 235.6854, 323.1888]
    angles = Rotation.from_matrix(T[:3, :3]).as_euler("xyz", degrees=True)  # about fixed axes
    np.testing.assert_allclose(shown["rx_ry_rz_deg"], angles, atol=6e-5)
    touched = touched_from(T)
    for key, value in {"pendant": shown, "touched": touched}.items():
        wheel = {**WHEEL, key: value}
        del wheel["T_base_contact0_mm"]
        placed = load_cell(write_cell(tmp_path, {"wheels": [wheel]})).wheels[0]
        there = placed.wheel.T_base_contact0
        # four digits of a degree, of a tenth of a micrometre
        assert np.linalg.norm(there[:3, 3] - T[:3, 3]) < 1e-7
        assert rotation_angle(there, T) < 2e-6
        # a job says its own wheel in the same ways
        job = write_job(
            tmp_path / key, {"wheel": {**wheel, "max_belt_penetration_mm": 0.5}}, quick=False
        )
        np.testing.assert_array_equal(load_job(job).cell.wheel.T_base_contact0, there)


def test_positions_are_taken_from_where_the_controller_counts(tmp_path):
    # the pendant of a KUKA counts from the floor, 675 mm below axis 2 or as its data say
    robot = load_robot("kr16")
    assert robot.base_height != robot.controller_base_height
    shown = {"xyz_mm": [900, 0, 800], "rx_ry_rz_deg": [0, 0, 0]}
    wheel = {**WHEEL, "pendant": shown}
    del wheel["T_base_contact0_mm"]
    changes = {"robot": "kr16", "wheels": [wheel], "home_deg": [0.0] * 6}
    z = load_cell(write_cell(tmp_path, changes)).wheels[0].wheel.T_base_contact0[2, 3]
    assert z == pytest.approx(0.8 - (robot.base_height - robot.controller_base_height))
    changes["wheels"] = [{**wheel, "pendant": {**shown, "frame": "cell"}}]
    changes["mounting_face"] = {"at_mm": [0, 0, 0]}
    z = load_cell(write_cell(tmp_path, changes)).wheels[0].wheel.T_base_contact0[2, 3]
    assert z == pytest.approx(0.8 - robot.base_height)


def test_a_wheel_touched_without_its_belt_lies_under_it(tmp_path):
    T = load_cell(write_cell(tmp_path)).wheels[0].wheel.T_base_contact0
    wheel = {**WHEEL, "radius_mm": 153, "touched": {**touched_from(T), "radius_mm": 150}}
    del wheel["T_base_contact0_mm"]
    placed = load_cell(write_cell(tmp_path, {"wheels": [wheel]})).wheels[0].wheel
    np.testing.assert_allclose(
        placed.T_base_contact0[:3, 3], T[:3, 3] - 0.003 * T[:3, 2], atol=1e-9
    )


def test_residuals_are_printed_and_too_large_ones_refused(tmp_path):
    T = load_cell(write_cell(tmp_path)).wheels[0].wheel.T_base_contact0
    wheel = {**WHEEL, "touched": touched_from(T, error=0.4)}
    del wheel["T_base_contact0_mm"]
    path = write_cell(tmp_path, {"wheels": [wheel]})
    ended = opl("cell", path)
    assert ended.status == 0
    line = "residuals of its touched points in mm: left_edge 1 0.200, right_edge 1 0.200, axle 1 0"
    assert line in ended.out and "2 equations more than needed" in ended.out
    told = json.loads(opl("cell", path, "--json").out)["wheels"][0]
    assert told["residuals_mm"] == {"left_edge 1": 0.2, "right_edge 1": 0.2, "axle 1": 0.0}
    job = write_both(tmp_path, {"wheels": [wheel]})
    assert line in opl("check", job).out
    direct = write_job(tmp_path / "direct", {"wheel": wheel}, quick=False)
    assert line in opl("check", direct).out
    wheel["touched"] = touched_from(T, error=1.4)
    assert refusal(write_cell(tmp_path, {"wheels": [wheel]})) == (
        f"{path}: wheels.0.touched: left_edge 1 is 0.70 mm from where the other points put it, "
        "0.5 mm allowed; residuals in mm: left_edge 1 0.70, right_edge 1 0.70, axle 1 0.00"
    )


def test_a_job_picks_a_wheel_and_keeps_away_from_the_others(tmp_path):
    away = [[*row[:3], row[3] + shift] for row, shift in zip(CONTACT0, (0, 900, 0, 0), strict=True)]
    wheels = [{**WHEEL, "name": "coarse"}, {**WHEEL, "name": "fine", "T_base_contact0_mm": away}]
    two = {"wheels": wheels, "pair_clearances": [{"pair": ["part", "fine"], "clearance_mm": 30}]}
    for picked, other in (("coarse", "fine"), ("fine", "coarse")):
        long = {"process.approach_mm": 40}  # the clearance must be left, too
        job = load_job(write_both(tmp_path, two, {"wheel_name": picked, **long}))
        assert [body.name for body in job.cell.obstacles] == ["post", other]
        named = other if picked == "coarse" else "wheel"
        assert job.cell.pairs.required == {frozenset(["part", named]): pytest.approx(0.03)}
        cylinder = job.cell.obstacles[1]
        assert (cylinder.shape.radius, cylinder.shape.length) == (0.15, 0.05)
        middle = {wheel["name"]: wheel for wheel in wheels}[other]["T_base_contact0_mm"]
        into = np.array(middle)[:3, 2] / np.linalg.norm(np.array(middle)[:3, 2])
        wanted = np.array(middle)[:3, 3] * 1e-3 + 0.15 * into
        np.testing.assert_allclose(cylinder.T_parent_body[:3, 3], wanted, atol=1e-4)
    for changes, told in (
        ({}, "job.yaml: wheel_name: is missing: "),
        ({"wheel_name": "rough"}, "no wheel 'rough' in "),
    ):
        with pytest.raises(InputError, match=told):
            load_job(write_both(tmp_path, two, changes))


def test_a_pair_of_one_link_goes_before_all_links(tmp_path):
    said = {
        "pair_clearances": [
            {"pair": ["B_link", "post"], "clearance_mm": 1},
            {"pair": ["robot", "post"], "clearance_mm": 40},
            {"pair": ["fixture", "post"], "clearance_mm": 30},
        ],
        "allowed_contacts": [["robot", "jaw"], ["post", "T_link"]],
    }
    held = [{"name": "clamp", "box_mm": [5, 5, 5], "at_mm": [0, 0, 60]}]
    pairs = load_job(write_both(tmp_path, said, {"fixture.bodies": held})).cell.pairs
    of_post = {
        name: round(1e3 * distance)
        for both, distance in pairs.required.items()
        for name in both - {"post"}
    }
    links = link_names(load_robot("mh24"))
    expected = {**dict.fromkeys(links, 40), "B_link": 1, "clamp": 30}
    del expected["T_link"]
    assert of_post == expected
    assert pairs.allowed == {
        frozenset(["post", "T_link"]),
        *(frozenset([name, "jaw"]) for name in links),
    }


# what is refused


LIMIT = {"lower_deg": -100, "upper_deg": 100}


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"robot": GONE}, "robot: is missing"),
        ({"robot": "mh99"}, "robot: unknown robot 'mh99'; known: "),
        ({"colour": "red"}, "colour: unknown key; known here: allowed_contacts, clearance_mm"),
        ({"wheels": []}, "wheels: must have at least 1 values, got 0"),
        ({"wheels.0.width_mm": -5}, "wheels.0.width_mm: must be more than 0, got -5"),
        ({"wheels.0.T_base_contact0_mm": GONE}, "wheels.0: needs exactly one of T_cell_contact0"),
        (
            {"wheels.0.pendant": {"xyz_mm": [1, 2, 3], "rx_ry_rz_deg": [0, 0, 0]}},
            "wheels.0: needs exactly one of T_cell_contact0_mm, T_base_contact0_mm, pendant, touch",
        ),
        (
            {"wheels.0": {**WHEEL, "T_base_contact0_mm": None, "touched": {"rim": [[1, 2, 3]]}}},
            "wheels.0.touched: 1 equations from 1 points, 6 are needed: touch left_edge",
        ),
        ({"wheels.0.name": "part"}, "wheels.0.name: 'part' is the name of the part already"),
        ({"wheels": [WHEEL, WHEEL]}, "wheels.1.name: 'wheel' is the name of wheels.0.name"),
        (
            {"wheels": [WHEEL, {**WHEEL, "name": "fine"}]},
            "wheels: each of several needs a name of its own, other than 'wheel'",
        ),
        ({"gripper.0.name": "post"}, "gripper.0.name: 'post' is the name of obstacles.0.name"),
        ({"obstacles.0.name": "T_link"}, "obstacles.0.name: 'T_link' is the name of a link of the"),
        ({"obstacles.0.name": "robot"}, "obstacles.0.name: 'robot' is the name of all links"),
        (
            {"obstacles.0.box_mm": GONE},
            "obstacles.0: needs either box_mm (edges along x, y, z) or cylinder_mm (radius, length "
            "along z) or mesh (a file)",
        ),
        ({"obstacles.0.mesh": "a.stl"}, "obstacles.0: needs either box_mm"),
        (
            {"obstacles.0": {"name": "frame", "mesh": "frame.stl", "at_mm": [0, 0, 0]}},
            "obstacles.0: mesh_unit, mm or m, goes with mesh",
        ),
        (
            {"gripper.0": {"name": "g", "mesh": "no.stl", "mesh_unit": "mm", "at_mm": [0, 0, 0]}},
            "gripper.0.mesh: ",
        ),
        (
            {"pair_clearances": [{"pair": ["post", "pots"], "clearance_mm": 5}]},
            "pair_clearances.0.pair: no body 'pots' in the cell; have: robot, part, fixture, jaw, "
            "wheel, post, base_link, S_link, L_link, U_link, R_link, B_link, T_link",
        ),
        (
            {"pair_clearances": [{"pair": ["post"], "clearance_mm": 5}]},
            "pair_clearances.0.pair: must have at least 2 values, got 1",
        ),
        (
            {"pair_clearances": [{"pair": ["post", "part"], "clearance_mm": -5}]},
            "pair_clearances.0.clearance_mm: must be at least 0, got -5",
        ),
        (
            {"pair_clearances": [{"pair": ["jaw", "part"], "clearance_mm": 5}]},
            "pair_clearances.0.pair: jaw and part: do not move against each other",
        ),
        (
            {"pair_clearances": [{"pair": ["U_link", "L_link"], "clearance_mm": 5}]},
            "pair_clearances.0.pair: U_link and L_link: do not move against each other, or share a",
        ),
        (
            {"pair_clearances": [{"pair": ["base_link", "post"], "clearance_mm": 5}]},
            "pair_clearances.0.pair: base_link and post: do not move against each other",
        ),
        (
            {
                "pair_clearances": [{"pair": ["post", "part"], "clearance_mm": 5}],
                "allowed_contacts": [["part", "post"]],
            },
            "pair_clearances.0.pair: post and part: are given in allowed_contacts.0 already",
        ),
        ({"allowed_contacts": [["post", "post"]]}, "allowed_contacts.0: post and post: are one"),
        ({"allowed_contacts": [["post", "nut"]]}, "allowed_contacts.0: no body 'nut' in the cell"),
        (
            {"allowed_contacts": [["part", "wheel"]]},
            "allowed_contacts.0: part and wheel: how deep a part may sink into the belt is the",
        ),
        (
            {"joint_limits": [{"joint": "X", **LIMIT}]},
            "joint_limits.0.joint: no such joint 'X'; have: S, L, U, R, B, T",
        ),
        (
            {"joint_limits": [{"joint": "R", **LIMIT}] * 2},
            "joint_limits.1.joint: joint R is given twice",
        ),
        (
            {"joint_limits": [{"joint": "R", "lower_deg": 100, "upper_deg": -100}]},
            "joint_limits.0: lower_deg must be below upper_deg -100",
        ),
        (
            {"joint_limits": [{"joint": "R", "lower_deg": 300, "upper_deg": 400}]},
            "joint_limits.0: leaves nothing of -200 to 200, the robot's own",
        ),
        (
            {"coupled_limits": [{"coefficients": {"R": 1, "Q": 1}, **LIMIT}]},
            "coupled_limits.0.coefficients: no such joint 'Q'; have: S, L, U, R, B, T",
        ),
        (
            {"coupled_limits": [{"coefficients": {"R": 0}, **LIMIT}]},
            "coupled_limits.0.coefficients: all are zero",
        ),
        (
            {"coupled_limits": [{"coefficients": {}, **LIMIT}]},
            "coupled_limits.0.coefficients: must have at least 1 values, got 0",
        ),
    ],
)
def test_a_bad_cell_is_refused_with_file_and_key(tmp_path, changes, told):
    path = write_cell(tmp_path, changes)
    assert refusal(path).startswith(f"{path}: {told}")
    ended = opl("cell", path)
    assert ended.status == 2 and ended.err.startswith(f"error: {path}: {told}")


@pytest.mark.parametrize(
    ("of_cell", "of_job", "told"),
    [
        ({}, {"robot": "mh24"}, "job.yaml: robot: is for the cell file, "),
        ({}, {"wheel": WHEEL}, "job.yaml: wheel: is for the cell file, "),
        ({}, {"obstacles": []}, "job.yaml: obstacles: is for the cell file, "),
        ({}, {"clearance_mm": 5}, "job.yaml: clearance_mm: is for the cell file, "),
        ({}, {"process.home_deg": [0] * 6}, "process.home_deg: is given here and as home_deg in "),
        ({"home_deg": GONE}, {}, "process.home_deg: is missing here, and home_deg in "),
        ({}, {"wheel_name": "fine"}, "job.yaml: wheel_name: no wheel 'fine' in "),
        ({}, {"cell": "none.yaml"}, "none.yaml: cannot be read: No such file"),
        ({"clearance_mm": -1}, {}, "cell.yaml: clearance_mm: must be at least 0, got -1"),
        (
            {},
            {"fixture.bodies": [{"name": "jaw", "box_mm": [1, 1, 1], "at_mm": [0, 0, 0]}]},
            "job.yaml: fixture.bodies.0.name: 'jaw' is something else in ",
        ),
        (
            {"home_deg": [15, -45, -50, 0, 50, 500]},
            {},
            "cell.yaml: home_deg: joint T must be in -455 to 455, got 500",
        ),
        (
            {"coupled_limits": [{"coefficients": {"R": 1, "T": -0.5}, **LIMIT, "upper_deg": 80}]},
            {},
            "cell.yaml: home_deg: R-0.5T must be in -100 to 80, got 90",
        ),
        (
            {"joint_limits": [{"joint": "T", **LIMIT}], "home_deg": GONE},
            {"process.home_deg": [15, -45, -50, 0, 50, -180]},
            "job.yaml: process.home_deg: T must be in -100 to 100, got -180",
        ),
    ],
)
def test_what_job_and_cell_say_must_go_together(tmp_path, of_cell, of_job, told):
    job = write_both(tmp_path, of_cell, of_job)
    with pytest.raises(InputError) as refused:
        load_job(job)
    assert told in str(refused.value)
    if "cell file, " in told or "home_deg in " in told:
        assert str(tmp_path / "cell.yaml") in str(refused.value)


def test_a_job_without_a_cell_says_all_itself(tmp_path):
    for key in ("robot", "wheel", "process.home_deg"):
        with pytest.raises(InputError, match=f"job.yaml: {key}: is missing, and there is no cell"):
            load_job(write_job(tmp_path, {key: GONE}))
    with pytest.raises(InputError, match="wheel_name: goes with a cell file"):
        load_job(write_job(tmp_path, {"wheel_name": "wheel"}))


def test_a_mesh_in_the_wrong_unit_is_refused(tmp_path):
    path = write_cell(tmp_path)
    trimesh.creation.box((800, 800, 1200)).export(tmp_path / "frame.stl")
    frame = {"name": "frame", "mesh": "frame.stl", "mesh_unit": "m", "at_mm": [0, 0, 0]}
    write_cell(tmp_path, {"obstacles.0": frame})
    assert refusal(path) == (
        f"{path}: obstacles.0.mesh_unit: m makes frame 1.2e+06 mm long, which nothing is"
    )


def test_home_in_a_body_names_the_cell_file(tmp_path):
    trimesh.creation.box((8, 8, 8)).export(tmp_path / "hall.stl")
    hall = {"name": "hall", "mesh": "hall.stl", "mesh_unit": "m", "at_mm": [0, 0, 0]}
    near = {"name": "block", "box_mm": [100, 100, 100], "at_mm": [480, 130, 740]}
    for body, told in (
        (hall, "at home one is in the other: flange inside of hall, part inside of hall"),
        (near, "at home these are nearer to each other than 5 mm (clearance_mm) or collide: "),
    ):
        ended = opl("run", write_both(tmp_path, {"obstacles": [body]}), "--out", tmp_path / "out")
        assert ended.status == 2
        assert ended.err.startswith(f"error: {tmp_path / 'cell.yaml'}: home_deg: {told}")


# the command line


def test_the_schema_of_cell_files_accepts_the_one_that_comes_with_opl():
    ended = opl("schema", "--cell")
    schema = json.loads(ended.out)
    content = yaml.safe_load(CELL.read_text(encoding="utf-8"))
    assert schema_faults(schema, content, schema["$defs"]) == []
    for wrong in (changed(content, {"colour": "red"}), changed(content, {"wheels": GONE})):
        assert schema_faults(schema, wrong, schema["$defs"]) != []


def test_a_cell_is_told_in_words_and_figures():
    ended = opl("cell", CELL)
    assert ended.status == 0
    for line in (
        "is a valid cell",
        "its base frame at 0 0 505 mm in the cell",
        "belt grinder: 50 mm wide, radius 150 mm, contact frame 0 on the pendant: X 890.363 Y",
        "machine frame (mesh of 156 triangles, 400 x 500 x 1200 mm)",
        "clearance 5 mm, robot and fence left 50 mm",
        "may touch: gripper and part",
        "limits beside the robot's own: R -150 to 150 deg, R+T -220 to 220 deg",
        "home 15 -45 -50 0 50 -160 deg",
    ):
        assert line in ended.out
    told = json.loads(opl("cell", CELL, "--json").out)
    assert told["limits"][1] == {
        "name": "R+T",
        "coefficients": [0.0, 0.0, 0.0, 1.0, 0.0, 1.0],
        "lower_deg": -220.0,
        "upper_deg": 220.0,
    }
    assert told["allowed_contacts"] == [["gripper", "part"]] and len(told["clearances"]) == 3
    checked = opl("check", WORKPIECES / "v_in_cell" / "job.yaml").out
    assert "belt_cell.yaml:\n  robot Motoman MH24" in checked and "R+T -220 to 220" in checked


# the same job on arm after arm


@pytest.mark.parametrize("robot", ["mh24", "gp25", "ar2010", "mh50"])
def test_the_same_job_in_the_same_cell_on_another_arm(robot, tmp_path):
    for part in ("cells", "v_in_cell", "v_shape"):
        shutil.copytree(WORKPIECES / part, tmp_path / part)
    path = tmp_path / "cells" / "belt_cell.yaml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("robot: mh24", f"robot: {robot}", 1), encoding="utf-8")
    job = tmp_path / "v_in_cell" / "job.yaml"
    content = yaml.safe_load(job.read_text(encoding="utf-8"))
    quick = {key: value for key, value in QUICK.items() if not key.startswith("wheel")}
    quick["process.max_dwell_s"] = 5.0  # some turn the wrist slowly at the bend
    # in poses, because not every arm's pulses are known
    told = {"program": {"controller": "DX200", "positions": "base"}}
    job.write_text(yaml.safe_dump(changed(content, {**quick, **told})), encoding="utf-8")
    ended = opl("run", job, "--out", tmp_path / "out", "--json")
    assert ended.status == 0, ended.err
    result = json.loads(ended.out)
    assert result["robot"]["name"] == robot
    assert result["verification"]["collisions"] == 0
    assert result["verification"]["limit_violations"] == 0


def test_a_program_that_breaks_a_limit_of_the_cell_is_not_proven(tmp_path):
    job = write_both(tmp_path)
    ended = opl("run", job, "--out", tmp_path / "out", "--quiet")
    assert ended.status == 0, ended.err
    program = tmp_path / "out" / "V_SHAPE.JBI"
    with (tmp_path / "out" / "V_SHAPE.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    wound = [float(row["R_deg"]) + float(row["T_deg"]) for row in rows]
    home, far = wound[0], max(wound, key=lambda angle: abs(angle - wound[0]))
    assert abs(far - home) > 10.0
    for beyond, status in ((1.0, 0), (-1.0, 4)):
        ends = sorted((home - np.sign(far - home) * 5.0, far + np.sign(far - home) * beyond))
        limit = {"lower_deg": float(ends[0]), "upper_deg": float(ends[1])}
        write_cell(tmp_path, {"coupled_limits": [{"coefficients": {"R": 1, "T": 1}, **limit}]})
        ended = opl("verify", job, program)
        assert ended.status == status, ended.err
        assert ("R+T: " in ended.err) == (status == 4)
