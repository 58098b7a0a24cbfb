"""Write ``<name>.urdf`` from ``robot.yaml`` and ``shapes.yaml`` of robots in this folder.

    python robots/make_urdf.py          every robot that has a shapes.yaml
    python robots/make_urdf.py gp25     one of them

The committed URDFs are its output; a test compares. That of mh24 was written by hand.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from opl.cell.robot_file import Joint, RobotFile, read_robot_file
from opl.files.documents import Document, read

HERE = Path(__file__).parent

Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
Triple = Annotated[list[float], Field(min_length=3, max_length=3)]

HEAD = """<?xml version="1.0"?>
<!--
  {title} in primitive shapes, lengths in [m], angles in [rad].
  Written by robots/make_urdf.py from robot.yaml and shapes.yaml; do not edit.

  At the zero configuration all link frames are parallel to the base frame: x forward, y left, z up.
  Each lies on its joint's axis. Joint axes point so that positive is positive for the maker.

  Shapes: {source} (certainty {certainty}).
  Masses and inertias are placeholders, because simulators ask for them; efforts are unknown.
-->
<robot name="{name}">
"""
INERTIAL = """    <inertial>
      <mass value="{mass}"/>
      <inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
"""


class _Cylinder(Document):
    along: Literal["x", "y", "z"]
    centre: Pair  # the other two coordinates of its axis
    start: Annotated[float, Field(alias="from")]
    to: float
    radius: Annotated[float, Field(gt=0)]


class _Shape(Document):
    name: str
    box_mm: Annotated[list[Triple], Field(min_length=2, max_length=2)] | None = None  # corners
    cylinder_mm: _Cylinder | None = None


class Shapes(Document):
    """The keys of a ``shapes.yaml``; links in order, the base first."""

    links: dict[str, list[_Shape]]


def urdf(robot: RobotFile, shapes: Shapes) -> str:
    """Return the text of the URDF."""
    text = [HEAD.format(name=robot.name, title=robot.title, **_source(robot))]
    text += [_link("base_link", shapes.links["base"]), _link("base", None)]
    text.append(_fixed("base_link", "base", f'xyz="0 0 {_m(robot.base.height_mm)}"'))
    parent = "base_link"
    for number, (joint, origin, axis) in enumerate(_joints(robot), start=1):
        child = f"{joint.name}_link"
        text.append(_revolute(joint, parent, child, origin, axis))
        text.append(_link(child, shapes.links[f"joint_{number}"]))
        parent = child
    origin = f'rpy="{_flange_rpy(robot)}"'
    text += [_link("tool0", None), _fixed(parent, "tool0", origin), "</robot>\n"]
    return "".join(text)


def _joints(robot: RobotFile) -> list[tuple[Joint, np.ndarray, np.ndarray]]:
    """Return each joint with its origin in the parent's frame in [mm] and its axis, at zero."""
    arm, signs = robot.arm, robot.arm.signs
    upper = math.radians(-arm.offsets_deg[1])  # tilt of the upper arm from upright
    fore = upper - math.radians(arm.offsets_deg[2])
    x, y, z = np.eye(3)
    up, along, ahead = _tilted(upper, z), _tilted(fore, z), _tilted(fore, x)
    origins = [
        np.zeros(3),
        arm.a1_mm * x + (robot.base.height_mm + arm.c1_mm) * z,
        arm.c2_mm * up,
    ]
    if arm.parallel_axes:
        assert np.allclose([arm.offsets_deg[k] for k in (0, 4, 5)], 0.0)
        down = _tilted(fore - math.radians(arm.offsets_deg[3]), z)
        axes = [z, y, y, y, down, y]
        origins += [arm.c3_mm * along + arm.b_mm * y, arm.c4_mm * down, arm.c5_mm * y]
    else:
        assert np.allclose(np.remainder([arm.offsets_deg[k] for k in (0, 3, 4)], 360.0), 0.0)
        axes = [z, y, y, along, y, along]
        origins += [arm.a2_mm * ahead + arm.b_mm * y, arm.c3_mm * along, arm.c4_mm * along]
    turned = [sign * axis for sign, axis in zip(signs, axes, strict=True)]
    return list(zip(robot.joints, origins, turned, strict=True))


