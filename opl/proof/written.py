"""Speeds, stops and ends of a written program against what its job asks for."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from opl.findings import Finding, Level
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.job.load import Job
from opl.motion.motion import Motion, Stretch
from opl.motion.timing import timed
from opl.program.inform.playback import Playback
from opl.program.moves import START_SPEED
from opl.program.posts import PASS_TIME_TOLERANCE
from opl.program.speeds import MOST_CORRECTION
from opl.program.stops import ON_WHEEL, ends_of_stretches
from opl.verification.place import where

# Fastest that one move may be, as a multiple of the speed asked for. On the wheel a move makes up
# for the rounding of those before it; elsewhere only its own last digit counts.
MOST_ON_WHEEL = 1.1 * MOST_CORRECTION
MOST_ELSEWHERE = 1.05
HOME_SLACK = 1e-4  # [rad] that the ends may be from home: a pulse or two


def written_findings(
    job: Job, points: CutterPoints, motion: Motion, playback: Playback
) -> list[Finding]:
    """Return what is wrong with speeds, stops, and the postures at both ends.

    Args:
        job: What is asked for.
        points: Its cutter points.
        motion: The written postures with their labels and written times; one for each visit.
        playback: The moves they are from.
    """
    asked = timed(motion, points, job.process, job.cell.robot)
    return [
        *_first_moves(playback),
        *_fast_moves(motion, asked, playback),
        *_pass_times(motion, asked),
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


def _fast_moves(motion: Motion, asked: Motion, playback: Playback) -> Iterator[Finding]:
    for k in range(1, len(motion)):
        ground = _ground(motion, k)
        most = MOST_ON_WHEEL if ground else MOST_ELSEWHERE
        if motion.duration[k] * most >= asked.duration[k]:
            continue
        factor = asked.duration[k] / max(float(motion.duration[k]), 1e-9)
        speed = "the feed" if ground else "the speed"
        place = f"{where(motion, k)} ({playback.visits[k].place})"
        yield _error("speed", place, f"{factor:.1f} times {speed} that the job asks for")


def _pass_times(motion: Motion, asked: Motion) -> Iterator[Finding]:
    ground = np.array([_ground(motion, k) for k in range(len(motion))])
    for index in np.unique(motion.pass_index[ground]):
        moves = ground & (motion.pass_index == index)
        wanted, written = asked.duration[moves].sum(), motion.duration[moves].sum()
        if abs(written - wanted) > PASS_TIME_TOLERANCE * wanted:
            told = f"takes {written:.2f} s, {wanted:.2f} s at the feed that the job asks for"
            yield _error("speed", f"pass {index + 1}", told)


def _rounded_ends(job: Job, motion: Motion, playback: Playback) -> Iterator[Finding]:
    """Look at how far corners may be rounded; the proof goes through them."""
    levels = job.program.levels
    on_wheel = [stretch in ON_WHEEL for stretch in motion.stretch]
    stops = ends_of_stretches(motion)
    for k, visit in enumerate(playback.visits):
        lead = motion.stretch[k] in (Stretch.APPROACH, Stretch.RETRACT)
        touching_down = on_wheel[k] and not _ground(motion, k)
        allowed = levels.on_wheel if on_wheel[k] else levels.lead if lead else levels.air
        if stops[k] or touching_down:
            allowed = 0
        level = visit.step.tag("PL")
        if level is None or not level.isdecimal() or int(level) > (allowed or 0):
            got = "none" if level is None else f"PL={level}"
            told = f"must be PL={allowed or 0} at most, got {got}"
            yield _error("level", f"{where(motion, k)} ({visit.place})", told)


def _ends_away_from_home(job: Job, motion: Motion) -> Iterator[Finding]:
    names = job.cell.robot.joint_names
    for posture, place in ((0, "way from home"), (len(motion) - 1, "way home")):
        away: Array = np.abs(motion.q[posture] - job.process.home)
        if away.max() > HOME_SLACK:
            joint = int(away.argmax())
            told = f"{np.rad2deg(away[joint]):.3f} deg from home"
            yield _error("home", place, f"joint {names[joint]}: {told}")


def _ground(motion: Motion, move: int) -> bool:
    """Return whether a whole move is on the wheel, in one pass."""
    return (
        move > 0
        and motion.stretch[move] in ON_WHEEL
        and motion.stretch[move - 1] in ON_WHEEL
        and motion.pass_index[move] == motion.pass_index[move - 1]
    )


def _error(kind: str, place: str, told: str) -> Finding:
    return Finding(Level.ERROR, kind, place, told)
