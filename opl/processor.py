"""The same numbers on every processor.

numpy and OpenBLAS choose their loops by the processor, and loops for wider vectors round otherwise:
in the last digit, which a search may turn into another motion that is as good. So the choice is
made here, before either is loaded: what every x86-64 processor with AVX2 has (Intel and AMD since
2013 to 2015). Older ones and others compute as they like, and only to the same accuracy.

What a process has set itself for these libraries is left as it is.
"""

from __future__ import annotations

import os

# names of numpy up to 2.3, then of numpy since 2.4; those that it does not know it passes over
_WIDER = (
    "AVX512F AVX512CD AVX512_KNL AVX512_KNM AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR "
    "X86_V4"
)
_FEATURES = {"avx2", "fma"}  # of x86-64 only


def round_alike() -> None:
    """Let numpy and OpenBLAS round alike on every x86-64 processor with AVX2.

    Of no effect on libraries that are loaded already: a program imports opl before numpy.
    """
    if not _features() >= _FEATURES:
        return
    os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")
    os.environ.setdefault("NPY_DISABLE_CPU_FEATURES", _WIDER)


def _features() -> set[str]:
    """Return what the first core has, as Linux names it; nothing where that is not to be read."""
    try:
        with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:
            flags = next((line for line in file if line.startswith("flags")), "")
    except OSError:
        return set()
    return set(flags.split())
