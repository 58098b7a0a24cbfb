"""A program of statements as a reader gives it: played, described, compared with another."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from opl.cell.robot import Robot, controller_poses
from opl.errors import InputError
from opl.findings import Finding, Level
from opl.geometry.frames import roll_pitch_yaw
from opl.program.played import Corners, Reading, ReadMove, Speed, play
from opl.program.posts import Reader
from opl.program.settings import Array, ProgramSettings
from opl.program.statements import Listing


def listing_reader(
    suffix: str,
    parse: Callable[[str, str], Listing],
    tool: Callable[[ProgramSettings], str],
    rounded: Callable[[Array, Robot, ProgramSettings], Array],
    start: Callable[[Robot], Speed],
    corners: Callable[[ProgramSettings], Corners],
) -> Reader:
    """Return the reader of a language whose programs are listings.

    Args:
        suffix: How the names of its files end.
        parse: Parses a text, given the name of its file too.
        tool: Returns the tool of a job as the language names it.
        rounded: See `Reader`, as the rest.
        start: The fastest first move.
        corners: The largest corners.
    """

    def read(files: Mapping[str, bytes], robot: Robot, settings: ProgramSettings) -> Reading:
        return read_listing(files, parse, tool(settings), robot, settings)

    def describe(name: str, content: bytes, robot: Robot) -> list[str]:
        return described(parse(decoded(name, content), name), robot)

    def differences(first: tuple[str, bytes], second: tuple[str, bytes]) -> list[str]:
        one, other = (parse(decoded(name, text), name) for name, text in (first, second))
        return differing(one, other)

    return Reader(suffix, read, rounded, start, corners, describe, differences)


def decoded(name: str, content: bytes) -> str:
    """Return the text of a file.

    Raises:
        InputError: If it is not ASCII.
    """
    try:
        return content.decode("ascii")
    except UnicodeDecodeError as error:
        raise InputError(name, f"is not ASCII at byte {error.start}") from error


def read_listing(
    files: Mapping[str, bytes],
    parse: Callable[[str, str], Listing],
    tool: str,
    robot: Robot,
    settings: ProgramSettings,
) -> Reading:
    """Read the one file of a program.

    Args:
        files: Content by what messages call the file.
        parse: Parses a text, given the name of its file.
        tool: The tool of the job, as the language names it.
        robot: Whose program.
        settings: The tool's data, and which programs of the user's own may be called.

    Raises:
        InputError: If there is not one file, or it holds no program.
    """
    if len(files) != 1:
        raise InputError("program", f"is one file in this language, got {len(files)}")
    ((name, content),) = files.items()
    listing = parse(decoded(name, content), name)
    foreign = [called for called, _ in listing.calls]
    doubts = [*listing.doubts, *_other_tools(listing.moves, tool)]
    for called, place in listing.calls:
        if called not in settings.actions.calls:
            message = f"calls {called}, which the job does not call"
            doubts.append(Finding(Level.ERROR, "program", place, message))
    playback, faults = play(listing.moves, robot, settings.T_flange_tool)
    doubts += faults
    return Reading(None if doubts else playback, tuple(dict.fromkeys(foreign)), tuple(doubts))


def described(listing: Listing, robot: Robot) -> list[str]:
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
    for one in listing.statements:
        lines.append(f"{one.line:5d}  {one.text}")
        if one.move is not None:
            lines += [f"       {text}" for text in _where(one.move, robot)]
    return lines


def differing(first: Listing, second: Listing) -> list[str]:
    """Return what differs, one line each: ``-`` stands in the first only, ``+`` in the second.

    Compared by meaning: dates, comments, spaces and zeros at the end of a number do not count.
    """
    before, after = _meaning(first), _meaning(second)
    texts = [text for _, text in before], [text for _, text in after]
    lines = []
    # no line is too common to matter: autojunk would skip them
    matcher = difflib.SequenceMatcher(None, *texts, autojunk=False)
    for tag, a, b, c, d in matcher.get_opcodes():
        if tag != "equal":
            lines += [f"- line {line}: {text}" for line, text in before[a:b]]
            lines += [f"+ line {line}: {text}" for line, text in after[c:d]]
    return lines


def _meaning(listing: Listing) -> list[tuple[int, str]]:
    return [(0, listing.name), *((one.line, one.meaning) for one in listing.statements)]


def _where(move: ReadMove, robot: Robot) -> Iterator[str]:
    if move.target.shape == (4, 4):
        yield "in the base frame: " + _pose(move.target)
        return
    named = zip(robot.joint_names, np.rad2deg(move.target), strict=True)
    yield "angles " + " ".join(f"{name} {angle:.3f}" for name, angle in named)
    yield "flange " + _pose(controller_poses(robot, move.target))


def _pose(T: np.ndarray) -> str:
    x, y, z = T[:3, 3] * 1e3
    rx, ry, rz = np.rad2deg(roll_pitch_yaw(T))
    return f"x {x:.3f} y {y:.3f} z {z:.3f} rx {rx:.4f} ry {ry:.4f} rz {rz:.4f}"


def _other_tools(moves: tuple[ReadMove, ...], tool: str) -> Iterator[Finding]:
    """Look for moves with another tool than the job's; of several in a row the first is named."""
    before = tool
    for move in moves:
        if move.tool not in (tool, before):
            message = f"moves with tool {move.tool}; the job's is {tool}"
            yield Finding(Level.ERROR, "program", move.place, message)
        before = move.tool
