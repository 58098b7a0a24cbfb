"""Places at rows of contact positions: what was solved and measured of them, known once.

Boxes that follow on each other are much alike, and so are the samples near to them: of ten rows
that are asked for nine were asked for before.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np

from opl.geometry.frames import Array
from opl.planning.depths import nearer_nodes
from opl.planning.nodes import inverse_solutions
from opl.planning.problem import GrindingProblem
from opl.planning.turned import blocks_of

MOST_KNOWN = 2**26  # bytes; beyond that all are forgotten
DEPTH = "depth"  # tells rows of depths from those of a posture, whose kind is a number too
UNKNOWN, NEARER = np.int8(-1), np.int8(1)  # than the part may be to the wheel; 0 where it is not

Key = tuple[Hashable, ...]


class KnownRows:
    """The rows that were asked for so far.

    Args:
        problem: What is to be planned.

    Attributes:
        solved: How many postures were solved, one for each place and contact position.
    """

    def __init__(self, problem: GrindingProblem) -> None:
        self._problem = problem
        self._known: dict[Key, Array] = {}
        self._bytes = 0
        self.solved = 0

    def angles(self, places: Array, t: Array, families: np.ndarray) -> Array:
        """Return principal angles in [rad], NaN where there is no posture, shape (n, m, 6).

        Args:
            places: Fractional cutter points, shape (n,).
            t: Contact positions of each in belt units, shape (n, m).
            families: The posture of each, shape (n,).
        """
        keys, cell = _keys(places, t, families.tolist()), self._problem.cell
        found = np.empty((*t.shape, 6))
        new = np.array([key not in self._known for key in keys], dtype=bool)
        for k in np.flatnonzero(~new).tolist():
            found[k] = self._known[keys[k]]
        to_solve = np.flatnonzero(new)
        for block in blocks_of(len(to_solve), t.shape[1]):
            own = to_solve[block]
            q = inverse_solutions(
                cell, self._problem.points.frames_at(places[own])[:, None], t[own]
            )
            found[own] = q[np.arange(len(own)), :, families[own]]
            self._keep([keys[k] for k in own.tolist()], found[own])
        self.solved += t[new].size
        return found

    def over_field(self, places: Array, families: np.ndarray) -> Array:
        """Return the same at all contact positions of the field, shape (n, M, 6)."""
        problem, whole = self._problem, places == np.floor(places)
        positions = problem.field.contact_positions
        angles = np.empty((len(places), len(positions), 6))
        for family in np.unique(families[whole]).tolist():
            own = whole & (families == family)
            angles[own] = problem.angles(family, places[own].astype(int))
        between, grid = ~whole, np.broadcast_to(positions, angles.shape[:2])
        angles[between] = self.angles(places[between], grid[between], families[between])
        return angles

    def cuts(self, places: Array, t: Array, doubted: np.ndarray) -> np.ndarray:
        """Return where the part would sink too deep into the wheel, shape (n, m).

        As `GrindingProblem.cuts_at` does, with what is doubted of each place, shape (n, m).
        """
        cut, unsure = self._problem.sure_cuts(places, t, doubted)
        return np.asarray(cut | self._nearer(places, t, np.zeros(len(places)), unsure))

    def spends(self, places: Array, t: Array, spare: Array, asked: np.ndarray) -> np.ndarray:
        """Return where the part leaves less than some depth of that allowed, shape (n, m).

        Args:
            places: Fractional cutter points, shape (n,).
            t: Contact positions of each in belt units, shape (n, m).
            spare: Depth in [m] that is to be left at each, shape (n,); none where it is 0.
            asked: Where that is asked, shape (n, m); elsewhere it is said that it does not.
        """
        return self._nearer(places, t, spare, asked & (spare > 0.0)[:, None])

    def _nearer(self, places: Array, t: Array, spare: Array, asked: np.ndarray) -> np.ndarray:
        """Return where of what is asked the part is nearer to the wheel than it may be, (n, m).

        It is to leave some depth in [m] of that allowed, shape (n,).
        """
        found = np.zeros(t.shape, dtype=bool)
        if not (some := asked.any(axis=1)).any():
            return found
        places, t, spare, asked = places[some], t[some], spare[some], asked[some]
        keys = _keys(places, t, [(DEPTH, depth) for depth in spare.tolist()])
        unknown = np.full(t.shape[1], UNKNOWN)
        known = np.array([self._known.get(key, unknown) for key in keys])
        new = asked & (known == UNKNOWN)
        if (own := np.flatnonzero(new.any(axis=1))).size:
            points = self._problem.points.at_places(places[own])
            needed = spare[own, None] - self._problem.cell.planned_penetration
            nearer = nearer_nodes(self._problem.scene, points, t[own], new[own], needed)
            known[own] = np.where(new[own], nearer, known[own])
            self._keep([keys[k] for k in own.tolist()], known[own])
        found[some] = asked & (known == NEARER)
        return found

    def _keep(self, keys: Sequence[Key], rows: np.ndarray) -> None:
        """Know rows from now on, the first time that they are found or anew."""
        size = rows.nbytes + 8 * rows.shape[0] * rows.shape[1]  # with their contact positions
        self._bytes += size
        if self._bytes > MOST_KNOWN:
            self._known.clear()
            self._bytes = size
        self._known.update(zip(keys, rows, strict=True))


def _keys(places: Array, t: Array, kinds: Sequence[Hashable]) -> list[Key]:
    """Return what rows are known by: place, contact positions and kind."""
    return list(zip(places.tolist(), (row.tobytes() for row in t), kinds, strict=True))
