"""Speeds, stops, events and ends of a written program against those of its job."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from opl.cell.robot import SAME_CONFIGURATION
from opl.findings import Finding, Level
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.job.values import Job
from opl.motion.motion import Motion, TimedMotion
from opl.motion.timing import time_motion
from opl.program.moves import Purpose
from opl.program.played import Playback
from opl.program.posts import Reader
from opl.program.settings import PositionForm
from opl.proof.events import event_findings
from opl.proof.speeds import pass_findings, speed_findings

HOME_SLACK = 1e-4  # [rad] that the ends may be from home: a pulse or two
CARRIED_HOME = np.deg2rad(5.0)  # the same where a user frame that is touched up takes home along
ROUND_OFF = 1e-9  # of a number that was read from a file, as a fraction


def written_findings(
    job: Job, points: CutterPoints, motion: Motion, playback: Playback, reader: Reader
) -> list[Finding]:
    """Return what is wrong with speeds, stops, events, and the configurations at both ends.

    Args:
        job: What is requested.
        points: Its cutter points.
        motion: What the program does, with its meaning, and where a move of it ends.
        playback: The moves.
        reader: Of the language they are written in.
    """
    requested = time_motion(motion, points, job.process, job.cell.robot)
    motion = requested.timed.motion
    at = np.cumsum(playback.duration)[playback.stations]
    written = TimedMotion(motion, np.diff(at, prepend=0.0))
    return [
        *_first_moves(job, playback, reader),
        *speed_findings(written, requested, playback, job.process.feed),
        *pass_findings(written, points, job.process.feed),
        *_rounded_ends(job, motion, playback, reader),
        *_ramps(job, motion, playback, reader),
        *event_findings(job, motion, playback),
        *_ends_away_from_home(job, motion, reader),
    ]


def _first_moves(job: Job, playback: Playback, reader: Reader) -> Iterator[Finding]:
    """Look at the moves that a program begins with: nobody knows from where they start."""
    limit = reader.start(job.cell.robot)
    places = playback.q[playback.stations]
    for move, place in zip(playback.moves, places, strict=True):
        away = np.abs(place - places[0]).max()
        if move.starts and job.program.one_job_per_pass and away > SAME_CONFIGURATION:
            message = f"{np.rad2deg(away):.3f} deg from home, so no pass could be left out"
            yield _error("home", move.place, message)
        speed = move.speed
        slow = speed.unit is limit.unit and speed.value <= limit.value * (1.0 + ROUND_OFF)
        if move.starts and not slow:
            message = f"a program begins with {limit.text} at most, got {speed.text}"
            yield _error("speed", move.place, message)


def _rounded_ends(
    job: Job, motion: Motion, playback: Playback, reader: Reader
) -> Iterator[Finding]:
    """Look at how far corners may be rounded, and for stops on the wheel: the belt digs in."""
    corners, stops = (
        reader.corners(job.program, job.cell.robot),
        motion.ends_phase & ~motion.on_wheel,
    )
    for k, move in enumerate(playback.moves):
        own = corners.of(Purpose.of(motion.phase[k]), move.straight)
        limit = corners.stop if stops[k] else own
        runs_on = not corners.of(Purpose.WHEEL, move.straight).exact_stop
        if not move.corner.within(limit, ROUND_OFF):
            message = f"must be {limit.text} at most, got {move.corner.text}"
            yield _error("level", f"{motion.place(k)} ({move.place})", message)
        if move.corner.exact_stop and runs_on and motion.on_wheel[k]:
            message = f"stops on the wheel: {move.corner.text}"
            yield _error("level", f"{motion.place(k)} ({move.place})", message)


def _ramps(job: Job, motion: Motion, playback: Playback, reader: Reader) -> Iterator[Finding]:
    """Look at how the moves speed up and slow down."""
    for k, move in enumerate(playback.moves):
        wanted = reader.ramps(Purpose.of(motion.phase[k]), job.program)
        if move.ramps != wanted:
            message = f"must have {wanted or 'no ramps of its own'}, has {move.ramps or 'none'}"
            yield _error("ramp", f"{motion.place(k)} ({move.place})", message)


def _ends_away_from_home(job: Job, motion: Motion, reader: Reader) -> Iterator[Finding]:
    names = job.cell.robot.joint_names
    (home,) = reader.rounded(job.process.home[None], job.cell.robot, job.program)
    # a user frame that was touched up takes home along
    carried = job.program.positions is PositionForm.USER
    slack = CARRIED_HOME if carried else HOME_SLACK
    for configuration, place in (
        (0, "free move from home"),
        (len(motion) - 1, "free move to home"),
    ):
        away: Array = np.abs(motion.q[configuration] - home)
        if away.max() > slack:
            joint = int(away.argmax())
            message = f"{np.rad2deg(away[joint]):.3f} deg from home"
            yield _error("home", place, f"joint {names[joint]}: {message}")


def _error(kind: str, place: str, message: str) -> Finding:
    return Finding(Level.ERROR, kind, place, message)
