"""Actions around the passes, as the section ``program`` of a job file lists them."""

from __future__ import annotations

from typing import Annotated

from pydantic import BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator

from opl.files.documents import Document
from opl.files.quantities import between
from opl.program.actions import Action, Call, Dwell, Remark, SetOutput, WaitInput

_Signal = Annotated[int, between(0, 99_999)]
_Seconds = Annotated[float, Field(gt=0.0, le=86_400.0)]


def _switched(value: object) -> object:
    """Return the words for signals, which YAML 1.2 takes for text, as what they mean."""
    return {"on": True, "off": False}.get(value, value) if isinstance(value, str) else value


_State = Annotated[
    bool, BeforeValidator(_switched), WithJsonSchema({"type": "string", "enum": ["on", "off"]})
]


class ActionSection(Document):
    """One action: exactly one of comment, output, wait_input, dwell_s and call."""

    model_config = ConfigDict(title="Action")

    comment: str | None = Field(default=None, description="A comment line in the program.")
    output: _Signal | None = Field(
        default=None, description="Number of a digital output to switch; with `state`."
    )
    wait_input: _Signal | None = Field(
        default=None, description="Number of a digital input to wait for; with `state`."
    )
    state: _State | None = Field(
        default=None, description="Of the output, or of the input to wait for."
    )
    timeout_s: _Seconds | None = Field(
        default=None,
        description="How long wait_input waits before the program pauses with a message; without "
        "it, for ever. It never goes on without the signal.",
    )
    dwell_s: _Seconds | None = Field(default=None, description="Stand still for this time.")
    call: str | None = Field(
        default=None, description="Name of a program on the controller that is called."
    )

    @model_validator(mode="after")
    def _one_action(self) -> ActionSection:
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
        """Return the action."""
        if self.comment is not None:
            return Remark(self.comment)
        if self.output is not None:
            return SetOutput(self.output, bool(self.state))
        if self.wait_input is not None:
            return WaitInput(self.wait_input, bool(self.state), self.timeout_s)
        if self.dwell_s is not None:
            return Dwell(self.dwell_s)
        return Call(str(self.call))
