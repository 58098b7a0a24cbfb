"""What a Yaskawa controller does with jobs: the moves they are, as every language gives them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from opl.cell.robot import Robot
from opl.errors import InputError
from opl.findings import Finding, Level
from opl.geometry.frames import Array
from opl.program.inform.job import InformJob
from opl.program.inform.sequence import Visit, first_job, visits
from opl.program.inform.times import job_configurations, written_speed
from opl.program.moves import SAME_CONFIGURATION, START_SPEED
from opl.program.played import Corner, Corners, Playback, ReadMove, SpeedUnit, WrittenSpeed, play
from opl.program.pulses import PulseScale
from opl.program.settings import ProgramSettings

# The fastest first move of a job.
START = WrittenSpeed(SpeedUnit.TOP_SPEED, START_SPEED, f"VJ={100.0 * START_SPEED:.2f}")
# Instructions at which the robot stands still.
_WAITS = ("TIMER", "WAIT", "PAUSE", "CALL")


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
    targets, waits = {}, {}
    for name, job in jobs.items():
        _require_robot(job, robot)
        targets[name] = _targets(job, robot, settings)
        waits[name] = _waits(job)
    half_pulse = 0.5 / PulseScale.of(robot).pulses_per_radian
    resolution = np.where(np.isnan(half_pulse), SAME_CONFIGURATION, half_pulse)
    moves = []
    before = None
    for visit in order:
        if visit.step.word == "MOVL" and _tool(visit) != settings.tool:
            message = f"moves tool {_tool(visit)} straight; the job knows tool {settings.tool} only"
            found.append(Finding(Level.ERROR, "program", _place(visit), message))
        moves.append(
            _move(
                visit,
                targets[visit.job.name][visit.position],
                resolution,
                visit.job is not before,
                waits[visit.job.name].get(visit.step.line, ()),
            )
        )
        before = visit.job
    playback, doubtful = play(moves, robot, settings.T_flange_tool)
    if not found:
        return playback, doubtful
    return None, [*found, *(doubtful if moves else [])]


def corners(settings: ProgramSettings) -> Corners:
    """Return the position levels a job allows."""
    levels = (0, settings.levels.on_wheel, settings.levels.lead, settings.levels.air)
    return Corners(*(Corner(float(level or 0), f"PL={level or 0}") for level in levels))


def _move(
    visit: Visit, target: Array, resolution: Array, starts: bool, waits: tuple[str, ...]
) -> ReadMove:
    step = visit.step
    level = step.tag("PL")
    size = float(level) if level is not None and level.isdecimal() else np.inf
    return ReadMove(
        target=target,
        straight=step.word == "MOVL",
        speed=written_speed(step),
        corner=Corner(size, "none" if level is None else f"PL={level}"),
        tool=str(_tool(visit)),
        place=_place(visit),
        resolution=resolution,
        starts=starts,
        waits=waits,
    )


def _waits(job: InformJob) -> dict[int, tuple[str, ...]]:
    """Return the instructions at which the robot stands still, by the line of the move before."""
    found: dict[int, tuple[str, ...]] = {}
    line = 0
    for step in job.instructions:
        if step.moves:
            line = step.line
        elif step.word in _WAITS and not step.disabled:
            found[line] = (*found.get(line, ()), job.lines[step.line - 1].strip())
    return found


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
