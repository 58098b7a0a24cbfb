"""The field's contact positions at places between cutter points too: postures there, known once."""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.planning.nodes import inverse_solutions
from opl.planning.problem import GrindingProblem


class FieldAtPlaces:
    """Tells the postures of places at the field's contact positions.

    Args:
        problem: The cutter points and their field.
    """

    def __init__(self, problem: GrindingProblem) -> None:
        self._problem = problem
        self._known: dict[tuple[float, int], Array] = {}

    def at(self, places: Array, family: int) -> Array:
        """Return principal angles in [rad] of one posture, NaN where there is none, (n, M, 6).

        Args:
            places: Fractional cutter points, shape (n,).
            family: The posture.
        """
        problem, whole = self._problem, places == np.floor(places)
        found = np.empty((len(places), len(problem.field.contact_positions), 6))
        found[whole] = problem.angles(family, places[whole].astype(int))
        new = [place for place in places[~whole].tolist() if (place, family) not in self._known]
        if new:
            frames = problem.points.frames_at(np.array(new))[:, None]
            q = inverse_solutions(problem.cell, frames, problem.field.contact_positions)
            for place, solution in zip(new, np.array(q[:, :, family]), strict=True):
                self._known[place, family] = solution
        for k in np.flatnonzero(~whole).tolist():
            found[k] = self._known[float(places[k]), family]
        return found
