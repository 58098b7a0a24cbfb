"""Programs as they stand in their files, in words: of a robot alone, no job and no cell."""

from __future__ import annotations

from pathlib import Path

from opl.cell.robot import Robot
from opl.errors import InputError
from opl.files.reading import MB, read_bytes
from opl.program.posts import reader_for

MOST_PROGRAM = 20 * MB


def read_program(file: Path) -> bytes:
    """Return the content of a program file.

    Raises:
        InputError: If it cannot be read.
    """
    return read_bytes(file, MOST_PROGRAM)


def describe_program(file: Path, robot: Robot) -> list[str]:
    """Return a program in words, one line each: positions, moves, speeds, signals.

    Args:
        file: The program; its suffix names the language.
        robot: Whose program it is taken for.

    Raises:
        InputError: If the file cannot be read or is no program.
    """
    return [*reader_for(file).describe(str(file), read_program(file), robot)]


def compare_programs(file: Path, other: Path, robot: Robot) -> list[str]:
    """Return how two programs differ in what they do, one line each; empty if they do not.

    What changed everywhere comes first, then what differs move by move, in degrees and mm.

    Args:
        file: The one; its suffix names the language.
        other: The other, of the same language.
        robot: Whose programs they are taken for.

    Raises:
        InputError: If a file cannot be read, is no program, or they are of two languages.
    """
    reader = reader_for(file)
    if reader_for(other) is not reader:
        raise InputError(str(other), f"is not of the language of {file}")
    first, second = ((str(path), read_program(path)) for path in (file, other))
    return [*reader.differences(first, second, robot)]
