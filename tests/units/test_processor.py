"""numpy and OpenBLAS must not choose their loops by what only some processors have."""

import json
import os
import subprocess
import sys

import pytest

from opl import processor

# what numpy found, and the kernels that each OpenBLAS it and scipy came with has chosen
LOOK = """
import opl, ctypes, json, pathlib, numpy, scipy.linalg
found = numpy.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
cores = []
for module in (numpy, scipy):
    home = pathlib.Path(module.__file__).parents[1] / f"{module.__name__}.libs"
    for library in home.glob("*openblas*"):
        loaded = ctypes.CDLL(str(library))
        for name in ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename",
                     "openblas_get_corename64_", "openblas_get_corename"):
            if hasattr(loaded, name):
                core = getattr(loaded, name)
                core.restype = ctypes.c_char_p
                cores.append(core().decode())
                break
print(json.dumps([found, cores]))
"""


def looked(**environment):
    env = {name: value for name, value in os.environ.items() if name not in processor_settings()}
    run = subprocess.run(
        [sys.executable, "-c", LOOK], env={**env, **environment}, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def processor_settings():
    return {"OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES"}


@pytest.mark.skipif(
    not {"avx2", "fma"} <= processor._features(), reason="this processor computes as it likes"
)
def test_wider_vectors_are_left_alone():
    found, cores = looked()
    assert not [name for name in found if "AVX512" in name or name == "X86_V4"]
    assert len(cores) == 2
    assert set(cores) == {"Haswell"}


def test_what_the_process_has_set_stays():
    _, cores = looked(OPENBLAS_CORETYPE="Nehalem")
    assert set(cores) == {"Nehalem"}


def test_an_older_processor_is_left_as_it_is(monkeypatch):
    monkeypatch.setattr(processor, "_features", lambda: {"sse4_2", "fma"})
    for name in processor_settings():
        monkeypatch.delenv(name, raising=False)
    processor.round_alike()
    assert not processor_settings() & os.environ.keys()
