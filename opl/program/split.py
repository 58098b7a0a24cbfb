"""Programs that a controller cannot hold in one piece, or under their whole name."""

from __future__ import annotations

import hashlib
from dataclasses import replace

from opl.errors import OplError
from opl.program.moves import START_SPEED, Move, Program, Purpose

_LETTERS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"
_MARK_LENGTH = 3


def short_name(name: str, length: int) -> str:
    """Return a name of at most ``length`` characters.

    A name that is too long is cut, and ends in a mark computed from the whole of it: two long names
    with the same beginning would else be one, and the later program overwrite the earlier.
    """
    if len(name) <= length:
        return name
    number = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")
    mark = ""
    for _ in range(_MARK_LENGTH):
        number, digit = divmod(number, len(_LETTERS))
        mark += _LETTERS[digit]
    return name[: length - _MARK_LENGTH] + mark


def numbered_names(name: str, count: int, length: int) -> list[str]:
    """Return the names of the parts of a program: its own, shortened if need be, and a number."""
    digits = max(2, len(str(count)))
    stem = short_name(name, length - digits)
    return [f"{stem}{number:0{digits}d}" for number in range(1, count + 1)]


def split(program: Program, step_limit: int, name_length: int = 32) -> tuple[Program, ...]:
    """Cut a program into numbered parts and a master that calls them.

    A cut lies only where the robot stands still off the wheel: between two jobs a controller may
    pause. Every part after the first begins with a slow move to where the part before it ended.
    Called by the master the robot is there already; started by hand it does not come rushing from
    elsewhere.

    Args:
        program: Moves without calls.
        step_limit: Most moves of a part.
        name_length: Most characters of a part's name.

    Returns:
        The program alone if it fits, else the master and then its parts in order.

    Raises:
        OplError: If there are more moves than the limit between two places to cut.
    """
    if len(program.moves) <= step_limit:
        return (program,)
    pieces = _pieces(program.moves, step_limit)
    names = numbered_names(program.name, len(pieces), name_length)
    parts = [
        Program(name, (*program.comments, f"PART {k} OF {len(pieces)}"), piece)
        for k, (name, piece) in enumerate(zip(names, pieces, strict=True), start=1)
    ]
    return (Program(program.name, program.comments, calls=tuple(names)), *parts)


def _pieces(moves: tuple[Move, ...], step_limit: int) -> list[tuple[Move, ...]]:
    """Fill one piece after the other as far as the places to cut allow."""
    cuts = [k for k, move in enumerate(moves, 1) if move.exact_stop and not move.on_wheel]
    pieces: list[tuple[Move, ...]] = []
    start = 0
    while start < len(moves):
        entry = (_entry(moves[start - 1]),) if start else ()
        room = start + step_limit - len(entry)
        # the end of the program needs no cut, wherever it lies
        end = max((k for k in (*cuts, len(moves)) if start < k <= room), default=None)
        if end is None:
            nearest = min((k for k in cuts if k > start), default=len(moves))
            raise OplError(
                f"configurations {moves[start].motion_index} to {moves[nearest - 1].motion_index} "
                f"take {nearest - start} moves between two places off the wheel where a job may be "
                f"cut; a job holds {step_limit}"
            )
        pieces.append((*entry, *moves[start:end]))
        start = end
    return pieces


def _entry(move: Move) -> Move:
    """Return the move to where the part before ended."""
    return replace(
        move,
        speed=START_SPEED,
        exact_stop=True,
        duration=None,
        kind=Purpose.AIR,
        ground_pass=None,
        straight=False,
        comment="START OF PART",
        actions=(),
    )
