"""Actions, corners and ramps in INFORM."""

from __future__ import annotations

from opl.errors import InputError, SettingError
from opl.program.actions import Action, Call, Dwell, Remark, SetOutput, WaitInput
from opl.program.controller import ControllerProfile
from opl.program.dialect import ActionTexts
from opl.program.moves import Move, Purpose
from opl.program.settings import ProgramSettings

ACTIONS = ActionTexts(
    states=("OFF", "ON"),
    output="DOUT OT#({number}) {state}",
    dwell="TIMER T={seconds:.2f}",
    wait=("WAIT IN#({number})={state}",),
    timed_wait=(
        "*WAIT{count}",
        "WAIT IN#({number})={state} T={timeout:.2f}",
        "PAUSE IF IN#({number})={other}",
        "JUMP *WAIT{count} IF IN#({number})={other}",
    ),
    call="CALL JOB:{name}",
    remark="'{text}",
)


STOP_LEVEL = 0


def corner(
    move: Move, straight: bool, settings: ProgramSettings, profile: ControllerProfile
) -> str:
    """Return the tag that says how the end of a move is rounded, after a space; "" for none."""
    if move.exact_stop:
        return f" PL={STOP_LEVEL}"
    radius = radius_tag(move.kind, settings, profile) if straight else None
    if radius is not None:
        return f" {radius}"
    level = settings.levels.of(move.kind)
    return "" if level is None else f" PL={level}"


def radius_tag(kind: Purpose, settings: ProgramSettings, profile: ControllerProfile) -> str | None:
    """Return the corner radius of the straight moves of a kind, None where they have a level.

    Raises:
        SettingError: If the controller takes no such radius.
    """
    if kind not in settings.corner_radii:
        return None
    radius, allowed = 1e3 * settings.corner_radii[kind], profile.corner_radius
    if not allowed.lowest <= radius <= allowed.highest:
        message = f"must be {allowed.lowest:g} to {allowed.highest:g} mm, got {radius:g}"
        raise SettingError("corner_radius", message)
    return f"CR={allowed.text(radius)}"


def ramps(kind: Purpose, settings: ProgramSettings) -> str:
    """Return the tags that set the ramps of a move, each after a space; "" where there are none."""
    pairs = (("ACC", settings.acceleration), ("DEC", settings.deceleration))
    found = ((word, numbers.of(kind)) for word, numbers in pairs)
    return "".join(f" {word}={percent}" for word, percent in found if percent is not None)


def require_accepted_action(action: Action, profile: ControllerProfile) -> None:
    """Refuse an action that a controller does not take.

    Raises:
        InputError: If its name, number, time or comment is not legal.
    """
    if isinstance(action, (SetOutput, WaitInput)):
        highest = profile.highest_signal
        if not 1 <= action.number <= highest:
            message = f"must be 1 to {highest}, got {action.number}"
            raise InputError("program: input or output", message)
    elif isinstance(action, Call):
        if fault := profile.name_fault(action.name):
            raise InputError("program: call", fault)
    elif isinstance(action, Remark) and (fault := profile.comment_fault(action.text)):
        raise InputError("program: comment", fault)
    time = action.seconds if isinstance(action, Dwell) else getattr(action, "timeout", None)
    timer = profile.timer
    if time is not None and not timer.lowest <= time <= timer.highest:
        allowed = f"{timer.lowest:g} to {timer.highest:g} s"
        raise InputError("program: time", f"must be {allowed}, got {time:g}")
