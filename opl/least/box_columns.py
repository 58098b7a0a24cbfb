"""Places along the passes as columns of postures, sampled where they are near to a box."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from opl.cell.wheel_cuts import shut_along
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.least.doubts import Doubts
from opl.least.flat_ends import FlatEnds
from opl.least.known_rows import KnownRows
from opl.least.postures import Columns
from opl.planning.problem import GrindingProblem
from opl.planning.turned import blocks_of
from opl.search.box import JointBox
from opl.search.in_box import about_nearest, hidden, missing, nearest_points, sampled
from opl.search.joint_limits import about
from opl.walls.families import GROWN, grown
from opl.walls.images import Seams, image_within_limits, wrist_flips
from opl.walls.placement import Placement, allowed, families_of, placed
from opl.walls.shut_leads import RESERVE, ShutLeads

FINE = 33  # contact positions of a place at which a box is held against it
SOLVED_OF_WORK, KNOWN_OF_WORK = 800, 900  # postures that cost a unit of work
WITHIN = 9  # halvings of the way between places that is too deep in the wheel, but hardly
CLOSER = 2  # times that places are sampled closer where collisions begin
HIDDEN = 5e-5  # of the box: what a chord that meets it may stand off the postures
LESS = 1e-4, 3e-5  # [m] beyond the clearance needed, where all of the reserve costs too much
SPENT = 3e-4  # of the box: what a reserve may cost
BORDER = 1e-2  # belt units to look beyond what lies in the box


class ColumnSampler:
    """Samples the postures of places.

    Args:
        problem: What is to be planned.
        seams: Where angles are cut open.
        limits: What boxes are within after full turns, with each flip of the wrist.
    """

    def __init__(self, problem: GrindingProblem, seams: Seams, limits: Sequence[JointBox]) -> None:
        self._problem = problem
        self._seams = seams
        self._known = KnownRows(problem)
        self._shut: dict[tuple[float, float, float], bool] = {}  # edges asked about, by their ends
        self.collisions = False  # whether postures that collide are left out
        self.mirrored = False  # whether they are those with the wrist flipped that may not collide
        self.reserve = RESERVE  # [m] beyond the clearance needed that postures leave
        self.leads = ShutLeads(problem)
        changes = np.flatnonzero(np.diff(problem.points.pass_index))
        self._ends = np.unique([0, *changes, *(changes + 1), len(problem.points) - 1])
        self._limits = tuple(limits)
        self.flips = wrist_flips(problem.cell.robot.arm)
        self.work = 0.0  # what was sampled so far, in units of work
        self.doubts, self.ends = Doubts(problem), FlatEnds(problem)

    @property
    def learnt(self) -> int:
        """How often motions told where the part is too deep."""
        return self.doubts.count + self.ends.count

    @property
    def limits(self) -> Sequence[JointBox]:
        """What boxes are within, with the flip of the wrist that may not collide, if it is told."""
        if self.collisions and len(self._limits) > 1:
            return (self._limits[int(self.mirrored)],)
        return self._limits

    def columns(
        self,
        box: JointBox,
        placements: Sequence[Placement],
        places: Array,
        spare: Array | None = None,
    ) -> Columns:
        """Sample the postures of places where they are near to a box.

        Args:
            box: The box.
            placements: The image that each pass uses, of passes with one of the places.
            places: Fractional cutter points, shape (n,).
            spare: Depth in [m] that they leave of what is allowed, shape (n,); none if not given.
        """
        problem, spare = self._problem, np.zeros(len(places)) if spare is None else spare
        there = self.there(places)
        positions = problem.field.contact_positions
        grid = np.broadcast_to(positions, (len(places), len(positions)))
        cuts = self._cuts(places, grid)
        t = np.empty((len(places), FINE))
        for block in blocks_of(*grid.shape):
            coarse = self._coarse(places[block], there.pass_index[block], placements)
            free = ~cuts[block] & ~np.isnan(coarse[..., 0])
            free &= allowed(places[block], there.pass_index[block], placements, grid[block])
            if spare[block].any():
                of = places[block], grid[block], spare[block]
                _leave_out(coarse, free, box, partial(self._known.spends, *of))
            t[block], _ = sampled(grid[block], coarse, free, box, FINE, whole=True)
        # where the part begins to cut is known to a hair only
        last = problem.cell.wheel.last_position
        t = np.clip(np.concatenate([t[:, :1] - BORDER, t, t[:, -1:] + BORDER], axis=1), -last, last)
        self.reserve = RESERVE
        return self._as_far_as_needed(box, self.at(places, there, placements, t), spare)

    def _as_far_as_needed(self, box: JointBox, columns: Columns, spare: Array) -> Columns:
        """Leave out what collides, with as large a reserve as costs hardly more than none.

        What is left of a place may leave the clearance needed, and hardly more.
        """
        found = self._left(box, columns, spare)
        if not self.collisions or (most := _size(found, box)) <= (1.0 + SPENT) * box.size:
            return found
        self.reserve = 0.0
        without = self._left(box, columns, spare)
        least = _size(without, box)
        if np.isinf(least):
            return without
        if most - least <= SPENT * box.size:
            self.reserve = RESERVE
            return found
        for self.reserve in LESS:
            found = self._left(box, columns, spare)
            if _size(found, box) - least <= SPENT * box.size:
                return found
        self.reserve = 0.0
        return without

    def _left(self, box: JointBox, columns: Columns, spare: Array) -> Columns:
        """Return what is left of columns with the reserve, sampled closer where a box needs it."""
        if self.reserve != RESERVE:  # with which they were sampled
            columns = self.at(columns.places, columns.points, columns.placements, columns.t)
        columns = self._within(box, self.spared(columns, spare))
        columns = self._closer(columns, box, spare)
        if self.collisions:
            self._leave_out_collisions(columns, box)
            # where collisions begin is seen at the samples only
            for _ in range(CLOSER):
                columns = self._closer(columns, box, spare)
                self._leave_out_collisions(columns, box)
        return columns

    def _closer(self, columns: Columns, box: JointBox, spare: Array) -> Columns:
        """Sample places that a box misses, or may miss, closer around what is nearest to it."""
        missed, row = nearest_points(columns.q, columns.free, box)
        poor = (missed > GROWN) & np.isfinite(missed)
        held = np.where(columns.free, missing(columns.q, box), np.inf).min(axis=1) <= GROWN
        met = np.flatnonzero(~held & (missed <= GROWN))  # by a chord alone
        poor[met] = hidden(columns.q[met], row[met]) > HIDDEN * box.size
        if not (own := np.flatnonzero(poor)).size:
            return columns
        t, q, free = columns.t.copy(), columns.q.copy(), columns.free.copy()
        t[own] = about_nearest(t[own], row[own], free[own], missing(q[own], box))
        places, passes = columns.places[own], np.unique(columns.points.pass_index[own])
        placements = [columns.placements[index] for index in passes.tolist()]
        found = self.at(places, self.there(places), placements, t[own])
        found = self._within(box, self.spared(found, spare[own]))
        q[own], free[own] = found.q, found.free
        return replace(columns, t=t, q=q, free=free)

    def _within(self, box: JointBox, columns: Columns) -> Columns:
        """Return columns without the postures beyond the limits where a box is within them."""
        free = columns.free & about(box, self.limits).holds(columns.q)
        return replace(columns, free=free)

    def _coarse(
        self, places: Array, pass_index: np.ndarray, placements: Sequence[Placement]
    ) -> Array:
        """Return postures of places at the field's contact positions, shape (n, M, 6)."""
        angles = self._known.over_field(places, families_of(pass_index, placements))
        return placed(angles, self._seams.start, pass_index, placements)

    def _leave_out_collisions(self, columns: Columns, box: JointBox) -> None:
        """Leave postures that collide out of columns, until those nearest to a box are free."""

        def refused(near: np.ndarray) -> np.ndarray:
            near[near] = self.collides(columns.q[near], self.reserve)
            return near

        _leave_out(columns.q, columns.free, box, refused)

    def at(
        self,
        places: Array,
        there: CutterPoints,
        placements: Sequence[Placement],
        t: Array,
        reserve: float | None = None,
    ) -> Columns:
        """Return the postures of places at contact positions, shape (n, m).

        Leads leave a reserve beyond the clearance needed in [m], that of the sampler if none is
        given.
        """
        problem = self._problem
        passes, solved = there.pass_index, self._known.solved
        angles = self._known.angles(places, t, families_of(passes, placements))
        self.work += (self._known.solved - solved) / SOLVED_OF_WORK + t.size / KNOWN_OF_WORK
        q = placed(angles, self._seams.start, passes, placements)
        free = ~np.isnan(q[..., 0]) & ~self._cuts(places, t)
        free &= allowed(places, passes, placements, t)
        free[free] = image_within_limits(problem.cell.robot, self.flips, q[free])
        if self.collisions:
            reserve = self.reserve if reserve is None else reserve
            self._leave_out_leads(places, there, placements, t, free, reserve)
        return Columns(places, there, tuple(placements), t, q, free)

    def _cuts(self, places: Array, t: Array) -> np.ndarray:
        """Return where the part would sink too deep into the wheel, shape (n, m)."""
        # their own passes: those of places that are points of their own count from 0 again
        passes, at_end = self._problem.points.pass_index[places.astype(int)], self.ends.are_at(t)
        cuts = self._known.cuts(places, t, self.doubts.at(passes, t) | at_end)
        spends = self._known.spends(places, t, self.ends.spared(passes), at_end & ~cuts)
        return np.asarray(cuts | spends)

    def spared(self, columns: Columns, spare: Array) -> Columns:
        """Leave out postures that leave less than some depth of that allowed, by place in [m]."""
        spends = self._known.spends(columns.places, columns.t, spare, columns.free)
        return replace(columns, free=columns.free & ~spends)

    def _leave_out_leads(
        self,
        places: Array,
        there: CutterPoints,
        placements: Sequence[Placement],
        t: Array,
        free: np.ndarray,
        reserve: float,
    ) -> None:
        """Leave postures out, flags of shape (n, m), where passes cannot begin or end."""
        for column in np.flatnonzero(np.isin(places, self._ends)).tolist():
            own, row = placements[int(there.pass_index[column])], np.flatnonzero(free[column])
            flip = own.number ^ int(self.mirrored)
            T = there.Ts_workpiece_cutter[column]
            free[column, row] = ~self.leads.at(T, own.family, flip, t[column, row], reserve)

    def there(self, places: Array) -> CutterPoints:
        """Return fractional cutter points of some passes, shape (n,), as points of their own."""
        return self._problem.points.at_places(places)

    def collides(self, q: Array, reserve: float) -> np.ndarray:
        """Return which postures collide, or mirrored do, with some clearance to spare.

        q in [rad], shape (n, 6); the reserve in [m].
        """
        sign, shift = self.flips[self.mirrored]
        return self._problem.scene.collision.wider(reserve).collides(q * sign + shift)

    def shut_along(self, first: Array, last: Array, t: Array) -> np.ndarray:
        """Return between which places the part surely cuts into the wheel all the way, (n,).

        Each on one contact position, between two neighbouring cutter points.
        """
        problem = self._problem
        edges = list(zip(first.tolist(), last.tolist(), t.tolist(), strict=True))
        new = np.array([edge not in self._shut for edge in edges], dtype=bool)
        if new.any():
            at = first[new], last[new], t[new], WITHIN
            found = shut_along(problem.cell, problem.scene.part, problem.points, *at)
            asked = (edge for edge, one in zip(edges, new, strict=True) if one)
            self._shut.update(zip(asked, found.tolist(), strict=True))
        return np.array([self._shut[edge] for edge in edges], dtype=bool)


def _leave_out(
    q: Array, free: np.ndarray, box: JointBox, refused: Callable[[np.ndarray], np.ndarray]
) -> None:
    """Leave postures out that are refused, until those nearest to a box are free.

    Args:
        q: Postures of places in [rad], shape (n, m, 6).
        free: Which are free as far as is known, shape (n, m); changed.
        box: The box.
        refused: Tells which of some are refused, both flags of shape (n, m).
    """
    asked, every = np.zeros_like(free), np.arange(len(free))
    while True:
        _, row = nearest_points(q, free, box)
        near = np.zeros_like(free)
        met = row >= 0.0
        for end in (np.floor(row), np.ceil(row)):
            near[every[met], end[met].astype(int)] = True
        near &= ~asked
        if not near.any():
            return
        asked |= near
        free &= ~refused(near)


def _size(columns: Columns, box: JointBox) -> float:
    """Return the size of a box grown until it holds a posture of each column, in [rad]."""
    larger = grown(columns.q, columns.free, box)
    return np.inf if larger is None else larger.size
