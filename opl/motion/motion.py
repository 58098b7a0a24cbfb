"""A motion of the robot as a value: its configurations, and what every move is for.

What kind a move is, whether it touches the wheel and which moves belong together is defined here
only. The type says how far a motion is: a `Motion` is planned, a `TimedMotion` also knows how long
its moves take, and a `VerifiedMotion` how near it comes to anything.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import Enum
from functools import cached_property
from itertools import groupby, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array


class MoveKind(str, Enum):
    """What the move that ends at a configuration is for."""

    HOME = "home"  # free move from or to home
    LINK = "link"  # free move between two passes
    APPROACH = "approach"  # along the contact normal or an arc, towards the wheel
    GRIND = "grind"  # on the wheel, to a cutter point
    BETWEEN = "between"  # on the wheel, to an intermediate node between two cutter points
    RETRACT = "retract"  # along the contact normal or an arc, away from the wheel

    @classmethod
    def at_cutter_point(cls, cutter_point: float) -> MoveKind:
        """Return the kind of a move that ends on the wheel at a cutter point, fractional or not."""
        return cls.BETWEEN if cutter_point % 1.0 else cls.GRIND

    @property
    def is_free(self) -> bool:
        """Whether nothing is in contact during the move."""
        return self in (MoveKind.HOME, MoveKind.LINK)

    @property
    def on_wheel(self) -> bool:
        """Whether the part touches the wheel where the move ends."""
        return self in (MoveKind.GRIND, MoveKind.BETWEEN)


class Phase(Enum):
    """What happens during a move, from its start to its end."""

    FREE = "free"
    APPROACHING = "approaching"  # ends with the move onto the wheel
    GRINDING = "grinding"  # on the wheel all along, within one pass
    RETRACTING = "retracting"


@dataclass(frozen=True, eq=False)
class Motion:
    """Configurations in the order they are visited, joined by linear joint interpolation.

    Attributes:
        q: Joint positions in [rad], shape (n, 6).
        kind: What the move that ends at each configuration is for, n items.
        contact_position: t, shape (n,); NaN off the wheel.
        cutter_point: Index of the cutter point, fractional between two, shape (n,); NaN off the
            wheel.
        pass_index: The pass that a configuration grinds, or leads to or from, shape (n,); -1 at
            home.
        written: Which configurations a program names, shape (n,); the others lie on the joint lines
            between those. All of them unless said otherwise.
    """

    q: Array
    kind: tuple[MoveKind, ...]
    contact_position: Array
    cutter_point: Array
    pass_index: NDArray[np.int64]
    written: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, dtype=bool))

    def __post_init__(self) -> None:
        if not len(self.written):
            object.__setattr__(self, "written", np.ones(len(self.q), dtype=bool))
        _keep_copies(self, len(self.q))

    def __len__(self) -> int:
        return len(self.q)

    @classmethod
    def off_wheel(cls, q: Array, kind: MoveKind, pass_index: int) -> Motion:
        """Return a motion of one kind without contact; q in [rad], shape (n, 6)."""
        nothing = np.full(len(q), np.nan)
        return cls(q, (kind,) * len(q), nothing, nothing, np.full(len(q), pass_index))

    @classmethod
    def joined(cls, parts: Sequence[Motion]) -> Motion:
        """Return motions one after the other as one motion."""
        return cls(
            np.concatenate([part.q for part in parts]),
            tuple(kind for part in parts for kind in part.kind),
            np.concatenate([part.contact_position for part in parts]),
            np.concatenate([part.cutter_point for part in parts]),
            np.concatenate([part.pass_index for part in parts]),
            np.concatenate([part.written for part in parts]),
        )

    def take(self, rows: Sequence[int] | NDArray[np.intp]) -> Motion:
        """Return a motion of some configurations of this one, by their indices."""
        return Motion(
            self.q[rows],
            tuple(self.kind[row] for row in rows),
            self.contact_position[rows],
            self.cutter_point[rows],
            self.pass_index[rows],
            self.written[rows],
        )

    def with_inserted(self, before: Sequence[int] | NDArray[np.intp], q: Array) -> Motion:
        """Return the motion with more configurations inserted, each of its move's kind.

        Each of `q` in [rad], shape (k, 6), comes before the configuration at its index in `before`.
        """
        source = np.insert(np.arange(len(self)), before, before)
        return replace(self.take(source), q=np.insert(self.q, before, q, axis=0))

    @property
    def positions(self) -> NDArray[np.intp]:
        """Indices of the configurations that a program names."""
        return np.flatnonzero(self.written)

    def renumbered(self, cutter_point: Array) -> Motion:
        """Return the motion with other numbers of its cutter points, shape (n,); NaN off the wheel.

        What ended at a cutter point may so end between two, and vice versa.
        """
        kind = tuple(
            MoveKind.at_cutter_point(point) if kind.on_wheel else kind
            for kind, point in zip(self.kind, cutter_point, strict=True)
        )
        return replace(self, kind=kind, cutter_point=cutter_point)

    @property
    def on_wheel(self) -> NDArray[np.bool_]:
        """At which configurations the part touches the wheel, shape (n,)."""
        return np.array([kind.on_wheel for kind in self.kind], dtype=bool)

    @property
    def ground_points(self) -> NDArray[np.intp]:
        """The cutter points that are ground, in the order of the motion."""
        ground = [kind is MoveKind.GRIND for kind in self.kind]
        return self.cutter_point[ground].astype(np.intp)

    @cached_property
    def phase(self) -> tuple[Phase, ...]:
        """What happens during the move that ends at each configuration, n items.

        No move leads to the first configuration, so that one is never `Phase.GRINDING`.
        """
        on_wheel = self.on_wheel
        goes_on = np.diff(self.pass_index, prepend=self.pass_index[:1]) == 0
        stays = on_wheel & np.roll(on_wheel, 1) & goes_on
        stays[:1] = False
        others = {kind: Phase.FREE for kind in MoveKind if kind.is_free}
        others[MoveKind.RETRACT] = Phase.RETRACTING
        return tuple(
            Phase.GRINDING if stay else others.get(kind, Phase.APPROACHING)
            for kind, stay in zip(self.kind, stays, strict=True)
        )

    @property
    def grinding(self) -> NDArray[np.bool_]:
        """Which moves are on the wheel from start to end, within one pass, shape (n,)."""
        return np.array([phase is Phase.GRINDING for phase in self.phase], dtype=bool)

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which moves are free, shape (n,)."""
        return np.array([phase is Phase.FREE for phase in self.phase], dtype=bool)

    @property
    def at_home(self) -> NDArray[np.bool_]:
        """Which configurations are the first one again, where the robot comes from, shape (n,)."""
        return np.asarray((self.q == self.q[:1]).all(axis=1))

    @property
    def ends_phase(self) -> NDArray[np.bool_]:
        """After which moves another phase begins, or the motion ends, shape (n,)."""
        changes = [one != other for one, other in pairwise(self._phase_and_pass)]
        return np.array([*changes, True], dtype=bool)

    def runs(self) -> Iterator[tuple[Phase, NDArray[np.intp]]]:
        """Yield the phases in order, those of each pass apart, with the indices of their moves.

        The first configuration is in none of them: no move leads to it.
        """
        moves = range(1, len(self))
        for (phase, _), run in groupby(moves, key=self._phase_and_pass.__getitem__):
            yield phase, np.fromiter(run, dtype=np.intp)

    def place(self, move: int) -> str:
        """Return where the move that ends at a configuration is, as a person would look for it."""
        index = self.pass_index[move] + 1  # people count passes from 1
        kind = self.kind[move]
        if kind.on_wheel:
            return f"pass {index}, cutter point {self.cutter_point[move]:.4g}"
        if kind is MoveKind.HOME:
            return "free move to home" if index == 0 and move > 0 else "free move from home"
        return f"{kind.value} of pass {index}"

    @cached_property
    def _phase_and_pass(self) -> list[tuple[Phase, int]]:
        return [
            (phase, -1 if phase is Phase.FREE else int(index))
            for phase, index in zip(self.phase, self.pass_index, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class TimedMotion:
    """A motion and how long it takes.

    Attributes:
        motion: The motion.
        duration: Time of the move that ends at each configuration in [s], shape (n,); 0 for the
            first.
    """

    motion: Motion
    duration: Array

    def __post_init__(self) -> None:
        _keep_copies(self, len(self.motion))

    @property
    def seconds(self) -> float:
        """Time of all moves in [s]."""
        return float(self.duration.sum())

    @classmethod
    def passing(cls, motion: Motion, duration: Array) -> TimedMotion:
        """Return a motion with times, given those of the moves to its written configurations.

        A controller moves evenly from one of these to the next, so what lies between gets its share
        of the time by where it lies; `duration` is in [s], of shape (written,).
        """
        at, positions = np.cumsum(duration), motion.positions
        before = np.cumsum(motion.written) - 1
        after = np.minimum(before + 1, len(positions) - 1)
        start = motion.q[positions[before]]
        line = motion.q[positions[after]] - start
        length = np.square(line).sum(axis=1)
        share = ((motion.q - start) * line).sum(axis=1) / np.where(length > 0.0, length, 1.0)
        time = at[before] + np.where(motion.written, 0.0, share * duration[after])
        return cls(motion, np.maximum(np.diff(time, prepend=0.0), 0.0))

    def take(self, rows: Sequence[int] | NDArray[np.intp]) -> TimedMotion:
        """Return some configurations, by ascending indices; the times between them are summed."""
        return TimedMotion(
            self.motion.take(rows), np.diff(np.cumsum(self.duration)[rows], prepend=0.0)
        )


@dataclass(frozen=True, eq=False)
class VerifiedMotion:
    """A timed motion that passed every check of a replay.

    Only `opl.verification` makes one (a test reads the code for it), and a program is rendered from
    nothing else: an unverified motion cannot reach a file.

    Attributes:
        timed: The motion and its times.
        clearance: Smallest distance of anything that has to keep one, measured on the move that
            ends at each configuration, in [m], shape (n,).
    """

    timed: TimedMotion
    clearance: Array

    def __post_init__(self) -> None:
        _keep_copies(self, len(self.motion))

    @property
    def motion(self) -> Motion:
        """The motion without its times."""
        return self.timed.motion


def _keep_copies(value: Any, count: int) -> None:
    """Check the lengths of the fields of a dataclass and make its arrays read-only copies."""
    for one in fields(value):
        items = getattr(value, one.name)
        if not isinstance(items, (np.ndarray, tuple)):
            continue
        if len(items) != count:
            raise ValueError(f"{one.name} has {len(items)} items for {count} configurations")
        if isinstance(items, np.ndarray):
            copy = items.copy()
            copy.setflags(write=False)
            object.__setattr__(value, one.name, copy)
