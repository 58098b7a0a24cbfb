"""The key ``program.stationary_tool``: a tool that stands, past which straight moves lead the part.

Its place is contact frame 0 of the wheel; where the controller knows it as a user frame, that of
the key ``program.user_frame``.
"""

from __future__ import annotations

from opl.errors import InputError
from opl.job import keys
from opl.job.source import Source
from opl.job.user_frame import UserFrameSection
from opl.program.led import StationaryTool
from opl.program.posts import Post, StationaryTools
from opl.program.settings import MotionForm, UserFrame


def is_led_past_one(wanted: bool | None, post: Post, motion: MotionForm) -> bool:
    """Return whether straight moves lead the part past a tool that stands.

    Args:
        wanted: What the key says, None where it is not there.
        post: Of the controller.
        motion: How moves on the wheel are written.
    """
    usual = post.stationary_tools is StationaryTools.USUAL
    return (usual if wanted is None else wanted) and motion is MotionForm.STRAIGHT


def stationary_tool_of(
    section: UserFrameSection | None, post: Post, at_wheel: StationaryTool
) -> tuple[StationaryTool, UserFrame | None]:
    """Return a tool that stands as the controller knows it, and the user frame it is if it is one.

    Args:
        section: The key ``user_frame``.
        post: Of the controller.
        at_wheel: Contact frame 0 of the wheel, and the part in the hand.
    """
    if post.stationary_tools is not StationaryTools.IN_FRAME:
        return at_wheel, None
    frame = (section or UserFrameSection.model_validate({})).in_si(at_wheel.T_base_tool)
    return StationaryTool(frame.T_base_user, at_wheel.T_flange_part), frame


def require_stationary_tool(source: Source, post: Post, motion: MotionForm) -> None:
    """Refuse a tool that stands where there can be none.

    Raises:
        InputError: If the controller has none, or no move is straight.
    """
    where = source.at(keys.PROGRAM_STATIONARY_TOOL)
    if post.stationary_tools is StationaryTools.NONE:
        raise InputError(
            where, f"must not be true: {post.title} has none that public manuals settle"
        )
    if motion is not MotionForm.STRAIGHT:
        raise InputError(where, "needs motion: straight")
