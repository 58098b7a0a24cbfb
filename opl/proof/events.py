"""What a program does besides moving, against what its job asks for: in order, and in its place.

What the job asks for is what opl itself writes: a program that only goes home, with the actions of
the job around as many passes as the written program has, is written by the job's post and template
and read back. So what a template adds at the top and at the end is asked for too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime
from difflib import SequenceMatcher

import numpy as np
from numpy.typing import NDArray

from opl.cell.robot import SAME_CONFIGURATION
from opl.findings import Finding, Level
from opl.job.values import Job
from opl.motion.motion import Motion
from opl.program.events import Event, meanings
from opl.program.moves import START_SPEED, Move, Program
from opl.program.played import Playback, Reading
from opl.program.posts import find_post
from opl.program.stops import actions_at

_BEFORE = -1  # the place before the first move


def name_findings(job: Job, name: str) -> Iterator[Finding]:
    """Give a finding if a program is not called what the program of its job is called."""
    home = Move(job.process.home, START_SPEED, exact_stop=True, on_wheel=False, motion_index=0)
    wanted = _written(job, [home]).name
    if name.casefold() != wanted.casefold():  # RAPID and KRL ignore case
        message = f"is called {name}, the program of the job {wanted}"
        yield Finding(Level.ERROR, "name", "program", message)


def expected_events(job: Job, motion: Motion) -> dict[int, tuple[str, ...]]:
    """Return what a job asks a program to do besides a motion, given the written configurations.

    Texts by the index of the configuration after which they stand, -1 before the first.
    """
    actions = actions_at(motion, job.program.actions)
    # the first and the last configuration have theirs, even where there is nothing to do
    at = sorted({0, *actions, len(motion) - 1})
    moves = [
        Move(
            job.process.home,
            START_SPEED,
            exact_stop=True,
            on_wheel=False,
            motion_index=k,
            duration=1.0 if k else None,  # a first move has none
            actions=actions.get(k, ()),
        )
        for k in at
    ]
    playback = _written(job, moves).playback
    texts: dict[int, tuple[str, ...]] = {}
    # a template that writes what nobody can follow makes the program itself doubtful
    for event in () if playback is None else playback.events:
        place = _BEFORE if event.after < 0 else at[event.after]
        texts[place] = (*texts.get(place, ()), event.text)
    return texts


def _written(job: Job, moves: Sequence[Move]) -> Reading:
    """Write moves as the program of a job and read them back."""
    settings, robot = job.program, job.cell.robot
    post = find_post(settings.controller)
    assert post.reader is not None, "a program that was read has a reader"
    program = Program(job.name, moves=tuple(moves))
    texts = post.write(program, robot, settings, datetime(2000, 1, 1)).files
    suffix = post.reader.suffix
    files = {name: text.encode() for name, text in texts.items() if name.endswith(suffix)}
    return post.reader.read(files, robot, settings)


def event_findings(job: Job, motion: Motion, playback: Playback) -> Iterator[Finding]:
    """Give what a program does besides moving that its job does not ask for, and what is missing.

    Args:
        job: What is asked for.
        motion: The written configurations with their labels, one for each move.
        playback: The moves and events they are from.
    """
    places = _places(playback)
    found: dict[int, list[Event]] = {}
    for event in playback.events:
        found.setdefault(_at(places, event.after), []).append(event)
    expected: dict[int, list[str]] = {}
    last_move = {int(place): k for k, place in enumerate(places)}
    for k, asked in expected_events(job, motion).items():
        expected.setdefault(_at(places, k), []).extend(asked)
    for place in sorted(found.keys() | expected.keys()):
        here = "start" if place == _BEFORE else motion.place(last_move[place])
        on_wheel = place != _BEFORE and motion.kind[last_move[place]].on_wheel
        given, wanted = found.get(place, []), expected.get(place, [])
        compared = SequenceMatcher(
            None, meanings(event.text for event in given), meanings(wanted), autojunk=False
        )
        for tag, a, b, c, d in compared.get_opcodes():
            if tag == "equal":
                continue
            for event in given[a:b]:
                yield _unasked(event, here, on_wheel)
            for text in wanted[c:d]:
                yield Finding(Level.ERROR, "event", here, f"{text} is missing after this move")


def _unasked(event: Event, here: str, on_wheel: bool) -> Finding:
    place = f"{here} ({event.place})"
    if event.waits and on_wheel:
        return Finding(Level.ERROR, "wait", place, f"stands still on the wheel: {event.text}")
    return Finding(Level.ERROR, "event", place, f"{event.text} is not what the job asks for here")


def _places(playback: Playback) -> NDArray[np.intp]:
    """Return a number for each move that counts where it ends; moves of no length share theirs.

    A part of a program begins with a move to where the part before it ended.
    """
    q = playback.q[playback.stations]
    moved = np.abs(np.diff(q, axis=0)).max(axis=1, initial=0.0) > SAME_CONFIGURATION
    return np.concatenate([[0], np.cumsum(moved)]).astype(np.intp)


def _at(places: NDArray[np.intp], move: int) -> int:
    return _BEFORE if move < 0 else int(places[move])
