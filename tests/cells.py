"""Cells, parts and an independent collision scene for tests. Everything slow is made once."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import cache
from itertools import combinations

import fcl
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from opl.cell.clearance import part_tree
from opl.cell.collision import CollisionScene
from opl.cell.robot import load_robot
from opl.cell.workcell import WorkCell
from opl.field.layer import wheel_layer
from opl.field.nodes import build_nodes
from opl.geometry.frames import pose
from opl.geometry.mesh import TriangleMesh
from opl.geometry.shapes import Body, Box
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import ContactWheel
from opl.job.load import load
from opl.motion.motion import Motion, Stretch
from opl.motion.timing import timed
from opl.pipeline import cutter_points
from opl.planning.plan import plan_recursive
from opl.planning.problem import GrindingProblem
from opl.resources import folder
from opl.verification.replay import replay

V_JOB = folder("workpieces") / "v_shape" / "job.yaml"


# the V part, whole and small


@cache
def v_job():
    return load(V_JOB)


def with_positions(job, count):
    """Return a job with another number of contact positions."""
    return replace(job, search=replace(job.search, n_contact_positions=count))


@cache
def small_job():
    """Return the V job with two of its rows and fewer contact positions."""
    job = v_job()
    return with_positions(replace(job, passes=replace(job.passes, rows=2)), 60)


def problem_of(job, points_of=None):
    """Return the problem of a job, or of a slice of its cutter points."""
    points = cutter_points(job)
    if points_of is not None:
        points = CutterPoints(
            points.Ts_workpiece_cutter[points_of],
            points.pass_index[points_of],
            points.arc_length[points_of],
        )
    positions = job.cell.wheel.positions(job.search.n_contact_positions)
    part = part_tree(job.cell.part)
    return GrindingProblem(
        job.cell,
        CollisionScene(job.cell).for_second_opinion(),
        part,
        points,
        build_nodes(job.cell, points, positions),
        wheel_layer(job.cell, part, points, positions),
        job.search.interpolation,
        job.pace,
    )


@cache
def v_problem():
    return problem_of(v_job())


@cache
def v_plan():
    return plan_recursive(v_problem())


@cache
def small_problem():
    return problem_of(small_job())


@cache
def small_plan():
    return plan_recursive(small_problem())


@cache
def small_motion():
    """Return a free and timed motion over the two rows."""
    problem = small_problem()
    return timed(small_plan().motion, problem.points, problem.pace, problem.cell.robot)


@cache
def v_motion():
    problem = v_problem()
    return timed(v_plan().motion, problem.points, problem.pace, problem.cell.robot)


@cache
def tiny_problem():
    """Return the end of one pass and the beginning of the next, and a home not far away."""
    problem = problem_of(with_positions(small_job(), 30), points_of=slice(50, 70))
    on_the_way = plan_recursive(problem).motion.q[1]  # where the first approach begins
    home = on_the_way + np.array([0.3, -0.2, 0.0, 0.2, 0.1, 0.2])
    return replace(problem, pace=replace(problem.pace, home=home))


@cache
def tiny_motion():
    problem = tiny_problem()
    motion = plan_recursive(problem).motion
    return timed(motion, problem.points, problem.pace, problem.cell.robot)


def replay_tiny(motion=None, cell=None):
    """Replay the tiny motion, or another one, or in another cell."""
    problem, allowed = tiny_problem(), small_job().search.max_contact_error
    return replay(cell or problem.cell, problem.points, motion or tiny_motion(), allowed)


def with_problem_cell(problem, cell):
    """Return a problem in another cell; nodes and wheel layer stay."""
    return replace(problem, cell=cell, scene=CollisionScene(cell).for_second_opinion())


def with_obstacle(cell, p_base, size=(0.03, 0.03, 0.03), name="post"):
    """Return a cell with one box more."""
    body = Body(name, Box(tuple(size)), pose(np.eye(3), np.asarray(p_base, dtype=float)))
    return replace(cell, obstacles=(*cell.obstacles, body))


# cells with nothing in them but what a test puts there


def block(size):
    """Return a closed box as a mesh, centred at the origin."""
    box = trimesh.creation.box(size)
    return TriangleMesh(np.asarray(box.vertices), np.asarray(box.faces))


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
        contact_allowance=0.0005,
        clearance=clearance,
    )


def free_move(q, seconds=10.0):
    """Return a motion that visits postures and touches nothing."""
    n, nothing = len(q), np.full(len(q), np.nan)
    duration = np.full(n, seconds)
    duration[0] = 0.0
    return Motion(
        np.asarray(q, dtype=float),
        duration,
        (Stretch.HOME,) * n,
        nothing,
        nothing,
        np.full(n, -1),
        nothing,
    )


def random_postures(robot, n, seed=0):
    return np.random.default_rng(seed).uniform(robot.lower, robot.upper, (n, 6))


# a collision scene that shares nothing with opl: URDF read here, links posed here, asked of fcl


class FclScene:
    """The cell in python-fcl. Pieces are primitives of the URDF, held bodies and obstacles."""

    NEAR = 0.25  # [m] pieces whose spheres are further apart are not measured

    def __init__(self, cell):
        tree = ET.parse(cell.robot.urdf).getroot()
        self._joints = {}  # child link: parent link, origin, axis or None
        for joint in tree.iter("joint"):
            axis = joint.find("axis")
            fixed = joint.get("type") == "fixed"
            self._joints[joint.find("child").get("link")] = (
                joint.find("parent").get("link"),
                _origin(joint.find("origin")),
                None if fixed else np.array([float(v) for v in axis.get("xyz").split()]),
                joint.get("name"),
            )
        self._q_index = {name: k for k, name in enumerate(cell.robot.joint_names)}
        links = [link.get("name") for link in tree.iter("link")]
        chain = [link for link in links if link not in ("base", "tool0")]
        self.pieces = []  # name, frame, pose in frame, fcl object, radius
        for link in tree.iter("link"):
            for collision in link.findall("collision"):
                shape = collision.find("geometry")[0]
                if shape.tag == "box":
                    size = [float(v) for v in shape.get("size").split()]
                    geometry, radius = fcl.Box(*size), np.linalg.norm(size) / 2
                else:
                    r, h = float(shape.get("radius")), float(shape.get("length"))
                    geometry, radius = fcl.Cylinder(r, h), np.hypot(r, h / 2)
                name = link.get("name")
                self._add(name, name, _origin(collision.find("origin")), geometry, radius)
        self._add("part", "tool0", cell.T_flange_workpiece, *_fcl_mesh(cell.part))
        for body in cell.fixture:
            self._add_body(body, "tool0")
        for body in cell.obstacles:
            self._add_body(body, "base")
        wheel, T_contact0_axle = cell.wheel, np.eye(4)
        T_contact0_axle[:3, :3] = Rotation.from_euler("y", 90, degrees=True).as_matrix()
        T_contact0_axle[2, 3] = wheel.radius
        self._add(
            "wheel",
            "base",
            wheel.T_base_contact0 @ T_contact0_axle,
            fcl.Cylinder(wheel.radius, wheel.width),
            np.hypot(wheel.radius, wheel.width / 2),
        )
        self.pairs = self._choose(chain, cell)

    def _add(self, name, frame, T_frame_piece, geometry, radius):
        self.pieces.append((name, frame, T_frame_piece, fcl.CollisionObject(geometry), radius))

    def _add_body(self, body, frame):
        if isinstance(body.shape, Box):
            geometry = fcl.Box(*body.shape.size)
            radius = np.linalg.norm(body.shape.size) / 2
        elif isinstance(body.shape, TriangleMesh):
            geometry, radius = _fcl_mesh(body.shape)
        else:
            geometry = fcl.Cylinder(body.shape.radius, body.shape.length)
            radius = np.hypot(body.shape.radius, body.shape.length / 2)
        self._add(body.name, frame, body.T_parent_body, geometry, radius)

    def _choose(self, chain, cell):
        """Return (first piece, second piece, clearance) as the rules in words say.

        Links that are no neighbours must not touch. Held bodies keep the clearance from all links
        but the flange's, and need only not touch the last but one. Held bodies and all links but
        the foot keep the clearance from everything fixed; part and wheel are asked elsewhere. What
        is said of a pair by name goes before all that.
        """
        held = {"part", *(body.name for body in cell.fixture)}
        place = {name: k for k, name in enumerate(chain)}
        pairs = []
        for one, other in combinations(range(len(self.pieces)), 2):
            a, b = sorted((self.pieces[one][0], self.pieces[other][0]), key=self._rank(place, held))
            if a in place and b in place:
                if abs(place[a] - place[b]) > 1:
                    pairs.append((one, other, 0.0))
            elif a in place and b in held:
                if place[a] < len(chain) - 1:
                    near = place[a] == len(chain) - 2
                    pairs.append((one, other, 0.0 if near else cell.clearance))
            elif (a, b) == ("part", "wheel") or place.get(a) == 0:
                continue
            elif a in place or (a in held and b not in held):
                pairs.append((one, other, cell.clearance))
        return list(self._as_said(pairs, cell.pairs))

    def _as_said(self, pairs, rules):
        for one, other, needed in pairs:
            names = frozenset([self.pieces[one][0], self.pieces[other][0]])
            if names not in rules.allowed:
                yield one, other, rules.clearances.get(names, needed)

    @staticmethod
    def _rank(place, held):
        return lambda name: (
            (0, place[name]) if name in place else (1, 0) if name in held else (2, 0)
        )

    def frames(self, q):
        """Return the pose of every link in the base frame."""
        T_root = {}

        def of(link):
            if link not in self._joints:
                return np.eye(4)
            if link not in T_root:
                parent, origin, axis, name = self._joints[link]
                T = of(parent) @ origin
                if axis is not None:
                    turn = np.eye(4)
                    angle = q[self._q_index[name]]
                    turn[:3, :3] = Rotation.from_rotvec(angle * axis).as_matrix()
                    T = T @ turn
                T_root[link] = T
            return T_root[link]

        links = [*self._joints, "base_link"]
        T_base_root = np.linalg.inv(of("base"))
        return {link: T_base_root @ of(link) for link in links}

    def clearances(self, q):
        """Return {(piece, piece): (distance - needed)} of every pair nearer than `NEAR`.

        Distance is 0 or less where the pieces meet.
        """
        frames = self.frames(q)
        centres = []
        for _, frame, T_frame_piece, thing, _ in self.pieces:
            T = frames[frame] @ T_frame_piece
            thing.setTransform(fcl.Transform(T[:3, :3], T[:3, 3]))
            centres.append(T[:3, 3])
        centres = np.array(centres)
        radii = np.array([piece[4] for piece in self.pieces])
        one, other, needed = (np.array(column) for column in zip(*self.pairs, strict=True))
        one, other = one.astype(int), other.astype(int)
        apart = np.linalg.norm(centres[one] - centres[other], axis=1) - radii[one] - radii[other]
        margins = {}
        for k in np.flatnonzero(apart < needed + self.NEAR):
            first, second = self.pieces[one[k]], self.pieces[other[k]]
            if fcl.collide(first[3], second[3], fcl.CollisionRequest(), fcl.CollisionResult()):
                distance = 0.0
            else:
                distance = fcl.distance(
                    first[3], second[3], fcl.DistanceRequest(), fcl.DistanceResult()
                )
            key = (first[0], second[0])
            margins[key] = min(margins.get(key, np.inf), distance - needed[k])
        return margins


def _fcl_mesh(mesh):
    """Return triangles as fcl's geometry, and the radius of a ball around them."""
    geometry = fcl.BVHModel()
    geometry.beginModel(len(mesh.vertices), len(mesh.faces))
    geometry.addSubModel(mesh.vertices, mesh.faces)
    geometry.endModel()
    return geometry, np.linalg.norm(mesh.vertices, axis=1).max()


