"""The inverse solutions of a problem as families: unrolled angles, before any count of full turns.

All nodes of a family are images of these: the same after full turns of joints, or with the wrist
flipped. Which image a pass uses is its placement.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from operator import itemgetter

import numpy as np

from opl.geometry.frames import Array
from opl.search.box import JointBox
from opl.search.cells import Key
from opl.search.chords import JUMP
from opl.search.joint_limits import about
from opl.search.outside import outside
from opl.walls.images import Images
from opl.walls.placement import Placement
from opl.walls.sides import Side

MOST_COLUMNS = 1000  # at which a box is held against the families
FEW_COLUMNS = 40  # over which a box is grown at first
STARTS = 8  # nodes from which one is grown
MOST_GROWN = 200  # times that a box is grown for a column
NODES_OF_WORK = 15000  # that cost a unit of work to hold against a box
MOST_KNOWN = 2_000_000  # placed nodes that are kept at hand: 49 bytes each
GROWN = 1e-7  # [rad] less need not be grown for


@dataclass(frozen=True)
class Fit:
    """How a pass fits into a box.

    Attributes:
        placement: The image.
        missing: How much the box must grow for each column of the pass, in [rad], shape (n,).
        row: Fractional row of the contact position where, shape (n,).
    """

    placement: Placement
    missing: Array
    row: Array


def grown(q: Array, free: np.ndarray, box: JointBox) -> JointBox | None:
    """Return a box grown until it holds a point of every column, the worst column first.

    None if some column has none.

    Args:
        q: Postures in [rad], shape (n, m, 6).
        free: Which may be used, shape (n, m).
        box: The box.
    """
    return _grown(np.ascontiguousarray(np.moveaxis(q, 1, 2)), np.ascontiguousarray(free), box)


def _grown(by_joint: Array, free: np.ndarray, box: JointBox) -> JointBox | None:
    """Return a box as `grown` does, for postures of shape (n, 6, m)."""
    low, high, q = box.lower.copy(), box.upper.copy(), by_joint
    missing, row = np.empty(len(q)), np.empty(len(q))
    for _ in range(MOST_GROWN):
        outside(by_joint, free, low, high, JUMP, missing, row)
        column = int(np.argmax(missing))
        if not np.isfinite(missing[column]):
            return None
        if missing[column] <= GROWN:
            break
        here = int(row[column])
        x = row[column] - here
        point = q[column, :, here]
        if x > 0.0:
            point = (1.0 - x) * point + x * q[column, :, here + 1]
        low, high = np.minimum(low, point), np.maximum(high, point)
    return JointBox(low, high)


def few_columns(pass_index: np.ndarray) -> np.ndarray:
    """Return columns spread over all of them, both ends of each pass among them."""
    step = -(-len(pass_index) // MOST_COLUMNS)
    ends = np.flatnonzero(np.diff(pass_index))
    last = len(pass_index) - 1
    return np.unique(np.concatenate([np.arange(0, last, step), ends, ends + 1, [last]]))


class Families:
    """The unrolled angles of every family at cutter points spread over the passes.

    Args:
        images: The images of each posture.
        q: Inverse solutions at `few_columns` in [rad], shape (n, M, 8, 6).
        cuts: Where the part would sink too deep into the wheel, shape (N, M).
        pass_index: Pass of each column, shape (N,).
        contact_positions: Those of the solutions in belt units, shape (M,).
        sides: The sides of each pass.

    Attributes:
        work: What was held against boxes so far, in units of work.
    """

    def __init__(
        self,
        images: Images,
        q: Array,
        cuts: np.ndarray,
        pass_index: np.ndarray,
        contact_positions: Array,
        sides: Sequence[Sequence[Side]],
    ) -> None:
        self._images = images
        self._contact_positions = contact_positions
        self._sides = sides
        self._places = few = few_columns(pass_index)
        cuts, pass_index = cuts[few], pass_index[few]
        begins = [0, *(np.flatnonzero(np.diff(pass_index)) + 1).tolist(), len(pass_index)]
        self._passes = [slice(*ends) for ends in pairwise(begins)]  # columns of each pass
        self._unrolled = {}
        self._known: dict[tuple[object, ...], tuple[Array, np.ndarray]] = {}
        self._known_nodes = 0
        self.work = 0.0
        for family in images.families:
            start = images.seams.start[family]
            unrolled = start + np.remainder(q[:, :, family] - start, 2.0 * np.pi)
            free = ~np.isnan(unrolled[..., 0]) & ~cuts
            free[free] = images.within_limits(unrolled[free])
            if free.any():
                self._unrolled[family] = unrolled, free

    def smallest_grown(self) -> JointBox | None:
        """Return a small box that holds a point of every column, grown from one of a few nodes."""
        best: JointBox | None = None
        if any(len(of_pass) > 1 for of_pass in self._sides):
            return None  # it might be on either side of a barrier
        step = max(len(self._places) // FEW_COLUMNS, 1)
        for family, (unrolled, free) in self._unrolled.items():
            if not free.any(axis=1).all():
                continue
            rows = np.flatnonzero(free[0])
            loose = ~self._images.seams.kept[family]
            for row in rows[np.linspace(0, len(rows) - 1, STARTS).astype(int)]:
                start = unrolled[0, row]
                here = Placement(family, 0, self._images.flips[0], np.zeros(6), loose, start)
                few = grown(here.of(unrolled[::step]), free[::step], JointBox(start, start))
                if few is None or (best is not None and few.size >= best.size):
                    continue
                whole = grown(here.of(unrolled), free, few)
                if whole is not None and (best is None or whole.size < best.size):
                    best = whole
        return best

    def grown(self, box: JointBox, placements: Sequence[Placement]) -> JointBox | None:
        """Return a box grown for all columns at the field's contact positions, as `grown` does."""
        for index, placement in enumerate(placements):
            limits = about(box, self._images.limits)
            larger = _grown(*self._placed(index, placement, limits), box)
            if larger is None:
                return None
            box = larger
        return box

    def _placed(
        self, index: int, placement: Placement, limits: JointBox
    ) -> tuple[Array, np.ndarray]:
        """Return the nodes of a pass as placed, shape (n, 6, m), and which are free, (n, m).

        Those beyond limits are not.
        """
        key = index, placement.key, limits.lower.tobytes(), limits.upper.tobytes()
        found = self._known.get(key)
        if found is None:
            columns = self._passes[index]
            unrolled, free = self._unrolled[placement.family]
            placed = placement.of(unrolled[columns])
            allowed = placement.side.holds(self._places[columns], self._contact_positions)
            allowed = allowed & limits.holds(placed)
            q = np.ascontiguousarray(np.moveaxis(placed, 1, 2))
            found = q, np.ascontiguousarray(free[columns] & allowed)
            if not placement.loose.any():
                if self._known_nodes > MOST_KNOWN:
                    self._known.clear()
                    self._known_nodes = 0
                self._known[key] = found
                self._known_nodes += found[1].size
        self.work += found[1].size / NODES_OF_WORK
        return found

    def _placements(
        self, index: int, center: Array, keys: Sequence[Key] | None
    ) -> Iterator[Placement]:
        """Yield the images that a pass may use; of families not decided yet those near a box."""
        sides = self._sides[index]
        for family, (unrolled, free) in self._unrolled.items():
            loose = ~self._images.seams.kept[family]
            if keys is not None:
                own = [(key, number) for name, key, number in keys if name == family]
                for (flip, *turns), number in own:
                    shift, side = 2.0 * np.pi * np.array(turns, dtype=float), sides[number]
                    flipped = flip, self._images.flips[flip]
                    yield Placement(family, *flipped, shift, loose, center, side)
                continue
            columns = self._passes[index]
            q, open_now = unrolled[columns], free[columns]
            mean = q[open_now].mean(axis=0) if open_now.any() else center
            for flip, (sign, shift) in enumerate(self._images.flips):
                whole = np.round((center - mean * sign - shift) / (2.0 * np.pi))
                whole = 2.0 * np.pi * np.where(loose, 0.0, whole)
                for side in sides:
                    yield Placement(family, flip, (sign, shift), whole, loose, center, side)

    def _fits(self, index: int, box: JointBox, keys: Sequence[Key] | None) -> list[Fit]:
        """Return how the images that a pass may use fit into a box."""
        found, limits = [], about(box, self._images.limits)
        for placement in self._placements(index, (box.lower + box.upper) / 2.0, keys):
            q, free = self._placed(index, placement, limits)
            missing, row = np.empty(len(q)), np.empty(len(q))
            outside(q, free, box.lower, box.upper, JUMP, missing, row)
            found.append(Fit(placement, missing, row))
        return found

    def anywhere(self, limits: JointBox) -> list[list[Placement]]:
        """Return images that all passes might use within limits, as near to the middle as may be.

        Of each family in turn, and of another for passes with a cutter point that it does not
        grind. First those of which most passes use the family.
        """
        fits = [self._fits(index, limits, None) for index in range(len(self._passes))]
        found = []
        for family in self._unrolled:
            chosen = [min(of_pass, key=partial(_in_family, family)) for of_pass in fits]
            own = [fit.placement.family == family for fit in chosen]
            if any(own) and all(np.isfinite(fit.missing).all() for fit in chosen):
                found.append((-sum(own), [fit.placement for fit in chosen]))
        return [placements for _, placements in sorted(found, key=itemgetter(0))]

    def hold(
        self,
        box: JointBox,
        keys: Mapping[int, Sequence[Key]],
        known: Collection[float],
        allowed: float,
    ) -> tuple[list[Placement], list[float]]:
        """Return the image of each pass that fits a box best, and where passes miss it most.

        Args:
            box: The box.
            keys: What is left of the families and images of passes, by pass.
            known: Cutter points that are held against the box already.
            allowed: What it may miss in [rad].

        Returns:
            The images, none if a pass has none left, and the worst cutter point of each pass, the
            worst of all first; of those it misses by less than a known one there is no need yet.
        """
        placements, missed = [], []
        for index, of_pass in enumerate(self._passes):
            fits = self._fits(index, box, keys.get(index))
            columns = self._places[of_pass]
            there = np.array([float(column) in known for column in columns])
            if not fits:
                return [], []
            # the image that the proof has in mind: the walls of the pass fit into the box
            best = min(fits, key=lambda fit: _misfit(fit, there))
            placements.append(best.placement)
            missing = np.where(there, -1.0, best.missing)
            worst = int(np.argmax(missing))
            if missing[worst] > max(allowed, best.missing[there].max(initial=0.0)):
                missed.append((float(missing[worst]), float(columns[worst])))
        missed.sort(reverse=True)
        return placements, list(dict.fromkeys(place for _, place in missed))


def _in_family(family: int, fit: Fit) -> tuple[float, bool]:
    """Return what a box misses of a pass, and whether another family than this places it."""
    return float(fit.missing.max()), fit.placement.family != family


def _misfit(fit: Fit, known: np.ndarray) -> tuple[float, float]:
    """Return what a box misses of the walls of a pass, and of all its columns."""
    at_walls = float(fit.missing[known].max(initial=0.0))
    return round(at_walls, 2), float(fit.missing.max())
