"""The robot's data, and the URDF against an arm written down another way."""

import shutil
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

from opl.cell.robot import forward_kinematics
from opl.cell.robot_loading import known_robots, load_robot
from opl.errors import InputError
from opl.files.resources import folder

MH24 = load_robot("mh24")

# standard Denavit-Hartenberg rows of the MH24 from its BASE frame: theta and alpha in [deg], d and
# a in [m]; the joint angle adds to theta
DH_ROWS = [
    (0, 0.0, 0.150, -90),
    (-90, 0.0, 0.760, 180),
    (0, 0.0, 0.200, -90),
    (0, -0.795, 0.0, 90),
    (0, 0.0, 0.0, -90),
    (0, -0.100, 0.0, 180),
]


def dh_forward(q):
    T = np.eye(4)
    for angle, (theta, d, a, alpha) in zip(q, DH_ROWS, strict=True):
        ct, st = np.cos(angle + np.radians(theta)), np.sin(angle + np.radians(theta))
        ca, sa = np.cos(np.radians(alpha)), np.sin(np.radians(alpha))
        T = T @ [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0, sa, ca, d],
            [0, 0, 0, 1],
        ]
    return T


def random_configurations(n, seed=0):
    return np.random.default_rng(seed).uniform(MH24.lower, MH24.upper, (n, 6))


@pytest.fixture
def copied_robot(tmp_path):
    """A user's own copy of the MH24, to be spoilt."""
    shutil.copytree(folder("robots") / "mh24", tmp_path / "mine")
    return tmp_path / "mine"


def spoil(path: Path, old: str, new: str):
    text = path.read_text(encoding="utf-8")
    assert text.count(old) >= 1
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


# forward kinematics


def test_zero_configuration_has_the_flange_ahead_facing_forward_with_x_up():
    expected = [[0, 0, 1, 1.045], [0, -1, 0, 0], [1, 0, 0, 0.960], [0, 0, 0, 1]]
    np.testing.assert_allclose(forward_kinematics(MH24, np.zeros(6)), expected, atol=1e-12)


def test_forward_agrees_with_denavit_hartenberg():
    q = random_configurations(200)
    np.testing.assert_allclose(
        forward_kinematics(MH24, q), [dh_forward(row) for row in q], atol=1e-12
    )


def test_forward_keeps_the_shape_of_the_stack():
    q = random_configurations(6).reshape(2, 3, 6)
    assert forward_kinematics(MH24, q).shape == (2, 3, 4, 4)
    np.testing.assert_array_equal(
        forward_kinematics(MH24, q)[1, 2], forward_kinematics(MH24, q[1, 2])
    )
    assert forward_kinematics(MH24, q[:0]).shape == (0, 3, 4, 4)


@pytest.mark.parametrize(
    ("joint", "coordinate", "sense"),
    [("S", 1, 1), ("L", 0, 1), ("U", 2, 1), ("B", 2, 1)],
)
def test_positive_joints_move_the_flange_as_the_pendant_does(joint, coordinate, sense):
    q = np.zeros(6)
    q[MH24.joint_names.index(joint)] = 0.1
    moved = forward_kinematics(MH24, q) - forward_kinematics(MH24, np.zeros(6))
    assert sense * moved[coordinate, 3] > 0.005


@pytest.mark.parametrize("joint", ["R", "T"])
def test_positive_roll_turns_counter_clockwise_seen_from_behind(joint):
    q = np.zeros(6)
    q[MH24.joint_names.index(joint)] = 0.1
    x_tool = forward_kinematics(MH24, q)[:3, 0]
    np.testing.assert_allclose(x_tool, [0, np.sin(0.1), np.cos(0.1)], atol=1e-12)


# data


def test_numbers_arrive_in_si_units():
    assert MH24.joint_names == ("S", "L", "U", "R", "B", "T")
    np.testing.assert_allclose(np.degrees(MH24.lower), [-180, -105, -86, -200, -150, -455])
    np.testing.assert_allclose(np.degrees(MH24.upper), [180, 155, 160, 200, 150, 455])
    np.testing.assert_allclose(np.degrees(MH24.max_speed), [197, 190, 210, 410, 410, 620])
    most = [492.5, 475, 525, 1025, 1025, 1550]
    np.testing.assert_allclose(np.degrees(MH24.max_acceleration), most)
    assert MH24.acceleration_assumed
    assert MH24.pulses_per_radian[0] * np.pi == pytest.approx(180 * 1341.383)
    assert MH24.arm.c2 == 0.76
    assert MH24.arm.c1 == 0.0
    assert MH24.base_height == 0.505


