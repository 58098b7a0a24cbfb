"""The same field of nodes for opl and for Tesseract's Descartes: a cell and postures as files.

Descartes is given the configurations of every node that exists and does not cut into the wheel;
which of them collide, the edges between neighbouring cutter points and the path of least joint
travel are its own work, as they are opl's here. It runs in a virtual environment of its own
(`python -m benchmarks --descartes PYTHON`), on one thread, as its planner does;
opl looks for collisions on all cores.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree as xml

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.measuring import SECOND, Row, Timing
from opl.cell.collision import CollisionScene
from opl.geometry.frames import Array
from opl.geometry.shapes import Box, Cylinder
from opl.planning.nodes import NodeMatrix
from opl.planning.problem import GrindingProblem
from opl.search.smooth import TrackCost, smoothest

# Tesseract wants a solver of its own for the arm, though no pose is solved here
PLUGINS = """
kinematic_plugins:
  search_libraries: [tesseract_kinematics_kdl_factories]
  inv_kin_plugins:
    arm:
      default: KDLInvKinChainLMA
      plugins:
        KDLInvKinChainLMA:
          class: KDLInvKinChainLMAFactory
          config: {base_link: base_link, tip_link: tool0}
"""
SIDE = Path(__file__).with_name("descartes_side.py")


def descartes_row(problem: GrindingProblem, python: Path, folder: Path, most: float) -> Row | None:
    """Measure both on a matrix of a problem once; None where Descartes fails or takes too long."""
    matrix = max(problem.field.matrices, key=lambda one: int(problem.free_nodes(one).sum()))
    free = problem.free_nodes(matrix)
    start, cpu = time.perf_counter(), time.process_time()
    clear, ours = _least_travel(problem, matrix, free)
    spent, computed = time.perf_counter() - start, time.process_time() - cpu
    write_cell(problem, folder)
    np.savez(folder / "nodes.npz", q=np.nan_to_num(matrix.q), free=free)
    command = [str(python), str(SIDE), str(folder)]
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=most, check=True)
    except subprocess.TimeoutExpired:
        print(f"Descartes: over {most:g} s", file=sys.stderr)
        return None
    except subprocess.CalledProcessError as error:
        print(f"Descartes: {error.stderr}", file=sys.stderr)
        return None
    theirs = json.loads(run.stdout.splitlines()[-1])
    name = (
        f"equal field, {len(free)} points x {len(problem.field.contact_positions)} with collisions,"
        f" {int(free.sum())} nodes, {int(clear.sum())} of them free: travel {_travel(ours):.3f} rad"
    )
    reference = (
        f"Descartes, nodes {theirs['nodes']:.1f} s, {theirs['free']} of them free, "
        f"travel {theirs['travel']:.3f} rad"
    )
    took = theirs["seconds"]
    return Row(
        name, SECOND, Timing(spent, spent, spent, computed), reference,
        Timing(took, took, took, took),
    )  # fmt: skip


def _least_travel(
    problem: GrindingProblem, matrix: NodeMatrix, free: np.ndarray
) -> tuple[np.ndarray, Array]:
    """Return which nodes touch nothing, and the free track whose joints turn least, (N, 6)."""
    clear = free.copy()
    ladder = problem.ladder(matrix, clear)
    clear[free] = ~problem.scene.collision.collides(ladder.q[free])
    cost = TrackCost(
        joint_weights=np.ones(6), contact_weight=0.0, time_weight=0.0,
        edge_seconds=np.zeros(len(free) - 1), max_speed=np.ones(6), contact_speed=1.0,
        node_cost=np.zeros(free.shape),
    )  # fmt: skip
    track = smoothest(ladder, np.empty(0, np.int64), clear, cost)
    if track is None:
        raise ValueError("no track of this field is free")
    return clear, matrix.along(track.rows)


def _travel(q: Array) -> float:
    """Return how far all joints turn along configurations in [rad]."""
    return float(np.abs(np.diff(q, axis=0)).sum())


def write_cell(problem: GrindingProblem, folder: Path) -> None:
    """Write robot, held bodies and surroundings as URDF, and the pairs that count as SRDF.

    The pairs are those of the planner's scene, so part against wheel is left out for both.
    """
    cell, scene = problem.cell, problem.scene.collision
    robot = xml.parse(cell.robot.urdf).getroot()
    robot.set("tesseract:make_convex", "false")
    robot.set("xmlns:tesseract", "tesseract")
    held = [("part", cell.part, cell.T_flange_workpiece)]
    held += [(body.name, body.shape, body.T_parent_body) for body in cell.fixture]
    around = [(body.name, body.shape, body.T_parent_body)
              for body in (cell.wheel_body(), *cell.obstacles)]  # fmt: skip
    for parent, bodies in (("tool0", held), ("base", around)):
        for name, shape, T in bodies:
            _add(robot, folder, parent, name, shape, T)
    (folder / "cell.urdf").write_bytes(xml.tostring(robot))
    (folder / "plugins.yaml").write_text(PLUGINS, encoding="utf-8")
    (folder / "cell.srdf").write_text(_pairs(robot, scene, folder), encoding="utf-8")
    joints = json.dumps(cell.robot.joint_names)
    (folder / "joints.json").write_text(joints, encoding="utf-8")
    margins = [
        (*map(_plain, pair), float(margin))
        for pair, margin in zip(scene._pairs, scene._margins, strict=True)
    ]
    (folder / "margins.json").write_text(json.dumps(margins), encoding="utf-8")


def _add(robot: xml.Element, folder: Path, parent: str, name: str, shape: object, T: Array) -> None:
    link = xml.SubElement(robot, "link", name=_plain(name))
    geometry = xml.SubElement(xml.SubElement(link, "collision"), "geometry")
    if isinstance(shape, Box):
        xml.SubElement(geometry, "box", size=" ".join(map(str, shape.size)))
    elif isinstance(shape, Cylinder):
        xml.SubElement(geometry, "cylinder", radius=str(shape.radius), length=str(shape.length))
    else:
        path = folder / f"{_plain(name)}.stl"
        path.write_bytes(_stl(shape.triangles))
        xml.SubElement(geometry, "mesh", filename=f"file://{path}")
    joint = xml.SubElement(robot, "joint", name=f"{_plain(name)}_at", type="fixed")
    xml.SubElement(joint, "parent", link=parent)
    xml.SubElement(joint, "child", link=_plain(name))
    turns = Rotation.from_matrix(T[:3, :3]).as_euler("xyz")
    xml.SubElement(joint, "origin", xyz=" ".join(map(str, T[:3, 3])), rpy=" ".join(map(str, turns)))


def _plain(name: str) -> str:
    return name.replace(" ", "_")


def _stl(triangles: Array) -> bytes:
    one = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    rows = np.zeros(len(triangles), one)
    rows["corners"] = triangles
    return bytes(80) + np.uint32(len(triangles)).tobytes() + rows.tobytes()


def _pairs(robot: xml.Element, scene: CollisionScene, folder: Path) -> str:
    """Return the SRDF: the arm, what plans it, and every pair that is not looked at."""
    looked = {frozenset(map(_plain, pair)) for pair in scene._pairs}
    names = [link.get("name", "") for link in robot.iter("link") if link.find("collision")]
    left_out = "".join(
        f'<disable_collisions link1="{first}" link2="{second}" reason="by opl"/>'
        for number, second in enumerate(names)
        for first in names[:number]
        if frozenset((first, second)) not in looked
    )
    return (
        f'<robot name="{robot.get("name")}">'
        '<group name="arm"><chain base_link="base_link" tip_link="tool0"/></group>'
        f'<kinematics_plugin_config filename="file://{folder / "plugins.yaml"}"/>'
        '<contact_managers_plugin_config filename="package://tesseract/support/urdf/'
        f'contact_manager_plugins.yaml"/>{left_out}</robot>'
    )
