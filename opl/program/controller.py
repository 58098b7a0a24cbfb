"""What a controller accepts: every limit of a program file, with its source."""

from __future__ import annotations

import re
from dataclasses import dataclass

_NAME = re.compile(r"[A-Z0-9_-]+")
_COMMENT = re.compile(r"[ -~]*")


@dataclass(frozen=True)
class ControllerProfile:
    """The limits of one generation of Yaskawa controllers.

    Attributes:
        name: What people call it.
        name_length: Most characters of a job name.
        comment_length: Most characters of a comment, the mark that opens it not counted.
        step_limit: Most positions in one job; longer programs are split.
        label_digits: Digits of a position label in the list of positions.
        joint_speed: Lowest and highest VJ in percent of the joints' own top speeds.
        joint_speed_decimals: Decimals VJ is written with.
        linear_speed: Lowest and highest V in [mm/s].
        linear_speed_decimals: Decimals V is written with.
        position_levels: Highest PL.
        highest_tool: Highest tool number; the lowest is 0.
    """

    name: str
    name_length: int
    comment_length: int
    step_limit: int
    label_digits: int
    joint_speed: tuple[float, float]
    joint_speed_decimals: int
    linear_speed: tuple[float, float]
    linear_speed_decimals: int
    position_levels: int
    highest_tool: int

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

    def joint_speed_text(self, fraction: float) -> str:
        """Return VJ as written, for a fraction of the joints' top speeds.

        A move slower than the controller can be asked for gets the slowest VJ there is.
        """
        lowest, highest = self.joint_speed
        percent = min(max(100.0 * fraction, lowest), highest)
        return f"{percent:.{self.joint_speed_decimals}f}"


DX200 = ControllerProfile(
    name="DX200",
    # the manuals of DX100 and later give 32 for names and comments; longest seen in jobs saved by
    # controllers: 27 and 32
    name_length=32,
    comment_length=32,
    # a job holds fewer than 10,000 lines (the controllers' remote commands count them with four
    # digits); other post-processors split at 2000, and no saved job seen had half of that
    step_limit=2000,
    # C00000 in every job saved by a DX100 or later
    label_digits=5,
    # all of some 480 saved VJ have two decimals; the pendant offers 0.01 to 100.00
    joint_speed=(0.01, 100.0),
    joint_speed_decimals=2,
    # all of some 2200 saved V have one decimal; 1500 mm/s is the documented span, not seen in a
    # manual of this controller
    linear_speed=(0.1, 1500.0),
    linear_speed_decimals=1,
    # PL=0 (stop in position) to PL=8
    position_levels=8,
    # 64 tools in the controllers of DX generation and later, 24 before
    highest_tool=63,
)
