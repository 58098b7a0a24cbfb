"""Writing INFORM jobs. Every job is read back before it is returned.

Pulse jobs need no option, no user frame and no RCONF, and leave the controller no
choice between configurations. Cartesian ones need the controller's function for relative jobs.
"""

from __future__ import annotations

import textwrap
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from opl.cell.robot import Robot
from opl.errors import InputError, SettingError
from opl.files import resources
from opl.program.controller import ControllerProfile
from opl.program.inform.conditions import frame_comments
from opl.program.inform.faults import job_faults
from opl.program.inform.heads import attributes, frame
from opl.program.inform.job_layout import JobLayout, JobStep, differences
from opl.program.inform.parse import parse
from opl.program.inform.positions import write_positions, write_speeds
from opl.program.inform.words import (
    ACTIONS,
    corner,
    radius_tag,
    ramps,
    require_accepted_action,
)
from opl.program.layout import fill
from opl.program.moves import Program
from opl.program.settings import PositionForm, ProgramSettings
from opl.program.split import short_name, split

FILE_SUFFIX = ".JBI"
TEMPLATE = resources.folder("templates") / "inform" / "job.jbi.j2"

# Of a template that goes wrong on every line, a few faults tell as much as all.
_FAULTS_SHOWN = 10


def split_for(
    program: Program, profile: ControllerProfile, by_pass: bool = False
) -> tuple[Program, ...]:
    """Return the jobs of a program, their names legal: one, or a master and the parts it calls.

    Raises:
        InputError: If the name is not of legal characters.
        OplError: If a pass has more moves than a job can hold.
    """
    program = replace(program, name=short_name(program.name, profile.name_length))
    return split(program, profile.step_limit, profile.name_length, by_pass)


def render(
    part: Program,
    robot: Robot,
    settings: ProgramSettings,
    profile: ControllerProfile,
    date: datetime,
) -> str:
    """Return one job, line ends CR LF, all ASCII; the same arguments give the same bytes.

    The part is no longer than a job can be.

    Raises:
        InputError: If the name, a number or a comment is not legal on the controller, or the
            template does not give a job that says what the program says.
        UnsafeError: If a configuration is beyond the soft limits.
    """
    layout = _layout(part, robot, settings, profile, date)
    _require_legal(layout, settings, profile)
    template: Path = settings.template or TEMPLATE
    text = fill(template, layout.values()).replace("\n", "\r\n")
    faults = job_faults(text, profile) or tuple(differences(parse(text), layout))
    if faults:
        shown = [*faults[:_FAULTS_SHOWN], *(["..."] if len(faults) > _FAULTS_SHOWN else [])]
        raise InputError(str(template), "\n".join(["does not give the job it should:", *shown]))
    return text


def _layout(
    part: Program,
    robot: Robot,
    settings: ProgramSettings,
    profile: ControllerProfile,
    date: datetime,
) -> JobLayout:
    form, user_frame = settings.positions, settings.user_frame
    in_user_frame = form is PositionForm.USER and user_frame is not None
    user = str(user_frame.number) if in_user_frame and user_frame is not None else None
    pulses = form is PositionForm.PULSES
    postype = "PULSE" if pulses else form.value.upper()
    notes = _ratio_notes(robot, profile.comment_length) if pulses else []
    notes += frame_comments(settings, profile)
    return JobLayout(
        name=part.name,
        tool=str(settings.tool),
        user=user,
        postype=postype,
        coordinates="PULSE" if pulses else "RECTAN",
        attributes=attributes(settings, bool(part.moves)),
        frame=frame(settings, bool(part.moves)),
        date=f"{date:%Y/%m/%d %H:%M}",
        title=settings.title,
        comments=(*part.comments, *notes),
        steps=_steps(part, robot, settings, profile),
        calls=part.calls,
    )


def _steps(
    part: Program, robot: Robot, settings: ProgramSettings, profile: ControllerProfile
) -> tuple[JobStep, ...]:
    positions = write_positions(part, robot, settings, profile)
    speeds = write_speeds(part, positions.q, robot, settings.T_flange_tool, profile)
    for move in part.moves:
        for action in move.actions:
            require_accepted_action(action, profile)
    actions = ACTIONS.lines(move.actions for move in part.moves)
    rconfs = [None, *positions.rconfs]
    return tuple(
        JobStep(
            label=f"C{number:0{profile.label_digits}d}",
            values=positions.values[number],
            rconf=rconfs[number + 1] if rconfs[number + 1] != rconfs[number] else None,
            word=speeds[number][0],
            speed=speeds[number][1],
            corner=corner(move, speeds[number][0] == "MOVL", settings, profile),
            ramps=ramps(move.kind, settings),
            comment=move.comment,
            actions=actions[number],
        )
        for number, move in enumerate(part.moves)
    )


def _ratio_notes(robot: Robot, width: int) -> list[str]:
    """Return the comment lines that warn of ratios nobody has confirmed."""
    if not robot.unverified_pulses:
        return []
    return textwrap.wrap(f"PULSE RATIO NOT VERIFIED: {' '.join(robot.unverified_pulses)}", width)


def _require_legal(
    layout: JobLayout, settings: ProgramSettings, profile: ControllerProfile
) -> None:
    """Refuse what no template can make legal, before one gets the blame."""
    if not 0 <= settings.tool <= profile.highest_tool:
        raise SettingError("tool", f"must be 0 to {profile.highest_tool}, got {settings.tool}")
    frame = settings.user_frame
    if frame is not None and not 1 <= frame.number <= profile.highest_user_frame:
        allowed = f"1 to {profile.highest_user_frame}"
        raise SettingError("user_frame", f"must be {allowed}, got {frame.number}")
    for kind in settings.corner_radii:
        radius_tag(kind, settings, profile)
    for name in (layout.name, *layout.calls):
        if fault := profile.name_fault(name):
            raise InputError("program name", fault)
    for comment in (*layout.all_comments, *([layout.title] if layout.title else [])):
        if fault := profile.comment_fault(comment):
            raise InputError("program comment", fault)
