"""Work done in a copy of the process: the same values whatever becomes of the copy."""

import os
import signal
import threading
from contextlib import contextmanager

import numpy as np
import pytest

from opl.files import kernels
from opl.files.beside import Beside, Later

HERE = os.getpid()
ENDS = {
    "ends": lambda: os._exit(0),
    "killed": lambda: os.kill(os.getpid(), signal.SIGKILL),
    "terminated": lambda: os.kill(os.getpid(), signal.SIGTERM),
    "raises": lambda: (_ for _ in ()).throw(MemoryError),
}


def where(*given):
    return os.getpid(), *given


def ends(how):
    if os.getpid() != HERE:
        ENDS[how]()
    return os.getpid()


def gone(pid):
    """Whether a process is neither running nor waiting to be asked how it ended."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def in_copy(later, *known):
    """The value of what a copy was asked for."""
    with Beside(True) as beside:
        beside.start(*known)
        beside.begin(later)
        return later.value()


def test_a_value_is_worked_out_in_another_process_once_and_the_process_is_gone():
    later = Later(where, np.arange(3.0))
    pid, array = in_copy(later)
    assert pid != HERE and gone(pid)
    assert later.value()[1] is array
    np.testing.assert_array_equal(array, np.arange(3.0))


def test_a_value_is_begun_behind_the_next_list_that_is_shared():
    before, later = Later(where), Later(where)
    with Beside(True) as beside:
        beside.begin_behind(before)
        assert beside.share(squaring, (0,), [1, 2]) and before.value() == (HERE,)
        beside.start()
        beside.begin_behind(later)
        beside.share(squaring, (1,), list(range(4)))
        assert later.value() != (HERE,)


def test_the_longest_items_are_taken_first_and_given_back_in_their_order():
    taken = []

    @contextmanager
    def working():
        yield lambda item: taken.append(item) or -item

    items = [3, 1, 4, 1, 5]
    assert Beside().share(working, (), items, length=float) == [-3, -1, -4, -1, -5]
    assert taken == [5, 4, 3, 1, 1]


def test_values_come_in_any_order_from_one_process():
    laters = [Later(where, k) for k in range(3)]
    with Beside(True) as beside:
        beside.start()
        for later in laters:
            beside.begin(later)
        (last, two), (first, zero) = laters[2].value(), laters[0].value()
    assert first == last != HERE and (zero, two) == (0, 2)


def test_without_a_copy_or_leave_it_is_worked_out_here():
    assert Later(where).value() == (HERE,)
    for beside in (Beside(True), Beside()):
        later = Later(where)
        with beside:
            if not beside._allowed:
                beside.start()
            beside.begin(later)
            assert later.value() == (HERE,)


def test_beside_threads_it_is_worked_out_here():
    ended = threading.Event()
    thread = threading.Thread(target=ended.wait)
    thread.start()
    try:
        assert in_copy(Later(where)) == (HERE,)
    finally:
        ended.set()
        thread.join()


@pytest.mark.parametrize("how", list(ENDS))
def test_what_a_process_does_not_answer_is_worked_out_here(how):
    first, second = Later(ends, how), Later(where)
    with Beside(True) as beside:
        beside.start()
        beside.begin(first)
        beside.begin(second)
        assert first.value() == HERE
        assert second.value() == (HERE,)
        after = Later(where)
        beside.begin(after)
        assert after.value() == (HERE,)


@pytest.mark.parametrize("how", ["answers", *ENDS])
def test_a_copy_of_which_the_system_keeps_nothing_ends_like_any_other(how):
    before = signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    try:
        if how == "answers":
            (pid,) = in_copy(Later(where))
            assert pid != HERE and gone(pid)
        else:
            assert in_copy(Later(ends, how)) == HERE
    finally:
        signal.signal(signal.SIGCHLD, before)


def test_what_cannot_be_passed_on_is_worked_out_here():
    assert in_copy(Later(lambda: 7)) == 7  # the question
    assert in_copy(Later(make_function))() == 7  # the answer


def make_function():
    return lambda: 7


def stumble():
    raise ValueError("seven")


def test_an_error_is_raised_where_the_value_is_asked_for():
    with pytest.raises(ValueError, match="seven"):
        in_copy(Later(stumble))


def tell(writer):
    os.write(writer, str(os.getpid()).encode())
    signal.pause()


def test_an_exception_in_the_context_ends_the_process():
    reader, writer = os.pipe()
    with pytest.raises(KeyError), Beside(True) as beside:
        beside.start()
        beside.begin(Later(tell, writer))
        pid = int(os.read(reader, 20))
        assert not gone(pid)
        raise KeyError
    assert gone(pid)


def test_questions_and_answers_larger_than_a_pipe_come_whole():
    pid, content = in_copy(Later(where, b"x" * 5_000_000))
    assert pid != HERE and len(content) == 5_000_000


class Untouchable:
    def __reduce__(self):
        raise AssertionError("it is known and need not be passed on")


def test_what_is_known_is_not_passed_on():
    known = Untouchable()
    pid, same, asked = in_copy(Later(where, known, [known]), known)
    assert pid != HERE and same is known and asked == [known]


def test_what_is_worked_out_from_another_value_in_the_copy_finds_it_there():
    first = Later(where)
    second = Later(from_another, first)
    with Beside(True) as beside:
        beside.start()
        beside.begin(first)
        beside.begin(second)
        assert second.value() == first.value()[0] != HERE


def from_another(first):
    return first.value()[0]


def test_handlers_of_this_process_do_not_run_in_the_copy():
    reader, writer = os.pipe()
    before = signal.signal(signal.SIGTERM, lambda *_: os.write(writer, b"handled"))
    try:
        assert in_copy(Later(ends, "terminated")) == HERE
        os.write(writer, b"nothing")
        assert os.read(reader, 20) == b"nothing"
    finally:
        signal.signal(signal.SIGTERM, before)


def test_a_copy_calls_no_kernel_with_threads():
    assert kernels.threads_are_allowed()
    assert in_copy(Later(kernels.threads_are_allowed)) is False


# shared work


@contextmanager
def squaring(first, stop=None):
    """Take a moment for each item, so that there is time for both; end the copy from one on."""

    def square(item):
        threading.Event().wait(0.02)
        if stop is not None and item >= stop and os.getpid() != HERE:
            os._exit(1)
        return item * item, os.getpid(), first

    yield square


def shared(count, *given, wait=False):
    seen = []
    with Beside(True) as beside:
        beside.start()
        if wait:
            ready = Later(where)
            beside.begin(ready)
            ready.value()
        made = beside.share(squaring, given, list(range(count)), seen.append)
    assert [square for square, _, _ in made] == [k * k for k in range(count)]
    assert seen == sorted(seen) and all(0.0 <= part < 1.0 for part in seen)
    return {pid for _, pid, _ in made}


def test_items_are_worked_on_in_both_processes_and_come_in_order():
    assert len(shared(20, "given", wait=True)) == 2


def test_items_are_worked_on_here_where_there_is_no_copy():
    made = Beside().share(squaring, (0,), [3, 4])
    assert made == [(9, HERE, 0), (16, HERE, 0)]
    assert Beside().share(squaring, (0,), []) == []


def test_items_that_a_copy_took_with_it_are_worked_on_here():
    assert shared(20, "given", 0, wait=True) == {HERE}


def test_a_copy_that_is_busy_is_not_waited_for():
    reader, writer = os.pipe()
    with Beside(True) as beside:
        beside.start()
        beside.begin(Later(tell, writer))
        os.read(reader, 20)
        assert {pid for _, pid, _ in beside.share(squaring, (0,), [1, 2, 3])} == {HERE}


def test_lists_that_are_shared_one_after_the_other_do_not_mix():
    with Beside(True) as beside:
        beside.start()
        for count in (1, 5, 0, 7):
            made = beside.share(squaring, (count,), list(range(count)))
            assert [(square, given) for square, _, given in made] == [
                (k * k, count) for k in range(count)
            ]
