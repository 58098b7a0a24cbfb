"""What the writers of RAPID, KRL, FANUC and UR programs share: steps as texts, templates, times.

A template may lay a program out anew; that no move or action got lost or changed is seen from the
text, whatever the language. What the program does then is for its reader.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from opl.errors import InputError
from opl.geometry.frames import Array
from opl.program.actions import Action, Call, Dwell, Remark, SetOutput, WaitInput
from opl.program.layout import fill
from opl.program.moves import Move, Program
from opl.program.posts import Written, pass_times
from opl.program.settings import ProgramSettings

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
class ActionTexts:
    """How a language writes actions: texts in whose braces stands what differs.

    The fields of the action, ``state`` in words, and the ``other`` state. Of a timed wait besides
    ``hundredths`` and ``thousandths`` of a second, and for labels the ``count`` of such waits so
    far and three numbers ``first``, ``second``, ``third`` of its own.

    Attributes:
        states: A signal that is off, and one that is on.
        output: Switches an output.
        dwell: Stands still.
        wait: Waits for an input.
        timed_wait: The same, and pauses when it takes too long. Started again by a person, it waits
            again instead of going on without the signal.
        call: Calls a program.
        remark: A line for people.
    """

    states: tuple[str, str]
    output: str
    dwell: str
    wait: tuple[str, ...]
    timed_wait: tuple[str, ...]
    call: str
    remark: str

    def lines(self, groups: Iterable[Sequence[Action]]) -> list[tuple[str, ...]]:
        """Return the instructions of each group of actions of one program, in order."""
        count, found = 0, []
        for group in groups:
            lines: list[str] = []
            for action in group:
                count += getattr(action, "timeout", None) is not None
                lines += self._texts(action, count)
            found.append(tuple(lines))
        return found

    def _texts(self, action: Action, count: int) -> Iterator[str]:
        values = dict(vars(action))
        texts = {
            SetOutput: [self.output],
            Dwell: [self.dwell],
            WaitInput: self.wait,
            Call: [self.call],
            Remark: [self.remark],
        }[type(action)]
        if isinstance(action, (SetOutput, WaitInput)):
            values["state"] = self.states[action.state]
            values["other"] = self.states[not action.state]
        if isinstance(action, WaitInput) and action.timeout is not None:
            texts = self.timed_wait
            values["hundredths"] = round(action.timeout * 100)
            values["thousandths"] = round(action.timeout * 1000)
            values |= {"count": count, "third": 3 * count}
            values |= {"first": 3 * count - 2, "second": 3 * count - 1}
        return (text.format(**values) for text in texts)


@dataclass(frozen=True)
class Dialect:
    """How a language is written, as far as all of them are written alike.

    Attributes:
        maker: For messages.
        suffix: How the name of a file ends.
        template: The layout that comes with opl.
        name: What a program name must match.
        name_rule: The same in words.
        comment_length: Most characters of a comment.
        motion: Finds the motion instructions in a program.
        line_end: How lines end.
        actions: How actions are written.
    """

    maker: str
    suffix: str
    template: Path
    name: re.Pattern[str]
    name_rule: str
    comment_length: int
    motion: re.Pattern[str]
    line_end: str
    actions: ActionTexts

    def write(
        self,
        program: Program,
        settings: ProgramSettings,
        date: datetime,
        tool: str,
        moves: Sequence[tuple[str, str, str, float]],
        own_values: Callable[[Sequence[Step]], Mapping[str, object]] = lambda steps: {},
    ) -> Written:
        """Return a program as written, its passes timed.

        Args:
            program: What the robot shall do.
            settings: How it is written.
            date: Of the file.
            tool: As the language names it.
            moves: Motion instruction, target, speed and time [s] of each move.
            own_values: What a template of this language gets besides, given the steps.

        Raises:
            OplError: If the language does not take a name or comment, the template is unusable or
                does not say what the steps say, or a pass does not keep its time.
        """
        self._require_legal(program, settings)
        actions = self.actions.lines(move.actions for move in program.moves)
        both = list(zip(program.moves, moves, strict=True))
        steps = [
            Step(*texts, move.comment, lines)
            for (move, texts), lines in zip(both, actions, strict=True)
        ]
        values = {
            "name": program.name,
            "date": f"{date:%Y-%m-%d %H:%M}",
            "title": settings.title,
            "tool": tool,
            "comments": program.comments,
            **own_values(steps),
        }
        text = self._render(settings.template or self.template, values, steps)
        times = {move.motion_index: texts[3] for move, texts in both if np.isfinite(texts[3])}
        speeds = {move.motion_index: texts[2] for move, texts in both}
        kept = pass_times(program, times, "this controller")
        return Written({program.name + self.suffix: text}, speeds, times, kept)

    def _require_legal(self, program: Program, settings: ProgramSettings) -> None:
        """Refuse names and comments that the language does not take."""
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

    def _render(self, template: Path, values: Mapping[str, object], steps: Sequence[Step]) -> str:
        """Fill a template and read the result back."""
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
