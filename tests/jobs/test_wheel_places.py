"""A wheel is where the pendant of the robot says, on every robot that comes with opl and on others.

What a pendant shows is written out here from the numbers of robot.yaml, or is the kinematics that
Universal Robots publish; how opl turns one frame into the other is not asked.
"""

import csv
import json
import math
import shutil

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from opl.cell.robot import forward_kinematics
from opl.cell.robot_loading import known_robots, load_robot
from opl.files.resources import folder
from opl.job.cell import load_cell
from opl.job.load import load_job
from tests.support.jobs import opl, write_job

SIZE = {"name": "belt", "width_mm": 50, "radius_mm": 150, "max_roll_deg": 45}
# any place whose frame is turned about all axes: origin in mm, roll, pitch, yaw in degrees
ORIGIN, TURNS = (640.0, -310.0, 275.0), (100.0, -35.0, 70.0)
TOUCHED = {"left_edge": (25, 0, 0), "right_edge": (-25, 0, 0), "axle": (80, 0, 150)}
# Denavit and Hartenberg's a, d in [m] and alpha of the UR10e, as Universal Robots publish them;
# they start at the frame Base of the pendant and end at the flange
UR10E = (
    (0.0, 0.1807, math.pi / 2),
    (-0.6127, 0.0, 0.0),
    (-0.57155, 0.0, 0.0),
    (0.0, 0.17415, math.pi / 2),
    (0.0, 0.11985, -math.pi / 2),
    (0.0, 0.11655, 0.0),
)


def by_denavit_hartenberg(q):
    """Return the flange of a UR10e in the frame Base of its pendant, origin in [m]."""
    T = np.eye(4)
    for angle, (a, d, alpha) in zip(q, UR10E, strict=True):
        c, s, ca, sa = math.cos(angle), math.sin(angle), math.cos(alpha), math.sin(alpha)
        T = T @ [
            [c, -s * ca, s * sa, a * c],
            [s, c * ca, -c * sa, a * s],
            [0.0, sa, ca, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    return T


def on_the_pendant(robot_file):
    """Return the 4x4 that turns mm in opl's base frame into what the pendant of a robot shows.

    A pendant that is turned by an angle against the base frame shows everything turned back by it.
    """
    base = yaml.safe_load(robot_file.read_text(encoding="utf-8"))["base"]
    angle = math.radians(base.get("controller_turn_deg", 0.0))
    up = base["height_mm"] - base.get("controller_height_mm", base["height_mm"])
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s, 0, 0], [-s, c, 0, 0], [0, 0, 1, up], [0, 0, 0, 1.0]])


def place():
    """Return the wheel's frame in opl's base frame, origin in mm."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", TURNS, degrees=True).as_matrix()
    T[:3, 3] = ORIGIN
    return T


def shown(T):
    """Return a frame as a pendant shows it: R = Rz Ry Rx."""
    angles = Rotation.from_matrix(T[:3, :3]).as_euler("xyz", degrees=True)
    return {"xyz_mm": T[:3, 3].tolist(), "rx_ry_rz_deg": angles.tolist()}


def wheel_in(home, robot, **where):
    """Return the wheel of a cell file that says in one of the forms where it is."""
    home.mkdir(parents=True, exist_ok=True)
    path = home / "cell.yaml"
    content = {"robot": str(robot), "wheels": [{**SIZE, **where}]}
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    T = load_cell(path).wheels[0].wheel.T_base_contact0.copy()
    T[:3, 3] *= 1e3
    return T


def folder_of(name, home):
    """Return the folder of a robot: one that comes with opl, or another that is made here."""
    if name == "turned":
        return turned_robot(home)
    return imported_robot(home) if name == "imported" else folder("robots") / name


def turned_robot(home):
    """Write an MH24 whose controller counts from elsewhere, turned by an odd angle; its folder."""
    shutil.copytree(folder("robots") / "mh24", home)
    path = home / "robot.yaml"
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    content["base"] |= {"controller_height_mm": 120.0, "controller_turn_deg": 35.0}
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return home


def imported_robot(home):
    """Import the UR10e with the frame base of its maker's URDF, turned by half a turn."""
    text = load_robot("ur10e").urdf.read_text(encoding="utf-8")
    ours = '<origin xyz="0 0 0.1807"/>\n  </joint>\n\n  <joint'
    assert ours in text
    urdf = home.parent / "maker.urdf"
    urdf.write_text(
        text.replace(ours, '<origin xyz="0 0 0" rpy="0 0 3.14159265"/></joint><joint'), "utf-8"
    )
    ended = opl("robots", "import-urdf", urdf, "--name", "mine", "--out", home)
    assert ended.status == 0, ended.err
    return home


