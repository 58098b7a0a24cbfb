"""What a Yaskawa controller accepts: the limits of a program file, one profile per generation.

The profiles themselves, with the source of every number, are in `opl.program.profiles`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from opl.program.speeds import SpeedRange

_NAME = re.compile(r"[A-Z0-9_-]+")
_COMMENT = re.compile(r"[ -~]*")


@dataclass(frozen=True)
class ControllerProfile:
    """The limits of one generation of Yaskawa controllers.

    Attributes:
        name: What people call it.
        name_length: Most characters of a job name.
        comment_length: Most characters of a comment or message, the mark that opens it left out.
        label_length: Most characters of a jump label after its ``*``.
        step_limit: Most positions in one job; longer programs are split.
        line_limit: Most instructions in one job.
        label_digits: Digits of a position label in the list of positions.
        rconf_fields: Numbers in ///RCONF as written.
        least_rconf_fields: Fewest that are read.
        length_decimals: Decimals of x, y, z in [mm].
        angle_decimals: Decimals of rx, ry, rz in [deg].
        joint_speed: VJ in percent of the joints' own top speeds.
        linear_speed: V in [mm/s].
        angular_speed: VR in [deg/s].
        timer: Times in [s].
        ramp_percent: Smallest and largest ACC and DEC.
        position_levels: Highest PL.
        corner_radius: CR in [mm].
        highest_tool: Highest tool number; the lowest is 0.
        highest_user_frame: Highest number of a user frame; the lowest is 1.
        highest_signal: Highest number of an input or output; the lowest is 1.
        instructions: Words an instruction may begin with.
    """

    name: str
    name_length: int
    comment_length: int
    label_length: int
    step_limit: int
    line_limit: int
    label_digits: int
    rconf_fields: int
    least_rconf_fields: int
    length_decimals: int
    angle_decimals: int
    joint_speed: SpeedRange
    linear_speed: SpeedRange
    angular_speed: SpeedRange
    timer: SpeedRange
    ramp_percent: tuple[int, int]
    position_levels: int
    corner_radius: SpeedRange
    highest_tool: int
    highest_user_frame: int
    highest_signal: int
    instructions: frozenset[str]

    def name_fault(self, name: str) -> str | None:
        """Say what is wrong with a job name, None if nothing is.

        Controllers accept a few more characters; these are the ones that every job saved by one
        keeps to.
        """
        if not _NAME.fullmatch(name):
            return f"must be of A-Z, 0-9, _ and -, got {name!r}"
        if len(name) > self.name_length:
            return f"has {len(name)} characters, {self.name} takes {self.name_length}: {name!r}"
        return None

    def comment_fault(self, comment: str) -> str | None:
        """Say what is wrong with a comment, None if nothing is."""
        if not _COMMENT.fullmatch(comment):
            return f"must be printable ASCII, got {comment!r}"
        if len(comment) > self.comment_length:
            return (
                f"has {len(comment)} characters, {self.name} takes {self.comment_length}: "
                f"{comment!r}"
            )
        return None
