"""The section ``program`` of a job file: its keys, units and defaults."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from opl.cell.robot import Robot
from opl.cell.spherical_wrist import SphericalWristArm
from opl.errors import InputError, OplError
from opl.files.documents import Document
from opl.geometry.frames import Array, nearest_pose
from opl.job.bodies import Matrix
from opl.job.source import Source
from opl.program.actions import Action, Actions, Call, Dwell, Remark, SetOutput, WaitInput
from opl.program.posts import Post, find_post, known_posts
from opl.program.pulses import require_accepted, require_known
from opl.program.ratios import with_ratios
from opl.program.settings import ByKind, MotionForm, PositionForm, ProgramSettings, UserFrame
from opl.program.write import try_out

_MAY_COUNT_PULSES = ("Yaskawa", "unknown")  # makers

_Signal = Annotated[int, Field(ge=0)]
_Seconds = Annotated[float, Field(gt=0.0)]
_Level = Annotated[int, Field(ge=0, le=8)]
_Percent = Annotated[int, Field(ge=1, le=100)]


class _Action(Document):
    """One line of a list of actions: exactly one of its main keys."""

    comment: str | None = None
    output: _Signal | None = None
    wait_input: _Signal | None = None
    state: bool | None = None
    timeout_s: _Seconds | None = None
    dwell_s: _Seconds | None = None
    call: str | None = None

    @model_validator(mode="after")
    def _one_action(self) -> _Action:
        main = ("comment", "output", "wait_input", "dwell_s", "call")
        given = [key for key in main if getattr(self, key) is not None]
        if len(given) != 1:
            raise ValueError(f"needs exactly one of {', '.join(main)}")
        signal = given[0] in ("output", "wait_input")
        if signal != (self.state is not None):
            raise ValueError("state (on or off) goes with output and wait_input, and only there")
        if self.timeout_s is not None and given[0] != "wait_input":
            raise ValueError("timeout_s goes with wait_input only")
        return self

    def in_si(self) -> Action:
        if self.comment is not None:
            return Remark(self.comment)
        if self.output is not None:
            return SetOutput(self.output, bool(self.state))
        if self.wait_input is not None:
            return WaitInput(self.wait_input, bool(self.state), self.timeout_s)
        if self.dwell_s is not None:
            return Dwell(self.dwell_s)
        return Call(str(self.call))


class _Levels(Document):
    on_wheel: _Level = 1
    lead: _Level = 1
    air: _Level = 1


class _Percents(Document):
    on_wheel: _Percent | None = None
    lead: _Percent | None = None
    air: _Percent | None = None

    def in_si(self) -> ByKind:
        return ByKind(self.on_wheel, self.lead, self.air)


class _UserFrame(Document):
    number: Annotated[int, Field(ge=1)]
    T_base_user_mm: Matrix


class ProgramSection(Document):
    """The keys of the section ``program``."""

    controller: str = "DX200"
    tool: Annotated[int, Field(ge=0)] = 0
    T_flange_tool_mm: Matrix | None = None
    motion: Literal["joint", "straight"] = "joint"
    positions: Literal["pulses", "base", "robot", "user"] = "pulses"
    user_frame: _UserFrame | None = None
    pulse_ratios: str | None = None
    accept_unverified_pulses: list[str] = Field(default=[])
    levels: _Levels = _Levels()
    acceleration_percent: _Percents = _Percents()
    deceleration_percent: _Percents = _Percents()
    comment: str | None = None
    at_start: list[_Action] = Field(default=[])
    before_pass: list[_Action] = Field(default=[])
    after_pass: list[_Action] = Field(default=[])
    at_end: list[_Action] = Field(default=[])
    template: str | None = None

    @model_validator(mode="after")
    def _fits(self) -> ProgramSection:
        if (self.positions == "user") != (self.user_frame is not None):
            raise ValueError("user_frame goes with positions: user, and only there")
        cartesian = self.positions != "pulses" or self.motion == "straight"
        if cartesian and self.tool and self.T_flange_tool_mm is None:
            raise ValueError(
                "positions in a frame and straight moves need T_flange_tool_mm, the data of tool "
                f"{self.tool} on the controller"
            )
        return self

    def robot_as_counted(self, source: Source, robot: Robot) -> Robot:
        """Return the robot with the pulse ratios and soft limits that the job names.

        Raises:
            InputError: If that file is unusable.
        """
        if self.pulse_ratios is None:
            return robot
        try:
            return with_ratios(robot, source.file(self.pulse_ratios))
        except InputError as error:
            raise InputError(source.at("program.pulse_ratios"), str(error)) from error

    def in_si(self, source: Source, name: str, robot: Robot, home: Array) -> ProgramSettings:
        """Return the settings, tried out on a program that only goes home.

        Args:
            source: The job file or mapping.
            name: The program's name.
            robot: Whose program.
            home: Joint positions in [rad], shape (6,).

        Raises:
            InputError: If something in it is unknown, or the controller does not take it.
        """
        post = find_post(self.controller, source.at("program.controller"))
        self._require_possible(source, post, robot)
        where = source.at("program.accept_unverified_pulses")
        for joint in self.accept_unverified_pulses:
            if joint not in robot.joint_names:
                known = ", ".join(robot.joint_names)
                raise InputError(where, f"no such joint {joint!r}; have: {known}")
        if post.counts_pulses and self.positions == "pulses":
            require_known(robot, source.at("program.pulse_ratios"))
            require_accepted(robot.unverified_pulses, self.accept_unverified_pulses, where)
        settings = self._settings(source)
        try:
            try_out(name, home, robot, settings)
        except OplError as error:
            raise InputError(source.label, str(error)) from error
        return settings

    def _settings(self, source: Source) -> ProgramSettings:
        levels = self.levels
        frame = self.user_frame
        return ProgramSettings(
            controller=self.controller,
            tool=self.tool,
            T_flange_tool=_pose(self.T_flange_tool_mm),
            motion=MotionForm(self.motion),
            positions=PositionForm(self.positions),
            user_frame=None
            if frame is None
            else UserFrame(frame.number, _pose(frame.T_base_user_mm)),
            levels=ByKind(levels.on_wheel, levels.lead, levels.air),
            acceleration=self.acceleration_percent.in_si(),
            deceleration=self.deceleration_percent.in_si(),
            actions=Actions(
                *(
                    tuple(action.in_si() for action in some)
                    for some in (self.at_start, self.before_pass, self.after_pass, self.at_end)
                )
            ),
            accepted_pulses=tuple(self.accept_unverified_pulses),
            title=self.comment,
            template=None if self.template is None else source.file(self.template),
        )

    def _require_possible(self, source: Source, post: Post, robot: Robot) -> None:
        """Refuse another maker's arm, and keys that the post would pass over in silence."""
        if post.counts_pulses:
            if robot.missing_pulses and robot.maker not in _MAY_COUNT_PULSES:
                raise InputError(
                    source.at("program.controller"),
                    f"{self.controller} counts pulses, of which {robot.title} (robot: "
                    f"{robot.name}, made by {robot.maker}) has none; name the controller of that "
                    f"arm: {', '.join(_without_pulses())}",
                )
            if self.positions != "pulses" and not isinstance(robot.arm, SphericalWristArm):
                raise InputError(
                    source.at("program.positions"),
                    f"must be pulses: poses of {self.controller} name a posture as that of an arm "
                    f"with a spherical wrist, which {robot.title} has not",
                )
            return
        own = ("positions", "user_frame", "levels", "acceleration_percent", "deceleration_percent")
        for key in own:
            if key in self.model_fields_set:
                raise InputError(
                    source.at(f"program.{key}"), f"is for Yaskawa controllers, not for {post.title}"
                )


def _without_pulses() -> list[str]:
    return [name for name in known_posts() if not find_post(name).counts_pulses]


def _pose(matrix_mm: list[list[float]] | None) -> Array:
    if matrix_mm is None:
        return np.eye(4)
    matrix = np.array(matrix_mm)
    matrix[:3, 3] *= 1e-3
    return nearest_pose(matrix)