def test_pulses_of_the_hand_axes_are_marked_unverified():
    assert MH24.unverified_pulses == ("R", "B", "T")


def test_unknown_accelerations_are_assumed_and_sourced_ones_are_not(copied_robot):
    text = (copied_robot / "robot.yaml").read_text(encoding="utf-8")
    start, end = text.index("acceleration:"), text.index("joints:")
    spoil(copied_robot / "robot.yaml", text[start:end], "")
    without = load_robot(str(copied_robot))
    assert without.acceleration_assumed
    np.testing.assert_allclose(without.max_acceleration, without.max_speed / 0.4)
    known = "acceleration:\n  max_deg_s2: [1, 2, 3, 4, 5, 6]\n  source: me\n  certainty: medium\n"
    spoil(copied_robot / "robot.yaml", "joints:", f"{known}joints:")
    told = load_robot(str(copied_robot))
    assert not told.acceleration_assumed
    np.testing.assert_allclose(told.max_acceleration, np.radians([1, 2, 3, 4, 5, 6]))


def test_arrays_are_read_only():
    for values in (MH24.lower, MH24.max_speed, MH24.max_acceleration, MH24.pulses_per_radian):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0.0


def test_urdf_has_the_limits_and_speeds_of_the_robot_file():
    model = pin.buildModelFromUrdf(str(MH24.urdf))
    np.testing.assert_allclose(model.lowerPositionLimit, MH24.lower, atol=1e-12)
    np.testing.assert_allclose(model.upperPositionLimit, MH24.upper, atol=1e-12)
    np.testing.assert_allclose(model.velocityLimit, MH24.max_speed, atol=1e-12)


def test_urdf_has_the_base_frame_at_its_height():
    model = pin.buildModelFromUrdf(str(MH24.urdf))
    placement = model.frames[model.getFrameId("base")].placement
    np.testing.assert_allclose(placement.homogeneous[:3, 3], [0, 0, MH24.base_height])


def test_urdf_names_every_shape_once():
    shapes = [shape.get("name") for shape in ElementTree.parse(MH24.urdf).iter("collision")]
    assert {"forearm_fork_left", "forearm_fork_right"} < set(shapes)
    assert len(set(shapes)) == len(shapes)


# shapes


def link_collisions():
    """Return a function that names the pairs of non-neighbouring links in collision at q."""
    model = pin.buildModelFromUrdf(str(MH24.urdf))
    geometry = pin.buildGeomFromUrdf(model, str(MH24.urdf), pin.GeometryType.COLLISION)
    shapes = geometry.geometryObjects
    for second in range(len(shapes)):
        for first in range(second):
            if abs(shapes[first].parentJoint - shapes[second].parentJoint) > 1:
                geometry.addCollisionPair(pin.CollisionPair(first, second))
    data, geometry_data = model.createData(), geometry.createData()

    def colliding(q):
        pin.computeCollisions(model, data, geometry, geometry_data, q, False)
        pairs = zip(geometry.collisionPairs, geometry_data.collisionResults, strict=True)
        return {
            (shapes[pair.first].name, shapes[pair.second].name)
            for pair, result in pairs
            if result.isCollision()
        }

    return colliding


def test_the_fork_is_open_for_the_whole_travel_of_the_wrist():
    colliding = link_collisions()
    for b in np.radians(np.linspace(-150, 150, 301)):
        assert not colliding(np.array([0, 0, 0, 0, b, 0]))


def test_the_flange_runs_between_the_cheeks_with_little_room():
    model = pin.buildModelFromUrdf(str(MH24.urdf))
    geometry = pin.buildGeomFromUrdf(model, str(MH24.urdf), pin.GeometryType.COLLISION)
    data = model.createData()
    q = np.array([0, 0, 0, 0, np.radians(120), 0])
    pin.updateGeometryPlacements(model, data, geometry, geometry.createData(), q)
    placed = {}
    for shape in geometry.geometryObjects:
        pose = data.oMi[shape.parentJoint] * shape.placement
        placed[shape.name] = (shape.geometry, coal.Transform3s(pose.rotation, pose.translation))
    gaps = [
        coal.distance(*placed[cheek], *placed["T_link_0"], coal.DistanceRequest(), result)
        for cheek in ("R_link_3", "R_link_4")
        for result in [coal.DistanceResult()]
    ]
    np.testing.assert_allclose(gaps, [0.007, 0.003], atol=1e-6)  # left, right


