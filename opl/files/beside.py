"""Work done beside other work: in a copy of this process, on another core.

The copy is forked, so it knows all that this process knew then, loads nothing of it again and takes
little memory. It is made only while no other thread of Python runs, whose locks it would inherit,
and calls nothing that computes in several threads itself.

Whatever becomes of the copy, what it was to do is done here: the same values, or the error that
there is. So nothing may depend on who works out a value, nor on what was worked out before it.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, suppress
from typing import Any, Generic, TypeVar

from opl.files.apart import end_with_parent
from opl.files.between import Known, Line, Turns
from opl.files.kernels import use_one_thread

Item = TypeVar("Item")
Result = TypeVar("Result")
_ENDING = (signal.SIGINT, signal.SIGTERM)
_NOT_PASSED_ON = (pickle.PicklingError, AttributeError, TypeError)  # what pickle refuses with


class Later(Generic[Result]):
    """A value that is worked out when it is first asked for, or beside.

    Args:
        work: What works it out; it lies in a module.
        given: What it is called with.
    """

    def __init__(self, work: Callable[..., Result], *given: Any) -> None:
        self._work = work
        self._given = given
        self._found: list[Result] = []
        self._asked: tuple[Beside, int] | None = None

    def value(self) -> Result:
        """Return the value, as soon as it is there."""
        if not self._found:
            answer = None if self._asked is None else self._asked[0].answer(self._asked[1])
            self._found.append(self._work(*self._given) if answer is None else answer[0])
        return self._found[0]

    def asked_of(self, beside: Beside, number: int) -> None:
        """Take the value from the answer to a question, if there will be one."""
        self._asked = beside, number

    def __reduce__(self) -> tuple[Any, ...]:
        return Later, (self._work, *self._given)


class Beside:
    """A copy of this process that takes work from it, or none.

    It is a context manager: the copy ends with the context, and in any case with this process. What
    was not asked for by then is worked out here, if ever.

    Args:
        allowed: Whether there may be a copy.
    """

    def __init__(self, allowed: bool = False) -> None:
        self._allowed = allowed
        self._process: int | None = None
        self._known = Known()
        self._questions = 0
        self._answers: list[bytes] = []
        self._lists = 0
        self._behind: list[Later[Any]] = []

    def __enter__(self) -> Beside:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def start(self, *known: object) -> bool:
        """Make the copy, if there may be one; return whether there is one.

        Args:
            known: What there is now and will be handed over: the copy has it.
        """
        if not self._allowed or not hasattr(os, "fork") or threading.active_count() > 1:
            return False
        for one in (self, *known):
            self._known.add(one)
        with suppress(OSError):  # no memory, no room, or too many processes
            self._to, self._back, self._turns = Line(), Line(), Turns()
            self._fork()
        return self._process is not None

    def begin(self, later: Later[Any]) -> None:
        """Let the copy work out a value, after all that was begun before."""
        number = self._ask(Beside._value, later)
        if number is not None:
            self._known.add(later)
            later.asked_of(self, number)

    def begin_behind(self, later: Later[Any]) -> None:
        """Let the copy work out a value as soon as all of the next list that is shared is taken."""
        self._behind.append(later)

    def share(
        self,
        opened: Callable[..., AbstractContextManager[Callable[[Item], Result]]],
        given: Sequence[Any],
        items: Sequence[Item],
        report: Callable[[float], None] = lambda fraction: None,
        length: Callable[[Item], float] = lambda item: 0.0,
    ) -> list[Result]:
        """Work on items here and in the copy: whoever is free takes the next one.

        The longest are taken first, so that nobody waits for long at the end.

        Args:
            opened: Opens what the work needs and gives what works on an item; it lies in a module.
            given: What it is called with, once in each process that takes an item.
            items: What is worked on.
            report: Called with the part of the items that is taken, 0 to 1.
            length: Tells how long the work on an item takes, in any unit.

        Returns:
            What was made of each item.
        """
        order = sorted(range(len(items)), key=lambda k: -length(items[k]))
        items = [items[k] for k in order]
        number, turns = None, iter(range(len(items)))
        if self._process is not None and self._lists < self._turns.most_lists:
            of, self._lists = self._lists, self._lists + 1
            number = self._ask(Beside._some, opened, given, items, of)
            turns = self._turns.taken(of, len(items))
        while self._behind:
            self.begin(self._behind.pop(0))
        made = dict(_made(opened, given, items, turns, report))
        if len(made) < len(items) and number is not None:
            answer = self.answer(number)
            made |= {} if answer is None else answer[0]
        left = [k for k in range(len(items)) if k not in made]  # by a copy that is gone
        made |= dict(_made(opened, given, items, iter(left)))
        found = {k: made[place] for place, k in enumerate(order)}
        return [found[k] for k in range(len(items))]

    def answer(self, number: int) -> list[Any] | None:
        """Wait for the answer to a question; None if there will be none."""
        while len(self._answers) <= number:
            answer = None if self._process is None else self._back.receive()
            if answer is None:
                self._end()
                return None
            self._answers.append(answer)
        return [self._known.loads(self._answers[number])]

    def _ask(self, work: Callable[..., object], *given: object) -> int | None:
        """Ask the copy for what work returns; return the number of the question."""
        if self._process is None:
            return None
        try:
            self._to.send(self._known.dumps((work, given)))
        except _NOT_PASSED_ON:
            return None
        except OSError:  # it is gone
            self._end()
            return None
        self._questions += 1
        return self._questions - 1

    def _value(self, later: Later[Any]) -> object:
        self._known.add(later)
        return later.value()

    def _some(
        self, opened: Any, given: Sequence[Any], items: Sequence[Any], of: int
    ) -> dict[int, Any]:
        turns = self._turns.taken(of, len(items))
        return dict(_made(opened, given, items, turns))

    def _fork(self) -> None:
        parent = os.getpid()
        # handlers of this process must not run in the copy
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDING)
        try:
            process = os.fork()
            if process == 0:
                self._answer_all(parent)
            self._process = process
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        self._to.only_send()
        self._back.only_receive()

    def _answer_all(self, parent: int) -> None:
        """Answer questions until there are no more, and end this process."""
        with suppress(BaseException):
            for one in _ENDING:
                signal.signal(one, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDING)
            end_with_parent(parent)
            use_one_thread()
            self._to.only_receive()
            self._back.only_send()
            while (question := self._to.receive()) is not None:
                work, given = self._known.loads(question)
                self._back.send(self._known.dumps(work(self, *given)))
        os._exit(1)

    def _end(self) -> None:
        """End the copy, if it is there still."""
        if self._process is None:
            return
        process, self._process = self._process, None
        # where nobody wants to know of processes that ended, its number may be another's by now
        with suppress(ChildProcessError, ProcessLookupError):
            if os.waitpid(process, os.WNOHANG)[0] == 0:
                os.kill(process, signal.SIGKILL)  # the number is its own until it is waited for
                os.waitpid(process, 0)
        for one in (self._to, self._back, self._turns):
            one.close()


def _made(
    opened: Callable[..., AbstractContextManager[Callable[[Item], Result]]],
    given: Sequence[Any],
    items: Sequence[Item],
    turns: Iterator[int],
    report: Callable[[float], None] = lambda fraction: None,
) -> Iterator[tuple[int, Result]]:
    """Yield the numbers of items whose turn it is, and what is made of them."""
    with ExitStack() as stack:
        work = None
        for k in turns:
            report(k / len(items))
            work = work or stack.enter_context(opened(*given))
            yield k, work(items[k])
