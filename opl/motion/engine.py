"""TOPP-RA, without the half second that loading its plots takes: nothing is plotted here."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from types import ModuleType
from typing import Any

_PACKAGE, _NAME = "matplotlib", "pyplot"


@contextmanager
def _plots_on_demand() -> Iterator[None]:
    """Let ``matplotlib.pyplot`` be loaded when something of it is first used."""
    full = f"{_PACKAGE}.{_NAME}"
    spec = None if full in sys.modules else find_spec(full)
    if spec is None or spec.loader is None:
        yield
        return
    module, loader = ModuleType(full), spec.loader
    module.__spec__, module.__file__ = spec, spec.origin

    def load(attribute: str) -> Any:
        del module.__dict__["__getattr__"]
        loader.exec_module(module)
        return getattr(module, attribute)

    module.__dict__["__getattr__"] = load
    sys.modules[full] = module
    setattr(sys.modules[_PACKAGE], _NAME, module)
    yield


with _plots_on_demand():
    from toppra.algorithm import TOPPRA
    from toppra.constraint import LinearConstraint
    from toppra.interpolator import AbstractGeometricPath

__all__ = ["TOPPRA", "AbstractGeometricPath", "LinearConstraint"]
