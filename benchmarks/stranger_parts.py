"""Random parts: a surface to be ground as a file, and a closed solid below it. Lengths in mm.

A part is drawn as a function of (a, b), both from -1 to 1: a goes across the rows if these run
along y of the part, b along them, and da x db points outward. The surface of most families is the
bicubic spline through samples of that function, and the solid has its corners on that spline.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline

SAMPLES = (13, 25)  # of a surface, along a and b
FACETS = (32, 96)  # of a solid
DEPTH = 20.0  # [mm] of a solid below the lowest place of its surface
UPRIGHT = 0.01  # [mm] that a wall leans outwards
WALL = 12.0  # [mm] thickness of a wall

Array = NDArray[np.float64]
Function = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Part:
    """A part that was drawn.

    Attributes:
        family: What it is called.
        at: Points of its surface at (a, b) in [mm], shape (..., 3).
        half: Half of its length across and along in [mm].
        thickness: Of a thin part, whose underside follows the surface, in [mm]; else None: the
            underside is flat.
        fillet: Radius of the edges of a box in [mm], which is written as STEP; else None.
        walls: Of a floor between walls, how high they are at its beginning and its end, and how far
            beyond the surface that is ground, in [mm]; else None.
    """

    family: str
    at: Function
    half: tuple[float, float]
    thickness: float | None = None
    fillet: float | None = None
    walls: tuple[float, float, float] | None = None

    def frames(self, normal: Array, count: tuple[int, int]) -> Array:
        """Return cutter frames on a grid of the surface, shape (n, 4, 4), origins in [m].

        Args:
            normal: Of the planes that the rows lie in; x of a frame runs along z cross this.
            count: How many across and along.
        """
        a, b = np.meshgrid(*(np.linspace(-0.95, 0.95, n) for n in count), indexing="ij")
        h = 1e-4
        du = self.at(a + h, b) - self.at(a - h, b)
        dv = self.at(a, b + h) - self.at(a, b - h)
        z = _unit(np.cross(du, dv))
        x = _unit(np.cross(z, normal))
        Ts = np.zeros((*a.shape, 4, 4))
        Ts[..., :3, 0], Ts[..., :3, 1], Ts[..., :3, 2] = x, np.cross(z, x), z
        Ts[..., :3, 3] = 1e-3 * self.at(a, b)
        Ts[..., 3, 3] = 1.0
        return Ts.reshape(-1, 4, 4)

    def write(self, folder: Path) -> str:
        """Write surface and ``part.stl``; return the name of the file of the surface."""
        if self.fillet is not None:
            _write_box(folder, self)
            return "surface.step"
        net, knots, sheet = _spline(self.at)
        surface = {
            "degree_u": 3,
            "degree_v": 3,
            "knots_u": knots[0].tolist(),
            "knots_v": knots[1].tolist(),
            "control_points_mm": net.tolist(),
            "weights": np.ones(net.shape[:2]).tolist(),
        }
        (folder / "surface.json").write_text(json.dumps(surface) + "\n", encoding="utf-8")
        if self.walls is not None:
            sheet = _between_walls(self.at, self.half[1], *self.walls)
        solid(sheet, self.thickness).export(folder / "part.stl")
        return "surface.json"


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def _spline(at: Function) -> tuple[Array, tuple[Array, Array], Array]:
    """Return control points, knots, and a fine sheet of points of the spline through samples."""
    a, b = (np.linspace(-1.0, 1.0, n) for n in SAMPLES)
    points = at(*np.meshgrid(a, b, indexing="ij"))
    along_a = make_interp_spline(a, points, k=3, axis=0)
    along_b = make_interp_spline(b, along_a.c, k=3, axis=1)
    # scipy keeps the interpolated axis of the coefficients in front
    net = along_b.c if along_b.c.shape[0] == SAMPLES[0] else np.moveaxis(along_b.c, 0, 1)
    fine_a, fine_b = (np.linspace(-1.0, 1.0, n + 1) for n in FACETS)
    sheet = BSpline(along_b.t, np.moveaxis(net, 1, 0), 3)(fine_b)  # b, control points of a, 3
    sheet = BSpline(along_a.t, np.moveaxis(sheet, 1, 0), 3)(fine_a)
    return net, (along_a.t, along_b.t), sheet


def sheet_of(at: Function) -> Array:
    """Return a fine sheet of points of the spline through samples, shape (m, n, 3), in [mm]."""
    return _spline(at)[2]


def solid(sheet: Array, thickness: float | None) -> trimesh.Trimesh:
    """Return the closed solid below a sheet of points, shape (m, n, 3)."""
    if thickness is None:
        below = sheet.copy()
        below[..., 2] = sheet[..., 2].min() - DEPTH
    else:
        du, dv = np.gradient(sheet, axis=0), np.gradient(sheet, axis=1)
        below = sheet - thickness * _unit(np.cross(du, dv))
    m, n = sheet.shape[:2]
    top = np.arange(m * n).reshape(m, n)
    bottom = top + m * n
    p, q, r, s = (x.ravel() for x in (top[:-1, :-1], top[1:, :-1], top[1:, 1:], top[:-1, 1:]))
    faces = [np.stack([p, q, r], -1), np.stack([p, r, s], -1)]
    faces += [np.stack([p, r, q], -1) + m * n, np.stack([p, s, r], -1) + m * n]
    ring = np.concatenate([top[:-1, 0], top[-1, :-1], top[:0:-1, -1], top[0, :0:-1]])
    low = ring + m * n
    after, low_after = np.roll(ring, -1), np.roll(low, -1)
    faces += [np.stack([ring, low, low_after], -1), np.stack([ring, low_after, after], -1)]
    assert (bottom.ravel()[ring] == low).all()
    corners = np.concatenate([sheet.reshape(-1, 3), below.reshape(-1, 3)])
    return trimesh.Trimesh(corners, np.concatenate(faces), process=False)


def _between_walls(at: Function, half: float, first: float, last: float, room: float) -> Array:
    """Return a sheet over a floor and the walls at its ends, shape (m, n, 3), in [mm].

    Args:
        at: Points of the floor at (a, b).
        half: Half of the length along the rows that is ground.
        first: Height of the wall at its beginning; 0 for none.
        last: Height of the wall at its end; 0 for none.
        room: From what is ground to the walls.
    """
    fine_a, fine_b = (np.linspace(-1.0, 1.0, n + 1) for n in FACETS)
    edge = 1.0 + room / half
    floor = at(*np.meshgrid(fine_a, edge * fine_b, indexing="ij"))
    sheet = [floor]
    for height, end, outward in ((first, 0, -1.0), (last, -1, 1.0)):
        if height == 0.0:
            continue
        steps = [(UPRIGHT, height), (WALL, height)]
        wall = [floor[:, end] + np.array([0.0, outward * y, z]) for y, z in steps]
        if end == 0:
            sheet.insert(0, np.stack(wall[::-1], axis=1))
        else:
            sheet.append(np.stack(wall, axis=1))
    return np.concatenate(sheet, axis=1)


def _write_box(folder: Path, part: Part) -> None:
    """Write a filleted box: its top, sides and the fillets between them are to be ground."""
    # optional, as STEP is in opl itself
    from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.gp import gp_Pnt
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
    from OCP.StlAPI import StlAPI_Writer
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    x, y = part.half
    top = float(part.at(np.zeros(1), np.zeros(1))[0, 2])
    box = BRepPrimAPI_MakeBox(gp_Pnt(-x, -y, 0.0), gp_Pnt(x, y, top)).Shape()
    rounded = BRepFilletAPI_MakeFillet(box)
    edges = TopExp_Explorer(box, TopAbs_EDGE)
    seen = set()
    while edges.More():
        edge = TopoDS.Edge_s(edges.Current())
        if hash(edge) not in seen and _is_long_top_edge(edge, y, top):
            rounded.Add(part.fillet, edge)
            seen.add(hash(edge))
        edges.Next()
    shape = rounded.Shape()
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(folder / "surface.step"))
    BRepMesh_IncrementalMesh(shape, 0.03, False, 0.1)
    StlAPI_Writer().Write(shape, str(folder / "part.stl"))


def _is_long_top_edge(edge: object, y: float, top: float) -> bool:
    """Return whether an edge of the box is one of the two along x at its top."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.Add_s(edge, box)
    _, y0, z0, _, y1, z1 = box.Get()
    return bool(abs(z0 - top) < 0.1 and abs(z1 - top) < 0.1 and abs(abs(y0 + y1) / 2 - y) < 0.1)


