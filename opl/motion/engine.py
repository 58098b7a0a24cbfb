"""The highest path speeds by TOPP-RA, without the second that its plots and splines load for."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

from opl.geometry.frames import Array

NEGLIGIBLE = 1e-6  # part of the largest acceleration that a change of path speed may add unseen
APART = 1e-5  # parts of their largest accelerations that joints are told apart by
_LIBRARIES = ("matplotlib", "matplotlib.pyplot", "scipy.interpolate", "scipy.sparse")


@contextmanager
def _libraries_on_demand() -> Iterator[None]:
    """Hand out stand-ins for libraries, whose functions load them when they are first called."""
    new = [name for name in _LIBRARIES if name not in sys.modules]
    for name in new:
        stand_in = sys.modules[name] = ModuleType(name)
        stand_in.__dict__["__getattr__"] = partial(_function, name)
    try:
        yield
    finally:
        for name in new:
            del sys.modules[name]


def _function(library: str, name: str) -> Callable[..., Any]:
    return lambda *given, **named: getattr(import_module(library), name)(*given, **named)


with _libraries_on_demand():
    from toppra.algorithm import TOPPRA
    from toppra.constraint import LinearConstraint
    from toppra.interpolator import AbstractGeometricPath


def path_speeds(
    place: Array,
    slope: Array,
    bend: Array,
    speed: Array,
    acceleration: Array,
    enters: bool,
    leaves: bool,
) -> Array | None:
    """Return the highest path speed at each place, shape (g,), None if toppra finds none.

    Args:
        place: Places on a line of configurations in [s], ascending, shape (g,).
        slope: Of the line there in [rad/s], shape (g, 6).
        bend: Its change on each piece in [rad/s^2], shape (g - 1, 6).
        speed: Largest speed of each joint in [rad/s], shape (6,).
        acceleration: Largest acceleration in [rad/s^2], shape (6,).
        enters: Whether it comes at full path speed; else from rest.
        leaves: Whether it goes at full path speed; else it comes to rest.
    """
    # over joints that turn alike to a hundred-millionth the search fails, so then none do
    for apart in (0.0, APART):
        lower = acceleration * (1.0 - apart * np.arange(len(acceleration)))
        constraint = _Limits(place, slope, bend, speed, lower)
        search = TOPPRA([constraint], _Place(place), gridpoints=place, solver_wrapper="seidel")
        search.compute_parameterization(float(enters), float(leaves))
        found: Array | None = search.problem_data.sd_vec
        if found is not None and np.isfinite(found).all():
            return found
    return None


class _Place(AbstractGeometricPath):  # type: ignore[misc]
    """All that toppra needs of a path whose constraint brings its own derivatives."""

    def __init__(self, place: Array) -> None:
        self._ends = place[[0, -1]]

    @property
    def dof(self) -> int:
        return 1

    @property
    def path_interval(self) -> Array:
        return self._ends


class _Limits(LinearConstraint):  # type: ignore[misc]
    """Speed and acceleration of all joints, at both ends of each piece of the grid.

    toppra's own constraint takes second derivatives at the grid alone; where they jump, it would
    take those of the wrong side.
    """

    def __init__(
        self, place: Array, slope: Array, bend: Array, speed: Array, acceleration: Array
    ) -> None:
        super().__init__()
        self.identical = True
        length = np.diff(place)[:, None]
        # u: half the change of the squared path speed with the place, x: its square at the start
        at_start, at_end = slope[:-1], slope[1:] + 2.0 * length * bend
        scale = np.tile(acceleration, 2)
        of_u = np.hstack([at_start, at_end]) / scale
        of_x = np.hstack([bend, bend]) / scale
        # x lies in [0, 1] at both ends of a piece, so |u| <= 1 / (2 length). What such u and x are
        # too small for is left out: where the joints all but stand still, the search fails over it.
        of_u = np.where(np.abs(of_u) > NEGLIGIBLE * 2.0 * length, of_u, 0.0)
        reached = np.abs(of_u) / (2.0 * length) + np.abs(of_x) > 1.0
        self._of_u, self._of_x = np.where(reached, of_u, 0.0), np.where(reached, of_x, 0.0)
        steepest = np.maximum(np.abs(slope[:-1]), np.abs(slope[1:])) / speed
        # Corners are passed no faster than they can be passed evenly. Without this the search
        # takes some so fast that it has to all but stop within them, where a joint turns back.
        sharpest = (np.abs(bend) / acceleration).max(axis=1)
        cap = 1.0 / np.maximum(np.maximum(steepest.max(axis=1) ** 2, sharpest), 1.0)
        self._most = np.minimum(np.append(cap, cap[-1]), np.insert(cap, 0, cap[0]))

    def compute_constraint_params(
        self, path: AbstractGeometricPath, gridpoints: Array, *args: Any, **kwargs: Any
    ) -> tuple[Any, ...]:
        n, m = self._of_u.shape
        of_u, of_x = (np.vstack([rows, rows[-1:]]) for rows in (self._of_u, self._of_x))
        both = np.vstack([np.eye(m), -np.eye(m)])
        bounds = np.column_stack([np.zeros(n + 1), self._most])
        return of_u, of_x, np.zeros((n + 1, m)), both, np.ones(2 * m), None, bounds
