"""Programs that a controller cannot hold in one piece, or under their whole name."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from opl.errors import OplError
from opl.program.moves import START_SPEED, Move, Program, Purpose

_LETTERS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"
_MARK_LENGTH = 3

Moves = tuple[Move, ...]


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


def numbered_names(name: str, numbers: range, length: int) -> list[str]:
    """Return the names of the parts of a program: its own, shortened if need be, and a number."""
    digits = max(2, len(str(numbers[-1])))
    stem = short_name(name, length - digits)
    return [f"{stem}{number:0{digits}d}" for number in numbers]


def split(
    program: Program, step_limit: int, name_length: int = 32, by_pass: bool = False
) -> tuple[Program, ...]:
    """Cut a program into numbered parts and a master that calls them.

    A cut lies only where the robot stands still off the wheel: between two jobs a controller may
    pause. Every part after the first begins with a slow move to where the part before it ended.
    Called by the master the robot is there already; started by hand it does not come rushing from
    elsewhere.

    Args:
        program: Moves without calls.
        step_limit: Most moves of a part.
        name_length: Most characters of a part's name.
        by_pass: Whether each pass, from home to home, is a part with its number; what is done at
            the start and at the end are parts too, so that any pass may be left out or repeated.

    Returns:
        The program alone if it fits and need not be cut, else the master and then its parts in
        order.

    Raises:
        OplError: If there are more moves than the limit between two places to cut.
    """
    if by_pass and any(move.ground_pass is not None for move in program.moves):
        return _by_pass(program, step_limit, name_length)
    if len(program.moves) <= step_limit:
        return (program,)
    pieces = _pieces(program.moves, step_limit)
    names = numbered_names(program.name, range(1, len(pieces) + 1), name_length)
    abouts = [f"PART {k} OF {len(pieces)}" for k in range(1, len(pieces) + 1)]
    return _called(program, names, abouts, pieces)


def _called(
    program: Program, names: Sequence[str], abouts: Sequence[str], pieces: Sequence[Moves]
) -> tuple[Program, ...]:
    """Return the master of some parts, and then these."""
    parts = [
        Program(name, (*program.comments, about), piece)
        for name, about, piece in zip(names, abouts, pieces, strict=True)
    ]
    return (Program(program.name, program.comments, calls=tuple(names)), *parts)


def _by_pass(program: Program, step_limit: int, name_length: int) -> tuple[Program, ...]:
    """Cut where the robot comes home; what is done at the very end is a part too."""
    moves = program.moves
    cuts = [k for k, move in enumerate(moves, 1) if (move.q == moves[0].q).all()]
    pieces = [moves[:1]]
    for start, end in pairwise(cuts):
        pieces.append((_entry(moves[0], "HOME"), *moves[start:end]))
        if len(pieces[-1]) > step_limit:
            message = f"pass {len(pieces) - 1} takes {len(pieces[-1])} moves, a job holds"
            raise OplError(f"{message} {step_limit}")
    *rest, last = pieces[-1]
    pieces[-1] = (*rest, replace(last, actions=()))
    pieces.append((replace(_entry(last, "HOME"), actions=last.actions),))
    count = len(pieces) - 2
    names = numbered_names(program.name, range(count + 2), name_length)
    abouts = ["START", *(f"PASS {k} OF {count}" for k in range(1, count + 1)), "END"]
    return _called(program, names, abouts, pieces)


def _pieces(moves: Moves, step_limit: int) -> list[Moves]:
    """Fill one piece after the other as far as the places to cut allow."""
    cuts = [k for k, move in enumerate(moves, 1) if move.exact_stop and not move.on_wheel]
    pieces: list[Moves] = []
    start = 0
    while start < len(moves):
        entry = (_entry(moves[start - 1], "START OF PART"),) if start else ()
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


def _entry(move: Move, comment: str) -> Move:
    """Return the move to where the part before ended, and what is said of it."""
    return replace(
        move,
        speed=START_SPEED,
        exact_stop=True,
        duration=None,
        kind=Purpose.AIR,
        ground_pass=None,
        straight=False,
        comment=comment,
        actions=(),
    )
