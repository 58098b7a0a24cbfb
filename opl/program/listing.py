"""A program of statements as a reader gives it: played, described, compared with another."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np

from opl.cell.robot import Robot, controller_poses
from opl.errors import InputError
from opl.findings import Finding, Level
from opl.geometry.frames import Array, roll_pitch_yaw
from opl.program.changes import Coordinate, Line, changed_lines
from opl.program.digits import Rounding
from opl.program.played import (
    Corners,
    Reading,
    ReadMove,
    WrittenSpeed,
    other_tools,
    play,
)
from opl.program.posts import Reader
from opl.program.settings import ProgramSettings
from opl.program.statements import Listing

Declared = Callable[[Sequence[tuple[str, str]], ProgramSettings, Robot], Iterable[tuple[str, str]]]


def listing_reader(
    suffix: str,
    parse: Callable[[str, str], Listing],
    tool_name: Callable[[ProgramSettings], str],
    rounded: Rounding,
    start: Callable[[Robot], WrittenSpeed],
    corners: Corners,
    declared: Declared = lambda found, settings, robot: (),
) -> Reader:
    """Return the reader of a language whose programs are listings of one file.

    Args:
        suffix: How the names of its files end.
        parse: Returns the program of a text, given the name of its file too; raises an `InputError`
            if it holds none.
        tool_name: Returns the tool of a job as the language names it.
        rounded: See `Reader`.
        start: The fastest first move.
        corners: The largest corners, whatever the job.
        declared: Gives place and message of each fault in what a file declares of tools and loads,
            given place and text of these, the settings of the job and its robot.
    """

    def parsed(name: str, content: bytes) -> Listing:
        try:
            text = content.decode("ascii")
        except UnicodeDecodeError as error:
            raise InputError(name, f"is not ASCII at byte {error.start}") from error
        return parse(text, name)

    def read(files: Mapping[str, bytes], robot: Robot, settings: ProgramSettings) -> Reading:
        if len(files) != 1:
            raise InputError("program", f"is one file in this language, got {len(files)}")
        listing = parsed(*next(iter(files.items())))
        doubts = [*listing.doubts, *other_tools(listing.moves, tool_name(settings))]
        for called, place in listing.calls:
            if called not in settings.actions.calls:
                message = f"calls {called}, which the job does not call"
                doubts.append(Finding(Level.ERROR, "program", place, message))
        for place, message in declared(listing.data, settings, robot):
            doubts.append(Finding(Level.ERROR, "frame", place, message))
        playback, faults = play(listing.moves, listing.events, robot, settings.led)
        doubts += faults
        foreign = tuple(dict.fromkeys(called for called, _ in listing.calls))
        return Reading(listing.name, None if doubts else playback, foreign, tuple(doubts))

    def describe(name: str, content: bytes, robot: Robot) -> list[str]:
        return _described(parsed(name, content), robot)

    def differences(first: tuple[str, bytes], second: tuple[str, bytes], robot: Robot) -> list[str]:
        return changed_lines(_meaning(parsed(*first), robot), _meaning(parsed(*second), robot))

    return Reader(
        suffix, read, rounded, start, lambda settings, robot: corners, describe, differences
    )


def _described(listing: Listing, robot: Robot) -> list[str]:
    """Return the summary of a program and its statements in order, one line each."""
    moves = listing.moves
    words = Counter(one.text.split("(")[0].split()[0] for one in listing.statements if one.move)
    corners = Counter(move.corner.text for move in moves)
    lines = [
        f"read as a program of {robot.title}",
        f"program {listing.name}, tool {', '.join(dict.fromkeys(m.tool for m in moves)) or 'none'}",
        *(f"{count} {word}" for word, count in words.items()),
        *(f"{count} ends of moves: {text}" for text, count in corners.items()),
    ]
    if listing.calls:
        lines.append(f"calls: {', '.join(dict.fromkeys(name for name, _ in listing.calls))}")
    lines += [f"caution: {doubt.where}: {doubt.message}" for doubt in listing.doubts]
    lines.append("")
    q = [move.target for move in moves if move.target.shape != (4, 4)]
    poses = iter(controller_poses(robot, np.reshape(q, (-1, len(robot.joint_names)))))
    for one in listing.statements:
        lines.append(f"{one.line:5d}  {one.text}")
        if one.move is not None:
            lines += [f"       {text}" for text in _where(one.move, poses, robot)]
    return lines


def _meaning(listing: Listing, robot: Robot) -> list[Line]:
    """Return what a program says; dates, comments, spaces and zeros at the end do not count."""
    said = [Line("", listing.name)]
    for one in listing.statements:
        move = one.move
        if move is None:
            said.append(Line(str(one.line), one.meaning))
            continue
        if move.target.shape == (4, 4):
            target = pose_coordinates(pose_values(move.target))
        else:
            target = angle_coordinates(move.target, robot)
        form = "straight" if move.straight else "joint"
        settings = [("move", form), ("speed", move.speed.text), ("corner", move.corner.text)]
        settings.append(("tool", move.tool))
        said.append(Line(str(one.line), one.meaning, target, tuple(settings)))
    return said


def angle_coordinates(q: Array, robot: Robot) -> tuple[Coordinate, ...]:
    """Return the angles of a configuration in [deg], by joint."""
    named = zip(robot.joint_names, np.rad2deg(q), strict=True)
    return tuple(Coordinate(name, float(angle), "deg") for name, angle in named)


def pose_coordinates(values: Sequence[float]) -> tuple[Coordinate, ...]:
    """Return x, y, z in [mm] and rx, ry, rz in [deg] by name."""
    named = zip(("x", "y", "z", "rx", "ry", "rz"), values, strict=True)
    return tuple(
        Coordinate(name, float(value), "deg" if name[0] == "r" else "mm") for name, value in named
    )


def _where(move: ReadMove, poses: Iterator[Array], robot: Robot) -> Iterator[str]:
    if move.target.shape == (4, 4):
        yield f"in {move.frame}: " + pose_text(pose_values(move.target))
        return
    yield angles_text(move.target, robot)
    yield "flange " + pose_text(pose_values(next(poses)))


def angles_text(q: Array, robot: Robot) -> str:
    """Return a configuration in [deg] for people."""
    named = zip(robot.joint_names, np.rad2deg(q), strict=True)
    return "angles " + " ".join(f"{name} {angle:.3f}" for name, angle in named)


def pose_values(T: Array) -> tuple[float, ...]:
    """Return x, y, z in [mm] and rx, ry, rz in [deg] of a pose."""
    return (*T[:3, 3] * 1e3, *np.rad2deg(roll_pitch_yaw(T)))


def pose_text(values: tuple[float, ...]) -> str:
    """Return x, y, z in [mm] and rx, ry, rz in [deg] for people."""
    x, y, z, rx, ry, rz = values
    return f"x {x:.3f} y {y:.3f} z {z:.3f} rx {rx:.4f} ry {ry:.4f} rz {rz:.4f}"
