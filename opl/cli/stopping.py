"""How the process of a command ends: at once, told to stop by Ctrl-C and SIGTERM or done.

What is stopped says so, and leaves nothing running.
"""

from __future__ import annotations

import atexit
import faulthandler
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn

import opl

STATUS = 1  # exit status of what was stopped
PATIENCE = 1.7  # [s] that the table of a batch may take
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_SHOW_CURSOR = "\x1b[?25h"


class Stopped(BaseException):
    """The command was told to stop. No Exception: nobody on the way takes it for an error."""


@contextmanager
def stopped_at_once() -> Iterator[None]:
    """Let signals end the process from where it is.

    Nothing is raised: an exception would have to make its way through libraries of C++, which do
    not know it, and through imports, which swallow some. What a delivery has half done the next
    run puts in order, as after a crash. A process whose command has ended goes on to its end: what
    it did is whole, and so is its exit status.
    """

    def stop(number: int, frame: FrameType | None) -> NoReturn:
        opl.release_folders()
        restored = _SHOW_CURSOR if sys.stderr.isatty() else ""
        os.write(2, f"{restored}error: stopped\n".encode())
        os._exit(STATUS)

    try:
        with _handled_by(stop):
            yield
    finally:
        # the first to be called at the end: Python takes a while to leave
        atexit.unregister(_ignored)
        atexit.register(_ignored)


def _ignored() -> None:
    """Let no signal stop a process that leaves."""
    for one in _SIGNALS:
        signal.signal(one, signal.SIG_IGN)


@contextmanager
def left_at_once() -> Iterator[None]:
    """End the process with what is done in here, without taking apart what it has loaded.

    What is to be done at the end is done. Python takes 0.1 s for the rest.
    """
    try:
        yield
    except SystemExit as end:
        if threading.active_count() == 1 and isinstance(end.code, int | None):
            atexit._run_exitfuncs()
            with suppress(OSError, ValueError):  # those that Python tells of itself
                for stream in (sys.stdout, sys.stderr):
                    stream.flush()
                os._exit(end.code or 0)
        raise


@contextmanager
def stopped_by_raising() -> Iterator[None]:
    """Let signals raise `Stopped` where Python waits for others; end the process if that fails."""
    with open(os.devnull, "w", encoding="ascii") as nowhere:

        def stop(number: int, frame: FrameType | None) -> NoReturn:
            for one in _SIGNALS:
                signal.signal(one, signal.SIG_IGN)
            # of the C library: it needs nothing of Python
            faulthandler.dump_traceback_later(PATIENCE, exit=True, file=nowhere)
            raise Stopped

        with _handled_by(stop):
            try:
                yield
            finally:
                faulthandler.cancel_dump_traceback_later()


@contextmanager
def _handled_by(stop: Callable[[int, FrameType | None], NoReturn]) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {one: signal.signal(one, stop) for one in _SIGNALS}
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
