"""Robots of the user's own: the closed form read off a URDF, and what is refused."""

import sys
from dataclasses import asdict, replace

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from opl.cell.collision import CollisionScene
from opl.cell.drawing import drawn_arm
from opl.cell.robot import controller_poses, forward_kinematics
from opl.cell.robot_file import read_robot_file
from opl.cell.robot_loading import known_robots, load_robot
from opl.cell.urdf_arm import arm_of_urdf
from opl.cell.urdf_import import import_urdf
from opl.errors import InputError
from opl.job.load import load_job
from opl.verification.world import World
from tests.support.jobs import V_JOB, opl

MH24 = load_robot("mh24")


def changed(tmp_path, *changes, name="mh24"):
    """Return a copy of a URDF with texts replaced."""
    text = load_robot(name).urdf.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "changed.urdf"
    path.write_text(text, encoding="utf-8")
    return path


def wrist_origin(dx, dy):
    return ('<origin xyz="0.795 0 0"/>', f'<origin xyz="{0.795 + dx} {dy} 0"/>')


@pytest.mark.parametrize("name", known_robots())
def test_our_own_robots_are_recognised(name, tmp_path):
    robot = load_robot(name)
    found = arm_of_urdf(robot.urdf)
    assert type(found.arm) is type(robot.arm)
    known = asdict(replace(robot.arm, c1=robot.base_height))
    for key, value in asdict(found.arm).items():
        np.testing.assert_allclose(value, known[key], atol=1e-9)
    made = import_urdf(robot.urdf, "mine", tmp_path / "mine")
    assert made.closure < 1e-11
    mine = load_robot("mine", tmp_path)
    q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (20, 6))
    np.testing.assert_allclose(forward_kinematics(mine, q), forward_kinematics(robot, q), atol=1e-9)
    np.testing.assert_allclose(mine.upper, robot.upper, atol=1e-9)
    np.testing.assert_allclose(mine.max_speed, robot.max_speed, atol=1e-9)
    assert mine.missing_pulses == robot.joint_names and mine.payload is None
    assert read_robot_file(made.files[0]).arm.certainty == "from the URDF"


def test_an_arm_with_a_lateral_offset_and_odd_zeros_is_recognised(tmp_path):
    tilted = ('<origin xyz="0 0 0.76"/>', '<origin xyz="0 0 0.76" rpy="0 0.3 0"/>')
    path = changed(tmp_path, tilted, ('<origin xyz="0 0 0.2"/>', '<origin xyz="0 0.04 0.2"/>'))
    made = import_urdf(path, "odd", tmp_path / "odd")
    assert made.robot.arm.b == pytest.approx(0.04, abs=1e-9)
    assert made.robot.arm.offsets[2] == pytest.approx(-np.pi / 2 - 0.3, abs=1e-9)
    assert made.closure < 1e-9


def ur_as_its_maker_has_it(tmp_path):
    """Return the UR10e below a link world, its foot on a fixed joint, its base turned round."""
    extra = """<link name="world"/><joint name="stand" type="fixed"><parent link="world"/>
      <child link="base_link"/></joint>
      <link name="plate"><collision name="plate"><geometry><box size="0.3 0.3 0.01"/></geometry>
      </collision></link><joint name="plate" type="fixed"><parent link="base_link"/>
      <child link="plate"/><origin rpy="0 0 3.14159265"/></joint>"""
    turned = '<origin xyz="0 0 0" rpy="0 0 3.14159265"/>'
    return changed(
        tmp_path,
        ('<robot name="ur10e">', f'<robot name="ur10e">{extra}'),
        ('<origin xyz="0 0 0.1807"/>\n  </joint>\n\n  <joint', f"{turned}</joint><joint"),
        name="ur10e",
    )


