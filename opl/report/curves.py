"""Curves of a motion against time, as the viewer draws them: one group of panels at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from opl.cell.nearest import Nearest
from opl.cell.robot import Robot
from opl.geometry.frames import Array
from opl.motion.motion import TimedMotion
from opl.motion.timing import Timing
from opl.report.packing import Packer

MM = 1e3
SHORTEST = 1e-6  # [s] of a move that has a speed
AT_REST = "off the wheel"
LIMIT = "limit"  # kind of a level line
LEAST = 1e-3  # shown of a quantity that hardly changes
NEAR = 1.2  # of what is shown, from its middle: a limit farther away is left out


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a panel: what the viewer's style calls it, its places in [s], and its name."""

    kind: str
    x: Array | Sequence[float]
    y: Array | Sequence[float]
    name: str


def panel(
    packer: Packer, title: str, unit: str, lines: Sequence[Line], **more: Any
) -> dict[str, Any]:
    """Return one panel; a limit is in what it shows only where a curve comes near to it."""
    seen = np.concatenate([np.asarray(one.y) for one in lines if one.kind != LIMIT])
    seen = seen[~np.isnan(seen)]
    low, high = (float(seen.min()), float(seen.max())) if len(seen) else (0.0, 1.0)
    caption = f"{title}: {low:.2f} to {high:.2f} {unit}"
    room, middle = max(high - low, LEAST), (low + high) / 2.0
    limits = [float(one.y[0]) for one in lines if one.kind == LIMIT]
    near = [level for level in limits if abs(level - middle) < NEAR * room]
    low, high = min([low, *near]), max([high, *near])
    margin = 0.06 * max(high - low, LEAST)
    return {
        "title": title,
        "unit": unit,
        "caption": caption,
        "low": low - margin,
        "high": high + margin,
        "lines": [
            {
                "name": one.name,
                "kind": one.kind,
                "x": packer.floats(one.x),
                "y": packer.floats(one.y),
            }
            for one in lines
        ],
        **more,
    }


def limit(end: float, value: float, name: str = "limit") -> Line:
    """Return a level line."""
    return Line(LIMIT, [0.0, end], [value, value], name)


def joint_panels(
    timed: TimedMotion, robot: Robot, fixed: Array | None, packer: Packer
) -> list[dict[str, Any]]:
    """Return the joint angles: found, contact fixed, their range on the wheel, and limits."""
    motion, times = timed.motion, moments(timed)
    ground, panels = motion.on_wheel, []
    q, end = np.rad2deg(motion.q), float(times[-1])
    for joint, name in enumerate(robot.joint_names):
        on_wheel = q[ground, joint]
        lines = [
            Line("range", [0.0, end], [on_wheel.min(), on_wheel.max()], "range on wheel"),
            limit(end, float(np.rad2deg(robot.lower[joint]))),
            limit(end, float(np.rad2deg(robot.upper[joint]))),
        ]
        if fixed is not None:
            points = np.arange(len(fixed))
            angles = np.interp(motion.cutter_point, points, np.rad2deg(fixed[:, joint]))
            lines.append(Line("fixed", times, angles, "contact kept at t = 0"))
        lines.append(Line("found", times, q[:, joint], "found"))
        panels.append(panel(packer, name, "deg", lines))
    return panels


def speed_panels(timing: Timing, robot: Robot, packer: Packer) -> list[dict[str, Any]]:
    """Return the mean speed of each joint on each move, with its limits."""
    times, speeds = moments(timing.timed), np.rad2deg(_speeds(timing.timed))
    most = np.rad2deg(robot.max_speed)
    return [
        panel(
            packer,
            f"{name} speed",
            "deg/s",
            [
                *(limit(float(times[-1]), sign * most[joint]) for sign in (-1.0, 1.0)),
                Line("found step", times, speeds[:, joint], "mean of a move"),
            ],
        )
        for joint, name in enumerate(robot.joint_names)
    ]


