"""A picture of a part, its passes, the frames of its cutter points and what is doubtful there."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D

from opl.geometry.frames import Array
from opl.geometry.inspection import Inspection
from opl.geometry.mesh import TriangleMesh
from opl.geometry.toolpath import CutterPoints
from opl.report.canvas import FAINT, INK, blank_figure, by_pass, house_style, legend_below, svg

MM = 1e3
AXIS_COLOURS = {"x": "#c8102e", "y": "#2e7d32", "z": "#0b4f8a"}
PASS: dict[str, Any] = {"color": INK, "linewidth": 1.6}
BEHIND: dict[str, Any] = {"color": FAINT, "linewidth": 1.0, "alpha": 0.45}
AIR: dict[str, Any] = {"color": FAINT, "linewidth": 0.9, "linestyle": (0, (3, 3))}
DOUBT = "#e08214"
MISSED = "#f4c48a"
PART_COLOUR = to_rgb("#d9dee2")
MOST_NORMALS, MOST_TRIADS, MOST_NUMBERS = 160, 12, 24  # drawn; more of them hide the passes
NORMAL_SIZE, TRIAD_SIZE = 0.05, 0.09  # of the part's size
LIGHT = np.array([-0.3, 0.6, 0.74])  # from above left, seen from the camera


@house_style()
def part_view(
    *,
    title: str,
    subtitle: str,
    part: TriangleMesh,
    points: CutterPoints,
    inspection: Inspection,
) -> str:
    """Return the part as SVG: seen obliquely, along its normals and from beside the passes.

    Args:
        title: Heading.
        subtitle: The figures, in one line.
        part: The part.
        points: What is ground.
        inspection: What is doubtful about it, and where no pass comes by.
    """
    figure = blank_figure(title)
    # the layout knows only the title; a second line of it leaves room for this one
    figure.suptitle(f"{title}\n", x=0.012, ha="left", fontsize=16, fontweight="bold")
    figure.text(0.012, 0.915, subtitle, fontsize=11.5, color=FAINT)
    axes = figure.subplot_mosaic([list("ob"), list("oa")], width_ratios=[1.3, 1.0])
    Ts, uncovered = points.Ts_workpiece_cutter, inspection.uncovered
    views = _views(Ts[:, :3, 2].mean(axis=0), Ts[:, :3, 0])
    size = float(np.ptp(part.vertices, axis=0).max())
    for key, view, name in zip("oab", views, ("oblique", "from above", "from beside"), strict=True):
        one = axes[key]
        _draw_part(one, view, part)
        facing = uncovered.normals @ view[2] > 0.0
        missed = MM * uncovered.points[facing] @ view.T
        # as pixels: thousands of squares are more than some viewers of SVG take
        squares: dict[str, Any] = {"color": MISSED, "markersize": 1.3, "rasterized": True}
        one.plot(missed[:, 0], missed[:, 1], "s", zorder=1.5, **squares)
        _draw_passes(one, view, points, inspection.doubtful, numbered=key != "b")
        _draw_frames(one, view, points, size)
        one.autoscale_view()
        one.set_aspect("equal")
        one.axis("off")
        one.set_title(name, loc="left", fontsize=11, color=FAINT)
        _draw_corner(one, view)
        _draw_scale(one, MM * size)
    legend_below(figure, _legend(bool(inspection.doubtful.any()), len(uncovered.points) > 0))
    return svg(figure, title)


def _legend(doubtful: bool, uncovered: bool) -> list[Artist]:
    handles: list[Artist] = [
        Line2D([], [], label="pass, begun at its dot", marker="o", markevery=2, **PASS),
        Line2D([], [], label="link between passes", **AIR),
        Line2D([], [], color=AXIS_COLOURS["z"], label="z: outward normal"),
        Line2D([], [], color=AXIS_COLOURS["x"], label="x of the frame: tangent of the path"),
        Line2D([], [], color=AXIS_COLOURS["y"], label="y of the frame: z cross x"),
    ]
    dots: dict[str, Any] = {"linestyle": "none", "color": DOUBT}
    if doubtful:
        handles.append(Line2D([], [], marker="o", label="cutter point with a warning", **dots))
    if uncovered:
        dots["color"] = MISSED
        handles.append(Line2D([], [], marker="s", label="no pass comes by", **dots))
    return handles


def _views(up: Array, tangents: Array) -> tuple[Array, Array, Array]:
    """Return three cameras as rows right, up, towards the eye; tangents of shape (N, 3)."""
    side = np.cross(up, tangents.mean(axis=0))
    if np.linalg.norm(side) < 1e-3:  # a closed pass has no mean direction
        up, side = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])
        if abs(float(up @ side)) > 0.9:
            side = np.array([1.0, 0.0, 0.0])
    z = up / (np.linalg.norm(up) or 1.0)
    y = side - (side @ z) * z
    y = y / np.linalg.norm(y)
    x = np.cross(y, z)
    eye = 0.75 * z - 0.85 * y - 0.45 * x
    return _camera(eye, z), _camera(z, y), _camera(-y, z)


def _camera(eye: Array, up: Array) -> Array:
    eye = eye / np.linalg.norm(eye)
    right = np.cross(up, eye)
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(eye, right), eye])


def _draw_part(axes: Axes, view: Array, part: TriangleMesh) -> None:
    """Draw the triangles that face the eye, the nearest last."""
    corners = part.triangles
    triangles = MM * corners @ view.T
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(lengths > 0.0, lengths, 1.0)
    front = normals @ view[2] > 0.0
    order = np.argsort(triangles[front][:, :, 2].mean(axis=1))
    shade = 0.72 + 0.28 * np.clip(normals[front] @ (LIGHT @ view), -0.4, 1.0)
    colours = np.clip(shade[:, None] * np.array(PART_COLOUR), 0.0, 1.0)[order]
    axes.add_collection(
        PolyCollection(
            triangles[front][order][:, :, :2],
            facecolors=colours,
            edgecolors=colours,
            linewidths=0.4,
            rasterized=True,
            zorder=1,
        )
    )


def _draw_passes(
    axes: Axes, view: Array, cutter_points: CutterPoints, doubtful: np.ndarray, numbered: bool
) -> None:
    """Draw passes from their starts, fainter where the surface turns away from the eye."""
    Ts, pass_index = cutter_points.Ts_workpiece_cutter, cutter_points.pass_index
    points = (MM * Ts[:, :3, 3] @ view.T)[:, :2]
    away = Ts[:, :3, 2] @ view[2] < 0.0
    steps = np.stack([points[:-1], points[1:]], axis=1)
    one_pass = np.diff(pass_index) == 0
    behind = away[:-1] & away[1:]
    axes.add_collection(LineCollection(list(steps[one_pass & behind]), **BEHIND, zorder=1.8))
    axes.add_collection(LineCollection(list(steps[one_pass & ~behind]), **PASS, zorder=3))
    axes.add_collection(LineCollection(list(steps[~one_pass]), **AIR, zorder=2))
    marked = points[doubtful & ~away]
    axes.plot(marked[:, 0], marked[:, 1], "o", color=DOUBT, markersize=3.2, zorder=4.5)
    passes = by_pass(pass_index)
    starts = points[[one[0] for one in passes]]
    axes.plot(starts[:, 0], starts[:, 1], "o", color=INK, markersize=4.0, zorder=5)
    shown = np.linspace(0, len(passes) - 1, MOST_NUMBERS if numbered else 0)
    for number in np.unique(shown.astype(int)):
        one = passes[number]
        # beyond the start, where the pass does not run
        ahead = points[one[min(2, len(one) - 1)]] - points[one[0]]
        offset = -10.0 * ahead / (np.linalg.norm(ahead) or 1.0)
        axes.annotate(
            str(number + 1),
            points[one[0]],
            xytext=tuple(offset),
            textcoords="offset points",
            fontsize=9,
            ha="center",
            va="center",
            zorder=6,
        )


def _draw_frames(axes: Axes, view: Array, points: CutterPoints, size: float) -> None:
    """Draw normals all along, and whole frames here and there."""
    Ts, passes = points.Ts_workpiece_cutter, by_pass(points.pass_index)
    shown = np.unique(np.linspace(0, len(Ts) - 1, min(len(Ts), MOST_NORMALS)).astype(int))
    _strokes(axes, view, Ts[shown], "z", NORMAL_SIZE * size, 0.8)
    some = np.unique(np.linspace(0, len(passes) - 1, min(len(passes), MOST_TRIADS)).astype(int))
    # each further along its pass than the one before, so that they do not hide each other
    fractions = np.linspace(0.15, 0.85, len(some))
    places = [passes[k][int(f * len(passes[k]))] for k, f in zip(some, fractions, strict=True)]
    for name in "xyz":
        _strokes(axes, view, Ts[np.array(places)], name, TRIAD_SIZE * size, 1.5)


def _strokes(axes: Axes, view: Array, Ts: Array, name: str, length: float, width: float) -> None:
    """Draw one axis of frames that face the eye."""
    Ts = Ts[Ts[:, :3, 2] @ view[2] > -0.2]
    tips = Ts[:, :3, 3] + length * Ts[:, :3, "xyz".index(name)]
    strokes = MM * np.stack([Ts[:, :3, 3], tips], axis=1) @ view.T
    colour = AXIS_COLOURS[name]
    axes.add_collection(
        LineCollection(list(strokes[..., :2]), color=colour, linewidth=width, zorder=4)
    )


def _draw_corner(axes: Axes, view: Array) -> None:
    """Draw the directions of the workpiece frame in the corner."""
    inset = axes.inset_axes((-0.18, 0.82, 0.18, 0.18))
    inset.set_xlim(-1.6, 1.6)
    inset.set_ylim(-1.6, 1.6)
    inset.set_aspect("equal")
    inset.axis("off")
    tips = view[:2].T
    places = 1.3 * tips
    for _ in range(20):  # names that are too near push each other away
        for a, b in pairwise((0, 1, 2, 0)):
            gap = places[a] - places[b]
            near = float(np.linalg.norm(gap))
            if near < 0.6:
                push = gap / near if near > 1e-6 else np.array([0.0, 1.0])
                places[a] += 0.05 * push
                places[b] -= 0.05 * push
    inset.text(0.0, -1.9, "workpiece", fontsize=8, color=FAINT, ha="center", va="center")
    for name, tip, place in zip("xyz", tips, places, strict=True):
        colour = AXIS_COLOURS[name]
        inset.plot([0.0, tip[0]], [0.0, tip[1]], color=colour, linewidth=1.4)
        inset.text(place[0], place[1], name, fontsize=10, color=colour, ha="center", va="center")


def _draw_scale(axes: Axes, size: float) -> None:
    """Draw a bar of a round length in [mm] under the part."""
    power = 10.0 ** np.floor(np.log10(0.3 * size))
    length = power * max(step for step in (1.0, 2.0, 5.0) if step * power <= 0.3 * size)
    (left, _), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    y = bottom - 0.06 * (top - bottom)
    axes.plot([left, left + length], [y, y], color=INK, linewidth=2.0, solid_capstyle="butt")
    axes.annotate(
        f"{length:g} mm",
        (left + length, y),
        xytext=(6.0, 0.0),
        textcoords="offset points",
        fontsize=10,
        va="center",
    )
