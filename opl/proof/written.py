"""Speeds, stops and ends of a written program against what its job asks for."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from opl.findings import Finding, Level
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.job.load import Job
from opl.motion.motion import Motion, Phase, TimedMotion
from opl.motion.timing import time_motion
from opl.program.inform.playback import Playback
from opl.program.moves import START_SPEED, Kind
from opl.program.posts import PASS_TIME_TOLERANCE
from opl.program.speeds import MOST_CORRECTION

# Fastest that one move may be, as a multiple of the speed asked for. On the wheel a move makes up
# for the rounding of those before it; elsewhere only its own last digit counts.
MOST_ON_WHEEL = 1.1 * MOST_CORRECTION
MOST_ELSEWHERE = 1.05
HOME_SLACK = 1e-4  # [rad] that the ends may be from home: a pulse or two


def written_findings(
    job: Job, points: CutterPoints, written: TimedMotion, playback: Playback
) -> list[Finding]:
    """Return what is wrong with speeds, stops, and the postures at both ends.

    Args:
        job: What is asked for.
        points: Its cutter points.
        written: The written configurations with their labels and written times; one for each
            visit.
        playback: The moves they are from.
    """
    motion = written.motion
    requested = time_motion(motion, points, job.process, job.cell.robot).timed
    return [
        *_first_moves(playback),
        *_fast_moves(written, requested, playback),
        *_pass_times(written, requested),
        *_rounded_ends(job, motion, playback),
        *_ends_away_from_home(job, motion),
    ]


def _first_moves(playback: Playback) -> Iterator[Finding]:
    """Look at the moves that a job begins with: nobody knows from where they start."""
    before = None
    for visit in playback.visits:
        speed = float(visit.step.tag("VJ") or "inf")
        if visit.job is not before and speed > 100.0 * START_SPEED:
            told = f"a job begins with VJ={100.0 * START_SPEED:.2f} at most, got VJ={speed:g}"
            yield _error("speed", visit.place, told)
        before = visit.job


def _fast_moves(
    written: TimedMotion, requested: TimedMotion, playback: Playback
) -> Iterator[Finding]:
    motion = written.motion
    grinding = motion.grinding
    for k in range(1, len(motion)):
        ground = grinding[k]
        most = MOST_ON_WHEEL if ground else MOST_ELSEWHERE
        if written.duration[k] * most >= requested.duration[k]:
            continue
        factor = requested.duration[k] / max(float(written.duration[k]), 1e-9)
        speed = "the feed" if ground else "the speed"
        place = f"{motion.place(k)} ({playback.visits[k].place})"
        yield _error("speed", place, f"{factor:.1f} times {speed} that the job asks for")


def _pass_times(written: TimedMotion, requested: TimedMotion) -> Iterator[Finding]:
    for phase, moves in written.motion.runs():
        if phase is not Phase.GRINDING:
            continue
        wanted, takes = requested.duration[moves].sum(), written.duration[moves].sum()
        if abs(takes - wanted) > PASS_TIME_TOLERANCE * wanted:
            told = f"takes {takes:.2f} s, {wanted:.2f} s at the feed that the job asks for"
            yield _error("speed", f"pass {written.motion.pass_index[moves[0]] + 1}", told)


def _rounded_ends(job: Job, motion: Motion, playback: Playback) -> Iterator[Finding]:
    """Look at how far corners may be rounded; the proof goes through them."""
    stops = motion.ends_phase
    for k, visit in enumerate(playback.visits):
        allowed = 0 if stops[k] else job.program.levels.of(Kind.of(motion.phase[k])) or 0
        level = visit.step.tag("PL")
        if level is None or not level.isdecimal() or int(level) > allowed:
            got = "none" if level is None else f"PL={level}"
            told = f"must be PL={allowed} at most, got {got}"
            yield _error("level", f"{motion.place(k)} ({visit.place})", told)


def _ends_away_from_home(job: Job, motion: Motion) -> Iterator[Finding]:
    names = job.cell.robot.joint_names
    for posture, place in ((0, "way from home"), (len(motion) - 1, "way home")):
        away: Array = np.abs(motion.q[posture] - job.process.home)
        if away.max() > HOME_SLACK:
            joint = int(away.argmax())
            told = f"{np.rad2deg(away[joint]):.3f} deg from home"
            yield _error("home", place, f"joint {names[joint]}: {told}")


def _error(kind: str, place: str, told: str) -> Finding:
    return Finding(Level.ERROR, kind, place, told)
