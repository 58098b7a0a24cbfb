"""What a controller does with a program as it stands in its files, whatever the language.

A joint move turns all joints in step. A straight move leads the tool point along a line and turns
the hand about one axis; here it becomes configurations so near to each other that turning the
joints in step between them is the same. The playback goes through
every written point, and each move says how far its end may be rounded (`opl.proof.corners`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from opl.cell.full_turns import nearest_turn
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import Robot, forward_kinematics
from opl.findings import Finding, Level
from opl.geometry.frames import Array, rotation_angle
from opl.program.events import Event
from opl.program.led import Led
from opl.program.lines import straight_configurations
from opl.program.moves import Purpose

# How far beyond a quarter turn an axis may be where the file names its neighbour [rad]: digits.
_QUARTER_SLACK = np.deg2rad(0.01)


class SpeedUnit(Enum):
    """What the number of a speed counts."""

    SECONDS = "time of the move in [s]"
    TOP_SPEED = "fraction of the top speed of the joint that takes longest"
    LEADING_JOINT = "speed of the joint that turns farthest in [rad/s]"
    TOOL_POINT = "speed of the tool point in [m/s]"
    HAND = "speed at which the hand turns in [rad/s]"


@dataclass(frozen=True)
class WrittenSpeed:
    """The speed of a move as written.

    Attributes:
        unit: What the value counts.
        value: In SI.
        text: As in the file.
        digit: What one more in its last digit counts, in SI.
    """

    unit: SpeedUnit
    value: float
    text: str
    digit: float = 0.0

    @classmethod
    def of_number(
        cls, unit: SpeedUnit, factor: float, number: str, decimals: int, text: str
    ) -> WrittenSpeed:
        """Return the speed of a number in a file.

        Args:
            unit: What it counts.
            factor: One of it in SI.
            number: As in the file.
            decimals: How many the language writes.
            text: Number and unit as in the file.
        """
        return cls(unit, factor * float(number), text, factor * 10.0**-decimals)


@dataclass(frozen=True)
class Corner:
    """How far a controller may round the corner at the end of a move.

    Attributes:
        size: In the language's own measure, 0 for an exact stop, infinite where nothing says.
        text: As in the file.
        reach: How far in [m] the tool point is from the written position at the most where the
            robot leaves its move, infinite where nobody knows.
        arc: Whether `reach` is the radius of an arc between two straight moves instead.
    """

    size: float
    text: str
    reach: float = np.inf
    arc: bool = False

    @property
    def zone(self) -> float:
        """How far in [m] from the written position the robot may leave its move, 0 for a stop."""
        return 0.0 if self.exact_stop else self.reach

    def in_words(self, zone: float) -> str:
        """Return the corner and what is taken for its zone in [m], for people."""
        if np.isinf(zone):
            return f"{self.text} (zone not known, half of each move taken)"
        return f"{self.text} (zone {1e3 * zone:g} mm)"

    def within(self, limit: Corner, slack: float) -> bool:
        """Return whether it is no larger than another of its measure, but for a fraction of it."""
        same = self.exact_stop or self.arc is limit.arc
        return same and self.size <= limit.size * (1.0 + slack)

    @property
    def exact_stop(self) -> bool:
        """Whether the robot comes to rest there."""
        return self.size == 0.0


@dataclass(frozen=True)
class Corners:
    """The largest corners a job allows; for each kind of move, and where the robot has to stop.

    Straight moves of some kinds may have others.
    """

    stop: Corner
    on_wheel: Corner
    lead: Corner
    air: Corner
    straight: Mapping[Purpose, Corner] = field(default_factory=dict)

    def of(self, kind: Purpose, straight: bool = False) -> Corner:
        """Return the largest corner after a move of a kind."""
        corner: Corner = getattr(self, kind.value)
        return self.straight.get(kind, corner) if straight else corner


@dataclass(frozen=True, eq=False)
class ReadMove:
    """A move as a file gives it.

    Attributes:
        target: Where it ends: a configuration in [rad], shape (6,), or the pose that runs straight
            as the controller counts it, shape (4, 4).
        straight: Whether the tool point runs on a straight line instead of the joints.
        speed: How fast.
        corner: How its end may be rounded.
        tool: The tool it is written with, as the language names it.
        place: File and line, for people.
        resolution: Half of the last digit of the target in [rad], shape (6,).
        quarters: Quarter turns of axes 1, 4 and 6 that the file states beside a pose; none where
            it states none.
        starts: Whether a program begins with it, so that nobody knows from where it comes.
        ramps: What it says of speeding up and slowing down, as written; empty where it leaves both
            to the controller.
        frame: What a pose is counted from, for people.
    """

    target: Array
    straight: bool
    speed: WrittenSpeed
    corner: Corner
    tool: str
    place: str
    resolution: Array
    quarters: tuple[int, ...] = ()
    starts: bool = False
    ramps: str = ""
    frame: str = "the base frame"


@dataclass(frozen=True, eq=False)
class Playback:
    """Configurations in the order they are visited, joined by linear joint interpolation.

    Attributes:
        q: Joint positions in [rad], shape (n, 6).
        duration: Time of the move that ends at each configuration at the written speed, ramps left
            out, in [s], shape (n,); 0 for the first, which is reached from wherever the robot is.
        stations: Indices of the configurations that are written, in order; the others lie on lines
            between them, shape (m,).
        moves: The move to each of these, m items.
        events: What is done besides moving, in order; each after one of these moves.
    """

    q: Array
    duration: Array
    stations: NDArray[np.intp]
    moves: tuple[ReadMove, ...]
    events: tuple[Event, ...] = ()


@dataclass(frozen=True, eq=False)
class Reading:
    """What was read from the files of a program.

    Attributes:
        name: Of the program on the controller, of several the one to start with.
        playback: What the controller does, None where that is in doubt.
        foreign: Names of the user's own programs that are called and were not looked at.
        findings: What a controller would refuse, and what cannot be followed without doubt.
    """

    name: str
    playback: Playback | None
    foreign: tuple[str, ...]
    findings: tuple[Finding, ...]


def play(
    moves: Sequence[ReadMove], events: Sequence[Event], robot: Robot, led: Led
) -> tuple[Playback | None, list[Finding]]:
    """Return what a controller does with moves, and what is in doubt; None if something is.

    Args:
        moves: In the order the controller makes them.
        events: What it does besides.
        robot: Whose moves.
        led: What straight moves lead along lines.
    """
    if not moves:
        return None, [Finding(Level.ERROR, "program", "program", "moves nothing")]
    legs: list[Array] = []
    times: list[Array] = []
    found: list[Finding] = []
    q: Array | None = None
    for move in moves:
        end = _end(move, q, robot, led)
        found += _faults(move, end)
        if end is None:
            continue
        leg: Array | None = end[None]
        if move.straight and q is not None:
            leg = straight_configurations(robot, q, end, led)
            if leg is None:
                message = "the straight move does not lead to the configuration that is written"
                found.append(_fault(move, message))
                leg = end[None]
        assert leg is not None
        time = 0.0 if q is None else move_time(move.speed, q, end, robot, led)
        legs.append(leg)
        times.append(np.full(len(leg), time / len(leg)))
        q = end
    if found:
        return None, found
    stations = np.cumsum([len(leg) for leg in legs]) - 1
    q_all, times_all = np.concatenate(legs), np.concatenate(times)
    return Playback(q_all, times_all, stations, tuple(moves), tuple(events)), []


def _end(move: ReadMove, q: Array | None, robot: Robot, led: Led) -> Array | None:
    """Return the configuration a move ends in: of a pose the one next to where it starts."""
    if move.target.shape != (4, 4):
        return None if np.isnan(move.target).any() else move.target
    if q is None:
        return None
    T_base_flange = led.flanges(led.from_counted(move.target, robot))
    (candidates,) = inverse_kinematics(robot.arm, T_base_flange[None], q[None])
    turned = nearest_turn(candidates, q)
    away = np.abs(turned - q).max(axis=1)
    return None if np.isnan(away).all() else np.asarray(turned[int(np.nanargmin(away))])


def _faults(move: ReadMove, end: Array | None) -> Iterator[Finding]:
    if not move.speed.value > 0.0:
        yield _fault(move, f"{move.speed.text}: must be above 0")
    if end is None:
        yield _fault(move, "no single configuration within the limits belongs to it")
    elif move.quarters:
        turns = end[[0, 3, 5]] / (np.pi / 2.0) - np.array(move.quarters)
        slack = _QUARTER_SLACK / (np.pi / 2.0)
        if (turns < -slack).any() or (turns > 1.0 + slack).any():
            yield _fault(move, "the quarter turns of its axes are not those of its pose")


def move_time(speed: WrittenSpeed, start: Array, end: Array, robot: Robot, led: Led) -> float:
    """Return the time of a move in [s], ramps left out."""
    if speed.unit is SpeedUnit.SECONDS:
        return speed.value
    turned = np.abs(end - start)
    if speed.unit is SpeedUnit.TOP_SPEED:
        distance = float((turned / robot.max_speed).max())
    elif speed.unit is SpeedUnit.LEADING_JOINT:
        distance = float(turned.max())
    else:
        T_start, T_end = led.frames(forward_kinematics(robot, np.stack([start, end])))
        if speed.unit is SpeedUnit.TOOL_POINT:
            distance = float(np.linalg.norm(T_end[:3, 3] - T_start[:3, 3]))
        else:
            distance = float(rotation_angle(T_start, T_end))
    return distance / speed.value if speed.value > 0.0 else 0.0


def _fault(move: ReadMove, message: str) -> Finding:
    return Finding(Level.ERROR, "program", move.place, message)


def other_tools(moves: Sequence[ReadMove], tool: str) -> Iterator[Finding]:
    """Look for moves with another tool than the job's; of several in a row the first is named."""
    before = tool
    for move in moves:
        if move.tool not in (tool, before):
            yield _fault(move, f"moves with tool {move.tool}; the job's is {tool}")
        before = move.tool
