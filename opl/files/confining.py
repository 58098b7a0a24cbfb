"""Reading confined to one folder: for jobs that may not see what else is on the machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from opl.errors import InputError
from opl.files.resources import folder

_CONFINED: ContextVar[Path | None] = ContextVar("confined", default=None)


@contextmanager
def confine_to(home: Path | None) -> Iterator[None]:
    """Let `require_inside` refuse all files but those in a folder and those that opl comes with.

    Args:
        home: The folder; None leaves all as it is.
    """
    before = _CONFINED.set(None if home is None else home.resolve())
    try:
        yield
    finally:
        _CONFINED.reset(before)


def require_inside(path: Path) -> None:
    """Refuse a file outside of the folder that reading is confined to, if it is.

    Links are followed first. Whether there is such a file outside is not told.

    Raises:
        InputError: If it lies outside.
    """
    home = _CONFINED.get()
    if home is None:
        return
    try:
        real = path.resolve()
    except (
        OSError,
        ValueError,
        RuntimeError,
    ) as error:  # zeros in it, links in a ring
        raise InputError(str(path), "is no name of a file") from error
    shipped = (folder(name).resolve() for name in ("robots", "templates"))
    if not any(real.is_relative_to(place) for place in (home, *shipped)):
        message = "lies outside of the job's own files; send it with the job, named relative to it"
        raise InputError(str(path), message)
