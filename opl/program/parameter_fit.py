"""Are the parameters of a controller those of this arm? What is compared, and what contradicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from opl.cell.robot import Robot
from opl.cell.spherical_wrist import SphericalWristArm
from opl.errors import InputError
from opl.geometry.frames import Array
from opl.program.parameters import AxisParameters, ParameterGroup

# Link lengths [m] of a calibrated arm stray from the drawing's by some millimetres.
LINK_TOLERANCE = 0.01
# Ratios are those of gears: two readings of one drive differ by hundredths of a percent.
RATIO_TOLERANCE = 0.002
# Soft limits [deg] may be drawn in at will, but reach no further than the arm; data sheets of one
# arm differ by up to 3 degrees.
LIMIT_TOLERANCE = 5.0


@dataclass(frozen=True)
class Comparison:
    """What came of holding a group of parameters against a robot.

    Attributes:
        compared: What agrees, and what could not be compared, one line each.
        contradictions: What speaks against the parameters being those of the robot.
    """

    compared: tuple[str, ...]
    contradictions: tuple[str, ...]


def choose_group(
    groups: Sequence[ParameterGroup], robot: Robot, wanted: int | None, source: str
) -> tuple[AxisParameters, Comparison]:
    """Return the group of axes that is the robot, and how that was found.

    Args:
        groups: Of the file.
        robot: Whose parameters are looked for.
        wanted: Number of the group, None for the only one that contradicts nothing.
        source: The file, for messages.

    Raises:
        InputError: If that group is not there, contradicts the robot, or several do not.
    """
    have = ", ".join(f"{group.number} ({group.n_axes} axes)" for group in groups)
    looked_at = [group for group in groups if wanted in (None, group.number)]
    if not looked_at:
        raise InputError(source, f"holds no group {wanted}; have: {have}")
    fitting, against = [], []
    for group in looked_at:
        try:
            axes = group.axes()
        except InputError as error:
            against.append(f"group {group.number}: {error}")
            continue
        comparison = compare_parameters(robot, axes)
        against += [f"group {group.number}: {line}" for line in comparison.contradictions]
        if not comparison.contradictions:
            fitting.append((axes, comparison))
    if not fitting:
        help_line = "name the robot whose controller the file is from"
        lines = [f"is not of a {robot.title}:", *(f"  {line}" for line in against), help_line]
        raise InputError(source, "\n".join(lines))
    if len(fitting) > 1:
        numbers = " and ".join(str(axes.group) for axes, _ in fitting)
        raise InputError(
            source, f"groups {numbers} could both be the {robot.title}: name one with --group"
        )
    return fitting[0]


def compare_parameters(robot: Robot, parameters: AxisParameters) -> Comparison:
    """Hold axes, soft limits, ratios and link lengths of a group against those of a robot."""
    compared = [f"axes: {len(parameters.upper)}, as {robot.title}"]
    against: list[str] = []
    for agrees, lines in (
        _limits(robot, parameters),
        _ratios(robot, parameters),
        _links(robot, parameters),
    ):
        (compared if agrees else against).extend(lines)
    return Comparison(tuple(compared), tuple(against))


def _limits(robot: Robot, parameters: AxisParameters) -> tuple[bool, list[str]]:
    ratios = np.array(parameters.pulses_per_degree)
    lower, upper = np.array(parameters.lower) / ratios, np.array(parameters.upper) / ratios
    least, most = np.rad2deg(robot.lower), np.rad2deg(robot.upper)
    beyond = (lower < least - LIMIT_TOLERANCE) | (upper > most + LIMIT_TOLERANCE)
    lines = [
        f"soft limits of {robot.joint_names[k]}: {_span(lower[k], upper[k])} deg, the arm turns "
        f"{_span(least[k], most[k])} deg"
        for k in np.flatnonzero(beyond)
    ]
    if lines:
        return False, lines
    shown = ", ".join(
        f"{name} {_span(low, high)}"
        for name, low, high in zip(robot.joint_names, lower, upper, strict=True)
    )
    return True, [f"soft limits: {shown} deg, none further than the arm turns"]


def _ratios(robot: Robot, parameters: AxisParameters) -> tuple[bool, list[str]]:
    ratios, known = np.array(parameters.pulses_per_degree), np.deg2rad(robot.pulses_per_radian)
    off = np.abs(ratios / known - 1.0) > RATIO_TOLERANCE  # never where none is known
    sure = ~np.isnan(known) & ~np.isin(robot.joint_names, robot.unverified_pulses)
    if (off & sure).any():
        return False, [
            f"pulses per degree of {robot.joint_names[k]}: {ratios[k]:.2f}, the arm has "
            f"{known[k]:.2f}"
            for k in np.flatnonzero(off & sure)
        ]
    lines = []
    if sure.any():
        names = " ".join(np.array(robot.joint_names)[sure])
        lines.append(f"pulses per degree of {names}: agree within {RATIO_TOLERANCE * 100:g} %")
    for k in np.flatnonzero(~sure):
        known_so_far = "none was known" if np.isnan(known[k]) else f"{known[k]:.2f} unverified"
        lines.append(
            f"pulses per degree of {robot.joint_names[k]}: {ratios[k]:.2f} instead of "
            f"{known_so_far}"
        )
    return True, lines


def _links(robot: Robot, parameters: AxisParameters) -> tuple[bool, list[str]]:
    arm = robot.arm
    if not isinstance(arm, SphericalWristArm):
        return False, [f"of an arm with a spherical wrist, {robot.title} has none"]
    links, drawn = (
        np.array(parameters.link_lengths),
        np.abs([arm.a1, arm.c2, arm.a2, arm.c3, arm.c4]),
    )
    if not links[[1, 3]].all():  # upper arm and forearm: an arm has both
        return True, ["link lengths: not in the file"]
    if np.abs(links - drawn).max() > LINK_TOLERANCE:
        return False, [f"links of {_lengths(links)} mm, the arm has {_lengths(drawn)} mm"]
    return True, [f"links: {_lengths(links)} mm, within {LINK_TOLERANCE * 1e3:g} mm of the drawing"]


def _span(low: float, high: float) -> str:
    return f"{low:.1f} to {high:.1f}"


def _lengths(values: Array) -> str:
    return " ".join(f"{value * 1e3:.0f}" for value in values)
