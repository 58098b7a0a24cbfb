"""Job files made from that of the V part, with something changed, and opl run on them."""

import contextlib
import copy
import io
import json
import shutil
from dataclasses import dataclass

import numpy as np
import trimesh
import yaml

from opl.cell.robot import forward_kinematics
from opl.cell.robot_loading import load_robot
from opl.cli.commands import main
from opl.files.resources import folder
from opl.geometry.frames import pose
from tests.support.surfaces import sphere_patch

V_SHAPE = folder("workpieces") / "v_shape"
V_JOB = V_SHAPE / "job.yaml"

GONE = object()  # as the value of a key: leave it out

# one row, few contact positions and long steps: planned and proven in a second
QUICK = {
    "passes.rows": 1,
    "passes.max_chord_error_mm": 0.3,
    "passes.max_step_mm": 20,
    "search.contact_positions": 40,
    "search.max_contact_step": 5,
    "search.max_contact_error_mm": 0.5,
    "wheel.max_belt_penetration_mm": 1.0,
    "process.approach_mm": 20,
}

# a post where the part has to be when it is ground: every configuration on the wheel hits it
POST = {"name": "post", "box_mm": [60, 60, 400], "at_mm": [800, 235, 320]}


@dataclass(frozen=True)
class Ended:
    """How a command ended and what it printed."""

    status: int
    out: str
    err: str


def opl(*arguments):
    """Run a command in this process; an error that is no exit status is not caught."""
    out, err = io.StringIO(), io.StringIO()
    status = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main([str(argument) for argument in arguments], prog_name="opl")
        except SystemExit as end:
            status = end.code
    return Ended(status, out.getvalue(), err.getvalue())


def document(changes=(), quick=True):
    """Return the content of the V job with changes: values by dotted key path."""
    content = yaml.safe_load(V_JOB.read_text(encoding="utf-8"))
    for path, value in {**(QUICK if quick else {}), **dict(changes)}.items():
        *parents, key = [int(part) if part.isdecimal() else part for part in path.split(".")]
        place = content
        for parent in parents:
            place = place[parent]
        if value is GONE:
            del place[key]
        else:
            place[key] = copy.deepcopy(value)
    return content


def write_job(home, changes=(), quick=True, file="job.yaml"):
    """Write a job and the V part's files to a folder; return the job file."""
    home.mkdir(parents=True, exist_ok=True)
    for part in ("surface.json", "v_shape.stl"):
        shutil.copy(V_SHAPE / part, home)
    path = home / file
    path.write_text(yaml.safe_dump(document(changes, quick), sort_keys=False), encoding="utf-8")
    return path


def write_text(home, text):
    """Write a job file word for word; return it."""
    home.mkdir(parents=True, exist_ok=True)
    path = home / "job.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def write_surface(path, **changes):
    """Write the V part's surface with some of its keys changed."""
    surface = json.loads((V_SHAPE / "surface.json").read_text(encoding="utf-8"))
    path.write_text(json.dumps({**surface, **changes}), encoding="utf-8")


def write_robot(home, limits_deg):
    """Write the MH24 with other limits, (lower, upper) by joint name, to a folder."""
    shutil.copytree(folder("robots") / "mh24", home)
    path = home / "robot.yaml"
    robot = yaml.safe_load(path.read_text(encoding="utf-8"))
    for joint in robot["joints"]:
        if joint["name"] in limits_deg:
            joint["limits"]["lower_deg"], joint["limits"]["upper_deg"] = limits_deg[joint["name"]]
    path.write_text(yaml.safe_dump(robot), encoding="utf-8")


