"""Values worked out in a copy of the process: the same value whatever becomes of the copy."""

import os
import signal
import threading

import numpy as np
import pytest

from opl.files.beside import Beside

HERE = os.getpid()


def where():
    return os.getpid(), np.arange(3.0)


def gone(pid):
    """Whether a process is neither running nor waiting to be asked how it ended."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def test_a_value_is_worked_out_in_another_process_once_and_the_process_is_gone():
    beside = Beside(where)
    with beside.begun():
        pid, array = beside.value()
    assert pid != HERE and gone(pid)
    assert beside.value()[1] is array
    np.testing.assert_array_equal(array, np.arange(3.0))


def test_the_context_ends_with_the_value():
    beside = Beside(where)
    with beside.begun():
        pass
    assert beside.value()[0] != HERE


def test_without_a_context_or_leave_it_is_worked_out_here():
    assert Beside(where).value()[0] == HERE
    beside = Beside(where)
    with beside.begun(allowed=False):
        assert beside.value()[0] == HERE


def test_beside_threads_it_is_worked_out_here():
    ended = threading.Event()
    thread = threading.Thread(target=ended.wait)
    thread.start()
    beside = Beside(where)
    try:
        with beside.begun():
            assert beside.value()[0] == HERE
    finally:
        ended.set()
        thread.join()


@pytest.mark.parametrize(
    "end",
    [
        lambda: os._exit(0),
        lambda: os.kill(os.getpid(), signal.SIGKILL),
        lambda: os.kill(os.getpid(), signal.SIGTERM),
        lambda: (_ for _ in ()).throw(MemoryError),
    ],
    ids=["ends", "killed", "terminated", "raises"],
)
def test_what_a_process_does_not_answer_is_worked_out_here(end):
    def work():
        if os.getpid() != HERE:
            end()
        return os.getpid()

    beside = Beside(work)
    with beside.begun():
        assert beside.value() == HERE


def test_what_cannot_leave_the_process_is_worked_out_here():
    beside = Beside(lambda: lambda: 7)
    with beside.begun():
        assert beside.value()() == 7


def test_an_error_is_raised_where_the_value_is_asked_for():
    def work():
        raise ValueError("seven")

    beside = Beside(work)
    with pytest.raises(ValueError, match="seven"), beside.begun():
        beside.value()


def test_an_exception_in_the_context_ends_the_process():
    reader, writer = os.pipe()

    def work():
        os.write(writer, str(os.getpid()).encode())
        signal.pause()

    with pytest.raises(KeyError), Beside(work).begun():
        pid = int(os.read(reader, 20))
        assert not gone(pid)
        raise KeyError
    assert gone(pid)


def test_answers_larger_than_a_pipe_come_whole():
    beside = Beside(lambda: (os.getpid(), b"x" * 5_000_000))
    with beside.begun():
        pid, content = beside.value()
    assert pid != HERE and len(content) == 5_000_000


def test_handlers_of_this_process_do_not_run_in_the_copy():
    reader, writer = os.pipe()
    before = signal.signal(signal.SIGTERM, lambda *_: os.write(writer, b"handled"))
    try:
        beside = Beside(lambda: os.kill(os.getpid(), signal.SIGTERM) if os.getpid() != HERE else 7)
        with beside.begun():
            assert beside.value() == 7
        os.write(writer, b"nothing")
        assert os.read(reader, 20) == b"nothing"
    finally:
        signal.signal(signal.SIGTERM, before)
