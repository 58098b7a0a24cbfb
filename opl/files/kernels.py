"""Functions that numba compiles, loaded when they are first called.

To load numba and what it has compiled takes longer than what many commands do. Until it is called a
kernel is a plain object. One that is kept on the disk holds what it calls, so only those that
Python calls are loaded.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, cached_property
from pathlib import Path
from threading import Event
from types import FunctionType
from typing import Any

from opl.files.kernel_cache import settle_kernel_cache

# numba looks for it when it is loaded, and needs it where a kernel multiplies matrices: none does
_LINEAR_ALGEBRA = "scipy.linalg"

prange = range  # numba's own in a kernel with threads

# an option of numba, for its own use: whether what is compiled counts references to arrays
_COUNTED = "_nrt"

_made: list[Kernel] = []
_one_thread = Event()


class Kernel:
    """A function to be compiled.

    Args:
        function: Takes scalars and arrays; what it calls are kernels, or what numba knows.
        signature: Types of result and arguments in the words of numba; None if they are those that
            it is called with.
        threads: Whether loops over `prange` are shared among threads.
        for_arrays: What does for arrays what it does for scalars, None for the function itself.
        early: Whether it is loaded before it is called where there is time: most runs call it.
        makes_arrays: Whether it makes arrays or returns one. All others count no references to
            those that they are given: at each call, that takes as long as what many of them do.
    """

    def __init__(
        self,
        function: FunctionType,
        signature: str | None,
        threads: bool,
        for_arrays: Callable[..., Any] | None,
        early: bool,
        makes_arrays: bool,
    ) -> None:
        returns = "" if signature is None else signature.partition("(")[0]
        assert makes_arrays or "[" not in returns, "a kernel that returns an array says that"
        self.__wrapped__ = function
        self.__doc__ = function.__doc__
        self._signature = signature
        self._threads = threads
        self._for_arrays = for_arrays
        self.early = early
        self._makes_arrays = makes_arrays

    def __call__(self, *arguments: Any) -> Any:  # noqa: D102
        assert not self._threads or threads_are_allowed(), "a copy of a process has no threads"
        return self.compiled(*arguments)

    @cached_property
    def compiled(self) -> Any:
        """The compiled function, from the disk if it lies there."""
        numba = _numba()
        function = self.__wrapped__
        if self._threads:
            known = {**function.__globals__, "prange": numba.prange}
            function = FunctionType(function.__code__, known)
        types = () if self._signature is None else (self._signature,)
        options = {"parallel": self._threads}
        if hasattr(numba.core.options.DefaultOptions, _COUNTED):
            options[_COUNTED] = self._makes_arrays or self._threads
        # a division by 0 gives what numpy gives: to look for one at each costs up to a quarter
        made = numba.njit(*types, cache=True, error_model="numpy", **options)
        return made(function)

    @cached_property
    def plain(self) -> Any:
        """The function in Python alone, which takes arrays where it is compiled for scalars."""
        if self._for_arrays is not None:
            return self._for_arrays
        function = self.__wrapped__
        known = {**function.__globals__}
        for name in function.__code__.co_names:
            if isinstance(known.get(name), Kernel):
                known[name] = known[name].plain
        return FunctionType(function.__code__, known)


def kernels_are_loaded() -> bool:
    """Return whether numba is loaded, so that a further kernel takes next to no time."""
    return _numba.cache_info().currsize > 0


def kernel(
    signature: str | None = None,
    threads: bool = False,
    for_arrays: Callable[..., Any] | None = None,
    early: bool = False,
    makes_arrays: bool = False,
) -> Callable[[Any], Kernel]:
    """Return what makes a `Kernel` of a function, with arguments as there."""

    def make(function: FunctionType) -> Kernel:
        made = Kernel(function, signature, threads, for_arrays, early, makes_arrays)
        _made.append(made)
        return made

    return make


def load_kernels(early: bool = False) -> None:
    """Load kernels of the modules that are loaded, so that no job waits for them.

    Args:
        early: Those alone that most runs call.
    """
    for made in _made:
        if made.early or not early:
            _ = made.compiled


def use_one_thread() -> None:
    """Call no kernel with threads in this process: those of the process that it copies are gone."""
    _one_thread.set()


def threads_are_allowed() -> bool:
    """Return whether kernels with threads may be called."""
    return not _one_thread.is_set()


def use_threads(count: int) -> None:
    """Limit the threads of kernels, where processes share the cores."""
    _numba().set_num_threads(count)


@cache
def _numba() -> Any:
    """Return numba, to which a kernel is the compiled function."""
    settle_kernel_cache(Path(__file__).parents[1])  # before numba looks for it
    # threads that wait for work leave the core to the copy of the process, unless told otherwise
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    with _without(_LINEAR_ALGEBRA):
        import numba
        import numba.np.arraymath
    from numba.extending import typeof_impl

    from opl.files.kept_kernels import load_without_compiler

    load_without_compiler()

    @typeof_impl.register(Kernel)
    def type_of(made: Kernel, _context: Any) -> Any:
        return numba.typeof(made.compiled)  # type: ignore[no-untyped-call]

    return numba


@contextmanager
def _without(library: str) -> Iterator[None]:
    """Let a library seem not to be there, unless it is loaded."""
    absent = library not in sys.modules
    if absent:
        sys.modules[library] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        if absent:
            del sys.modules[library]
