"""Speeds of a written program, move by move, against those that its job asks for.

A controller takes speeds of few digits, so a move on the wheel may make up for what rounding did to
those before it (`opl.program.speeds`). And where a configuration grinds between two cutter points
is recognised to a fraction of a millimetre only. So the feed is held against the ground point's
lead over where it would be at the feed: moves that were slow use it up, and at a cutter point,
which is recognised exactly, nothing but the last digit of a speed may be left of it. Where joints,
the contact's way over the wheel or slow neighbours allow less, the time that moves save is counted
in the same way: the ratio of two times says nothing of a move as short as places are uncertain.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from opl.cell.robot import SAME_CONFIGURATION
from opl.findings import Finding, Level
from opl.geometry.toolpath import CutterPoints
from opl.job import keys
from opl.motion.motion import Motion, MoveKind, Phase, TimedMotion
from opl.motion.repeats import short_passes
from opl.motion.timing import Timing
from opl.program.played import Playback, ReadMove, SpeedUnit
from opl.program.posts import PASS_TIME_TOLERANCE
from opl.program.speeds import MOST_CORRECTION

AHEAD = 0.02  # of the feed: what a pass may be off
AT_POINT = 5e-5  # [m] that a cutter point may be ground too early
BETWEEN = 2.5e-4  # [m] the same between two, where places are recognised less well
# What a move may be off where joints or the contact's way over the wheel limit it, and off the
# wheel: faster, and slower; times of moves too short to be written go to the next one.
LIMITED = 1.3
FASTER = 1.05
SLOWER = 1.5
COARSE = 0.2  # of the time of a move: the last digit of a speed before it that may be to blame


def speed_findings(
    written: TimedMotion, requested: Timing, playback: Playback, feed: float
) -> Iterator[Finding]:
    """Give the moves that are faster or slower than asked for, and the passes that are.

    Args:
        written: The written configurations and times, one for each move.
        requested: The same with the times that the job asks for.
        playback: The moves.
        feed: Of the ground point in [m/s].
    """
    motion, durations = written.motion, requested.timed.duration
    for phase, moves in motion.runs():
        if phase is Phase.GRINDING:
            yield from _ahead(written, requested, playback, feed, moves.tolist())
            yield from _pass_time(written, requested.timed, moves.tolist())
        else:
            for k in moves.tolist():
                wanted, takes = float(durations[k]), float(written.duration[k])
                digit = _last_digit(playback.moves[k], takes)
                slowest = wanted * SLOWER + _last_digit(playback.moves[k], takes, wanted)
                if _stays(motion, k):  # parts of a split program begin where the one before ended
                    continue
                if not wanted / FASTER - digit <= takes <= slowest:
                    yield _finding(written, playback, k, wanted, "the speed that the job asks for")


def pass_findings(written: TimedMotion, points: CutterPoints, feed: float) -> Iterator[Finding]:
    """Give the passes whose moves on the wheel take less than their way along the surface.

    Args:
        written: The written configurations and times, one for each move.
        points: The cutter points.
        feed: Of the ground point in [m/s].
    """
    for one in short_passes(written, points, feed):
        message = f"{one.takes:.2f} s of moves on the wheel, {one.at_feed:.2f} s at the feed"
        yield Finding(Level.ERROR, "speed", f"pass {one.pass_index + 1}", message)


def _stays(motion: Motion, k: int) -> bool:
    """Return whether a move ends where it begins."""
    return k > 0 and bool(np.abs(motion.q[k] - motion.q[k - 1]).max() <= SAME_CONFIGURATION)


def _ahead(
    written: TimedMotion, requested: Timing, playback: Playback, feed: float, moves: list[int]
) -> Iterator[Finding]:
    """Look at the moves of a pass, given by their indices."""
    motion = written.motion
    lead = late = 0.0  # of the ground point in [m], negative if it is too early; of the time in [s]
    saved = 0.0  # [s] by which the moves so far were too fast where not the feed limits them
    coarsest, coarse = 0.0, ""  # last digit of a speed so far in [s], and what to say of it
    for k in moves:
        takes, wanted = float(written.duration[k]), float(requested.timed.duration[k])
        distance = float(requested.surface_distance[k])
        digit = _last_digit(playback.moves[k], takes)
        at_slowest = digit == np.inf and takes < wanted / FASTER
        step = np.inf if at_slowest else _one_more(playback.moves[k], takes)
        if coarsest <= step:
            coarsest, coarse = step, _coarse(playback.moves[k], takes, wanted, step)
        because = coarse if coarsest > COARSE * wanted else ""
        aims = wanted, min(max(wanted - late, wanted / MOST_CORRECTION), wanted * MOST_CORRECTION)
        late += takes - wanted
        place = AT_POINT if motion.kind[k] is MoveKind.GRIND else BETWEEN
        allowed = place + digit * feed
        lead += takes * (1.0 + AHEAD) * feed - distance
        early, lead = -lead, min(max(lead, -allowed), allowed)
        by_feed = wanted * feed <= distance * (1.0 + AHEAD)
        # a short move may be off by as much as it is long, many of them by no more than one place
        slack = allowed / feed
        saved = max(saved + min(aims) / LIMITED - takes, 0.0)
        too_fast, saved = not by_feed and saved > slack, min(saved, slack)
        too_slow = takes > max(aims) * LIMITED + digit + BETWEEN / feed
        if too_fast or too_slow or (early > allowed and wanted > FASTER * takes):
            yield _finding(written, playback, k, wanted, f"the feed that the job asks for{because}")
        elif early > allowed:  # because of the moves before it
            message = f"{1e3 * early:.2f} mm ahead of the feed that the job asks for{because}"
            where = f"{motion.place(k)} ({playback.moves[k].place})"
            yield Finding(Level.ERROR, "speed", where, message)


def _last_digit(move: ReadMove, takes: float, wanted: float | None = None) -> float:
    """Return by how much in [s] the time of a move changes with the last digit of its speed.

    Args:
        move: The move.
        takes: Its time as written in [s].
        wanted: Another time in [s], at which the digit is taken instead.
    """
    speed = move.speed
    if speed.unit is SpeedUnit.SECONDS:
        return speed.digit
    time = takes if wanted is None or not wanted > 0.0 else wanted
    slower = speed.value * takes / time - speed.digit if time > 0.0 else 0.0
    # the slowest speed there is may stand for any slower one
    return time * speed.digit / slower if slower > 0.0 else np.inf


def _one_more(move: ReadMove, takes: float) -> float:
    """Return by how much in [s] one more in the last digit of its speed changes a move's time."""
    speed = move.speed
    if speed.unit is SpeedUnit.SECONDS:
        return speed.digit
    return takes * speed.digit / (speed.value + speed.digit)