def _between(random: np.random.Generator, low: float, high: float) -> float:
    return float(random.uniform(low, high))


def _graph(z: Function, half: tuple[float, float]) -> Function:
    """Return the surface of heights over x and y."""

    def at(a: Array, b: Array) -> Array:
        x, y = half[0] * a, half[1] * b
        return np.stack([x, y, z(x, y)], axis=-1)

    return at


def draw_part(family: str, random: np.random.Generator, wheel: tuple[float, float]) -> Part:
    """Draw a part of a family that a wheel of a radius and width in [mm] may grind."""
    half = _between(random, 8.0, 30.0), _between(random, 20.0, 70.0)
    height = _between(random, 30.0, 80.0)
    if family in WALLED:
        return WALLED[family](random, half, height, wheel[1])
    return FAMILIES[family](random, half, height, wheel[0])


def _torus(random: np.random.Generator, half: tuple[float, float], height: float, _: float) -> Part:
    """A patch from the outside of a torus, to where it is a saddle if the draw says so."""
    ring, tube = _between(random, 60.0, 160.0), _between(random, 20.0, 50.0)
    spread, reach = min(half[0] / tube, 0.9), min(half[1] / (ring + tube), 0.8)
    lean = random.choice([0.0, 0.5, 1.0])
    hollow = bool(random.random() < 0.3)  # seen from within the ring: a saddle all over

    def at(a: Array, b: Array) -> Array:
        angle, along = spread * a, reach * b
        if hollow:
            out = -(ring + tube) + tube * np.cos(angle)
            x, reached = tube * np.sin(angle), -out
            return np.stack(
                [x, reached * np.sin(along), height + ring - reached * np.cos(along)], axis=-1
            )
        out = ring + tube * np.cos(angle + lean * spread)
        x = tube * np.sin(angle + lean * spread)
        z = height - ring - tube + out * np.cos(along)
        return np.stack([x, out * np.sin(along), z], axis=-1)

    return Part("torus saddle" if hollow else "torus", at, half)