@pytest.mark.parametrize("name", [*known_robots(), "turned", "imported"])
def test_pendant_touched_points_and_matrix_are_one_place(name, tmp_path):
    robot = folder_of(name, tmp_path / "robot")
    there, T_pendant_base = place(), on_the_pendant(robot / "robot.yaml")
    is_turned = not np.allclose(T_pendant_base[:2, :2], np.eye(2))
    assert is_turned == (name in ("turned", "imported", "ur10e"))
    seen = T_pendant_base @ there
    points = {kind: [(seen @ [*point, 1.0])[:3].tolist()] for kind, point in TOUCHED.items()}
    for form in ({"pendant": shown(seen)}, {"touched": points}):
        found = wheel_in(tmp_path, robot, **form)
        np.testing.assert_allclose(found, there, atol=1e-6)
    by_matrix = {"T_base_contact0_mm": there.tolist()}
    np.testing.assert_allclose(wheel_in(tmp_path, robot, **by_matrix), there, atol=1e-9)
    # and back: what opl cell prints is what the pendant shows
    told = json.loads(opl("cell", tmp_path / "cell.yaml", "--json").out)["wheels"][0]["pendant"]
    np.testing.assert_allclose(told["xyz_mm"], seen[:3, 3], atol=1e-4)
    np.testing.assert_allclose(told["rx_ry_rz_deg"], shown(seen)["rx_ry_rz_deg"], atol=1e-4)
    x, y, z = seen[:3, 3]
    assert (
        f"on the pendant: X {x:.3f} Y {y:.3f} Z {z:.3f} Rx"
        in opl("cell", tmp_path / "cell.yaml").out
    )


def test_the_pendant_of_a_ur_is_its_makers_kinematics(tmp_path):
    robot = load_robot("ur10e")
    for q in np.random.default_rng(0).uniform(-np.pi, np.pi, (20, 6)):
        # the flange of the arm is brought to where the wheel's frame is
        seen = by_denavit_hartenberg(q)
        seen[:3, 3] *= 1e3
        found = wheel_in(tmp_path, "ur10e", pendant=shown(seen))
        found[:3, 3] /= 1e3
        np.testing.assert_allclose(found, forward_kinematics(robot, q), atol=1e-9)


def test_the_table_has_the_flange_where_the_pendant_of_a_ur_shows_it(tmp_path, monkeypatch):
    monkeypatch.setattr("opl.run.stages.draw_charts", lambda *_: {})
    changes = {
        "robot": "ur10e",
        "search.method": "recursive",
        "process.max_dwell_s": 5.0,
        "passes.end_margin_mm": 75,
        "process.home_deg": [-136, -95, -102, -163, -58, -68],
        "program": {"controller": "URSCRIPT"},
    }
    path = write_job(tmp_path, changes)
    ended = opl("run", path, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    rows = list(csv.DictReader((tmp_path / "out" / "V_SHAPE.csv").open()))
    names = load_job(path).cell.robot.joint_names
    for row in rows:
        seen = by_denavit_hartenberg(np.radians([float(row[f"{name}_deg"]) for name in names]))
        flange = [float(row[key]) for key in ("x_mm", "y_mm", "z_mm")]
        # four digits of a degree, 1.3 m away
        np.testing.assert_allclose(flange, 1e3 * seen[:3, 3], atol=0.02)
        R = Rotation.from_euler(
            "xyz", [float(row[key]) for key in ("rx_deg", "ry_deg", "rz_deg")], degrees=True
        )
        assert (R.inv() * Rotation.from_matrix(seen[:3, :3])).magnitude() < 1e-4