def _coarse(move: ReadMove, takes: float, wanted: float, step: float) -> str:
    """Return what to say of a speed of few digits.

    Args:
        move: The move.
        takes: Its time as written in [s].
        wanted: That wanted in [s].
        step: By how much one more in the last digit changes it in [s]; infinite where it should be
            slower and cannot be.
    """
    why = (
        f"one more in the last digit of its speed changes the {takes:.2g} s of {move.place} by "
        f"{step:.2g} s"
    )
    if step == np.inf:
        why = (
            f"{move.place} takes {takes:.2g} s at the slowest speed there is, {wanted:.2g} s were "
            "wanted"
        )
    straight = "" if move.straight else f", or {keys.PROGRAM_MOTION}: straight,"
    return f"; {why}: a higher {keys.PROCESS_FEED}{straight} may help"


def _pass_time(written: TimedMotion, requested: TimedMotion, moves: list[int]) -> Iterator[Finding]:
    wanted, takes = requested.duration[moves].sum(), written.duration[moves].sum()
    if abs(takes - wanted) > PASS_TIME_TOLERANCE * wanted:
        message = f"takes {takes:.2f} s, {wanted:.2f} s at the feed that the job asks for"
        place = f"pass {written.motion.pass_index[moves[0]] + 1}"
        yield Finding(Level.ERROR, "speed", place, message)


def _finding(
    written: TimedMotion, playback: Playback, k: int, wanted: float, speed: str
) -> Finding:
    factor = wanted / max(float(written.duration[k]), 1e-9)
    place = f"{written.motion.place(k)} ({playback.moves[k].place})"
    message = f"{factor:.2g} times {speed}"
    return Finding(Level.ERROR, "speed", place, message)