def _sphere(
    random: np.random.Generator, half: tuple[float, float], height: float, _: float
) -> Part:
    radius = _between(random, 1.4 * np.hypot(*half), 220.0)
    return Part(
        "sphere cap",
        _graph(lambda x, y: height - radius + np.sqrt(radius**2 - x**2 - y**2), half),
        half,
    )


def _cylinder(
    random: np.random.Generator, half: tuple[float, float], height: float, _: float
) -> Part:
    """A cylinder with its axis across the rows or along them, or at an angle."""
    turn = random.choice([0.0, np.pi / 2.0, _between(random, 0.0, np.pi)])
    c, s = np.cos(turn), np.sin(turn)
    widest = abs(half[0] * c) + abs(half[1] * s)
    radius = _between(random, 1.1 * widest, 1.1 * widest + 100.0)
    return Part(
        "cylinder",
        _graph(lambda x, y: height - radius + np.sqrt(radius**2 - (x * c + y * s) ** 2), half),
        half,
    )


def _cone(random: np.random.Generator, half: tuple[float, float], height: float, _: float) -> Part:
    slope, least = _between(random, 0.1, 0.5), _between(random, 15.0, 50.0)
    spread = _between(random, 0.3, 0.8)

    def at(a: Array, b: Array) -> Array:
        radius = least + slope * half[1] * (1.0 + b)
        z = height - least - slope * half[1] + radius * np.cos(spread * a)
        return np.stack([radius * np.sin(spread * a), half[1] * b, z], axis=-1)

    return Part("cone", at, half)


def _blade(random: np.random.Generator, half: tuple[float, float], height: float, _: float) -> Part:
    """Arcs across, turned about y more and more."""
    radius = _between(random, 1.3 * half[0], 1.3 * half[0] + 80.0)
    twist, bow = _between(random, -0.5, 0.5), _between(random, -0.05, 0.1)
    spread = half[0] / radius

    def at(a: Array, b: Array) -> Array:
        x = radius * np.sin(spread * a)
        z = radius * (np.cos(spread * a) - 1.0)
        c, s = np.cos(twist * b), np.sin(twist * b)
        return np.stack(
            [c * x + s * z, half[1] * b, height + c * z - s * x - bow * half[1] * b**2], axis=-1
        )

    return Part("blade", at, half, thickness=_between(random, 3.0, 6.0))


def _saddle(
    random: np.random.Generator, half: tuple[float, float], height: float, wheel: float
) -> Part:
    """Hollow along y where the wheel is flat, or along x where it must be smaller."""
    round_radius = _between(random, 40.0, 250.0)
    along = bool(random.random() < 0.5)
    hollow = _between(random, 120.0, 400.0) if along else _between(random, 1.3, 3.0) * wheel
    kx, ky = (1.0 / round_radius, -1.0 / hollow) if along else (-1.0 / hollow, 1.0 / round_radius)
    return Part(
        "saddle", _graph(lambda x, y: height - kx * x**2 / 2.0 - ky * y**2 / 2.0, half), half
    )


