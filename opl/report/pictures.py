"""Two pictures of a planned path: where the part touches the wheel, and what each joint does.

Passes are counted from 1, as people do; cutter points from 0, as in messages and tables.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from opl.cell.robot import Robot
from opl.geometry.frames import Array
from opl.motion.path import GrindingPath
from opl.report.canvas import (
    FAINT,
    INK,
    RULE,
    Margins,
    charts,
    draw_pass_borders,
    house_style,
    line_by_pass,
    points_wide,
)

# one per state, free first; they differ in lightness too, for colour-blind eyes and grey printers
STATE_COLOURS = ("#edf4ee", "#aeb5bb", "#f0da85", "#e2825c", "#8a5f9e", "#5fa3a3", "#3f4a54")
FOUND: dict[str, Any] = {"color": "#0b4f8a", "linewidth": 2.4, "label": "found path"}
HOLDS: dict[str, Any] = {
    "color": FOUND["color"],
    "marker": "o",
    "markersize": 9.0,
    "markerfacecolor": "white",
    "markeredgewidth": 2.0,
    "linestyle": "none",
    "label": "holds the joint range sum up",
}
FIXED: dict[str, Any] = {
    "color": FAINT,
    "linewidth": 1.6,
    "dashes": (2.8, 2.8),
    "label": "contact kept at t = 0",
}
LIMIT: dict[str, Any] = {"color": "#c8102e", "linewidth": 1.4, "label": "joint limit"}
CONTACT = Margins(left=84.0, right=76.0, top=48.0, bottom=50.0)
JOINTS = Margins(left=64.0, right=14.0, top=50.0, bottom=50.0, beside=46.0, between=30.0)
OUTER = 7.0  # [point] from the left side of a figure to the labels along charts
LEAST_SPAN = 10.0  # [deg] shown of a joint, lest one that hardly moves look busy
NEAR = 0.1  # of the span shown: a limit farther away than this is left out
ZONES = ("left edge", "flat", "right edge")  # of the wheel, from small t to large
LEAST_PIXELS = (1800, 840)  # of the state image, across and up
LABEL_WIDTH, NUMBER_WIDTH = 0.075, 0.03  # of "pass 12" and "12", as parts of the chart's width


@house_style()
def contact_chart(
    *,
    title: str,
    contact_positions: Array,
    states: np.ndarray,
    state_names: Sequence[str],
    pass_index: np.ndarray,
    flat_end: float,
    path: GrindingPath,
    held_at: Sequence[float] = (),
) -> Figure:
    """Draw what is free at every cutter point and contact position, and the path through it.

    Args:
        title: What the picture is called.
        contact_positions: M evenly spaced values of t in belt units, increasing, shape (M,).
        states: Code of each node, 0 is free, shape (N, M) of uint8.
        state_names: What the codes mean.
        pass_index: Pass of each cutter point, 0, 1, ..., shape (N,).
        flat_end: Contact position in belt units where the flat ends.
        path: The path found.
        held_at: Cutter points that keep the joint range sum from being smaller.
    """
    counts = np.bincount(states.ravel())
    handles: list[Patch | Line2D] = [
        Patch(
            facecolor=_state_colour(code),
            edgecolor=RULE,
            linewidth=0.8,
            label=f"{state_names[code]} {_percent(counts[code] / states.size)}",
        )
        for code in np.flatnonzero(counts).tolist()
    ]
    handles.append(Line2D([], [], **FOUND))
    if len(held_at):
        handles.append(Line2D([], [], **HOLDS))
    figure, (axes,) = charts(title, 1, 1, CONTACT, handles)
    step = np.ptp(contact_positions) / max(len(contact_positions) - 1, 1) or 1.0
    bottom, top = contact_positions[0] - step / 2.0, contact_positions[-1] + step / 2.0
    palette = np.array([_state_colour(code) for code in range(len(state_names))])
    # one embedded image is ever so much smaller than rectangles; several pixels a node, as many
    # viewers smooth images whatever the file requests
    across, up = (-(-least // n) for least, n in zip(LEAST_PIXELS, states.shape, strict=True))
    pixels = np.uint8(np.rint(255.0 * palette))[states.T].repeat(across, axis=1)
    axes.imshow(
        pixels.repeat(up, axis=0),
        extent=(-0.5, len(states) - 0.5, bottom, top),
        origin="lower",
        aspect="auto",
        interpolation="none",
    )
    _mark_zones(axes, flat_end, bottom, top)
    draw_pass_borders(axes, pass_index)
    _number_passes(axes, pass_index)
    line = line_by_pass(path.pass_index, path.cutter_point, path.contact_position)
    axes.plot(*line, color="white", linewidth=2.0 * FOUND["linewidth"])
    axes.plot(*line, **FOUND, gid="found")
    if len(held_at):
        at = np.interp(held_at, path.cutter_point, path.contact_position)
        axes.plot(held_at, at, **HOLDS, gid="holds")
    axes.set_ylim(bottom, top)
    axes.xaxis.set_major_locator(MaxNLocator(12, integer=True, min_n_ticks=1))
    axes.yaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 2.5, 5, 10]))
    axes.set_xlabel("cutter point")
    _label_up(axes, "contact position t\n(mm on the flat, degrees on the edges)", CONTACT)
    return figure


@house_style()
def joint_chart(
    *,
    title: str,
    robot: Robot,
    path: GrindingPath,
    fixed_q: Array | None,
    pass_index: np.ndarray,
) -> Figure:
    """Draw the joint angles along the found path beside those with the contact kept at t = 0.

    Args:
        title: What the picture is called.
        robot: Names and limits of the joints.
        path: The path found.
        fixed_q: The contact-fixed configuration at each cutter point in [rad], shape (N, 6), or
            None.
        pass_index: Pass of each cutter point, 0, 1, ..., shape (N,).
    """
    points = np.arange(len(pass_index), dtype=float)
    limits = np.rad2deg(np.stack([robot.lower, robot.upper], axis=-1))
    found = np.rad2deg(path.q)
    shown = found if fixed_q is None else np.concatenate([found, np.rad2deg(fixed_q)])
    spans = [_span(angles, limit) for angles, limit in zip(shown.T, limits, strict=True)]
    limit_seen = any(len(near) for near, _, _ in spans)
    styles = [FOUND, *([FIXED] if fixed_q is not None else []), *([LIMIT] if limit_seen else [])]
    handles = [Line2D([], [], **style) for style in styles]
    figure, panels = charts(title, 2, 3, JOINTS, handles)
    for joint, axes in enumerate(panels):
        heading = f"range {np.ptp(found[:, joint]):.1f} deg"
        if fixed_q is not None:
            fixed = np.rad2deg(fixed_q[:, joint])
            heading += f" (fixed {np.ptp(fixed):.1f} deg)"
            axes.plot(*line_by_pass(pass_index, points, fixed), **FIXED, gid=f"fixed_{joint}")
        line = line_by_pass(path.pass_index, path.cutter_point, found[:, joint])
        axes.plot(*line, **FOUND, gid=f"found_{joint}")
        _frame_angles(axes, *spans[joint])
        draw_pass_borders(axes, pass_index)
        # y is where it is anyhow: else it is looked for, a sixth of the time to draw
        name = robot.joint_names[joint]
        axes.set_title(name, loc="left", fontsize=13, fontweight="bold", y=1.0)
        axes.set_title(heading, loc="right", fontsize=10.5, y=1.0)
        axes.set_xlim(-0.5, len(points) - 0.5)
        axes.xaxis.set_major_locator(MaxNLocator(6, integer=True, min_n_ticks=1))
        axes.spines[["top", "right"]].set_visible(False)
    for axes in panels[::3]:
        _label_up(axes, "joint angle (deg)", JOINTS)
    for axes in panels[3:]:
        axes.set_xlabel("cutter point")
    return figure


def _label_up(axes: Axes, text: str, margins: Margins) -> None:
    """Write along the left side of charts, at the same place whatever their numbers are."""
    axes.set_ylabel(text, va="top")
    axes.yaxis.set_label_coords((OUTER - margins.left) / points_wide(axes), 0.5)


def _state_colour(code: int) -> tuple[float, float, float]:
    return to_rgb(STATE_COLOURS[code % len(STATE_COLOURS)])


def _percent(share: float) -> str:
    """Return a share that neither hides a few nodes nor claims all of them."""
    if 0.0 < share < 0.01:
        return "< 1 %"
    return "> 99 %" if 0.99 < share < 1.0 else f"{100.0 * share:.0f} %"


def _mark_zones(axes: Axes, flat_end: float, bottom: float, top: float) -> None:
    """Draw where the flat ends, and name the zones beside the chart."""
    borders = np.clip([bottom, -flat_end, flat_end, top], bottom, top)
    beside = axes.get_yaxis_transform()
    for name, start, end in zip(ZONES, borders[:-1], borders[1:], strict=True):
        if end > start:
            axes.text(1.012, (start + end) / 2.0, name, transform=beside, va="center")
    for end in (-flat_end, flat_end):
        if bottom < end < top:
            axes.axhline(end, color=INK, linewidth=1.0, dashes=(5.0, 4.0), zorder=1.6)


def _number_passes(axes: Axes, pass_index: np.ndarray) -> None:
    """Write ``pass 1``, ``pass 2``, ... over the passes, less of it where there is no room."""
    last = pass_index[-1] + 1
    middles = np.array([np.flatnonzero(pass_index == k).mean() for k in range(last)])
    places = (middles + 0.5) / len(pass_index)
    roomy = np.diff(places, prepend=-1.0).min() >= LABEL_WIDTH
    above = axes.get_xaxis_transform()
    taken = -1.0
    for k, place in enumerate(places):
        if k == 0 or place - taken >= (LABEL_WIDTH if roomy else NUMBER_WIDTH):
            text = f"pass {k + 1}" if roomy or k == 0 else f"{k + 1}"
            axes.text(middles[k], 1.012, text, transform=above, ha="center", va="bottom")
            taken = place


def _span(angles: Array, limits: Array) -> tuple[Array, float, float]:
    """Choose what a panel shows of angles in [deg], and of limits, shape (2,).

    Returns:
        The limits in it or near, and from where to where it shows angles.
    """
    middle = (angles.min() + angles.max()) / 2.0
    half = max(np.ptp(angles), LEAST_SPAN) / 2.0
    near = limits[np.abs(limits - middle) <= half * (1.0 + 2.0 * NEAR)]
    ends = np.append(near, [middle - half, middle + half])
    margin = 0.06 * np.ptp(ends)
    return near, ends.min() - margin, ends.max() + margin


def _frame_angles(axes: Axes, near: Array, bottom: float, top: float) -> None:
    """Draw the limits in a panel or near, and set what it shows, as `_span` chooses."""
    for limit in near:
        axes.axhline(limit, **LIMIT)
    axes.set_ylim(bottom, top)
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 3, 5, 10]))
    axes.grid(axis="y", color="#e6eaed", linewidth=0.8)
    axes.set_axisbelow(True)