def _origin(element):
    T = np.eye(4)
    if element is not None:
        T[:3, 3] = [float(v) for v in element.get("xyz", "0 0 0").split()]
        rpy = [float(v) for v in element.get("rpy", "0 0 0").split()]
        T[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
    return T


class Ghosts:
    """A scene in which postures near some others collide; stands in for a `CollisionScene`."""

    def __init__(self, q, radius):
        self._q = np.atleast_2d(q)
        self._radius = radius

    def collides(self, q):
        away = np.linalg.norm(np.asarray(q)[:, None] - self._q, axis=-1)
        return (away < self._radius).any(axis=1)

    def colliding_pairs(self, q):
        return [("R_link", "ghost")] if self.collides(q[None])[0] else []

    def against_surroundings(self, reserve):
        return Ghosts(self._q, self._radius + reserve)

    def levers(self):
        return np.ones(6)  # distances are those of joint space


# the paper's search, as printed


def printed_recursion(q, free, leads_on, start):
    """Return the rows that Algorithm 1 finds from a start node, or None.

    Written as the paper prints it: recursive, forgetting every dead end.

    Args:
        q: Joint positions, shape (n_columns, n_rows, 6).
        free: Which nodes are free, shape (n_columns, n_rows).
        leads_on: leads_on(column, row, next_row) tells whether a step can be made.
        start: Row of the start node.
    """
    track = [start]

    def ranges(row):
        on_track = np.array([q[k, r] for k, r in enumerate([*track, row])])
        return float((on_track.max(axis=0) - on_track.min(axis=0)).sum())

    def go_on():
        column = len(track) - 1
        if column == len(q) - 1:
            return True
        candidates = [row for row in range(q.shape[1]) if free[column + 1, row]]
        for row in sorted(candidates, key=ranges):  # stable: the lower row first among equals
            if leads_on(column, track[-1], row):
                track.append(row)
                if go_on():
                    return True
                track.pop()
        return False

    return track if go_on() else None


def range_sum(q, rows):
    on_track = np.array([q[k, row] for k, row in enumerate(rows)])
    return float((on_track.max(axis=0) - on_track.min(axis=0)).sum())