def test_an_arm_with_parallel_axes_is_recognised_as_its_maker_describes_it(tmp_path):
    made = import_urdf(ur_as_its_maker_has_it(tmp_path), "mine", tmp_path / "mine")
    ours = load_robot("ur10e")
    assert made.closure < 1e-11 and made.cautions == ()
    q = np.random.default_rng(0).uniform(ours.lower, ours.upper, (20, 6))
    np.testing.assert_allclose(
        forward_kinematics(made.robot, q), forward_kinematics(ours, q), atol=1e-9
    )
    # the pendant counts from the mounting face, turned by half a turn
    np.testing.assert_allclose(made.robot.T_controller_base, ours.T_controller_base, atol=1e-8)
    assert made.robot.controller_base_turn == pytest.approx(np.pi)
    ended = opl("robots", "import-urdf", ours.urdf, "--name", "m", "--out", tmp_path / "command")
    assert "arm with parallel axes, reach 1316 mm" in ended.out


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('xyz="0 0.11655 0"', 'xyz="0.003 0.11655 0"'), None),
        (('<axis xyz="0 0 -1"/>', '<axis xyz="0.6 0 -0.8"/>'), "axis 5 must meet it, it passes by"),
        (('<axis xyz="0 0 -1"/>', '<axis xyz="0 0.6 -0.8"/>'), "axes 4 and 5 must be at right"),
        (
            ('xyz="0 0.11655 0"', 'xyz="0 0.11655 0" rpy="0.2 0 0"'),
            "axes 5 and 6 must be at right angles",
        ),
        (('xyz="0 0 -0.11985"', 'xyz="0.02 0 -0.11985"'), "it passes by 20 mm"),
    ],
)
def test_another_build_with_parallel_axes_is_refused(change, message, tmp_path):
    path = changed(tmp_path, change, name="ur10e")
    with pytest.raises(InputError, match=message or "axes 5 and 6 must meet, they pass by 3 mm"):
        import_urdf(path, "mine", tmp_path / "mine")


def test_rounded_right_angles_are_no_obstacle(tmp_path):
    rounded = ('rpy="3.141592653589793 -1.5707963267948966 0"', 'rpy="3.14159 -1.570796 0"')
    made = import_urdf(changed(tmp_path, rounded), "mine", tmp_path / "mine")
    assert 1e-9 < made.closure < 2e-5


def test_the_base_frame_goes_where_it_is_asked_for(tmp_path):
    floor = import_urdf(MH24.urdf, "mine", tmp_path / "floor", base_at_floor=True).robot
    assert floor.base_height == 0.0 and floor.arm.c1 == pytest.approx(0.505)
    assert forward_kinematics(floor, np.zeros(6))[2, 3] == pytest.approx(1.465)
    # the frame base of the URDF is where the controller counts from
    assert floor.controller_base_height == pytest.approx(0.505)
    assert controller_poses(floor, np.zeros(6))[2, 3] == pytest.approx(0.960)


def test_a_urdf_without_base_gets_one(tmp_path):
    path = changed(tmp_path, ('link="base"', 'link="other"'), ('name="base"', 'name="other"'))
    made = import_urdf(path, "mine", tmp_path / "mine").robot
    assert made.base_height == made.controller_base_height == pytest.approx(0.505)
    np.testing.assert_allclose(
        forward_kinematics(made, np.zeros(6)), forward_kinematics(MH24, np.zeros(6)), atol=1e-12
    )


def test_meshes_come_along_and_are_found(tmp_path):
    package = tmp_path / "my_arm"
    (package / "urdf").mkdir(parents=True)
    trimesh.creation.box((0.3, 0.3, 0.2)).export(package / "foot.stl")
    mesh = '<mesh filename="package://my_arm/foot.stl"/>'
    path = changed(package / "urdf", ('<box size="0.536 0.4 0.208"/>', mesh))
    made = import_urdf(path, "mine", tmp_path / "mine")
    assert tmp_path / "mine" / "meshes" / "foot.stl" in made.files
    assert 'filename="meshes/foot.stl"' in made.robot.urdf.read_text(encoding="utf-8")
    (package / "foot.stl").unlink()
    with pytest.raises(
        InputError, match=r"changed\.urdf: mesh package://my_arm/foot\.stl: no such"
    ):
        import_urdf(path, "mine", tmp_path / "other")


