"""Kernels are loaded when they are called, not before."""

import os
import subprocess
import sys

import numba
import numpy as np
import pytest

from opl.files.kernels import kernel, prange


@kernel("float64(float64)")
def _twice(x):
    return 2.0 * x


@kernel()
def _thrice(x):
    return x + _twice(x)


def _all_thrice(x, y):
    for k in prange(len(x)):
        y[k] = _thrice(x[k])


@pytest.mark.parametrize("threads", [False, True])
def test_a_kernel_calls_kernels_and_may_share_a_loop_among_threads(tmp_path, monkeypatch, threads):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))  # the code of cached ones is gone
    made = kernel("void(float64[::1],float64[::1])", threads)(_all_thrice)
    x, y = np.arange(5.0), np.zeros(5)
    made(x, y)
    assert y.tolist() == (3.0 * x).tolist()
    assert _thrice(2.0) == 6.0 and _twice(2.0) == 4.0
    (code,) = made.compiled.inspect_llvm().values()
    assert ("numba_parallel_for" in code) == threads


@kernel("float64(float64,float64)")
def _parted(x, y):
    return x / y


def test_kernels_divide_as_numpy_does():
    assert _parted(1.0, 0.0) == np.inf and np.isnan(_parted(0.0, 0.0))


@kernel("float64(float64[::1],int64)")
def _at(x, k):
    return x[k]


def _sum_of_double(x):
    double, total = 2.0 * x, 0.0
    for k in range(len(x)):
        total += _at(double, k)
    return total


def test_only_kernels_that_make_arrays_count_references_to_them(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    signature = "float64(float64[::1])"
    made = kernel(signature, makes_arrays=True)(_sum_of_double)
    assert made(np.arange(4.0)) == 12.0
    (code,) = made.compiled.inspect_llvm().values()
    assert "NRT_MemInfo_alloc" in code
    alone = numba.njit(**_at.compiled.targetoptions)(_at.__wrapped__)
    assert alone(np.arange(4.0), 3) == 3.0
    (code,) = alone.inspect_llvm().values()
    assert "NRT_" not in code.split("cpython")[0]  # what follows is what Python calls it by
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "other"))
    with pytest.raises(numba.core.errors.NumbaError, match="NRT required"):
        _ = kernel(signature)(_sum_of_double).compiled
    with pytest.raises(AssertionError, match="that returns an array"):
        kernel("float64[::1](float64[::1])")(_sum_of_double)


def test_types_are_those_of_the_signature():
    with pytest.raises(TypeError, match="No matching definition"):
        _twice("two")


def test_numba_is_loaded_at_the_first_call_and_only_what_is_called():
    script = """
import sys
import numpy as np
from opl.cell import chain, separating, wheel_distance
from opl.motion import corner_error, fewest
from opl.search import recursive, relaxation
print("numba" in sys.modules)
from opl.files import kernels
wheel_distance._few_distances.compiled
print("numba.cpython.setobj" in sys.modules, "scipy.linalg" in sys.modules)
print(*(made.__wrapped__.__name__ for made in kernels._made if "compiled" in vars(made)))
kernels.load_kernels()
print(all("compiled" in vars(made) for made in kernels._made))
"""
    for _ in range(2):  # the first may have to compile
        ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    said = ["False", "False False", "_few_distances", "True"]  # nor what numba compiles with
    assert ended.stdout.splitlines() == said, ended.stderr


def test_what_was_kept_is_taken_into_what_is_compiled_later(tmp_path):
    (tmp_path / "kept.py").write_text(
        """
import numpy as np
from opl.files.kernels import kernel

@kernel("float64(float64[::1])", makes_arrays=True)
def inner(x):
    y = np.empty(len(x))
    for k in range(len(x)):
        y[k] = 2.0 * x[k]
    return y.sum()

@kernel("float64(float64[::1])")
def outer(x):
    return inner(x) + inner(x[1:])
"""
    )
    script = """
import sys
import numpy as np
import kept
for name in sys.argv[1:]:
    made = getattr(kept, name)
    hits = sum(made.compiled.stats.cache_hits.values())
    print(name, made(np.arange(4.0)), hits)
"""
    keeps = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(tmp_path)}
    said = []
    for names in (["inner"], ["inner", "outer"], ["outer"], ["outer", "inner"]):
        ended = subprocess.run(
            [sys.executable, "-c", script, *names], capture_output=True, text=True, env=keeps
        )
        assert not ended.stderr
        said += ended.stdout.splitlines()
    assert said == [
        *("inner 12.0 0", "inner 12.0 1", "outer 24.0 0"),
        *("outer 24.0 1", "outer 24.0 1", "inner 12.0 1"),
    ]
