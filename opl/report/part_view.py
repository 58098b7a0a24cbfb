"""A picture of a part, its passes and the frames of its cutter points."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D

from opl.geometry.frames import Array
from opl.report.canvas import FAINT, INK, RULE, blank_figure, house_style, legend_below, svg

MM = 1e3
AXIS_COLOURS = {"x": "#c8102e", "z": "#0b4f8a"}
PASS: dict[str, Any] = {"color": INK, "linewidth": 1.6}
AIR: dict[str, Any] = {"color": FAINT, "linewidth": 0.9, "linestyle": (0, (3, 3))}
PART = to_rgb("#d9dee2")
MOST_NORMALS, MOST_TANGENTS = 160, 20  # drawn; more of them hide the passes
FRAME_SIZE = 0.05  # of the part's size
LIGHT = np.array([-0.3, 0.6, 0.74])  # from above left, seen from the camera


@house_style()
def part_view(
    *,
    title: str,
    vertices: Array,
    faces: np.ndarray,
    Ts_workpiece_cutter: Array,
    pass_index: np.ndarray,
) -> str:
    """Return the part seen from two sides, as SVG: along the mean normal tilted, and from beside.

    Args:
        title: Heading.
        vertices: Corners of the part's triangles in [m], shape (n, 3).
        faces: Their indices, shape (m, 3).
        Ts_workpiece_cutter: Cutter frames, shape (N, 4, 4).
        pass_index: Pass of each, shape (N,).
    """
    figure = blank_figure(title)
    axes = figure.subplots(1, 2)
    up = Ts_workpiece_cutter[:, :3, 2].mean(axis=0)
    along = Ts_workpiece_cutter[:, :3, 0].mean(axis=0)
    for one, view, name in zip(
        axes, _views(up, along), ("oblique", "along the rows' planes"), strict=True
    ):
        _draw(one, view, vertices, faces, Ts_workpiece_cutter, pass_index)
        one.set_title(name, loc="left", fontsize=11, color=FAINT)
    handles = [
        Line2D([], [], label="pass, starting at the dot", **PASS),
        Line2D([], [], label="way in the air", **AIR),
        Line2D([], [], color=AXIS_COLOURS["z"], label="z: outward normal"),
        Line2D([], [], color=AXIS_COLOURS["x"], label="x: along the path"),
    ]
    legend_below(figure, handles)
    return svg(figure, title)


def _views(up: Array, along: Array) -> tuple[Array, Array]:
    """Return two cameras as rows right, up, towards the eye, shape (3, 3) each."""
    side = np.cross(up, along)
    if np.linalg.norm(side) < 1e-3:  # a closed pass has no mean direction
        up, side = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])
        if abs(float(up @ side)) > 0.9:
            side = np.array([1.0, 0.0, 0.0])
    z = up / (np.linalg.norm(up) or 1.0)
    y = side - (side @ z) * z
    y = y / np.linalg.norm(y)
    x = np.cross(y, z)
    eye = 0.75 * z - 0.85 * y - 0.45 * x
    return _camera(eye, z), _camera(-y, z)


def _camera(eye: Array, up: Array) -> Array:
    eye = eye / np.linalg.norm(eye)
    right = np.cross(up, eye)
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(eye, right), eye])


def _draw(
    axes: Axes,
    view: Array,
    vertices: Array,
    faces: np.ndarray,
    Ts: Array,
    pass_index: np.ndarray,
) -> None:
    seen = MM * vertices @ view.T
    triangles = seen[faces]
    normals = np.cross(
        vertices[faces][:, 1] - vertices[faces][:, 0], vertices[faces][:, 2] - vertices[faces][:, 0]
    )
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(lengths > 0.0, lengths, 1.0)
    front = normals @ view[2] > 0.0
    order = np.argsort(triangles[front][:, :, 2].mean(axis=1))
    shade = 0.72 + 0.28 * np.clip(normals[front] @ (LIGHT @ view), -0.4, 1.0)
    colours = np.clip(shade[:, None] * np.array(PART), 0.0, 1.0)[order]
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
    origins = Ts[:, :3, 3]
    points = MM * origins @ view.T
    ends = np.flatnonzero(np.diff(pass_index)) + 1
    passes = np.split(np.arange(len(points)), ends)
    axes.add_collection(LineCollection([points[one][:, :2] for one in passes], **PASS, zorder=3))
    gaps = [points[[one[-1], other[0]]][:, :2] for one, other in pairwise(passes)]
    axes.add_collection(LineCollection(gaps, **AIR, zorder=2))
    starts = points[[one[0] for one in passes]]
    axes.plot(starts[:, 0], starts[:, 1], "o", color=INK, markersize=4.0, zorder=5)
    size = FRAME_SIZE * float(np.ptp(vertices, axis=0).max())
    for axis, name, most in ((2, "z", MOST_NORMALS), (0, "x", MOST_TANGENTS)):
        shown = np.unique(np.linspace(0, len(points) - 1, min(len(points), most)).astype(int))
        tips = MM * (origins[shown] + size * Ts[shown][:, :3, axis]) @ view.T
        strokes = np.stack([points[shown][:, :2], tips[:, :2]], axis=1)
        axes.add_collection(
            LineCollection(list(strokes), color=AXIS_COLOURS[name], linewidth=0.9, zorder=4)
        )
    _corner(axes, view)
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.set_xlabel("mm")
    axes.tick_params(length=2)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _corner(axes: Axes, view: Array) -> None:
    """Draw the directions of the workpiece frame in the corner."""
    inset = axes.inset_axes((0.0, 0.84, 0.16, 0.16))
    inset.set_xlim(-1.3, 1.3)
    inset.set_ylim(-1.3, 1.3)
    inset.set_aspect("equal")
    inset.axis("off")
    for name, axis in zip("xyz", np.eye(3), strict=True):
        tip = (view @ axis)[:2]
        inset.plot([0.0, tip[0]], [0.0, tip[1]], color=RULE, linewidth=1.2)
        x, y = 1.15 * tip
        inset.text(x, y, name, fontsize=9, color=FAINT, ha="center", va="center")
