"""The section ``program`` of a job file: its keys, units and defaults."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from opl.cell.robot import Robot
from opl.cell.spherical_wrist import SphericalWristArm
from opl.errors import InputError, OplError, SettingError
from opl.files.documents import Document
from opl.files.quantities import at_most, between
from opl.geometry.frames import Array
from opl.job import keys
from opl.job.actions import ActionSection
from opl.job.bodies import Matrix, pose_of
from opl.job.move_kinds import CornerRadii, Percents, PositionLevels
from opl.job.refusals import keys_named
from opl.job.source import Source
from opl.job.stationary_tool import (
    is_led_past_one,
    require_stationary_tool,
    stationary_tool_of,
)
from opl.job.user_frame import UserFrameSection
from opl.job.workpiece import GripperSection
from opl.program.actions import Actions
from opl.program.export import try_out
from opl.program.led import StationaryTool
from opl.program.posts import Post, StationaryTools, find_post, known_posts
from opl.program.ratios import with_ratios
from opl.program.settings import (
    Load,
    MotionForm,
    PositionForm,
    ProgramSettings,
)

_MAY_COUNT_PULSES = ("Yaskawa", "unknown")  # makers
_YASKAWA_ONLY = (
    *("positions", "user_frame"),
    *("position_levels", "corner_radius_mm", "acceleration_percent", "deceleration_percent"),
    "one_job_per_pass",
)


class ProgramSection(Document):
    """The controller, and how the program is written."""

    model_config = ConfigDict(title="Program")
    renamed: ClassVar[Mapping[str, str]] = {"levels": "position_levels"}

    controller: str = Field(
        default="DX200",
        description="A Yaskawa controller (NX100, DX100, DX200, YRC1000), another language (RAPID, "
        "KRL, FANUC, URSCRIPT), or a post of your own.",
    )
    tool: Annotated[int, between(0, 999)] = Field(
        default=0, description="Number of the tool that positions are written for."
    )
    T_flange_tool_mm: Matrix | None = Field(
        default=None,
        description="Pose of that tool in the flange frame as it is set on the controller, 4x4 "
        "with its origin in mm; else the flange itself.",
    )
    motion: Literal["joint", "straight"] | None = Field(
        default=None,
        description="Moves on the wheel, approach and retract as joint moves, or straight where "
        "that stays near the verified path; else joint moves, in KRL straight ones: its joint "
        "speeds are whole percents, too coarse for the feed.",
    )
    stationary_tool: bool | None = Field(
        default=None,
        description="Straight moves lead the part past a tool point that stands at the wheel "
        "(contact frame 0), so that their speed is that over the part: the surface feed where the "
        "part is ground there. In RAPID unless false. In FANUC if true: needs the option Remote "
        "TCP (RTCP), and `user_frame` set on the controller as the program says. URScript has "
        "none; what KRL ($IPO_MODE #TCP) and INFORM (an option) make of positions is not public.",
    )
    positions: Literal["pulses", "base", "robot", "user"] = Field(
        default="pulses",
        description="Positions as encoder pulses, or as poses in the base, robot or user frame. "
        "For Yaskawa controllers.",
    )
    user_frame: UserFrameSection | None = Field(
        default=None,
        description="The frame of `positions: user`, else user frame 1 at the wheel: touched up, "
        "it takes the whole program along, home included. In FANUC that of `stationary_tool`.",
    )
    pulse_ratios: str | None = Field(
        default=None,
        description="File with the pulse ratios of your robot, from `opl robots import-params`; "
        "else those of the robot's data.",
    )
    accept_unverified_pulses: Annotated[list[str], at_most(100)] = Field(
        default=[],
        description="Names of joints whose pulse ratios nobody has verified and you accept.",
    )
    position_levels: PositionLevels = Field(
        default=PositionLevels(),
        description="Position level (PL) of each kind of move. For Yaskawa controllers.",
    )
    corner_radius_mm: CornerRadii = Field(
        default=CornerRadii(),
        description="Corner radius (CR) of straight moves instead of a position level. For Yaskawa "
        "controllers, with `motion: straight`.",
    )
    acceleration_percent: Percents = Field(
        default=Percents(),
        description="Acceleration (ACC) of each kind of move. For Yaskawa controllers.",
    )
    deceleration_percent: Percents = Field(
        default=Percents(),
        description="Deceleration (DEC) of each kind of move. For Yaskawa controllers.",
    )
    one_job_per_pass: bool = Field(
        default=False,
        description="Each pass as a job of its own, from home to home, called by a master, so that "
        "it can be repeated or left out at the pendant. For Yaskawa controllers.",
    )
    belt_switched_by: str | None = Field(
        default=None,
        description="Who switches the belt where the program does not, e.g. `the operator`; else "
        "opl asks.",
    )
    gripper: GripperSection | None = Field(
        default=None,
        description="What the gripper weighs. With it and `workpiece.density_kg_m3` programs set "
        "the load of both together: in TOOL.CND, $LOAD, set_target_payload; RAPID has them apart.",
    )
    comment: str | None = Field(default=None, description="A line about the program, in its head.")
    at_start: Annotated[list[ActionSection], at_most(500)] = Field(
        default=[], description="Actions at home, before anything else."
    )
    before_pass: Annotated[list[ActionSection], at_most(500)] = Field(
        default=[], description="Actions in front of the wheel, before each approach."
    )
    after_pass: Annotated[list[ActionSection], at_most(500)] = Field(
        default=[], description="Actions in front of the wheel, after each retract."
    )
    at_end: Annotated[list[ActionSection], at_most(500)] = Field(
        default=[], description="Actions at home, at the end."
    )
    template: str | None = Field(
        default=None,
        description="A template of your own for the layout of the program, relative to this file.",
    )

    @model_validator(mode="after")
    def _fits(self) -> ProgramSection:
        if self.user_frame is not None and self.positions != "user" and not self.stationary_tool:
            raise ValueError("user_frame goes with positions: user only, in FANUC stationary_tool")
        return self

    def _form(self, post: Post) -> MotionForm:
        """Return how moves on the wheel are written."""
        return post.motion if self.motion is None else MotionForm(self.motion)

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
            raise InputError(source.at(keys.PROGRAM_PULSE_RATIOS), str(error)) from error

    def in_si(
        self,
        source: Source,
        name: str,
        robot: Robot,
        home: Array,
        at_wheel: StationaryTool,
        load: Load | None,
    ) -> ProgramSettings:
        """Return the settings, tried out on a program that only goes home.

        Args:
            source: The job file or mapping.
            name: The program's name.
            robot: Whose program.
            home: Joint positions in [rad], shape (6,).
            at_wheel: Contact frame 0 of the wheel, and the part in the hand.
            load: The part in the hand, None where nobody says what it weighs.

        Raises:
            InputError: If something in it is unknown, or the controller does not take it.
        """
        with keys_named(source):
            self._require_possible(source, find_post(self.controller), robot)
            for joint in self.accept_unverified_pulses:
                if joint not in robot.joint_names:
                    known = ", ".join(robot.joint_names)
                    raise SettingError("accepted_pulses", f"no such joint {joint!r}; have: {known}")
            settings = self._settings(source, find_post(self.controller), at_wheel, load)
            try:
                try_out(name, home, robot, settings)
            except SettingError:
                raise
            except OplError as error:
                raise InputError(source.label, str(error)) from error
        return settings

    def _settings(
        self, source: Source, post: Post, at_wheel: StationaryTool, load: Load | None
    ) -> ProgramSettings:
        tool = self.T_flange_tool_mm
        frame, stationary = None, None
        if is_led_past_one(self.stationary_tool, post, self._form(post)):
            stationary, frame = stationary_tool_of(self.user_frame, post, at_wheel)
        elif self.positions == "user":
            section = self.user_frame or UserFrameSection.model_validate({})
            frame = section.in_si(at_wheel.T_base_tool)
        actions = (self.at_start, self.before_pass, self.after_pass, self.at_end)
        return ProgramSettings(
            controller=self.controller,
            tool=self.tool,
            T_flange_tool=np.eye(4) if tool is None else pose_of(tool),
            motion=self._form(post),
            stationary=stationary,
            positions=PositionForm(self.positions),
            user_frame=frame,
            levels=self.position_levels.in_si(),
            corner_radii=self.corner_radius_mm.in_si(),
            acceleration=self.acceleration_percent.in_si(),
            deceleration=self.deceleration_percent.in_si(),
            actions=Actions(*(tuple(action.in_si() for action in some) for some in actions)),
            accepted_pulses=tuple(self.accept_unverified_pulses),
            one_job_per_pass=self.one_job_per_pass,
            load=load,
            gripper=None if self.gripper is None else self.gripper.in_si(),
            belt_switched_by=self.belt_switched_by,
            title=self.comment,
            template=None
            if self.template is None
            else source.file(self.template, "program.template"),
        )

    def _require_possible(self, source: Source, post: Post, robot: Robot) -> None:
        """Refuse another maker's arm, and keys that the post would pass over in silence."""
        form = self._form(post)
        if self.stationary_tool:
            require_stationary_tool(source, post, form)
        past_one = is_led_past_one(self.stationary_tool, post, form)
        led = form is MotionForm.STRAIGHT and not past_one
        if (led or self.positions != "pulses") and self.tool and not self.T_flange_tool_mm:
            raise InputError(
                source.at(keys.PROGRAM_TOOL_POSE),
                "positions in a frame and straight moves need the data of tool "
                f"{self.tool} on the controller",
            )
        if post.counts_pulses:
            if robot.missing_pulses and robot.maker not in _MAY_COUNT_PULSES:
                others = [name for name in known_posts() if not find_post(name).counts_pulses]
                raise InputError(
                    source.at(keys.PROGRAM_CONTROLLER),
                    f"{self.controller} counts pulses, of which {robot.title} (robot: "
                    f"{robot.name}, made by {robot.maker}) has none; name the controller of that "
                    f"arm: {', '.join(others)}",
                )
            if self.positions != "pulses" and not isinstance(robot.arm, SphericalWristArm):
                raise InputError(
                    source.at("program.positions"),
                    f"must be pulses: poses of {self.controller} name a configuration as that of "
                    f"an arm with a spherical wrist, which {robot.title} has not",
                )
            if form is not MotionForm.STRAIGHT and (keys_given := [*self.corner_radius_mm.given()]):
                raise InputError(
                    source.at(f"program.corner_radius_mm.{keys_given[0]}"),
                    "goes with motion: straight only; joint moves take position_levels",
                )
            return
        in_frame = post.stationary_tools is StationaryTools.IN_FRAME
        for key in _YASKAWA_ONLY:
            if key in self.model_fields_set and not (in_frame and key == "user_frame"):
                raise InputError(
                    source.at(f"program.{key}"), f"is for Yaskawa controllers, not for {post.title}"
                )