def acceleration_panels(timing: Timing, robot: Robot, packer: Packer) -> list[dict[str, Any]]:
    """Return how the speeds of neighbouring moves differ, over the time from middle to middle.

    Where the robot rests there is none: the ramps there are the controller's own.
    """
    timed = timing.timed
    times, speeds = moments(timed), _speeds(timed)
    apart = (timed.duration[1:] + timed.duration[:-1]) / 2.0
    found = np.full(speeds.shape, np.nan)
    found[1:] = np.diff(speeds, axis=0) / np.maximum(apart, SHORTEST)[:, None]
    found[1:][timed.motion.ends_phase[:-1]] = np.nan
    most = np.rad2deg(robot.max_acceleration)
    assumed = ", assumed" if robot.acceleration_assumed else ""
    return [
        panel(
            packer,
            f"{name} acceleration",
            "deg/s2",
            [
                *(
                    limit(float(times[-1]), sign * most[joint], f"limit{assumed}")
                    for sign in (-1.0, 1.0)
                ),
                Line("found", times, np.rad2deg(found[:, joint]), "from speeds of neighbours"),
            ],
        )
        for joint, name in enumerate(robot.joint_names)
    ]


def feed_panels(
    timing: Timing, passing: TimedMotion, feed: float, robot: Robot, packer: Packer
) -> list[dict[str, Any]]:
    """Return the speed along the surface with what lowers it, and the contact position.

    Args:
        timing: The moves from written to written configuration, and what sets their times.
        passing: The same motion through all of its configurations.
        feed: As set in [m/s].
        robot: The robot.
        packer: Takes the arrays.
    """
    times, speed = moments(timing.timed), MM * surface_speed(timing)
    causes = [
        AT_REST
        if np.isnan(distance)
        else "as set"
        if cause.value == "none"
        else f"lowered: {cause.value}"
        + (f" of joint {robot.joint_names[joint]}" if joint >= 0 else "")
        for distance, cause, joint in zip(
            timing.surface_distance, timing.cause, timing.joint, strict=True
        )
    ]
    names = list(dict.fromkeys(causes))
    slow = np.array([text.startswith("lowered") for text in causes])
    lines = [
        limit(float(times[-1]), MM * feed, "set"),
        Line("found step", times, speed, "along the surface, mean of a move"),
        Line("blame step", times, np.where(slow, speed, np.nan), "lowered"),
    ]
    labels = {"codes": packer.counts([names.index(text) for text in causes]), "names": names}
    t = Line("found", moments(passing), passing.motion.contact_position, "t")
    return [
        panel(packer, "feed", "mm/s", lines, labels=labels),
        panel(packer, "contact position t", "mm on the flat, deg on the edges", [t]),
    ]


def clearance_panels(times: Array, nearest: Nearest, packer: Packer) -> list[dict[str, Any]]:
    """Return the distance of the nearest pair at moments in [s], with its names."""
    line = Line("found", times, MM * nearest.distance, "nearest pair")
    names = [" and ".join(pair) for pair in nearest.pairs]
    labels = {"codes": packer.counts(nearest.pair), "names": names}
    return [panel(packer, "clearance", "mm", [line], labels=labels)]


def moments(timed: TimedMotion) -> Array:
    """Return when each configuration is reached in [s], shape (n,)."""
    return np.asarray(np.cumsum(timed.duration))


def surface_speed(timing: Timing) -> Array:
    """Return the mean speed of the ground point on each move in [m/s], NaN off the wheel."""
    return timing.surface_distance / np.maximum(timing.timed.duration, SHORTEST)


def _speeds(timed: TimedMotion) -> Array:
    """Return the mean speed of each joint on the move to each configuration, NaN for none."""
    moved = np.diff(timed.motion.q, axis=0, prepend=timed.motion.q[:1])
    lasting = timed.duration > SHORTEST
    return np.where(lasting[:, None], moved / np.maximum(timed.duration, SHORTEST)[:, None], np.nan)
