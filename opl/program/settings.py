"""The settings of a job for its program, in SI units; their keys are known in `opl.job` only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

import numpy as np

from opl.geometry.frames import Array
from opl.program.actions import NO_ACTIONS, Actions
from opl.program.led import HandTool, Led, StationaryTool
from opl.program.moves import Purpose


class MotionForm(str, Enum):
    """How moves on the wheel and along its normal are written."""

    JOINT = "joint"  # all joints linear, as verified
    STRAIGHT = "straight"  # the tool point on a line, where that stays near the verified path


class PositionForm(str, Enum):
    """How positions are written."""

    PULSES = "pulses"
    BASE = "base"
    ROBOT = "robot"
    USER = "user"


@dataclass(frozen=True, eq=False)
class UserFrame:
    """A user frame as it is set on the controller.

    Attributes:
        number: Its number.
        T_base_user: Where it lies, shape (4, 4).
    """

    number: int
    T_base_user: Array


@dataclass(frozen=True, eq=False)
class Load:
    """Something that the flange carries.

    Attributes:
        mass: In [kg].
        p_flange: Its centre of gravity in the flange frame in [m], shape (3,).
    """

    mass: float
    p_flange: Array


@dataclass(frozen=True)
class ByKind:
    """A number for each kind of move, none where the controller's own is to hold.

    Attributes:
        on_wheel: While grinding.
        lead: To and from the wheel along its normal.
        air: From and to home, and between passes.
    """

    on_wheel: int | None = None
    lead: int | None = None
    air: int | None = None

    def of(self, kind: Purpose) -> int | None:
        """Return the number for a kind of move."""
        number: int | None = getattr(self, kind.value)
        return number


@dataclass(frozen=True, eq=False)
class ProgramSettings:
    """How a program is written.

    Attributes:
        controller: Name of the post that writes it, e.g. ``DX200``.
        tool: Number of the tool in whose name positions are kept.
        T_flange_tool: That tool as it is set on the controller, shape (4, 4).
        motion: How moves on the wheel are written.
        stationary: The tool at the wheel past which straight moves lead the part, None where the
            tool in the hand runs straight.
        positions: How positions are written.
        user_frame: The frame of positions in a user frame, or that of a stationary tool.
        levels: How far corners may be rounded where the robot does not stop (PL of a Yaskawa).
        corner_radii: Radii in [m] of the corners between straight moves, by kind of move (CR of a
            Yaskawa); kinds that are not in it have levels.
        acceleration: Of each kind of move in percent of the controller's own ramp.
        deceleration: The same for slowing down.
        actions: What is done around the passes.
        accepted_pulses: Joints whose unverified pulse ratios are accepted.
        one_job_per_pass: Whether each pass is a job of its own, called by a master.
        load: The part in the hand, None where nobody says what it weighs.
        gripper: What holds it, None where nobody says what it weighs.
        belt_switched_by: Who switches the belt if not the program, None where nobody says.
        title: A line about the program, None without one.
        template: The user's own template, None for the one that comes with opl.
    """

    controller: str = "DX200"
    tool: int = 0
    T_flange_tool: Array = field(default_factory=lambda: np.eye(4))
    motion: MotionForm = MotionForm.JOINT
    stationary: StationaryTool | None = None
    positions: PositionForm = PositionForm.PULSES
    user_frame: UserFrame | None = None
    # the finest level that does not stop: a pass must not, or the belt digs in
    levels: ByKind = ByKind(on_wheel=1, lead=1, air=1)
    corner_radii: Mapping[Purpose, float] = field(default_factory=dict)
    acceleration: ByKind = ByKind()
    deceleration: ByKind = ByKind()
    actions: Actions = NO_ACTIONS
    accepted_pulses: tuple[str, ...] = ()
    one_job_per_pass: bool = False
    load: Load | None = None
    gripper: Load | None = None
    belt_switched_by: str | None = None
    title: str | None = None
    template: Path | None = None

    @property
    def led(self) -> Led:
        """What straight moves lead along lines."""
        return self.stationary or HandTool(self.T_flange_tool)
