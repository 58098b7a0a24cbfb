"""Actions in INFORM."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from opl.errors import InputError
from opl.program.actions import Action, Call, Dwell, SetOutput, WaitInput
from opl.program.controller import ControllerProfile


class ActionWriter:
    """Writes the actions of one job; labels in a job are numbered.

    Args:
        profile: The controller.
    """

    def __init__(self, profile: ControllerProfile) -> None:
        self._profile = profile
        self._waits = 0

    def lines(self, actions: Sequence[Action]) -> tuple[str, ...]:
        """Return the instructions of some actions.

        Raises:
            InputError: If the controller does not take one.
        """
        return tuple(line for action in actions for line in self._lines(action))

    def _lines(self, action: Action) -> Iterator[str]:
        if isinstance(action, SetOutput):
            yield f"DOUT OT#({self._signal(action.number)}) {_state(action.state)}"
        elif isinstance(action, Dwell):
            yield f"TIMER T={self._time(action.seconds)}"
        elif isinstance(action, WaitInput):
            yield from self._wait(action)
        elif isinstance(action, Call):
            if fault := self._profile.name_fault(action.name):
                raise InputError("program: call", fault)
            yield f"CALL JOB:{action.name}"
        else:
            if fault := self._profile.comment_fault(action.text):
                raise InputError("program: comment", fault)
            yield f"'{action.text}"

    def _wait(self, action: WaitInput) -> Iterator[str]:
        signal, state = f"IN#({self._signal(action.number)})", _state(action.state)
        if action.timeout is None:
            yield f"WAIT {signal}={state}"
            return
        self._waits += 1
        label, missing = f"*WAIT{self._waits}", f"IF {signal}={_state(not action.state)}"
        yield label
        yield f"WAIT {signal}={state} T={self._time(action.timeout)}"
        # started again by a person, it waits again instead of going on without the signal
        yield f"PAUSE {missing}"
        yield f"JUMP {label} {missing}"

    def _signal(self, number: int) -> int:
        highest = self._profile.highest_signal
        if not 1 <= number <= highest:
            raise InputError("program: input or output", f"must be 1 to {highest}, got {number}")
        return number

    def _time(self, seconds: float) -> str:
        timer = self._profile.timer
        if not timer.lowest <= seconds <= timer.highest:
            allowed = f"{timer.lowest:g} to {timer.highest:g} s"
            raise InputError("program: time", f"must be {allowed}, got {seconds:g}")
        return timer.text(seconds)


def _state(on: bool) -> str:
    return "ON" if on else "OFF"
