"""Every robot that comes with opl: URDF against closed form and against other descriptions."""

import importlib.util
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
import pytest

from opl.cell.full_turns import full_turns
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import controller_poses, forward_kinematics
from opl.cell.robot_file import read_robot_file
from opl.cell.robot_loading import known_robots, load_robot, robot_path
from opl.cell.urdf_import import closure_error
from opl.files.documents import read
from opl.files.resources import folder
from tests.support.closed_forms import opw_solutions

ROBOTS = {name: load_robot(name) for name in known_robots()}
every_robot = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
every_spherical_wrist = pytest.mark.parametrize(
    "robot", [r for name, r in ROBOTS.items() if name != "ur10e"], ids=lambda robot: robot.name
)

# Where the makers and public descriptions put the flange of the zero configuration, in [mm] above
# the floor, whether its x points up there, and the published reach.
AT_ZERO = {
    "mh24": (1045, 1465, True, 1730),
    "gp25": (1045, 1465, True, 1730),
    "ar2010": (1332, 1465, True, 2010),
    "gp12": (895, 1264, True, 1440),
    "mh12": (895, 1264, True, 1440),
    "mh50": (1345, 1620, True, 2061),
    "irb2600": (1030, 1260, False, 1653),
    "irb4600": (1270, 1570, False, 2051),
    "kr16": (1768, 640, False, 1611),
    "m20ia": (1085, 1565, True, 1812),
}
# three axes parallel, where the others have a spherical wrist
UR = "ur10e"

# Denavit-Hartenberg: a1, length of the upper arm, offset of the forearm, forearm, wrist to flange,
# in [m]; a frame on axis 1 at the height of axis 2
DH = {
    "mh24": ("motoman", 0.150, 0.760, 0.200, 0.795, 0.100),
    "gp25": ("motoman", 0.150, 0.760, 0.200, 0.795, 0.100),
    "ar2010": ("motoman", 0.150, 0.760, 0.200, 1.082, 0.100),
    "gp12": ("motoman", 0.155, 0.614, 0.200, 0.640, 0.100),
    "mh12": ("motoman", 0.155, 0.614, 0.200, 0.640, 0.100),
    "mh50": ("motoman", 0.145, 0.870, 0.210, 1.025, 0.175),
    "m20ia": ("motoman", 0.150, 0.790, 0.250, 0.835, 0.100),
    "irb2600": ("abb", 0.150, 0.700, 0.115, 0.795, 0.085),
    "irb4600": ("abb", 0.175, 0.900, 0.175, 0.960, 0.135),
    "kr16": ("kuka", 0.260, 0.680, -0.035, 0.670, 0.158),
    UR: ("ur", 0.61270, 0.57155, 0.17415, 0.11985, 0.11655),
}
# the rows of each family: sign and zero of theta in [deg], d, a, alpha in [deg]
DH_ROWS = {
    "motoman": lambda a1, a2, a3, d4, d6: [
        (1, 0, 0, a1, -90), (1, -90, 0, a2, 180), (1, 0, 0, a3, -90),
        (1, 0, -d4, 0, 90), (1, 0, 0, 0, -90), (1, 0, -d6, 0, 180),
    ],
    "abb": lambda a1, a2, a3, d4, d6: [
        (1, 0, 0, a1, -90), (1, -90, 0, a2, 0), (1, 0, 0, a3, -90),
        (1, 0, d4, 0, 90), (1, 0, 0, 0, -90), (1, 180, d6, 0, 0),
    ],
    "kuka": lambda a1, a2, a3, d4, d6: [
        (-1, 0, 0, a1, -90), (1, 0, 0, a2, 0), (1, -90, 0, a3, -90),
        (-1, 0, d4, 0, 90), (1, 0, 0, 0, -90), (-1, 180, d6, 0, 0),
    ],
    # as the maker publishes it, its base turned by half a turn
    "ur": lambda a2, a3, d4, d5, d6: [
        (1, 180, 0, 0, 90), (1, 0, 0, -a2, 0), (1, 0, 0, -a3, 0),
        (1, 0, d4, 0, 90), (1, 0, d5, 0, -90), (1, 0, d6, 0, 0),
    ],
}  # fmt: skip


def dh_forward(name, q):
    family, *lengths = DH[name]
    T = np.eye(4)
    for angle, (sign, zero, d, a, alpha) in zip(q, DH_ROWS[family](*lengths), strict=True):
        theta = sign * angle + np.radians(zero)
        ct, st = np.cos(theta), np.sin(theta)
        ca, sa = np.cos(np.radians(alpha)), np.sin(np.radians(alpha))
        T = T @ [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0, sa, ca, d],
            [0, 0, 0, 1],
        ]
    return T


