"""Curves of a motion against time, as the viewer draws them: one group of panels at a time."""

from __future__ import annotations

from collections.abc import Sequence
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


def panel(title: str, unit: str, lines: Sequence[dict[str, Any]], **more: Any) -> dict[str, Any]:
    """Return one panel."""
    return {"title": title, "unit": unit, "lines": list(lines), **more}


def limit(packer: Packer, end: float, value: float, name: str = "limit") -> dict[str, Any]:
    """Return a level line; it is shown where a curve comes near."""
    return _line(packer, "limit", [0.0, end], [value, value], name)


def joint_panels(
    timing: Timing, robot: Robot, fixed: Array | None, packer: Packer
) -> list[dict[str, Any]]:
    """Return the joint angles: found, contact fixed, their range on the wheel, and limits."""
    motion, times = timing.timed.motion, moments(timing.timed)
    ground, panels = motion.on_wheel, []
    q, end = np.rad2deg(motion.q), float(times[-1])
    for joint, name in enumerate(robot.joint_names):
        on_wheel = q[ground, joint]
        lines = [
            _line(packer, "range", [0.0, end], [on_wheel.min(), on_wheel.max()], "range on wheel"),
            limit(packer, end, float(np.rad2deg(robot.lower[joint]))),
            limit(packer, end, float(np.rad2deg(robot.upper[joint]))),
        ]
        if fixed is not None:
            points = np.arange(len(fixed))
            angles = np.interp(motion.cutter_point, points, np.rad2deg(fixed[:, joint]))
            lines.append(_line(packer, "fixed", times, angles, "contact kept at t = 0"))
        lines.append(_line(packer, "found", times, q[:, joint], "found"))
        panels.append(panel(name, "deg", lines))
    return panels


def speed_panels(timing: Timing, robot: Robot, packer: Packer) -> list[dict[str, Any]]:
    """Return the mean speed of each joint on each move, with its limits."""
    times, speeds = moments(timing.timed), np.rad2deg(_speeds(timing.timed))
    most = np.rad2deg(robot.max_speed)
    return [
        panel(
            f"{name} speed",
            "deg/s",
            [
                *(limit(packer, float(times[-1]), sign * most[joint]) for sign in (-1.0, 1.0)),
                _line(packer, "found step", times, speeds[:, joint], "mean of a move"),
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
            f"{name} acceleration",
            "deg/s2",
            [
                *(
                    limit(packer, float(times[-1]), sign * most[joint], f"limit{assumed}")
                    for sign in (-1.0, 1.0)
                ),
                _line(
                    packer, "found", times, np.rad2deg(found[:, joint]), "from speeds of neighbours"
                ),
            ],
        )
        for joint, name in enumerate(robot.joint_names)
    ]


def feed_panels(timing: Timing, feed: float, robot: Robot, packer: Packer) -> list[dict[str, Any]]:
    """Return the speed along the surface with what lowers it, and the contact position."""
    timed, times = timing.timed, moments(timing.timed)
    speed = MM * timing.surface_distance / np.maximum(timed.duration, SHORTEST)
    told = [
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
    names = list(dict.fromkeys(told))
    slow = np.array([text.startswith("lowered") for text in told])
    lines = [
        limit(packer, float(times[-1]), MM * feed, "set"),
        _line(packer, "found step", times, speed, "along the surface"),
        _line(packer, "blame step", times, np.where(slow, speed, np.nan), "lowered"),
    ]
    labels = {"codes": packer.counts([names.index(text) for text in told]), "names": names}
    t = _line(packer, "found", times, timed.motion.contact_position, "t")
    return [
        panel("feed", "mm/s", lines, labels=labels),
        panel("contact position t", "mm on the flat, deg on the edges", [t]),
    ]


def clearance_panels(times: Array, nearest: Nearest, packer: Packer) -> list[dict[str, Any]]:
    """Return the distance of the nearest pair at moments in [s], with its names."""
    line = _line(packer, "found", times, MM * nearest.distance, "nearest pair")
    names = [" and ".join(pair) for pair in nearest.pairs]
    labels = {"codes": packer.counts(nearest.pair), "names": names}
    return [panel("clearance", "mm", [line], labels=labels)]


def moments(timed: TimedMotion) -> Array:
    """Return when each configuration is reached in [s], shape (n,)."""
    return np.asarray(np.cumsum(timed.duration))


def _speeds(timed: TimedMotion) -> Array:
    """Return the mean speed of each joint on the move to each configuration, NaN for none."""
    moved = np.diff(timed.motion.q, axis=0, prepend=timed.motion.q[:1])
    lasting = timed.duration > SHORTEST
    return np.where(lasting[:, None], moved / np.maximum(timed.duration, SHORTEST)[:, None], np.nan)


def _line(packer: Packer, kind: str, x: Any, y: Any, name: str) -> dict[str, Any]:
    return {"name": name, "kind": kind, "x": packer.floats(x), "y": packer.floats(y)}
