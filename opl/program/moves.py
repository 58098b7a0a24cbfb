"""A robot program that belongs to no maker yet: moves with speeds, stops and comments.

Every move is planned as a joint move. Between two configurations the controller then does what the
verification replayed: all joints run linearly, in step with the slowest. A straight-line move leads
the hand's tool point along a line instead, away from where the contact was proven;
`opl.program.lines` makes one only where it stays near enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from opl.errors import UnsafeError
from opl.geometry.frames import Array
from opl.motion.motion import Motion, MoveKind, Phase, TimedMotion, VerifiedMotion
from opl.motion.repeats import named_of, repeats
from opl.program.actions import NO_ACTIONS, Action, Actions
from opl.program.stops import actions_at, stops_at

# Speed of the move to the first configuration. Nothing is known of where the robot starts from, so
# that move is proven by nobody but the person who watches it.
START_SPEED = 0.05
# What a move may need above a joint's top speed before it is refused: the last digit of a speed.
OVERSPEED = 1e-4


class Purpose(str, Enum):
    """What a move is for."""

    WHEEL = "on_wheel"  # grinding
    LEAD = "lead"  # approach or retract, to or from the wheel
    AIR = "air"  # from and to home, and between passes

    @classmethod
    def of(cls, phase: Phase) -> Purpose:
        """Return the kind of a move by what happens during it."""
        return {Phase.GRINDING: cls.WHEEL, Phase.FREE: cls.AIR}.get(phase, cls.LEAD)


class Part(str, Enum):
    """What part of a cycle a move belongs to."""

    FROM_HOME = "from_home"
    APPROACH = "approach"
    PASS = "pass"
    RETRACT = "retract"
    LINK = "link"  # to the pass it is counted with
    TO_HOME = "to_home"

    @classmethod
    def of(cls, phase: Phase, kind: MoveKind, pass_index: int) -> Part:
        """Return the part of a move by what happens during it; a pass of -1 is none."""
        if phase is not Phase.FREE:
            parts = {Phase.APPROACHING: cls.APPROACH, Phase.RETRACTING: cls.RETRACT}
            return parts.get(phase, cls.PASS)
        if kind is MoveKind.LINK:
            return cls.LINK
        return cls.FROM_HOME if pass_index >= 0 else cls.TO_HOME


@dataclass(frozen=True, eq=False)
class Move:
    """A move.

    Attributes:
        q: Where it ends, joint positions in [rad], shape (6,).
        speed: Speed as a fraction of the top speed of the joint that takes longest, in (0, 1].
        duration: Time it shall take in [s]; None where the speed alone is set.
        exact_stop: Whether the robot comes to rest there; if not, the next move may round the
            corner.
        on_wheel: Whether the part touches the wheel there.
        motion_index: Index of that configuration in the motion.
        kind: What it is for.
        ground_pass: The pass ground during the whole move, counted from 0, None off the wheel.
        part: The part of the cycle it belongs to, and its pass, counted from 0; -1 for none.
        straight: Whether the tool point runs on a straight line instead of the joints.
        comment: What a person reads before the move.
        actions: What is done once the robot has come to rest there.
    """

    q: Array
    speed: float
    exact_stop: bool
    on_wheel: bool
    motion_index: int
    duration: float | None = None
    kind: Purpose = Purpose.AIR
    ground_pass: int | None = None
    part: tuple[Part, int] = (Part.FROM_HOME, -1)
    straight: bool = False
    comment: str | None = None
    actions: tuple[Action, ...] = ()

    def __post_init__(self) -> None:
        q = np.array(self.q, dtype=float)
        q.setflags(write=False)
        object.__setattr__(self, "q", q)


@dataclass(frozen=True)
class PassTime:
    """How long a pass takes.

    Attributes:
        wanted: At constant feed in [s].
        written: As the controller will play the written speeds, ramps left out, in [s].
        single: How far a single move is off its time at the most, as a fraction of it.
    """

    wanted: float
    written: float
    single: float

    @property
    def error(self) -> float:
        """How much longer than wanted, as a fraction of the wanted time."""
        return self.written / self.wanted - 1.0


@dataclass(frozen=True)
class PartTime:
    """How long a part of a cycle takes.

    Attributes:
        part: The part.
        pass_index: The pass that it grinds, or leads to or from, counted from 0; -1 to home.
        seconds: Its time in [s], ramps included, waits not.
    """

    part: Part
    pass_index: int
    seconds: float


@dataclass(frozen=True)
class CycleTime:
    """How long a program runs, from its first configuration to its last.

    Attributes:
        passes: Grinding in [s].
        leads: Approaching the wheel and leaving it in [s].
        air: Moving from and to home and between passes in [s].
        waits: Standing still because the program says so in [s].
        ramps: What of all this is beyond the written speeds, coming up to them and to rest, in [s].
        open_ended: Whether it also waits for inputs or runs other programs, for times unknown.
        parts: Its parts in order, each between two changes of what is done.
    """

    passes: float
    leads: float
    air: float
    waits: float
    ramps: float
    open_ended: bool
    parts: tuple[PartTime, ...] = ()

    @property
    def total(self) -> float:
        """All of it in [s]."""
        return self.passes + self.leads + self.air + self.waits


@dataclass(frozen=True)
class Program:
    """Moves in order, or calls of other programs in order.

    Attributes:
        name: Its name on the controller.
        comments: Lines at its top.
        moves: What the robot does; the first brings it to where the rest is proven from.
        calls: Names of the programs it runs after its moves.
        pass_times: Of each pass, once it is written for a controller.
        cycle: How long it runs, once it is written.
    """

    name: str
    comments: tuple[str, ...] = ()
    moves: tuple[Move, ...] = ()
    calls: tuple[str, ...] = ()
    pass_times: tuple[PassTime, ...] = ()
    cycle: CycleTime | None = None

    @property
    def q(self) -> Array:
        """Where the moves end, joint positions in [rad], shape (n, 6)."""
        return np.array([move.q for move in self.moves]).reshape(-1, 6)

    @property
    def chained(self) -> list[bool]:
        """Whether each move but the first goes on with the pass of the move before."""
        return [
            move.ground_pass is not None and move.ground_pass == before.ground_pass
            for before, move in pairwise(self.moves)
        ]


def plan_moves(
    verified: VerifiedMotion,
    name: str,
    max_speed: Array,
    comments: Sequence[str] = (),
    joint_names: Sequence[str] = ("1", "2", "3", "4", "5", "6"),
    actions: Actions = NO_ACTIONS,
) -> Program:
    """Turn a verified motion into moves.

    Configurations that are not written lie on the moves between those that are. One that repeats
    the one before needs no move; its time goes to the move that follows, or at the end of a pass to
    the one before, which so gets slower, never faster. The robot stops at home, where it enters and
    leaves the wheel, where a phase ends, and at sharp corners off the wheel; it never stops within
    a pass.

    Args:
        verified: What the program shall do.
        name: The program's name.
        max_speed: Top speeds of the joints in [rad/s], shape (6,).
        comments: Lines at its top.
        joint_names: For messages.
        actions: What is done around the passes.

    Raises:
        TypeError: If the motion was not verified.
        UnsafeError: If a move would need more than a joint's top speed.
    """
    if not isinstance(verified, VerifiedMotion):
        raise TypeError(f"a program is made of a VerifiedMotion, got {type(verified).__name__}")
    positions = verified.motion.positions
    timed = verified.timed.take(positions)
    groups, grinding = repeats(timed.motion), timed.motion.grinding
    kept = np.array([named_of(grinding, group) for group in groups])
    motion = _without_repeats(timed.motion, groups)
    speeds = _speeds(timed, kept, np.asarray(max_speed), joint_names)
    times = timed.take(kept).duration.tolist()
    stops, on_wheel = stops_at(motion), motion.on_wheel
    done_there = actions_at(motion, actions)
    moves = []
    at_home, place_before = motion.at_home, ""
    for m, (configuration, phase) in enumerate(zip(kept, motion.phase, strict=True)):
        pass_here = int(motion.pass_index[m])
        place = "HOME" if pass_here < 0 or at_home[m] else f"PASS {pass_here + 1}"
        moves.append(
            Move(
                q=motion.q[m],
                speed=float(speeds[m]),
                exact_stop=stops[m],
                on_wheel=bool(on_wheel[m]),
                motion_index=int(positions[configuration]),
                duration=times[m] if m else None,
                kind=Purpose.of(phase),
                ground_pass=pass_here if phase is Phase.GRINDING else None,
                part=(Part.of(phase, motion.kind[m], pass_here), pass_here),
                comment=place if place != place_before else None,
                actions=done_there.get(m, ()),
            )
        )
        place_before = place
    return Program(name=name, comments=tuple(comments), moves=tuple(moves))


def _without_repeats(motion: Motion, groups: Sequence[NDArray[np.intp]]) -> Motion:
    """Return the first of each group; what it is for, those that repeat it on the wheel say."""
    on_wheel = motion.on_wheel
    rows = [int(group[on_wheel[group].argmax()]) for group in groups]
    return replace(motion.take(rows), q=motion.q[[group[0] for group in groups]])


def _speeds(
    timed: TimedMotion, kept: NDArray[np.intp], max_speed: Array, joint_names: Sequence[str]
) -> Array:
    """Return the speed of the move to each kept configuration, shape (len(kept),)."""
    motion, times = timed.motion, timed.take(kept).duration[1:]
    joint_times = np.abs(np.diff(motion.q[kept], axis=0)) / max_speed  # at top speed, [s]
    with np.errstate(divide="ignore"):
        speeds = np.concatenate([[START_SPEED], joint_times.max(axis=1) / times])
    m = int(np.argmax(speeds))
    if speeds[m] > 1.0 + OVERSPEED:
        joint = joint_names[int(np.argmax(joint_times[m - 1]))]
        raise UnsafeError(
            f"configuration {kept[m]} ({motion.kind[kept[m]].value}): joint {joint} would need "
            f"{100.0 * speeds[m]:.1f} % of its top speed"
        )
    possible: Array = np.minimum(speeds, 1.0)
    return possible
