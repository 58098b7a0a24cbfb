"""A picture of an arm from the side: links, axes, dimensions, where its wrist can be, limits."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.spatial import ConvexHull

from opl.cell.drawing import DrawnArm, drawn_arm, wrist_reach
from opl.cell.parallel_axes import ParallelAxesArm
from opl.cell.robot import Robot
from opl.geometry.frames import Array
from opl.report.canvas import FAINT, INK, RULE, blank_figure, house_style, legend_below, svg

MM = 1e3
ENVELOPE = "#dbe8f3"
EDGE = "#7ba3c7"
LINKS = ("#c3c9ce", "#d5dade")  # in turn, that neighbours differ
AXIS: dict[str, Any] = {"color": "#c8102e", "linewidth": 0.9, "linestyle": (0, (9, 3, 2, 3))}
DIMENSION: dict[str, Any] = {"color": INK, "linewidth": 0.7}
PLACES = 300  # across the envelope
SHORTEST = 1e-3  # [m] a dimension that is drawn
SHORT = 60.0  # [mm] one too short for arrows
LONGEST_STEP = 60.0  # [deg] between ticks of the limits


@house_style()
def arm_view(robot: Robot) -> str:
    """Return the arm at all angles zero, seen from its right side, with its limits, as SVG."""
    title = f"{robot.title}: zero configuration, reach {MM * robot.reach:.0f} mm"
    figure = blank_figure(title)
    side, limits = figure.subplots(1, 2, width_ratios=(2.3, 1.0))
    arm = drawn_arm(robot)
    _draw_envelope(side, robot)
    _draw_links(side, arm)
    floor = -robot.base_height
    side.axhline(MM * floor, color=RULE, linewidth=1.4, zorder=1)
    _draw_axes(side, arm)
    _draw_dimensions(side, arm, floor)
    side.set_aspect("equal")
    side.margins(0.04)
    side.set_xlabel("x ahead of axis 1 in mm")
    side.set_ylabel("z above axis 2 in mm" if not robot.arm.c1 else "z in mm")
    _draw_limits(limits, robot)
    for axes in (side, limits):
        axes.tick_params(length=2)
        for edge in ("top", "right"):
            axes.spines[edge].set_visible(False)
    parallel = isinstance(robot.arm, ParallelAxesArm)
    wrist = "axis 4" if parallel else "the wrist centre"
    handles = [
        Patch(facecolor=ENVELOPE, edgecolor=EDGE, label=f"where {wrist} can be"),
        Line2D([], [], label="joint axis", **AXIS),
        Patch(facecolor=LINKS[0], edgecolor=FAINT, label="shapes checked for collision"),
    ]
    legend_below(figure, handles)
    return svg(figure, title)


def _draw_envelope(axes: Axes, robot: Robot) -> None:
    far = 1.02 * robot.reach
    x, z = np.meshgrid(np.linspace(-far, far, PLACES), np.linspace(-far, far, PLACES))
    inside = wrist_reach(robot, x, z)
    axes.contourf(MM * x, MM * z, inside, levels=[0.0, 1e3], colors=[ENVELOPE], zorder=0)
    axes.contour(MM * x, MM * z, inside, levels=[0.0], colors=[EDGE], linewidths=1.0, zorder=0)


def _draw_links(axes: Axes, arm: DrawnArm) -> None:
    nearest_last = sorted(arm.outlines, key=lambda outline: -outline[1][:, 1].min())
    for joint, points in nearest_last:
        flat = MM * points[:, [0, 2]]
        corners = flat[ConvexHull(flat).vertices]
        colour = LINKS[joint % 2]
        axes.fill(*corners.T, facecolor=colour, edgecolor=FAINT, linewidth=0.6, zorder=2)


def _draw_axes(axes: Axes, arm: DrawnArm) -> None:
    size = MM * float(np.abs(arm.axis_points).max())
    half, aside = 0.09 * size, np.array([0.05 * size, 0.0])
    seen: list[Array] = []
    for number, (point, direction) in enumerate(zip(arm.axis_points, arm.axes, strict=True), 1):
        at = MM * point[[0, 2]]
        if abs(direction[1]) > 0.5:
            axes.plot(*at, "o", markersize=7.0, markerfacecolor="white",
                      markeredgecolor=AXIS["color"], markeredgewidth=1.1, zorder=5)  # fmt: skip
            label = at + 0.022 * size
        else:
            reach = half * direction[[0, 2]] / np.linalg.norm(direction[[0, 2]])
            ends = np.array([at - reach, at + reach])
            axes.plot(*ends.T, zorder=4, **AXIS)
            label = ends[int(np.argmax(ends @ [1.0, 1.0]))] + aside / 4.0
        while any(np.abs(label - other).max() < 0.045 * size for other in seen):
            label = label + aside
        seen.append(label)
        axes.text(
            label[0],
            label[1],
            str(number),
            color=AXIS["color"],
            fontsize=9.5,
            zorder=6,
            bbox={"facecolor": "white", "alpha": 0.75, "pad": 0.6, "edgecolor": "none"},
        )


def _draw_dimensions(axes: Axes, arm: DrawnArm, floor: float) -> None:
    """Draw one chain of dimensions below the floor, one to the left: axes, wrist and flange."""
    corners = np.concatenate([points for _, points in arm.outlines])
    size = float(np.ptp(corners, axis=0).max())
    points = [arm.axis_points[k] for k in range(6)] + [arm.flange]
    below = MM * (min(floor, corners[:, 2].min()) - 0.09 * size)
    beside = MM * (corners[:, 0].min() - 0.09 * size)
    _chain(axes, [p[0] for p in [np.zeros(3), *points]], below, False)
    _chain(axes, [floor, 0.0, *(p[2] for p in points)], beside, True)


def _chain(axes: Axes, places: Sequence[float], beside: float, upright: bool) -> None:
    steps: list[float] = []
    for place in sorted(places):
        if not steps or place - steps[-1] > SHORTEST:
            steps.append(place)
    for start, end in pairwise(steps):
        low, high = MM * start, MM * end
        first, last = (
            ((beside, low), (beside, high)) if upright else ((low, beside), (high, beside))
        )
        short = high - low < SHORT
        arrow = "|-|,widthA=0.25,widthB=0.25" if short else "<->"
        properties = {"arrowstyle": arrow, "shrinkA": 0, "shrinkB": 0, **DIMENSION}
        axes.annotate("", first, last, arrowprops=properties, zorder=5)
        middle = (low + high) / 2.0
        at = (beside, middle) if upright else (middle, beside)
        axes.annotate(
            f"{high - low:.6g}",
            at,
            xytext=(-4, 0) if upright else (0, -4),
            textcoords="offset points",
            ha="right" if upright else "center",
            va="center" if upright else "top",
            rotation=90.0 if short and not upright else 0.0,
            fontsize=9.5,
            zorder=6,
        )


def _draw_limits(axes: Axes, robot: Robot) -> None:
    lower, upper = np.rad2deg(robot.lower), np.rad2deg(robot.upper)
    rows = np.arange(6)
    axes.barh(rows, upper - lower, left=lower, height=0.34, color=LINKS[0], zorder=2)
    axes.axvline(0.0, color=RULE, linewidth=0.8, zorder=3)
    for row, low, high, speed in zip(rows, lower, upper, np.rad2deg(robot.max_speed), strict=True):
        for value, side in ((low, "left"), (high, "right")):
            axes.text(value, row + 0.24, f"{value:.4g}", fontsize=9.5, ha=side, va="top", zorder=4)
        axes.text(0.0, row - 0.22, f"{speed:.4g} deg/s", fontsize=9.5, color=FAINT, ha="center",
                  va="bottom", zorder=4)  # fmt: skip
    axes.set_yticks(rows, [f"{k + 1}  {name}" for k, name in enumerate(robot.joint_names)])
    axes.set_ylim(5.7, -0.6)
    farthest = float(np.abs([lower, upper]).max())
    axes.set_xlim(-1.1 * farthest, 1.1 * farthest)
    step = LONGEST_STEP * np.ceil(farthest / 3.0 / LONGEST_STEP)
    axes.set_xticks(np.arange(-3, 4) * step)
    axes.set_xlim(-1.1 * farthest, 1.1 * farthest)
    axes.set_title("limits in deg, top speeds", loc="left", fontsize=11, color=FAINT)
