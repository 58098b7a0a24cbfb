"""Cells with nothing in them but what a test puts there."""

from dataclasses import replace

import numpy as np
import trimesh

from opl.cell.robot_loading import load_robot
from opl.cell.workcell import WorkCell
from opl.geometry.frames import pose
from opl.geometry.mesh import TriangleMesh
from opl.geometry.shapes import Body, Box
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import ContactWheel
from opl.motion.motion import Motion, MoveKind, TimedMotion

NO_POINTS = CutterPoints(np.empty((0, 4, 4)), np.empty(0, dtype=int), np.empty(0))


def with_obstacle(cell, p_base, size=(0.03, 0.03, 0.03), name="post"):
    """Return a cell with one box more."""
    body = Body(name, Box(tuple(size)), pose(np.eye(3), np.asarray(p_base, dtype=float)))
    return replace(cell, obstacles=(*cell.obstacles, body))


def block(size):
    """Return a closed box as a mesh, centred at the origin."""
    box = trimesh.creation.box(size)
    return TriangleMesh(np.asarray(box.vertices), np.asarray(box.faces))


def cut_finer(mesh, times):
    """Return a mesh with each triangle cut into four, so many times."""
    finer = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    for _ in range(times):
        finer = finer.subdivide()
    return TriangleMesh(np.asarray(finer.vertices), np.asarray(finer.faces))


def c_shape(width=0.2, wall=0.03, depth=0.1):
    """Return a C extruded along z, open towards +x: a square frame with one side missing."""
    a, b = width / 2.0, width / 2.0 - wall
    profile = [(a, -a), (a, -b), (-b, -b), (-b, b), (a, b), (a, a), (-a, a), (-a, -a)]
    low = np.array([(x, y, -depth / 2.0) for x, y in profile])
    vertices = np.concatenate([low, low + np.array([0.0, 0.0, depth])])
    quads = [(0, 1, 2, 7), (7, 2, 3, 6), (6, 3, 4, 5)]  # of the profile, clockwise from above
    faces = []
    for p, q, r, s in quads:
        faces += [(p, q, r), (p, r, s), (r + 8, q + 8, p + 8), (s + 8, r + 8, p + 8)]
    for k in range(8):
        following = (k + 1) % 8
        faces += [(k, k + 8, following), (following, k + 8, following + 8)]
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    return TriangleMesh(vertices, np.array(faces) if mesh.volume > 0 else np.array(faces)[:, ::-1])


def convex_hull(mesh):
    hull = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).convex_hull
    return TriangleMesh(np.asarray(hull.vertices), np.asarray(hull.faces))


def bare_cell(part, obstacles=(), clearance=0.005):
    """Return an MH24 holding a part 0.1 m off its flange, its wheel out of everything's way."""
    far_away = pose(np.eye(3), np.array([0.0, 0.0, 10.0]))
    return WorkCell(
        robot=load_robot("mh24"),
        wheel=ContactWheel(0.05, 0.15, np.radians(45.0), far_away),
        obstacles=tuple(obstacles),
        part=part,
        fixture=(),
        T_flange_workpiece=pose(np.eye(3), np.array([0.0, 0.0, 0.1])),
        max_belt_penetration=0.0005,
        required_clearance=clearance,
    )


def free_move(q, seconds=10.0):
    """Return a timed motion that visits configurations and touches nothing."""
    duration = np.full(len(q), seconds)
    duration[0] = 0.0
    motion = Motion.off_wheel(np.asarray(q, dtype=float), MoveKind.HOME, -1)
    return TimedMotion(motion, duration)


def random_configurations(robot, n, seed=0):
    return np.random.default_rng(seed).uniform(robot.lower, robot.upper, (n, 6))


class Ghosts:
    """A scene in which all near some configurations collide; stands in for a `CollisionScene`.

    Distances, where they are wanted, are those of the scene that it haunts.
    """

    def __init__(self, q, radius, haunted=None):
        self._q = np.atleast_2d(q)
        self._radius = radius
        self._haunted = haunted
        self.queries = 0

    def __getattr__(self, name):
        return getattr(self._haunted, name)

    def collides(self, q):
        self.queries += len(q)
        away = np.linalg.norm(np.asarray(q)[:, None] - self._q, axis=-1)
        return (away < self._radius).any(axis=1)

    def collides_throughout(self, q, turned):
        away = np.linalg.norm(np.asarray(q)[:, None] - self._q, axis=-1)
        return (away + np.linalg.norm(turned, axis=-1)[:, None] < self._radius).any(axis=1)

    def first_colliding(self, q):
        return next((k for k, one in enumerate(q) if self.collides(one[None])[0]), len(q))

    def colliding_pairs(self, q):
        return [("R_link", "ghost")] if self.collides(q[None])[0] else []

    def against_surroundings(self, reserve):
        return Ghosts(self._q, self._radius + reserve)

    def wider(self, reserve):
        return Ghosts(self._q, 0.0)  # ghosts haunt places, not the ways between them

    def less(self, amount):
        return Ghosts(self._q, self._radius - amount)

    @property
    def levers(self):
        return np.ones(6)  # distances are those of joint space