def write_trough(home, width_mm=30.0, depth_mm=15.0):
    """Write a job whose surface is the bottom of a trough; the path runs from wall to wall.

    The trough lies where the apex of the V part is. A wheel wider than the trough cannot reach its
    bottom; on a wheel that may not roll about its edges it would have to cut ``depth_mm`` deep.
    """
    bottom, wall, base = 96.5, 10.0, 60.0
    middle, x = -24.572, 12.5
    inner, outer = 0.5 * width_mm, 0.5 * width_mm + wall
    # counter-clockwise seen against x: base, wall up, down to the bottom, up, wall down
    profile = [
        (-outer, base), (outer, base), (outer, bottom + depth_mm), (inner, bottom + depth_mm),
        (inner, bottom), (-inner, bottom), (-inner, bottom + depth_mm), (-outer, bottom + depth_mm),
    ]  # fmt: skip
    ring = np.array([(y + middle, z) for y, z in profile])
    n = len(ring)
    corners = np.vstack([np.column_stack([np.full(n, side), ring]) for side in (-x, x)])
    cap = [(0, 1, 4), (1, 2, 3), (1, 3, 4), (0, 4, 5), (0, 5, 6), (0, 6, 7)]
    around = [(i, (i + 1) % n) for i in range(n)]
    faces = [face for i, j in around for face in ((i, j, j + n), (i, j + n, i + n))]
    faces += [(c, b, a) for a, b, c in cap] + [(a + n, b + n, c + n) for a, b, c in cap]
    solid = trimesh.Trimesh(corners, faces, process=False)
    assert solid.is_watertight and solid.volume > 0.0

    job = write_job(
        home,
        {
            "name": "TROUGH",
            "wheel.max_roll_deg": 0,
            "workpiece.mesh": "trough.stl",
            "passes.margin_mm": 2,
        },
    )
    solid.export(home / "trough.stl")
    edge = 0.8 * inner  # of the ground surface, short of the walls
    net = [[[side, y + middle, bottom] for y in (-edge, edge)] for side in (-x, x)]
    surface = {
        "degree_u": 1,
        "degree_v": 1,
        "knots_u": [0, 0, 1, 1],
        "knots_v": [0, 0, 1, 1],
        "control_points_mm": np.array(net).tolist(),
        "weights": [[1.0, 1.0], [1.0, 1.0]],
    }
    (home / "surface.json").write_text(json.dumps(surface), encoding="utf-8")
    return job


def write_ball(home):
    """Write a job of two passes over the top of a ball, one on either side of it.

    Where the top is ground in the middle of the wheel, the wrist is straight: it bends to one side
    on one pass and to the other on the other. The axle is parallel to the axis of that bend.
    """
    radius, away = 0.04, 0.09  # in m; the middle of the ball from the flange
    upright = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    T_flange_workpiece = pose(upright, np.array([0.0, 0.0, away]))
    outward = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
    T_workpiece_cutter = pose(outward, np.array([radius, 0.0, 0.0]))
    straight = np.deg2rad([15, 0, -40, 0, 0, 0])
    T_base_flange = forward_kinematics(load_robot("mh24"), straight)
    job = write_job(
        home,
        {
            "name": "BALL",
            "wheel.T_base_contact0_mm": _in_mm(
                T_base_flange @ T_flange_workpiece @ T_workpiece_cutter
            ),
            "obstacles": [],
            "fixture": {
                "T_flange_workpiece_mm": _in_mm(T_flange_workpiece),
                "bodies": [{"name": "stem", "cylinder_mm": [16, 60], "at_mm": [0, 0, 30]}],
            },
            "workpiece.mesh": "ball.stl",
            "passes.plane_normal": [0, 1, 0],
            "passes.pitch_mm": 10,
            "passes.rows": 2,
            "passes.max_step_mm": 2,
            "process.approach_mm": 20,
            "process.home_deg": [15, -30, -40, 0, 0, 0],
        },
        quick=False,
    )
    trimesh.creation.icosphere(4, 1000.0 * radius).export(home / "ball.stl")
    patch = sphere_patch(1000.0 * radius, (-0.35, 0.35), (-0.35, 0.35))
    write_surface(
        home / "surface.json",
        degree_u=2,
        degree_v=2,
        knots_u=patch.knots_u.tolist(),
        knots_v=patch.knots_v.tolist(),
        control_points_mm=patch.control_points.tolist(),
        weights=patch.weights.tolist(),
    )
    return job


def _in_mm(T):
    return np.vstack([T[:3] * [1.0, 1.0, 1.0, 1000.0], T[3]]).round(6).tolist()
