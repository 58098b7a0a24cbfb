"""Work done beside other work: in a copy of this process, on another core.

The copy is forked, so it knows all that this process knows, loads nothing and takes little memory.
It is made only while no other thread of Python runs, whose locks it would inherit, and may not call
what computes in several threads itself.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Generic, TypeVar

from opl.files.apart import end_with_parent

Result = TypeVar("Result")
_ENDING = (signal.SIGINT, signal.SIGTERM)


class Beside(Generic[Result]):
    """A value that is worked out beside other work, or when it is first asked for.

    Whatever keeps the other process from an answer, the value is worked out here: the same value,
    or the error that there is. What is returned there comes here as bytes.
    """

    def __init__(self, work: Callable[[], Result]) -> None:
        self._work = work
        self._found: list[Result] = []
        self._child: tuple[int, int] | None = None  # process, and where its answer comes from

    @contextmanager
    def begun(self, allowed: bool = True) -> Iterator[None]:
        """Work it out beside what is done in the context, if that is allowed and possible.

        The other process ends with the context: with its answer, or without one where the context
        ends with an exception, and in any case with this process.
        """
        if allowed and not self._found:
            self._child = _fork(self._work)
        try:
            yield
            if self._child is not None:
                self.value()
        finally:
            self._end()

    def value(self) -> Result:
        """Return the value, as soon as it is there."""
        if not self._found:
            answer = self._answer()
            self._found.append(self._work() if answer is None else pickle.loads(answer))
        return self._found[0]

    def _answer(self) -> bytes | None:
        """Wait for the answer of the other process; None without one."""
        if self._child is None:
            return None
        with os.fdopen(self._child[1], "rb", closefd=False) as pipe:
            answer = pipe.read()
        return (answer or None) if self._end(killing=False) == 0 else None

    def _end(self, killing: bool = True) -> int:
        """End the other process, or wait for its end; return its status."""
        if self._child is None:
            return 0
        (process, answer), self._child = self._child, None
        os.close(answer)
        if killing:
            os.kill(process, signal.SIGKILL)  # its number is its own until it is waited for
        return os.waitpid(process, 0)[1]


def _fork(work: Callable[[], object]) -> tuple[int, int] | None:
    """Let a copy of this process work; None where there can be none."""
    if not hasattr(os, "fork") or threading.active_count() > 1:
        return None
    parent = os.getpid()
    answer, end = os.pipe()
    # handlers of this process must not run in the copy
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDING)
    try:
        process = os.fork()
        if process == 0:
            _work_as_copy(parent, work, end)
    except OSError:  # no memory, or too many processes
        os.close(answer)
        return None
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        os.close(end)
    return process, answer


def _work_as_copy(parent: int, work: Callable[[], object], end: int) -> None:
    """Write the answer whole or not at all, and end this process."""
    with suppress(BaseException):
        for one in _ENDING:
            signal.signal(one, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDING)
        end_with_parent(parent)
        answer = pickle.dumps(work(), pickle.HIGHEST_PROTOCOL)
        with os.fdopen(end, "wb") as pipe:
            pipe.write(answer)
        os._exit(0)
    os._exit(1)
