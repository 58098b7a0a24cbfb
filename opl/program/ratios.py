"""What one controller says of its robot, in a small file of the user's own.

Written by opl from a parameter file, or by hand: pulse ratios and soft limits, and the zones of the
position levels. By axis it holds either what the controller's parameters say, or two readings from
the pendant: the same axis in two positions, each in pulses and in degrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from opl.cell.robot import Robot
from opl.errors import InputError
from opl.files.documents import Document, read
from opl.files.quantities import Number, Positive, Pulses
from opl.files.reading import MB, read_bytes
from opl.files.writing import write_file
from opl.program.parameter_fit import choose_group
from opl.program.parameters import AxisParameters, read_parameters

# Readings nearer than this in [deg] give a ratio of too few digits: the pendant shows hundredths.
LEAST_SPAN = 20.0
MOST_PARAMETERS = 20 * MB
# Farthest from zero pulses [deg] that two readings may meet zero degrees.
ZERO_TOLERANCE = 0.1


_Zone = Positive  # [mm]


class _Reading(Document):
    pulses: Pulses
    degrees: Number


class _Axis(Document):
    name: str
    per_degree: Positive | None = None
    readings: Annotated[list[_Reading], Field(min_length=2, max_length=2)] | None = None
    lower_pulses: Pulses | None = None
    upper_pulses: Pulses | None = None

    @model_validator(mode="after")
    def _usable(self) -> _Axis:
        if (self.per_degree is None) == (self.readings is None):
            raise ValueError("needs either per_degree or readings")
        low, high = self.lower_pulses, self.upper_pulses
        if low is not None and high is not None and low >= high:
            raise ValueError(f"lower_pulses must be below upper_pulses {high}")
        if self.readings is not None:
            first, second = self.readings
            span = second.degrees - first.degrees
            if abs(span) < LEAST_SPAN:
                raise ValueError(f"readings must be {LEAST_SPAN:g} degrees apart or more")
            ratio = (second.pulses - first.pulses) / span
            if ratio <= 0.0:
                raise ValueError("readings must grow in pulses as in degrees")
            if abs(first.degrees - first.pulses / ratio) > ZERO_TOLERANCE:
                raise ValueError("readings must lie on a line through 0 pulses at 0 degrees")
        return self

    def ratio(self) -> float:
        """Return the pulses per degree."""
        if self.per_degree is not None:
            return self.per_degree
        assert self.readings is not None
        first, second = self.readings
        return (second.pulses - first.pulses) / (second.degrees - first.degrees)


class _RatioFile(Document):
    robot: str
    source: str
    axes: Annotated[list[_Axis], Field(min_length=1, max_length=100)]
    # of PL=1 to PL=8
    position_level_zones_mm: Annotated[list[_Zone], Field(min_length=8, max_length=8)] | None = None

    @model_validator(mode="after")
    def _widening(self) -> _RatioFile:
        zones = self.position_level_zones_mm
        if zones is not None and zones != sorted(zones):
            raise ValueError("position_level_zones_mm must not get narrower from level to level")
        return self


def with_ratios(robot: Robot, path: Path) -> Robot:
    """Return a robot that counts, and is limited, as its own controller says.

    The axes of the file are verified then; axes it leaves out stay as they were. Of two limits the
    narrower one holds.

    Raises:
        InputError: If the file is unusable or of another robot.
    """
    file = read(path, _RatioFile)
    if file.robot != robot.name:
        raise InputError(f"{path}: robot", f"must be {robot.name!r}, got {file.robot!r}")
    names = [axis.name for axis in file.axes]
    for place, name in enumerate(names):
        where = f"{path}: axes.{place}.name"
        if name not in robot.joint_names:
            known = ", ".join(robot.joint_names)
            raise InputError(where, f"no such joint {name!r}; have: {known}")
        if name in names[:place]:
            raise InputError(where, f"joint {name} is given twice")
    ratios, lower, upper = (
        np.array(value) for value in (robot.pulses_per_radian, robot.lower, robot.upper)
    )
    for axis in file.axes:
        joint = robot.joint_names.index(axis.name)
        ratios[joint] = np.rad2deg(axis.ratio())
        if axis.lower_pulses is not None:
            lower[joint] = max(lower[joint], axis.lower_pulses / ratios[joint])
        if axis.upper_pulses is not None:
            upper[joint] = min(upper[joint], axis.upper_pulses / ratios[joint])
        if lower[joint] >= upper[joint]:
            raise InputError(str(path), f"joint {axis.name}: no range is left between the limits")
    unverified = tuple(name for name in robot.unverified_pulses if name not in names)
    zones = file.position_level_zones_mm
    return replace(
        robot,
        pulses_per_radian=ratios,
        lower=lower,
        upper=upper,
        unverified_pulses=unverified,
        position_level_zones=None if zones is None else tuple(zone * 1e-3 for zone in zones),
    )


@dataclass(frozen=True)
class ImportedRatios:
    """What came of an import.

    Attributes:
        file: What was written; a job names it as ``program.pulse_ratios``.
        group: Number of the group of axes that was taken.
        pulses_per_degree: By joint name.
        zones: Of the position levels PL=1 to PL=8 in [m], None where the parameters do not say.
        compared: What was compared with the robot and agrees, one line each.
    """

    file: Path
    group: int
    pulses_per_degree: Mapping[str, float]
    zones: tuple[float, ...] | None
    compared: tuple[str, ...]


def import_pulse_ratios(
    parameter_file: Path, robot: Robot, file: Path, group: int | None = None
) -> ImportedRatios:
    """Make a file of pulse ratios, soft limits and corner zones from a controller's parameters.

    Args:
        parameter_file: RC.PRM or ALL.PRM; only the latter has the zones.
        robot: Whose parameters are taken.
        file: What is written.
        group: Number of the robot's group of axes, None for the only one that can be its.

    Raises:
        InputError: If the one cannot be read, is no such file or contradicts the robot, or the
            other cannot be written.
    """
    text = read_bytes(parameter_file, MOST_PARAMETERS).decode("latin-1")
    source = str(parameter_file)
    parameters, found = choose_group(read_parameters(text, source), robot, group, source)
    write_file(file, ratio_file(robot, parameters, parameter_file.name))
    ratios = dict(zip(robot.joint_names, parameters.pulses_per_degree, strict=True))
    return ImportedRatios(file, parameters.group, ratios, parameters.zones, found.compared)


def ratio_file(robot: Robot, parameters: AxisParameters, source: str) -> str:
    """Return the text of a file with the parameters from a controller's file, the source."""
    axes = zip(
        robot.joint_names,
        parameters.pulses_per_degree,
        parameters.lower,
        parameters.upper,
        strict=True,
    )
    rows = [
        f"  - {{name: {name}, per_degree: {ratio:.6f}, lower_pulses: {low}, upper_pulses: {high}}}"
        for name, ratio, low, high in axes
    ]
    quoted = source.replace("'", "''")
    lines = [
        f"# Pulse ratios and soft limits of one {robot.title}; the section program of a",
        "# job names this file as pulse_ratios.",
        f"robot: {robot.name}",
        f"source: '{quoted}, group {parameters.group}, layout of {parameters.layout}'",
        "axes:",
        *rows,
    ]
    if parameters.zones is not None:
        zones = ", ".join(f"{zone * 1e3:g}" for zone in parameters.zones)
        lines += [
            "# how far a corner may be cut at PL=1 to PL=8",
            f"position_level_zones_mm: [{zones}]",
        ]
    return "\n".join([*lines, ""])
