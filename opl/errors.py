"""Everything opl refuses to do, as one small tree of exceptions.

The command line prints ``str(error)`` on one line and ends with ``error.exit_status``; no other
module knows of exit statuses. Anything that is not an `OplError` is a bug and shows its traceback.
"""

from __future__ import annotations

from collections.abc import Sequence


class OplError(Exception):
    """Root of all errors that a user can cause or has to know of."""

    exit_status = 1


class InputError(OplError):
    """An input file or value is unusable.

    Args:
        where: File, and the key path in it where there is one, e.g. ``job.yaml: wheel.width_mm``.
        message: The value seen and the values allowed.
    """

    exit_status = 2

    def __init__(self, where: str, message: str) -> None:
        super().__init__(f"{where}: {message}" if where else message)
        self.where = where
        self.message = message

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str]]:
        return type(self), (self.where, self.message)  # as it is made, in another process too


class SettingError(InputError):
    """A setting of a job is unusable; the room that finds it knows its name, not its key.

    Args:
        where: The setting by its name in Python, e.g. ``user_frame``.
        message: The value seen and the values allowed.
    """


class NoPathError(OplError):
    """No track satisfies reach, limits, continuity and freedom from collision.

    Args:
        message: What stops the path, and where.
        reasons: One line for each run of cutter points that cannot be passed.
        lower_bound: Where none was found: no motion has a smaller joint range sum, in [rad].
        at_leads: Whether what stops it was met where passes begin or end, too.
    """

    exit_status = 3

    def __init__(
        self,
        message: str,
        reasons: Sequence[str] = (),
        lower_bound: float | None = None,
        at_leads: bool = False,
    ) -> None:
        super().__init__("\n".join([message, *reasons]))
        self.message = message
        self.reasons = tuple(reasons)
        self.lower_bound = lower_bound
        self.at_leads = at_leads


class NoFreeMoveError(NoPathError):
    """The passes can be ground, but a free move from home, between passes or home was not found."""


class UnsafeError(OplError):
    """A motion was planned but could not be proven safe, so no program was written."""

    exit_status = 4


class TimeLawError(UnsafeError):
    """No time law keeps the speeds and accelerations of the joints."""


class PassTimeError(OplError):
    """A pass cannot be written so that it keeps its time."""


class Cancelled(OplError):
    """A run was cancelled by the program that started it; nothing was written."""