def test_a_folded_arm_collides_with_itself():
    assert link_collisions()(np.radians([0, 155, -86, 0, 0, 0]))


# finding and refusing


def test_a_robot_is_found_by_name_or_by_folder(copied_robot):
    assert "mh24" in known_robots()
    for mine in (
        load_robot(str(copied_robot)),
        load_robot("mine", relative_to=copied_robot.parent),
    ):
        assert mine.urdf == (copied_robot / "mh24.urdf").resolve()
        np.testing.assert_array_equal(mine.upper, MH24.upper)


def test_an_unknown_robot_names_the_known_ones(tmp_path):
    with pytest.raises(InputError, match=r"robot: unknown robot 'mh99'; known: .*mh24"):
        load_robot("mh99", relative_to=tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("c2_mm: 760", "c2_mm: -760", r"arm\.c2_mm: .*more than 0, got -760"),
        ("c2_mm: 760", "c2: 760", r"arm\.c2: unknown key; known here: .*c2_mm"),
        ("signs: [1, 1, -1, -1, -1, -1]", "signs: [1, 1, -1]", r"arm\.signs: .*6 values"),
        ("signs: [1, 1,", "signs: [1, 2,", r"arm\.signs\.1: .*got 2"),
        ("lower_deg: -105", "lower_deg: 170", r"joints\.1\.limits: lower_deg must be below .*155"),
        ("verified: true", "verified: perhaps", r"joints\.0\.pulses\.verified: .*got 'perhaps'"),
        ("certainty: high", "certainty: sure", r"base\.certainty: .*got 'sure'"),
        ("c2_mm: 760", "c2_mm: 760.1", r"arm: is not the arm that mh24\.urdf describes"),
        ("signs: [1, 1, -1,", "signs: [1, 1, 1,", r"arm: is not the arm that mh24\.urdf describes"),
        ("urdf: mh24.urdf", "urdf: mh25.urdf", r"urdf: no such file, got 'mh25.urdf'"),
    ],
)
def test_a_bad_robot_file_is_refused_with_file_and_key(copied_robot, old, new, message):
    spoil(copied_robot / "robot.yaml", old, new)
    with pytest.raises(InputError, match=rf"robot\.yaml: (.*\n)*{message}"):
        load_robot(str(copied_robot))


RING = "".join(
    f'<link name="{a}"/><joint name="{a}{b}" type="fixed"><parent link="{a}"/><child link="{b}"/>'
    "</joint>"
    for a, b in ("ab", "ba")
)
RING += "</robot>"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<joint name="U"', '<joint name="J3"', r"joints S L U R B T in this order, has S L J3"),
        (
            '<link name="tool0"',
            '<link name="tool1"',
            r"must have one root link, has",
        ),
        ("</robot>", "", r"is not XML: no element found: line 259"),
        ("</robot>", RING, r"link [ab] hangs on itself"),
        ("</robot>", "<a>" * 70, r"is not XML: elements are nested more than 60 deep"),
    ],
)
def test_a_bad_urdf_is_refused_with_its_file(copied_robot, old, new, message):
    spoil(copied_robot / "mh24.urdf", old, new)
    with pytest.raises(InputError, match=rf"mh24\.urdf: .*{message}"):
        load_robot(str(copied_robot))


def test_shapes_that_the_replay_would_not_see_are_refused(copied_robot):
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    spoil(copied_robot / "mh24.urdf", '<link name="tool0">', f'<link name="tool0">{ball}')
    with pytest.raises(InputError, match="link tool0 has collision shapes but hangs on a fixed"):
        load_robot(str(copied_robot))


def test_a_urdf_without_flange_frame_is_refused(copied_robot):
    text = (copied_robot / "mh24.urdf").read_text(encoding="utf-8")
    (copied_robot / "mh24.urdf").write_text(text.replace("tool0", "hand"), encoding="utf-8")
    with pytest.raises(InputError, match="must have links base and tool0, lacks tool0"):
        load_robot(str(copied_robot))
