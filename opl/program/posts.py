"""Posts: what turns a maker-neutral program into the files of one controller.

A post is a Python entry point of the group ``opl.posts``; its name is what a job calls its
controller. Those that come with opl are declared in opl's own ``pyproject.toml``, those of a site
in the site's own package, which leaves opl as it is::

    [project.entry-points."opl.posts"]
    OUR_CELL = "our_package.our_module:POST"

A post that has a `Reader` gets its programs read back and proven from their bytes. Without one they
are written and not read back, and nothing claims more.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from enum import Enum
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from opl.cell.robot import Robot
from opl.errors import InputError, PassTimeError, SettingError
from opl.geometry.frames import Array
from opl.program.moves import PassTime, Program, Purpose
from opl.program.played import Corners, Reading, WrittenSpeed
from opl.program.settings import MotionForm, ProgramSettings

GROUP = "opl.posts"

# How far the time of a pass may be from the wanted one, as a fraction of it: the pressure of the
# part on the belt is set for the feed.
PASS_TIME_TOLERANCE = 0.02
LOST_ON_LEAD = 0.1  # [s] by which a move of a lead may be too fast: less is the last digit's
# Periods of interpolation in a move, at least: a controller plays it in whole ones, and half of one
# more or less is then within 5 % of its time.
PERIODS_OF_A_MOVE = 10


@dataclass(frozen=True)
class Written:
    """A program in the language of a controller.

    Attributes:
        files: Text by file name, line ends as the controller wants them, the one to start first.
        speeds: Speed of the move to each configuration as written, by the configuration's index in
            the motion.
        times: Time of that move at the written speed in [s], ramps left out, by the same index.
        pass_times: Of each pass.
    """

    files: Mapping[str, str]
    speeds: Mapping[int, str] = field(default_factory=dict)
    times: Mapping[int, float] = field(default_factory=dict)
    pass_times: tuple[PassTime, ...] = ()


@dataclass(frozen=True)
class Reader:
    """How the programs of a language are read back.

    Attributes:
        suffix: How the names of its files end, e.g. ``.mod``.
        read: Reads all files of a program, content by what messages call them.
        rounded: Returns the configurations nearest to some, shape (n, 6) in [rad], that the digits
            of a program can express: these are proven, and these are read back.
        start: The fastest first move of a program: nobody knows from where it comes.
        corners: The largest corners that a job allows.
        describe: Says in lines what a file does, given its name, content and robot.
        differences: Says in lines what one file does and another does not, given the name and
            content of both, and whose programs they are taken for.
        nameable: Which configurations, shape (n, 6) in [rad], a program names without doubt, even
            if joints were off by a margin in [rad].
        companions: Names of files that lie beside a program and are read with it.
        ramps: What a kind of move says of speeding up and slowing down, see `ReadMove`.
    """

    suffix: str
    read: Callable[[Mapping[str, bytes], Robot, ProgramSettings], Reading]
    rounded: Callable[[Array, Robot, ProgramSettings], Array]
    start: Callable[[Robot], WrittenSpeed]
    corners: Callable[[ProgramSettings, Robot], Corners]
    describe: Callable[[str, bytes, Robot], list[str]]
    differences: Callable[[tuple[str, bytes], tuple[str, bytes], Robot], list[str]]
    nameable: Callable[[Array, Robot, ProgramSettings, float], NDArray[np.bool_]] = (
        lambda q, robot, settings, margin: np.ones(len(q), dtype=bool)
    )
    companions: tuple[str, ...] = ()
    ramps: Callable[[Purpose, ProgramSettings], str] = lambda kind, settings: ""


class StationaryTools(Enum):
    """Whether straight moves may lead the part past a tool that stands."""

    NONE = "none that public manuals settle"
    IN_FRAME = "on request, in a user frame that is set on the controller"
    USUAL = "unless the job wants none"


@dataclass(frozen=True)
class Post:
    """How programs are written for one controller.

    Attributes:
        title: The controller, for people.
        write: Writes a program; the date is part of the files where the controller wants one. It
            raises `OplError`s, and returns nothing that the controller would refuse.
        template: The layout that comes with the post.
        variables: What its templates get: name and meaning.
        counts_pulses: Whether positions may be written in encoder pulses.
        motion: How moves on the wheel are written unless the job says so.
        stationary_tools: Whether straight moves may lead the part past a tool that stands.
        reader: Reads its programs back; None where they are written and not read back.
        period: From one interpolated configuration to the next in [s]; 0 where nothing is known of
            it. No controller was asked: each says beside the number where it is from.
    """

    title: str
    write: Callable[[Program, Robot, ProgramSettings, datetime], Written]
    template: Path
    variables: Mapping[str, str]
    counts_pulses: bool = False
    motion: MotionForm = MotionForm.JOINT
    stationary_tools: StationaryTools = StationaryTools.NONE
    reader: Reader | None = None
    period: float = 0.0

    @property
    def shortest_move(self) -> float:
        """Least time of a move while grinding in [s], so that the controller keeps it."""
        return PERIODS_OF_A_MOVE * self.period


@cache
def _installed(path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Return the posts of the packages on a path of modules, read once: it opens them all."""
    return tuple(entry_points(group=GROUP))