def test_planner_and_replay_take_a_mesh_of_a_link_alike(tmp_path):
    # the fork of the forearm as one concave mesh
    bars = [[[0.3, -0.085, -0.07], [0.66, 0.096, 0.12]],
            [[0.6, -0.085, -0.06], [0.858, -0.054, 0.1]],
            [[0.6, 0.058, -0.06], [0.858, 0.096, 0.1]]]  # fmt: skip
    trimesh.util.concatenate([trimesh.creation.box(bounds=bar) for bar in bars]).export(
        tmp_path / "fork.stl"
    )
    before, rest = MH24.urdf.read_text(encoding="utf-8").split('<link name="R_link">')
    own, after = rest.split("</link>", 1)
    inertial = own.split("<collision")[0]
    mesh = '<collision><geometry><mesh filename="fork.stl"/></geometry></collision></link>'
    path = tmp_path / "forked.urdf"
    path.write_text(f'{before}<link name="R_link">{inertial}{mesh}{after}', encoding="utf-8")
    made = import_urdf(path, "mine", tmp_path / "mine")
    assert made.cautions[0].startswith("link R_link: each collision mesh counts as its convex hull")
    drawn = np.concatenate(
        [points for joint, points in drawn_arm(made.robot).outlines if joint == 4]
    )
    assert np.ptp(drawn[:, 1]) == pytest.approx(0.181)
    cell = replace(load_job(V_JOB).cell, robot=made.robot)
    scene = CollisionScene(cell)
    planner = scene.for_second_opinion()
    q = np.random.default_rng(0).uniform(MH24.lower, MH24.upper, (150, 6))
    seen = set()
    with World(cell) as world:
        pairs = [pair for pair in world.pairs() if "R_link" in (pair.first.name, pair.second.name)]
        for row in q:
            world.move_to(row)
            hits = {hit for hit in scene.colliding_pairs(row) if "R_link" in hit}
            kept = planner.colliding_pairs(row)
            for pair in pairs:
                name = (pair.first.name, pair.second.name)
                apart = world.distance(pair.first, pair.second, 0.1) - pair.clearance
                hit = name in hits or name[::-1] in hits
                assert hit == (apart < 0.0) or abs(apart) < 3e-4, (name, apart)
                # what the planner calls free the replay calls free
                assert apart > pair.rounding or name in kept or name[::-1] in kept
                seen.add((name, hit))
    assert (("R_link", "T_link"), True) in seen and len({name for name, hit in seen if hit}) > 3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (wrist_origin(0, 0), None),
        (("xyz=\"0.1 0 0\"", "xyz=\"0.1 0 0.03\""), r"do not meet in one point.* by \d+ mm"),
        (
            ('<axis xyz="-1 0 0"/>', '<axis xyz="0 1 0"/>'),
            r"axes 4 and 5 must be at right angles",
        ),
        (('<axis xyz="0 0 1"/>', '<axis xyz="0 1 0"/>'), r"axis 1 must be the z axis"),
        (('<origin xyz="0.15 0 0.505"/>', '<origin xyz="0.15 0 0.505" rpy="0.1 0 0"/>'),
         r"axes 1 and 2 must be at right angles"),
        (('rpy="3.141592653589793 -1.5707963267948966 0"', ""), r"tool0 must lie on axis 6"),
        (('name="T" type="revolute"', 'name="T" type="continuous"'), r"has S L U R B T, some of"),
        (('name="T" type="revolute"', 'name="T" type="fixed"'), r"six revolute .* has S L U R B"),
        (('name="T" type="revolute"', 'name="T" type="prismatic"'), r"all six must be revolute"),
        (("tool0", "hand"), r"lacks the link tool0"),
        (("</robot>", ""), r"not XML"),
        (('<robot name="mh24">', '<robot name="mh24"><link name="a"/>'), r"one root link"),
        (('<origin xyz="0 0 0.505"/>', '<origin xyz="0 0.1 0.505"/>'), r"link base must be fixed"),
    ],
)  # fmt: skip
def test_what_has_no_closed_form_is_refused_with_the_reason(change, message, tmp_path):
    path = changed(tmp_path, change)
    if message is None:
        import_urdf(path, "mine", tmp_path / "mine")
        return
    with pytest.raises(InputError, match=message):
        import_urdf(path, "mine", tmp_path / "mine")
    assert not (tmp_path / "mine").exists()


