"""A collision scene in fcl that shares nothing with opl: URDF and poses are read here."""

import xml.etree.ElementTree as ET
from itertools import combinations

import fcl
import numpy as np
from scipy.spatial.transform import Rotation

from opl.cell.robot import forward_kinematics
from opl.geometry.frames import transform
from opl.geometry.mesh import TriangleMesh
from opl.geometry.shapes import Box
from opl.motion.joint_lines import densify


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
                    pairs.append((one, other, 0.0 if near else cell.required_clearance))
            elif (a, b) == ("part", "wheel") or place.get(a) == 0:
                continue
            elif a in place or (a in held and b not in held):
                pairs.append((one, other, cell.required_clearance))
        return list(self._as_said(pairs, cell.pairs))

    def _as_said(self, pairs, rules):
        for one, other, needed in pairs:
            names = frozenset([self.pieces[one][0], self.pieces[other][0]])
            if names not in rules.allowed:
                yield one, other, rules.required.get(names, needed)

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


def margin_along(cell, q, step=0.4):
    """Return the least distance beyond what is needed, by fcl, the wheel as closed form."""
    scene = FclScene(cell)
    dense, _ = densify(q, np.deg2rad(step))
    corners = cell.part.vertices
    least = np.inf
    for configuration in dense:
        least = min(least, *scene.clearances(configuration).values(), np.inf)
        T = cell.Ts_contact0_workpiece(forward_kinematics(cell.robot, configuration))
        gap = cell.wheel.signed_distance(transform(T, corners)).min()
        least = min(least, gap - cell.part_from_wheel)
    return least