def random_configurations(robot, n, seed=0):
    return np.random.default_rng(seed).uniform(robot.lower, robot.upper, (n, 6))


# geometry


def test_there_are_robots_of_five_makers():
    makers = {"Yaskawa", "ABB", "KUKA", "FANUC", "Universal Robots"}
    assert {robot.maker for robot in ROBOTS.values()} == makers
    assert {*AT_ZERO, UR} == set(DH) == set(ROBOTS)


def test_the_zero_configuration_of_the_ur10e_is_the_makers():
    T = controller_poses(ROBOTS[UR], np.zeros(6))
    expected = [[1, 0, 0, -1.18425], [0, 0, -1, -0.2907], [0, 1, 0, 0.06085], [0, 0, 0, 1]]
    np.testing.assert_allclose(T, expected, atol=1e-12)
    assert ROBOTS[UR].reach == pytest.approx(1.3, abs=0.02)  # published, in round figures


@every_spherical_wrist
def test_the_zero_configuration_is_the_makers(robot):
    ahead, high, x_up, reach = AT_ZERO[robot.name]
    T = forward_kinematics(robot, np.zeros(6))
    x = [0.0, 0.0, 1.0 if x_up else -1.0]
    np.testing.assert_allclose(T[:3, :3].T, [x, np.cross([1, 0, 0], x), [1, 0, 0]], atol=1e-12)
    floor = robot.base_height
    np.testing.assert_allclose(T[:3, 3], [ahead / 1e3, 0, high / 1e3 - floor], atol=1e-12)
    assert robot.reach == pytest.approx(reach / 1e3, abs=1e-3)


@every_robot
def test_forward_agrees_with_denavit_hartenberg(robot):
    q = random_configurations(robot, 100)
    expected = [dh_forward(robot.name, row) for row in q]
    np.testing.assert_allclose(forward_kinematics(robot, q), expected, atol=1e-12)


@every_robot
def test_every_configuration_found_reaches_the_pose_and_the_original_is_among_them(robot):
    assert closure_error(robot) < 1e-11
    q = random_configurations(robot, 300, seed=1)
    found = inverse_kinematics(robot.arm, forward_kinematics(robot, q))[:, :, None] + full_turns(
        robot.lower, robot.upper
    )
    distance = np.abs(found - q[:, None, None]).max(axis=-1)
    assert np.nanmin(distance.reshape(len(q), -1), axis=1).max() < 1e-8


@every_spherical_wrist
def test_an_independent_package_finds_the_same_configurations(robot):
    Ts = forward_kinematics(robot, random_configurations(robot, 60, seed=2))
    for q, q_opw in zip(
        inverse_kinematics(robot.arm, Ts), opw_solutions(robot.arm, Ts), strict=True
    ):
        q = q[~np.isnan(q).any(axis=-1)]
        assert len(q) == len(q_opw) > 0
        apart = np.abs(np.remainder(q[:, None] - q_opw[None] + np.pi, 2 * np.pi) - np.pi)
        assert apart.max(axis=-1).min(axis=1).max() < 1e-7


@every_robot
def test_urdf_and_robot_file_give_the_same_limits_speeds_and_base(robot):
    model = pin.buildModelFromUrdf(str(robot.urdf))
    np.testing.assert_allclose(model.lowerPositionLimit, robot.lower, atol=1e-12)
    np.testing.assert_allclose(model.upperPositionLimit, robot.upper, atol=1e-12)
    np.testing.assert_allclose(model.velocityLimit, robot.max_speed, atol=1e-12)
    base = model.frames[model.getFrameId("base")].placement
    np.testing.assert_allclose(base.translation, [0, 0, robot.base_height])
    np.testing.assert_array_equal(base.rotation, np.eye(3))


@every_robot
def test_the_base_frame_lies_at_the_height_of_axis_2(robot):
    model = pin.buildModelFromUrdf(str(robot.urdf))
    data = model.createData()
    pin.forwardKinematics(model, data, np.zeros(6))
    assert data.oMi[2].translation[2] == pytest.approx(robot.base_height, abs=1e-12)
    assert robot.arm.c1 == 0.0


@pytest.mark.parametrize(
    ("name", "from_floor"), [("kr16", True), ("irb2600", True), ("gp25", False), ("m20ia", False)]
)
def test_poses_are_told_from_where_the_controller_counts(name, from_floor):
    robot = ROBOTS[name]
    assert robot.controller_base_height == (0.0 if from_floor else robot.base_height)
    (z,) = controller_poses(robot, np.zeros((1, 6)))[:, 2, 3]
    above_floor = AT_ZERO[name][1] / 1e3
    assert z == pytest.approx(above_floor - (0.0 if from_floor else robot.base_height))


# data