def test_shapes_on_fixed_joints_come_to_the_link_that_carries_them(tmp_path):
    # as in the description of UR: the foot hangs on a fixed joint, turned, below a root link world
    hung = """<link name="world"/><joint name="stand" type="fixed"><parent link="world"/>
      <child link="base_link"/><origin xyz="0 0 0.02"/></joint>
      <joint name="plate" type="fixed"><parent link="base_link"/><child link="mount"/>
      <origin xyz="0 0 0.1" rpy="0 0 1.5707963267948966"/></joint>
      <link name="mount"><collision name="block"><origin xyz="0.3 0 0"/><geometry>
      <box size="0.1 0.2 0.3"/></geometry></collision></link>"""
    path = changed(tmp_path, ('<robot name="mh24">', f'<robot name="mh24">{hung}'))
    made = import_urdf(path, "mine", tmp_path / "mine").robot
    assert made.base_height == pytest.approx(0.525)
    assert made.controller_base_height == pytest.approx(0.525)
    model = pin.buildModelFromUrdf(str(made.urdf))
    shapes = pin.buildGeomFromUrdf(model, str(made.urdf), pin.GeometryType.COLLISION)
    (block,) = (
        shape
        for shape in shapes.geometryObjects
        if np.allclose(getattr(shape.geometry, "halfSide", 0.0), [0.05, 0.1, 0.15])
    )
    assert model.frames[block.parentFrame].name == "world"
    np.testing.assert_allclose(block.placement.translation, [0, 0.3, 0.12], atol=1e-12)
    np.testing.assert_allclose(block.placement.rotation[:, 0], [0, 1, 0], atol=1e-12)
    q = np.ones((1, 6))
    np.testing.assert_allclose(forward_kinematics(made, q), forward_kinematics(MH24, q), atol=1e-9)


def test_what_hangs_on_a_frame_base_stays_where_it_is(tmp_path):
    on_foot = '<parent link="base_link"/>\n    <child link="S_link"/>\n    <origin xyz="0 0 0"/>'
    on_base = '<parent link="base"/><child link="S_link"/><origin xyz="0 0 -0.505"/>'
    path = changed(tmp_path, (on_foot, on_base))
    made = import_urdf(path, "mine", tmp_path / "mine", base_at_floor=True).robot
    expected = forward_kinematics(MH24, np.ones(6))
    expected[2, 3] += 0.505
    np.testing.assert_allclose(forward_kinematics(made, np.ones(6)), expected, atol=1e-9)


def test_placeholders_are_told(tmp_path):
    path = changed(tmp_path)
    text = path.read_text(encoding="utf-8")
    parts = text.split("<limit ")
    same = ['lower="-3.2" upper="3.2" velocity="0" effort="0"/>' + part.split("/>", 1)[1]
            for part in parts[1:]]  # fmt: skip
    path.write_text("<limit ".join([parts[0], *same]), encoding="utf-8")
    made = import_urdf(path, "mine", tmp_path / "mine")
    told = "\n".join(made.cautions)
    assert "L: limits -183 to 183 deg look like a placeholder" in told
    assert "all joints have the same limits" in told
    assert "S: the URDF gives no speed, 10 deg/s stands there" in told
    np.testing.assert_allclose(made.robot.max_speed, np.radians(10.0))
    speed = read_robot_file(made.files[0]).joints[0].speed
    assert speed.certainty == "low"


def test_a_link_without_shapes_is_told(tmp_path):
    shape = MH24.urdf.read_text(encoding="utf-8").split('<collision name="wrist">')[1]
    path = changed(tmp_path, (f'<collision name="wrist">{shape.split("</collision>")[0]}'
                              "</collision>", ""))  # fmt: skip
    made = import_urdf(path, "mine", tmp_path / "mine")
    assert made.cautions == ("link B_link has no collision shape: nothing of it is checked",)


