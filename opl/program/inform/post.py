"""The posts of the Yaskawa controllers: what `opl.program.posts` finds under their names."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime

import numpy as np

from opl.cell.robot import Robot
from opl.errors import InputError
from opl.findings import Finding, Level
from opl.program.controller import ControllerProfile
from opl.program.inform.cartesian import frame_pose, nameable
from opl.program.inform.compare import differences_in_meaning
from opl.program.inform.conditions import (
    TOOLS,
    USER_FRAMES,
    condition_files,
    condition_findings,
)
from opl.program.inform.faults import faults_of, job_faults
from opl.program.inform.job import InformJob
from opl.program.inform.job_layout import VARIABLES
from opl.program.inform.parse import decode, parse, read_jobs, unparse
from opl.program.inform.playback import START, corners, play_jobs
from opl.program.inform.positions import rounded_to_job
from opl.program.inform.render import FILE_SUFFIX, TEMPLATE, render, split_for
from opl.program.inform.sequence import first_job
from opl.program.inform.summary import describe
from opl.program.inform.times import move_times, written_speed
from opl.program.inform.words import ramps
from opl.program.moves import Program
from opl.program.played import Reading
from opl.program.posts import Post, Reader, Written, pass_times
from opl.program.profiles import PROFILES
from opl.program.pulses import require_accepted, require_known
from opl.program.settings import PositionForm, ProgramSettings


def write_jobs(
    program: Program,
    robot: Robot,
    settings: ProgramSettings,
    profile: ControllerProfile,
    date: datetime,
) -> Written:
    """Return the job files of a program: one, or a master and the parts it calls.

    Raises:
        InputError: If a setting of the job is not legal on the controller, the template is
            unusable, or a pulse ratio is neither verified nor accepted.
        UnsafeError: If a configuration is beyond the soft limits.
        OplError: If a pass has more moves than a job can hold, or cannot keep its time.
    """
    if settings.positions is PositionForm.PULSES:
        require_known(robot)
        require_accepted(robot.unverified_pulses, settings.accepted_pulses)
    parts = split_for(program, profile, settings.one_job_per_pass)
    clash = settings.actions.calls & {part.name for part in parts}
    if clash:
        raise InputError("program: call", f"{sorted(clash)[0]} is the name of the program itself")
    T_base_frame = frame_pose(settings)
    files, speeds, times = {}, {}, {}
    for part in parts:
        text = render(part, robot, settings, profile, date)
        files[part.name + FILE_SUFFIX] = text
        job = parse(text)
        written_times = move_times(job, robot, T_base_frame, settings.T_flange_tool)
        for move, line, time in zip(part.moves, job.moves, written_times, strict=True):
            if move.duration is None and move.motion_index in speeds:
                continue  # a part begins where the one before it ended
            speeds[move.motion_index] = written_speed(line).text
            if np.isfinite(time):
                times[move.motion_index] = float(time)
    files |= condition_files(settings, profile)
    return Written(files, speeds, times, pass_times(program, times, profile.name))


def _read(
    files: Mapping[str, bytes], robot: Robot, settings: ProgramSettings, profile: ControllerProfile
) -> Reading:
    """Read the files of a program: the master, all parts it calls, and condition files.

    Raises:
        InputError: If the files are no jobs, not those of one program, or of another robot.
    """
    jobs: dict[str, InformJob] = {}
    conditions = {name: data for name, data in files.items() if name.upper().endswith(".CND")}
    refused = [*condition_findings(conditions, settings, profile)]
    for source, data in files.items():
        if source in conditions:
            continue
        text, _ = decode(data)
        several = read_jobs(text, source)
        for job in several:
            if job.name in jobs:
                raise InputError(source, f"a job {job.name} was given before")
            jobs[job.name] = job
            faults = job_faults(text if len(several) == 1 else unparse(job), profile)
            refused += [Finding(Level.ERROR, "file", source, fault) for fault in faults]
    playback, doubtful = play_jobs(jobs, robot, settings)
    foreign = sorted({name for job in jobs.values() for name in job.calls} - jobs.keys())
    return Reading(first_job(jobs), playback, tuple(foreign), (*refused, *doubtful))


_MOST_FAULTS = 10  # that are listed
_CODE_PAGES = {"cp932": "Shift-JIS", "latin-1": "Latin-1", "utf-8": "UTF-8"}


def describe_file(name: str, content: bytes, robot: Robot) -> list[str]:
    """Say what each job of a file does.

    Raises:
        InputError: If the file holds what is no job.
    """
    text, encoding = decode(content)
    jobs = read_jobs(text, name)
    unsure = ", ".join(robot.unverified_pulses)
    about = f"read as a program of {robot.title}"
    about += f", whose pulse ratios of {unsure} are not verified" if unsure else ""
    lines = [about]
    if encoding in _CODE_PAGES:
        lines.append(f"text in {_CODE_PAGES[encoding]}, found by trial; controllers need ASCII")
    for job in jobs:
        lines += describe(job, robot, _cautions(job, text if len(jobs) == 1 else unparse(job)))
    return lines


def _cautions(job: InformJob, text: str) -> list[str]:
    """Say what is wrong with a job on the controller that finds least wrong with it."""
    least: tuple[str, tuple[str, ...]] | None = None
    for profile in reversed(PROFILES.values()):
        found = faults_of(job, text, profile)
        if not found:  # none finds less
            return []
        if least is None or len(found) < len(least[1]):
            least = profile.name, found
    assert least is not None, "there are controllers"
    name, faults = least
    shown = [f"caution, on {name}: {fault}" for fault in faults[:_MOST_FAULTS]]
    more = len(faults) - len(shown)
    return [*shown, *([f"caution: {more} more of this kind"] if more else [])]


def file_differences(
    first: tuple[str, bytes], second: tuple[str, bytes], robot: Robot
) -> list[str]:
    """Say how two files of jobs differ in meaning.

    Raises:
        InputError: If a file holds what is no job.
    """
    one, other = (read_jobs(decode(content)[0], name) for name, content in (first, second))
    pairs = zip(one, other, strict=False)
    lines = [line for pair in pairs for line in differences_in_meaning(*pair, robot)]
    return lines if len(one) == len(other) else [*lines, f"{len(one)} jobs against {len(other)}"]


def post_of(profile: ControllerProfile) -> Post:
    """Return the post of a controller."""
    reader = Reader(
        FILE_SUFFIX,
        lambda files, robot, settings: _read(files, robot, settings, profile),
        lambda q, robot, settings: rounded_to_job(q, robot, settings, profile),
        lambda robot: START,
        lambda settings, robot: corners(settings, robot, profile),
        describe_file,
        file_differences,
        lambda q, robot, settings, margin: (
            np.ones(len(q), dtype=bool)
            if settings.positions is PositionForm.PULSES
            else nameable(q, robot, margin)
        ),
        (USER_FRAMES, TOOLS),
        lambda kind, settings: ramps(kind, settings).strip(),
    )
    return Post(
        f"Yaskawa {profile.name} (INFORM)",
        lambda program, robot, settings, date: write_jobs(program, robot, settings, profile, date),
        TEMPLATE,
        VARIABLES,
        counts_pulses=True,
        reader=reader,
        # DX200: the interface page of a simulator; assumed for the other generations
        period=0.004,
    )


NX100, DX100, DX200, YRC1000 = (
    post_of(PROFILES[name]) for name in ("NX100", "DX100", "DX200", "YRC1000")
)
