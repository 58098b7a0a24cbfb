"""What numba has compiled and kept on the disk, loaded without what it compiles with.

Numba's own way first loads all that it compiles with, which takes half as long as numba itself, and
of each kernel the code that others may take in, which takes as long as the rest of it. What is
compiled needs neither; whatever compiles loads both then.
"""

from __future__ import annotations

from typing import Any

from numba.core import codegen
from numba.core.caching import FunctionCache
from numba.core.compiler import CompileResult
from numba.core.runtime.nrt import rtsys

_llvm: Any = getattr(codegen, "ll", None)
# what is meant here by names that numba keeps to itself; another numba may have changed them
_NEEDED = {
    FunctionCache: ("load_overload", "_guard_against_spurious_io_errors", "_index_key"),
    codegen: ("ll",),
    codegen.JITCodeLibrary: ("_unserialize", "_get_module_for_linking"),
    codegen.JitEngine: ("_load_defined_symbols", "is_symbol_defined"),
    CompileResult: ("_rebuild",),
}
_NAMES = "llvm_func_name", "llvm_cpython_wrapper_name", "llvm_cfunc_wrapper_name"


def load_without_compiler() -> None:
    """Have numba load what it kept as said above, if it is a numba that is known to."""
    if all(hasattr(owner, name) for owner, names in _NEEDED.items() for name in names):
        FunctionCache.load_overload = _load  # type: ignore[method-assign]


class _Library(codegen.JITCodeLibrary):
    """A kernel that was loaded; what others may take in of it is read when one does."""

    unread: bytes | None

    def _get_module_for_linking(self) -> Any:
        if self.unread is not None:
            self._shared_module = _llvm.parse_bitcode(self.unread)
            engine: Any = self._codegen._engine
            engine._load_defined_symbols(self._shared_module)
            self.unread = None
        return super()._get_module_for_linking()  # type: ignore[no-untyped-call]


def _load(kept: Any, signature: Any, context: Any) -> Any:
    """Return a kernel for a signature, None if it is not kept; as numba's own `load_overload`."""
    rtsys.initialize(context)
    with kept._guard_against_spurious_io_errors():
        content = kept._cache_file.load(kept._index_key(signature, context.codegen()))
        if content is None:
            return None
        (name, kind, data), described, *rest = content
        if kind != "object" or not all(hasattr(described, one) for one in _NAMES):
            return kept._impl.rebuild(context, content)
        code, unread = data
        nothing = _llvm.parse_assembly("").as_bitcode()
        context.codegen()._engine._defined_symbols |= {getattr(described, n) for n in _NAMES}
        rebuild: Any = CompileResult._rebuild
        found = rebuild(context, (name, kind, (code, nothing)), described, *rest)
        found.library.unread = unread
        found.library.__class__ = _Library
        return found
    return None