def known_posts() -> list[str]:
    """Return the names of the posts that were installed when this process first asked."""
    return sorted({entry.name for entry in _installed(tuple(sys.path))})


def find_post(name: str) -> Post:
    """Return the post of a controller by the name that jobs give it.

    Raises:
        SettingError: If there is none, or it cannot be loaded.
    """
    found = [entry for entry in _installed(tuple(sys.path)) if entry.name == name]
    if not found:
        known = ", ".join(known_posts())
        raise SettingError("controller", f"unknown controller {name!r}; known: {known}")
    try:
        post = found[0].load()
    except Exception as error:  # a package of the site's own: whatever is wrong in it
        message = f"post {found[0].value} cannot be loaded: {error}"
        raise SettingError("controller", message) from error
    if not isinstance(post, Post):
        raise SettingError("controller", f"post {found[0].value} is no opl.program.posts.Post")
    return post


def readers() -> Iterator[tuple[str, Reader]]:
    """Yield suffixes of files that opl can read, in capitals, with the reader; the first counts."""
    for name in known_posts():
        try:
            reader = find_post(name).reader
        except InputError:
            continue  # a post that cannot be loaded is an error for the job that names it only
        if reader is not None:
            yield reader.suffix.upper(), reader


def reader_for(path: Path) -> Reader:
    """Return the reader of a program file by its suffix, in either case.

    Raises:
        InputError: If no post reads such files.
    """
    known = set()
    for suffix, reader in readers():  # each is loaded when its turn comes
        if suffix == path.suffix.upper():
            return reader
        known.add(suffix)
    raise InputError(str(path), f"is no program that can be read: {', '.join(sorted(known))}")


def pass_times(
    program: Program, times: Mapping[int, float], controller: str
) -> tuple[PassTime, ...]:
    """Return wanted and written time of each pass.

    Args:
        program: The moves.
        times: Time of the move to each configuration as written in [s], by the configuration's
            index.
        controller: For messages.

    Raises:
        PassTimeError: If a pass does not keep its time, or a move of its leads is too fast.
    """
    moves: dict[int, list[tuple[float, float]]] = {}
    leads: dict[int, list[tuple[float, float]]] = {}
    for move in program.moves:
        of_pass = moves if move.ground_pass is not None else leads
        if move.duration is not None and move.kind is not Purpose.AIR:
            pair = move.duration, times[move.motion_index]
            of_pass.setdefault(move.part[1], []).append(pair)
    found = {}
    for index, pairs in sorted(moves.items()):
        wanted, written = np.array(pairs).T
        single = float(np.abs(written / wanted - 1.0).max())
        found[index] = PassTime(float(wanted.sum()), float(written.sum()), single)
    too_low = f"{controller} takes no speeds so low"
    for index, one in found.items():
        if abs(one.error) > PASS_TIME_TOLERANCE:
            raise PassTimeError(
                f"pass {index + 1} would take {one.written:.2f} s instead of {one.wanted:.2f} s: "
                f"{too_low}"
            )
        for wanted, written in leads.get(index, ()):
            if wanted - written > max(PASS_TIME_TOLERANCE * one.wanted, LOST_ON_LEAD):
                raise PassTimeError(
                    f"a move to or from the wheel of pass {index + 1} would take {written:.2f} s "
                    f"instead of {wanted:.2f} s: {too_low}"
                )
    return tuple(found.values())