def _wavy(
    random: np.random.Generator, half: tuple[float, float], height: float, wheel: float
) -> Part:
    """Waves on an arc: curved to both sides along and across."""
    k = 2.0 * np.pi / _between(random, 60.0, 200.0)
    across = 2.0 * np.pi / _between(random, 150.0, 400.0)
    most = min(1.0 / 90.0, 0.7 / wheel)  # [1/mm] how far it is bent, either way
    amplitude = most / k**2 * _between(random, 0.3, 1.0)
    other = min(most / across**2 * _between(random, 0.0, 0.8), 8.0)
    phase, turn = random.uniform(0.0, 2.0 * np.pi, 2)
    arc = 1.0 / _between(random, 80.0, 400.0)
    return Part(
        "wavy",
        _graph(
            lambda x, y: (
                height
                - arc * y**2 / 2.0
                + amplitude * np.sin(k * y + phase)
                + other * np.sin(across * x + turn)
            ),
            half,
        ),
        half,
    )


def _hollow(
    random: np.random.Generator, half: tuple[float, float], height: float, wheel: float
) -> Part:
    """Hollow along the rows: only a narrow wheel grinds it, or the edges of one."""
    radius = _between(random, 1.6 * half[1], 1.6 * half[1] + 250.0)
    bulge = 1.0 / _between(random, 60.0, 300.0)
    return Part(
        "hollow",
        _graph(lambda x, y: height + radius - np.sqrt(radius**2 - y**2) - bulge * x**2 / 2.0, half),
        half,
    )


def _box(random: np.random.Generator, half: tuple[float, float], height: float, _: float) -> Part:
    """A box whose long top edges are rounded: side, fillet, top, fillet, side."""
    fillet = _between(random, 6.0, min(20.0, 0.6 * half[1], 0.6 * height))
    flat, side = 2.0 * (half[1] - fillet), 0.7 * (height - fillet)
    quarter = 0.5 * np.pi * fillet
    total = flat + 2.0 * side + 2.0 * quarter

    def at(a: Array, b: Array) -> Array:
        s = 0.5 * total * b
        from_top = np.abs(s) - 0.5 * flat
        angle = np.clip(from_top / fillet, 0.0, 0.5 * np.pi)
        down = np.maximum(from_top - quarter, 0.0)
        y = np.minimum(np.abs(s), 0.5 * flat) + fillet * np.sin(angle)
        z = height - fillet + fillet * np.cos(angle) - down
        return np.stack([half[0] * a, np.sign(s) * y, z], axis=-1)

    return Part("filleted box", at, half, fillet=fillet)


def _channel(
    random: np.random.Generator, half: tuple[float, float], height: float, width: float
) -> Part:
    """A floor between two walls, with room for the wheel and little more."""
    inner = 0.5 * width + _between(random, 0.5, 12.0)
    ground = _between(random, 0.6, 0.97) * inner
    return _floor("channel", random, (half[0], ground), height, (True, True), inner - ground)


def _step(random: np.random.Generator, half: tuple[float, float], height: float, _: float) -> Part:
    """A floor with a wall at its end alone."""
    room = _between(random, 0.5, 15.0)
    return _floor("step", random, half, height, (False, True), room)


def _floor(
    family: str,
    random: np.random.Generator,
    half: tuple[float, float],
    height: float,
    walls: tuple[bool, bool],
    room: float,
) -> Part:
    """Draw how a floor bends along the rows and across, and how high its walls are.

    `walls` says whether there is one at its beginning and at its end.
    """
    along, across = (
        float(random.choice([0.0, 1.0 / _between(random, 150.0, 900.0)])) for _ in range(2)
    )
    first, last = (wall * _between(random, 1.0, 25.0) for wall in walls)
    at = _graph(lambda x, y: height - 0.5 * (along * y**2 + across * x**2), half)
    return Part(family, at, half, walls=(first, last, room))


# whose solid rises beside the surface that is ground
WALLED: dict[str, Callable[..., Part]] = {"channel": _channel, "step": _step}
FAMILIES: dict[str, Callable[..., Part]] = {
    "torus": _torus,
    "sphere": _sphere,
    "cylinder": _cylinder,
    "cone": _cone,
    "blade": _blade,
    "saddle": _saddle,
    "wavy": _wavy,
    "hollow": _hollow,
    "box": _box,
}
