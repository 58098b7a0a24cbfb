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
from opl.program.played import Playback
from opl.program.posts import PASS_TIME_TOLERANCE, Reader
from opl.program.speeds import MOST_CORRECTION
from opl.program.stops import ON_WHEEL, ends_of_stretches
from opl.verification.place import where

# Fastest that one move may be, as a multiple of the requested speed. On the wheel a move makes up
# for the rounding of those before it; elsewhere only its own last digit counts. Where a language
# has whole percents only (`ReadMove.last_digit`), one of them comes on top.
MOST_ON_WHEEL = 1.1 * MOST_CORRECTION
MOST_ELSEWHERE = 1.05
HOME_SLACK = 1e-4  # [rad] that the ends may be from home: a pulse or two
ROUND_OFF = 1e-9  # of a number that was read from a file, as a fraction


def written_findings(
    job: Job, points: CutterPoints, motion: Motion, playback: Playback, reader: Reader
) -> list[Finding]:
    """Return what is wrong with speeds, stops, and the postures at both ends.

    Args:
        job: What is asked for.
        points: Its cutter points.
        motion: The written configurations with their labels and written times, one for each move.
        playback: The moves they are from.
        reader: Of the language they are written in.
    """
    requested = timed(motion, points, job.pace, job.cell.robot)
    return [
        *_first_moves(job, playback, reader),
        *_fast_moves(motion, requested, playback),
        *_pass_times(motion, requested),
        *_rounded_ends(job, motion, playback, reader),
        *_waits_on_wheel(motion, playback),
        *_ends_away_from_home(job, motion),
    ]


def _first_moves(job: Job, playback: Playback, reader: Reader) -> Iterator[Finding]:
    """Look at the moves that a program begins with: nobody knows from where they start."""
    limit = reader.start(job.cell.robot)
    for move in playback.moves:
        speed = move.speed
        slow = speed.unit is limit.unit and speed.value <= limit.value * (1.0 + ROUND_OFF)
        if move.starts and not slow:
            message = f"a program begins with {limit.text} at most, got {speed.text}"
            yield _error("speed", move.place, message)


def _fast_moves(motion: Motion, requested: Motion, playback: Playback) -> Iterator[Finding]:
    for k in range(1, len(motion)):
        ground, move = _ground(motion, k), playback.moves[k]
        most = MOST_ON_WHEEL if ground else MOST_ELSEWHERE
        # as if it were one last digit slower: the slowest that the language knows is never too fast
        if motion.duration[k] * most >= requested.duration[k] * (1.0 - move.last_digit):
            continue
        factor = requested.duration[k] / max(float(motion.duration[k]), 1e-9)
        speed = "the feed" if ground else "the speed"
        place = f"{where(motion, k)} ({move.place})"
        yield _error("speed", place, f"{factor:.1f} times {speed} that the job asks for")


def _pass_times(motion: Motion, requested: Motion) -> Iterator[Finding]:
    ground = np.array([_ground(motion, k) for k in range(len(motion))])
    for index in np.unique(motion.pass_index[ground]):
        moves = ground & (motion.pass_index == index)
        wanted, written = requested.duration[moves].sum(), motion.duration[moves].sum()
        if abs(written - wanted) > PASS_TIME_TOLERANCE * wanted:
            message = f"takes {written:.2f} s, {wanted:.2f} s at the feed that the job asks for"
            yield _error("speed", f"pass {index + 1}", message)


def _rounded_ends(
    job: Job, motion: Motion, playback: Playback, reader: Reader
) -> Iterator[Finding]:
    """Look at how far corners may be rounded; the proof goes through them."""
    corners = reader.corners(job.program)
    on_wheel = [stretch in ON_WHEEL for stretch in motion.stretch]
    stops = ends_of_stretches(motion)
    for k, move in enumerate(playback.moves):
        lead = motion.stretch[k] in (Stretch.APPROACH, Stretch.RETRACT)
        touching_down = on_wheel[k] and not _ground(motion, k)
        limit = corners.on_wheel if on_wheel[k] else corners.lead if lead else corners.air
        if stops[k] or touching_down:
            limit = corners.stop
        if move.corner.size > limit.size * (1.0 + ROUND_OFF):
            message = f"must be {limit.text} at most, got {move.corner.text}"
            yield _error("level", f"{where(motion, k)} ({move.place})", message)


def _waits_on_wheel(motion: Motion, playback: Playback) -> Iterator[Finding]:
    """Look for places where the program lets the robot stand still while the belt grinds."""
    for k, move in enumerate(playback.moves):
        if move.waits and motion.stretch[k] in ON_WHEEL:
            message = f"stands still on the wheel: {', '.join(move.waits)}"
            yield _error("wait", f"{where(motion, k)} ({move.place})", message)


def _ends_away_from_home(job: Job, motion: Motion) -> Iterator[Finding]:
    names = job.cell.robot.joint_names
    for posture, place in ((0, "way from home"), (len(motion) - 1, "way home")):
        away: Array = np.abs(motion.q[posture] - job.pace.home)
        if away.max() > HOME_SLACK:
            joint = int(away.argmax())
            message = f"{np.rad2deg(away[joint]):.3f} deg from home"
            yield _error("home", place, f"joint {names[joint]}: {message}")


def _ground(motion: Motion, move: int) -> bool:
    """Return whether a whole move is on the wheel, in one pass."""
    return (
        move > 0
        and motion.stretch[move] in ON_WHEEL
        and motion.stretch[move - 1] in ON_WHEEL
        and motion.pass_index[move] == motion.pass_index[move - 1]
    )


def _error(kind: str, place: str, message: str) -> Finding:
    return Finding(Level.ERROR, kind, place, message)
