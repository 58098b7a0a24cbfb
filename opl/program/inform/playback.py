"""What a Yaskawa controller does with jobs: the moves they are, as every language gives them."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from opl.cell.robot import SAME_CONFIGURATION, Robot
from opl.errors import InputError
from opl.findings import Finding
from opl.geometry.frames import Array
from opl.program.controller import ControllerProfile
from opl.program.events import Event
from opl.program.inform.heads import head_findings
from opl.program.inform.job import InformJob
from opl.program.inform.sequence import Doing, Visit, first_job, visits
from opl.program.inform.times import job_configurations, written_speed
from opl.program.inform.words import STOP_LEVEL, radius_tag
from opl.program.moves import START_SPEED
from opl.program.played import (
    Corner,
    Corners,
    Playback,
    ReadMove,
    SpeedUnit,
    WrittenSpeed,
    other_tools,
    play,
)
from opl.program.pulses import PulseScale
from opl.program.settings import ProgramSettings

# The fastest first move of a job.
START = WrittenSpeed(SpeedUnit.TOP_SPEED, START_SPEED, f"VJ={100.0 * START_SPEED:.2f}")


def play_jobs(
    jobs: Mapping[str, InformJob],
    robot: Robot,
    settings: ProgramSettings,
) -> tuple[Playback | None, list[Finding]]:
    """Return what a controller does with jobs, and what is in doubt; None if something is.

    Raises:
        InputError: If the jobs are not those of one program, or of another robot.
    """
    order, found = visits(jobs, first_job(jobs), settings.actions.calls)
    targets = {}
    for name, job in jobs.items():
        _require_robot(job, robot)
        found += head_findings(job, settings)
        targets[name] = _targets(job, robot, settings)
    half_pulse = 0.5 / PulseScale.of(robot).pulses_per_radian
    resolution = np.where(np.isnan(half_pulse), SAME_CONFIGURATION, half_pulse)
    moves: list[ReadMove] = []
    events = []
    before = None
    for one in order:
        if isinstance(one, Doing):
            events.append(Event(len(moves) - 1, one.text, one.place, one.waits))
            continue
        target = targets[one.job.name][one.position]
        moves.append(_move(one, target, resolution, one.job is not before, robot))
        before = one.job
    found += other_tools(moves, str(settings.tool))
    playback, doubtful = play(moves, events, robot, settings.led)
    if not found:
        return playback, doubtful
    return None, [*found, *(doubtful if moves else [])]


def corners(settings: ProgramSettings, robot: Robot, profile: ControllerProfile) -> Corners:
    """Return the position levels and corner radii a job allows."""
    levels = (STOP_LEVEL, settings.levels.on_wheel, settings.levels.lead, settings.levels.air)
    stop, on_wheel, lead, air = (
        _corner(None if level is None else str(level), None, robot) for level in levels
    )
    tags = {kind: radius_tag(kind, settings, profile) for kind in settings.corner_radii}
    radii = {kind: tag.removeprefix("CR=") for kind, tag in tags.items() if tag is not None}
    straight = {kind: _corner(None, radius, robot) for kind, radius in radii.items()}
    return Corners(stop, on_wheel, lead, air, straight)


def _corner(level: str | None, radius: str | None, robot: Robot) -> Corner:
    """Return what PL or CR allow; without either it is the controller's affair."""
    if radius is not None:
        length = float(radius) if re.fullmatch(r"[0-9]{1,9}(\.[0-9]{1,9})?", radius) else np.inf
        return Corner(length, f"CR={radius}", 1e-3 * length, arc=True)
    if level is None or not level.isdecimal():
        return Corner(np.inf, "no PL" if level is None else f"PL={level}")
    zones, number = robot.position_level_zones, int(level)
    known = zones is not None and number <= len(zones)
    reach = zones[number - 1] if zones is not None and known and number else np.inf
    return Corner(float(number), f"PL={level}", reach)


def _move(visit: Visit, target: Array, resolution: Array, starts: bool, robot: Robot) -> ReadMove:
    step = visit.step
    return ReadMove(
        target=target,
        straight=step.word == "MOVL",
        speed=written_speed(step),
        corner=_corner(step.tag("PL"), step.tag("CR"), robot),
        tool=str(_tool(visit)),
        place=_place(visit),
        resolution=resolution,
        starts=starts,
        ramps=" ".join(f"{name}={value}" for name, value in step.tags if name in ("ACC", "DEC")),
    )


def _targets(job: InformJob, robot: Robot, settings: ProgramSettings) -> Array:
    """Return the configuration of each position, NaN where the file or the job leave it open."""
    q = job_configurations(job, robot, np.eye(4), settings.T_flange_tool)
    frame = settings.user_frame
    in_frame = None
    for k, position in enumerate(job.positions):
        if position.coordinates == "PULSE":
            continue
        if position.frame == "USER" and frame is not None and position.user == frame.number:
            if in_frame is None:
                in_frame = job_configurations(job, robot, frame.T_base_user, settings.T_flange_tool)
            q[k] = in_frame[k]
        elif position.frame not in ("BASE", "ROBOT"):
            q[k] = np.nan
        if position.tool != settings.tool:
            q[k] = np.nan
    return q


def _require_robot(job: InformJob, robot: Robot) -> None:
    """Refuse jobs that can only be those of another robot."""
    groups = [h.value for h in job.headers if h.key.startswith("///GROUP")]
    if groups not in ([], ["RB1"]):
        raise InputError(job.name, f"moves {', '.join(groups)}; opl knows programs of RB1 alone")
    for position in job.positions:
        if position.kind == "C" and len(position.values) != len(robot.joint_names):
            raise InputError(
                f"{job.name} line {position.line}",
                f"{len(position.values)} values; {robot.title} has {len(robot.joint_names)} joints",
            )


def _tool(visit: Visit) -> int | None:
    return visit.job.positions[visit.position].tool


def _place(visit: Visit) -> str:
    return f"{visit.place}, {visit.job.positions[visit.position].label}"
