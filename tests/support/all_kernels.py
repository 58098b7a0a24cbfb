"""Compiles all kernels of opl, before the workers of a run of tests begin.

Each worker, and each process that a test of it starts, would compile the same ones: in a fresh
clone four do at once, on two cores.
"""

import importlib
import os
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import opl
from opl.files import kernels
from opl.files.kernel_cache import VARIABLE, settle_kernel_cache

ROOT = Path(opl.__file__).parents[1]
_COMMAND = "from tests.support.all_kernels import load; load({first})"


def compile_all():
    """Compile all kernels in two processes, unless some were compiled of this state of the code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "environ", {**os.environ})  # the workers settle it for themselves
        settle_kernel_cache(Path(opl.__file__).parent)
        if any(Path(os.environ[VARIABLE]).rglob("*.nbi")):
            return
    commands = [[sys.executable, "-c", _COMMAND.format(first=first)] for first in (True, False)]
    for process in [subprocess.Popen(command, cwd=ROOT) for command in commands]:
        process.wait()  # what went wrong there is told by the tests that call it


def load(first):
    """Load all kernels, from the first one on, or from the last one back: until the two meet."""
    for module in pkgutil.walk_packages(opl.__path__, "opl."):
        if not module.name.startswith("opl.plugins."):  # whose home is another Python
            importlib.import_module(module.name)
    for made in kernels._made if first else reversed(kernels._made):
        _ = made.compiled
