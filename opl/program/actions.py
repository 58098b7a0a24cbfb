"""What a program does besides moving: outputs, waits, calls and remarks, no maker's words yet."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SetOutput:
    """Switch a digital output.

    Attributes:
        number: As the controller counts its outputs.
        state: Whether it is switched on.
    """

    number: int
    state: bool


@dataclass(frozen=True)
class Dwell:
    """Stand still.

    Attributes:
        seconds: How long in [s].
    """

    seconds: float


@dataclass(frozen=True)
class WaitInput:
    """Wait for a digital input.

    Attributes:
        number: As the controller counts its inputs.
        state: The state to wait for.
        timeout: After this time in [s] the program pauses, and waits again once it is started
            again: it never goes on without the signal. None waits for ever.
    """

    number: int
    state: bool
    timeout: float | None = None


@dataclass(frozen=True)
class Call:
    """Run a program of the user's own.

    Attributes:
        name: Its name on the controller.
    """

    name: str


@dataclass(frozen=True)
class Remark:
    """A line for people.

    Attributes:
        text: The line.
    """

    text: str


Action = SetOutput | Dwell | WaitInput | Call | Remark


@dataclass(frozen=True)
class Actions:
    """What is done where; the robot stands still off the wheel at all of these places.

    Attributes:
        at_start: At home, before anything else.
        before_pass: In front of the wheel, before each approach.
        after_pass: In front of the wheel, after each retract.
        at_end: Back at home.
    """

    at_start: tuple[Action, ...] = ()
    before_pass: tuple[Action, ...] = ()
    after_pass: tuple[Action, ...] = ()
    at_end: tuple[Action, ...] = ()

    @property
    def every(self) -> tuple[Action, ...]:
        """All of them."""
        return (*self.at_start, *self.before_pass, *self.after_pass, *self.at_end)

    @property
    def switches(self) -> bool:
        """Whether any of them could switch the belt: an output, or a program of the site's own."""
        return any(isinstance(action, (SetOutput, Call)) for action in self.every)

    @property
    def calls(self) -> frozenset[str]:
        """Names of the programs called."""
        return frozenset(action.name for action in self.every if isinstance(action, Call))


NO_ACTIONS = Actions()