@pytest.mark.parametrize(
    ("name", "file", "message"),
    [
        ("Mine!", "x.urdf", "name: must be small letters"),
        ("mine", "x.urdf", r"x\.urdf: no such file"),
    ],
)
def test_a_bad_name_or_file_is_refused(name, file, message, tmp_path):
    with pytest.raises(InputError, match=message):
        import_urdf(tmp_path / file, name, tmp_path / "mine")


# xacro


HEAD = '<robot name="mh24" xmlns:xacro="http://www.ros.org/wiki/xacro">'


def test_a_xacro_is_expanded_and_its_meshes_are_found(tmp_path):
    trimesh.creation.box((0.3, 0.3, 0.2)).export(tmp_path / "foot.stl")
    path = changed(
        tmp_path,
        ('<robot name="mh24">', f'{HEAD}<xacro:property name="arm" value="${{0.5 + 0.26}}"/>'),
        ('xyz="0 0 0.76"', 'xyz="0 0 ${arm}"'),
        ('<box size="0.536 0.4 0.208"/>', '<mesh filename="foot.stl"/>'),
    )
    source = path.rename(tmp_path / "arm.urdf.xacro")
    out = tmp_path / "mine"
    ended = opl("robots", "import-urdf", source, "--name", "mine", "--out", out)
    assert ended.status == 0, ended.err
    mine = load_robot(str(out))
    np.testing.assert_allclose(
        forward_kinematics(mine, np.ones(6)), forward_kinematics(MH24, np.ones(6)), atol=1e-9
    )
    assert (out / "meshes" / "foot.stl").is_file()
    assert "source: arm.urdf.xacro" in (out / "robot.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('<link name="${w}"/>', r"arm\.xacro: xacro refuses it: line 3: name 'w' is not defined"),
        ("<xacro:foo/>", r"arm\.xacro: xacro refuses it: line 3: unknown macro name: xacro:foo"),
        ('<link name="$(arg n)"/>', r"line 3: Undefined .* n: give it a default, or expand it by"),
        (
            '<xacro:include filename="$(find ur)/ur.xacro"/>',
            r"line 3: \$\(find \.\.\.\) needs a ROS package, .*: xacro arm\.xacro ARGUMENT:=",
        ),
        ('<xacro:include filename="none.xacro"/>', r"arm\.xacro: xacro refuses it: line 3: .*none"),
        ('<xacro:include filename="bad.xacro"/>', r"bad\.xacro: is not XML: .* line 2"),
        ('<link name="a"/>', r"arm\.xacro: must have six revolute joints"),
        ('<link name="a"/><link name="b"/>', r"arm\.xacro: must have one root link, has a, b"),
    ],
)
def test_a_bad_xacro_is_refused_with_file_and_line(line, message, tmp_path):
    (tmp_path / "bad.xacro").write_text("<robot>\n<a></robot>")
    path = tmp_path / "arm.xacro"
    path.write_text(f'<?xml version="1.0"?>\n{HEAD}\n{line}</robot>\n')
    with pytest.raises(InputError, match=message):
        import_urdf(path, "mine", tmp_path / "mine")


def test_a_xacro_without_the_extra_is_refused_with_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    path = tmp_path / "arm.xacro"
    path.write_text(f"{HEAD}</robot>")
    ended = opl("robots", "import-urdf", path, "--name", "mine", "--out", tmp_path / "mine")
    assert ended.status == 2 and "pip install 'opl[xacro]'" in ended.err


# the command line


def test_the_command_writes_a_robot_and_overwrites_none(tmp_path):
    out = tmp_path / "mine"
    arguments = ("robots", "import-urdf", MH24.urdf, "--name", "mine", "--out", out)
    ended = opl(*arguments, "--maker", "Yaskawa")
    assert ended.status == 0, ended.err
    assert "reach 1730 mm" in ended.out and "FK(IK) closes within" in ended.out
    assert load_robot(str(out)).maker == "Yaskawa"
    shown = opl("robots", "show", out)
    assert "from the URDF" in shown.out and "not known" in shown.out
    again = opl(*arguments)
    assert again.status == 2 and "robot.yaml: exists already" in again.err