def _flange_rpy(robot: RobotFile) -> str:
    """Return how the flange is turned at zero: z out of its face, x as the maker has it."""
    if robot.arm.parallel_axes:
        return "1.5707963267948966 0 3.141592653589793"  # z left, x back
    if abs(robot.arm.offsets_deg[5]) == 180.0:
        return "3.141592653589793 -1.5707963267948966 0"  # z ahead, x up
    return "0 1.5707963267948966 0"  # z ahead, x down


def _tilted(angle: float, v: np.ndarray) -> np.ndarray:
    """Return v turned about y, quarter turns exact."""
    c, s = (round(f(angle), 15) for f in (math.cos, math.sin))
    return np.array([c * v[0] + s * v[2], v[1], c * v[2] - s * v[0]])


def _link(name: str, shapes: list[_Shape] | None) -> str:
    light = shapes is None
    inertial = INERTIAL.format(mass="0.001" if light else "10", moment="1e-6" if light else "0.1")
    collisions = "".join(_collision(shape) for shape in shapes or [])
    return f'\n  <link name="{name}">\n{inertial}{collisions}  </link>\n'


def _collision(shape: _Shape) -> str:
    rpy = ""
    if shape.box_mm is not None:
        low, high = np.array(shape.box_mm)
        middle = (low + high) / 2.0
        solid = f'<box size="{_row(high - low)}"/>'
    else:
        cylinder = shape.cylinder_mm
        assert cylinder is not None
        axis = "xyz".index(cylinder.along)
        middle = np.insert(np.array(cylinder.centre), axis, (cylinder.start + cylinder.to) / 2.0)
        length = _m(cylinder.to - cylinder.start)
        solid = f'<cylinder radius="{_m(cylinder.radius)}" length="{length}"/>'
        rpy = ("0 1.5707963267948966 0", "1.5707963267948966 0 0", "")[axis]
        rpy = f' rpy="{rpy}"' if rpy else ""
    return f"""    <collision name="{shape.name}">
      <origin xyz="{_row(middle)}"{rpy}/>
      <geometry>{solid}</geometry>
    </collision>
"""


def _fixed(parent: str, child: str, origin: str) -> str:
    return f"""  <joint name="{parent}-{child}" type="fixed">
    <parent link="{parent}"/>
    <child link="{child}"/>
    <origin {origin}/>
  </joint>
"""


def _revolute(joint: Joint, parent: str, child: str, origin: np.ndarray, axis: np.ndarray) -> str:
    lower, upper = joint.limits.lower_deg, joint.limits.upper_deg
    speed = joint.speed.max_deg_s
    return f"""
  <joint name="{joint.name}" type="revolute">
    <parent link="{parent}"/>
    <child link="{child}"/>
    <origin xyz="{_row(origin)}"/>
    <axis xyz="{" ".join(f"{value + 0.0:g}" for value in axis)}"/>
    <!-- {lower:g} to {upper:g} deg, {speed:g} deg/s -->
    <limit lower="{math.radians(lower)!r}" upper="{math.radians(upper)!r}"
           velocity="{math.radians(speed)!r}" effort="0"/>
  </joint>"""


def _row(values: np.ndarray) -> str:
    return " ".join(_m(value) for value in values)


def _m(value: float) -> str:
    """Return millimetres in [m]."""
    return f"{round(float(value) / 1e3, 7) + 0.0:g}"


def _source(robot: RobotFile) -> dict[str, str]:
    assert robot.shapes is not None
    return {"source": robot.shapes.source, "certainty": robot.shapes.certainty}


def main(names: list[str]) -> None:
    """Write the URDFs of the robots named, or of all."""
    for name in names or sorted(path.parent.name for path in HERE.glob("*/shapes.yaml")):
        home = HERE / name
        robot = read_robot_file(home / "robot.yaml")
        text = urdf(robot, read(home / "shapes.yaml", Shapes))
        (home / robot.urdf).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
