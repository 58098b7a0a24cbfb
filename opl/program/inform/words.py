"""Actions and ramps in INFORM."""

from __future__ import annotations

from opl.errors import InputError
from opl.program.actions import Action, Call, Dwell, Remark, SetOutput, WaitInput
from opl.program.controller import ControllerProfile
from opl.program.dialect import ActionTexts
from opl.program.moves import Purpose
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
