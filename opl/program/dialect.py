"""What the writers of RAPID, KRL, FANUC and UR programs share: steps as texts, templates, times.

A template may lay a program out anew; that no move or action got lost or changed is seen from the
text, whatever the language (`Dialect.render`). What the program does then is for its reader.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from opl.errors import InputError
from opl.program.actions import Action, Remark
from opl.program.layout import fill
from opl.program.moves import Move, Program
from opl.program.posts import Written, pass_times
from opl.program.settings import ProgramSettings

Array = NDArray[np.float64]

# Name and meaning of what the templates of all these languages get.
VARIABLES = {
    "name": "program name",
    "date": "of the program",
    "title": "line about the program, or none",
    "tool": "tool, as the maker's language names it",
    "comments": "lines at the top",
    "steps": "each move and what belongs to it, in order",
    "step.move": "the motion instruction",
    "step.target": "where it leads: joint angles",
    "step.comment": "line before the move, or none",
    "step.actions": "instructions after the move: outputs, waits, calls, comments",
}


@dataclass(frozen=True)
class Step:
    """A move as texts; see `VARIABLES`.

    Attributes:
        move: The motion instruction.
        target: Where it leads.
        speed: The part of it that sets speed or time.
        time: How long it takes at that speed in [s]; NaN where nobody knows from where it comes.
        comment: Line before it, or None.
        actions: Instructions after it.
    """

    move: str
    target: str
    speed: str
    time: float
    comment: str | None
    actions: tuple[str, ...]


@dataclass(frozen=True)
class Dialect:
    """The rules of a language that are checked the same way for all of them.

    Attributes:
        maker: For messages.
        name: What a program name must match.
        name_rule: The same in words.
        comment_length: Most characters of a comment.
        motion: Finds the motion instructions in a program.
        line_end: How lines end.
    """

    maker: str
    name: re.Pattern[str]
    name_rule: str
    comment_length: int
    motion: re.Pattern[str]
    line_end: str

    def require_legal(self, program: Program, settings: ProgramSettings) -> None:
        """Refuse names and comments that the language does not take.

        Raises:
            InputError: For the first of them.
        """
        for name in (program.name, *sorted(settings.actions.calls)):
            if not self.name.fullmatch(name):
                raise InputError(
                    "program name", f"{self.maker} takes {self.name_rule}, got {name!r}"
                )
        texts = [*program.comments, *([settings.title] if settings.title else [])]
        for move in program.moves:
            texts += [move.comment] if move.comment else []
            texts += [action.text for action in move.actions if isinstance(action, Remark)]
        for text in texts:
            if not re.fullmatch("[ -~]*", text) or len(text) > self.comment_length:
                raise InputError(
                    "program comment",
                    f"{self.maker} takes {self.comment_length} printable ASCII characters, "
                    f"got {text!r}",
                )

    def render(self, template: Path, values: Mapping[str, object], steps: Sequence[Step]) -> str:
        """Fill a template and read the result back.

        Raises:
            InputError: If the template is unusable, or its program does not say what the steps say.
        """
        text = fill(template, {**values, "steps": steps})
        if not text.isascii():
            raise InputError(str(template), "gives a program that is not ASCII")
        found = [line.strip() for line in text.splitlines()]
        wanted = [item for step in steps for item in (*_own_speed(step), step.move, *step.actions)]
        rest = iter(found)
        for item in wanted:
            if not any(item.strip() in line for line in rest):  # goes on where the last was found
                raise InputError(str(template), f"loses or moves {item.strip()!r}")
        count = sum(self.motion.search(line) is not None for line in found)
        if count != len(steps):
            raise InputError(str(template), f"gives {count} moves instead of {len(steps)}")
        return text.replace("\n", self.line_end)


def _own_speed(step: Step) -> tuple[str, ...]:
    """Return the instruction that sets the speed, where that is not part of the move."""
    return () if step.speed in step.move else (step.speed,)


def write_steps(
    program: Program,
    moves: Sequence[tuple[str, str, str, float]],
    actions: Callable[[Action], Sequence[str]],
) -> list[Step]:
    """Return the steps of a program.

    Args:
        program: The program.
        moves: Motion instruction, target, speed and time [s] of each move.
        actions: Writes one action.
    """
    return [
        Step(
            instruction,
            target,
            speed,
            time,
            move.comment,
            tuple(line for action in move.actions for line in actions(action)),
        )
        for move, (instruction, target, speed, time) in zip(program.moves, moves, strict=True)
    ]


def written(program: Program, file_name: str, text: str, steps: Sequence[Step]) -> Written:
    """Return a program as written, its passes timed.

    Raises:
        OplError: If a pass does not keep its time.
    """
    both = list(zip(program.moves, steps, strict=True))
    times = {move.motion_index: step.time for move, step in both if np.isfinite(step.time)}
    speeds = {move.motion_index: step.speed for move, step in both}
    return Written({file_name: text}, speeds, times, pass_times(program, times, "this controller"))


def rounded_times(moves: Sequence[Move], decimals: int, shortest: float) -> Array:
    """Return the times of moves rounded so that the error does not add up; NaN where none is set.

    Args:
        moves: The moves.
        decimals: Digits a time is written with.
        shortest: Shortest time that can be written in [s].
    """
    times = np.full(len(moves), np.nan)
    late = 0.0
    for k, move in enumerate(moves):
        if move.duration is None:
            continue
        late = late if move.ground_pass is not None and k else 0.0
        times[k] = max(round(move.duration - late, decimals), shortest)
        late += times[k] - move.duration
    return times