@every_robot
def test_every_number_has_a_source(robot):
    file = read_robot_file(robot_path(robot.name))
    groups = [file.base, file.arm, file.shapes, *(joint.limits for joint in file.joints)]
    groups += [joint.speed for joint in file.joints]
    assert all(len(group.source) > 5 and group.certainty != "from the URDF" for group in groups)


def test_pulses_are_verified_absent_or_marked():
    missing = {name for name, robot in ROBOTS.items() if robot.missing_pulses}
    assert missing == {"gp12", "mh50", "irb2600", "irb4600", "kr16", "m20ia", UR}
    for name in missing:
        assert np.isnan(ROBOTS[name].pulses_per_radian).all()
        assert ROBOTS[name].unverified_pulses == ()
    verified = [name for name in ROBOTS.keys() - missing if not ROBOTS[name].unverified_pulses]
    assert sorted(verified) == ["ar2010", "gp25"]


def test_the_pulse_limits_of_a_real_ar2010_are_met():
    robot = ROBOTS["ar2010"]
    upper, lower = robot.upper * robot.pulses_per_radian, robot.lower * robot.pulses_per_radian
    np.testing.assert_allclose(upper, [241449, 295690, 254863, 204573, 147036, 206914], atol=2)
    np.testing.assert_allclose(lower[1:3], [-200306, -136989], atol=2)


# shapes


def make_urdf():
    """Return robots/make_urdf.py as a module."""
    path = folder("robots") / "make_urdf.py"
    spec = importlib.util.spec_from_file_location("make_urdf", path)
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", sorted(set(ROBOTS) - {"mh24"}))
def test_the_urdf_is_what_the_generator_writes(name):
    module = make_urdf()
    shapes = read(folder("robots") / name / "shapes.yaml", module.Shapes)
    text = module.urdf(read_robot_file(robot_path(name)), shapes)
    assert text == ROBOTS[name].urdf.read_text(encoding="utf-8")


@every_robot
def test_every_shape_has_its_own_name(robot):
    shapes = [shape.get("name") for shape in ElementTree.parse(robot.urdf).iter("collision")]
    assert len(set(shapes)) == len(shapes) >= 7


def link_collisions(robot):
    """Return a function that tells whether links that are no neighbours collide at q."""
    model = pin.buildModelFromUrdf(str(robot.urdf))
    geometry = pin.buildGeomFromUrdf(model, str(robot.urdf), pin.GeometryType.COLLISION)
    shapes = geometry.geometryObjects
    for second in range(len(shapes)):
        for first in range(second):
            if abs(shapes[first].parentJoint - shapes[second].parentJoint) > 1:
                geometry.addCollisionPair(pin.CollisionPair(first, second))
    data, geometry_data = model.createData(), geometry.createData()
    return lambda q: pin.computeCollisions(model, data, geometry, geometry_data, q, True)


def configuration(robot, *degrees):
    """Return joint positions from the angles of the drawing in [deg]."""
    q = (np.radians(degrees) + robot.arm.offsets) * robot.arm.signs
    return np.remainder(q + np.pi, 2 * np.pi) - np.pi


@every_spherical_wrist
def test_ordinary_configurations_do_not_collide(robot):
    colliding = link_collisions(robot)
    assert not colliding(np.zeros(6))
    for shoulder in (-20, 0, 30):  # of the upper arm from upright
        for forearm in (-30, 0, 30, 60):  # above level
            for bend in (-90, -45, 0, 45, 90):
                q = configuration(robot, 10, shoulder, 90 - forearm - shoulder, 20, bend, 0)
                assert (q >= robot.lower).all() and (q <= robot.upper).all()
                assert not colliding(q), np.degrees(q)


def test_ordinary_configurations_of_the_ur10e_do_not_collide():
    colliding = link_collisions(ROBOTS[UR])
    assert not colliding(np.zeros(6))
    for elbow in range(-90, 91, 30):
        for hand in (-90, 0, 90):
            for turn in (-90, 0, 90):
                assert not colliding(np.radians([10, -90, elbow, hand, turn, 30]))
    assert colliding(np.radians([0, -90, 180, 0, 0, 0]))


@every_spherical_wrist
def test_the_wrist_bends_freely_over_its_travel(robot):
    colliding = link_collisions(robot)
    for bend in np.linspace(robot.lower[4], robot.upper[4], 61):
        assert not colliding(np.array([0, 0, 0, 0, bend, 0]))


@every_robot
def test_few_random_configurations_collide_and_some_do(robot):
    colliding = link_collisions(robot)
    rate = np.mean([colliding(q) for q in random_configurations(robot, 1000)])
    # axis 3 of m20ia turns through 458 degrees, and that of ur10e through 360: most of the excess
    # is the arm folded into itself
    assert 0.03 < rate < {"m20ia": 0.45, UR: 0.5}.get(robot.name, 0.17)
