"""What is to be planned: the scene, the points and the free nodes, as one value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from opl.cell.wheel_distance import signed_wheel_distance
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array, inverse
from opl.geometry.toolpath import CutterPoints
from opl.motion.process_settings import ProcessSettings
from opl.planning.nodes import NodeField, NodeMatrix, build_nodes, inverse_solutions
from opl.planning.scene import PlanningScene
from opl.planning.settings import Interpolation
from opl.planning.turned import blocks_of
from opl.search.ladder import Ladder

CLOSE = 1e-3  # [m] between places: what is shut at both is shut between them, as far as seen


@dataclass(frozen=True)
class GrindingProblem:
    """Everything a search needs.

    Attributes:
        scene: The cell and its geometry.
        points: N cutter points.
        field: The nodes of every matrix.
        wheel_distance: Signed distance of the part to the wheel in [m], exact where it is less
            than the largest belt penetration allows, shape (N, M).
        interpolation: How the path between nodes is filled in.
        process: Speeds, approach and home.
        known_sides: `sides`, where the distances do not tell.
        spacing: How far the points are apart in cutter points, shape (N - 1,), or 1 for all.
    """

    scene: PlanningScene
    points: CutterPoints
    field: NodeField
    wheel_distance: Array
    interpolation: Interpolation
    process: ProcessSettings
    known_sides: np.ndarray | None = None
    spacing: Array | float = 1.0

    @property
    def cell(self) -> WorkCell:
        """The cell."""
        return self.scene.cell

    @cached_property
    def shut(self) -> np.ndarray:
        """Between which cutter points the part cuts in all the way, as far as seen, (N - 1, M).

        On one contact position of the field. On a flat between two walls the wheel fits in at one
        contact position after the other, at none at two cutter points: so places between are looked
        at until they are close together.
        """
        shut = self.cuts[:-1] & self.cuts[1:] & ~self.off_wheel[:, None]
        length, parts = np.abs(np.diff(self.points.arc_length)), 1
        while len(edges := np.flatnonzero(shut.any(axis=1) & (length > parts * CLOSE))):
            parts *= 2
            t = np.broadcast_to(self.field.contact_positions, (len(edges), shut.shape[1]))
            for share in np.arange(1, parts, 2) / parts:
                between = self.points.at_places(edges + share)
                shut[edges] = nearer_nodes(self.scene, between, t, shut[edges])
        return np.asarray(shut)

    @cached_property
    def sides(self) -> np.ndarray | None:
        """Between which shut contact positions nodes lie, as `Ladder.sides`, (N - 1, 2, M).

        None where nothing is shut.
        """
        if self.known_sides is not None:
            return self.known_sides
        if not self.shut.any():
            return None
        below = np.cumsum(self.shut, axis=1, dtype=np.int16)
        return np.stack([below, below], axis=1)

    def sides_at(self, places: Array, t: Array) -> np.ndarray | None:
        """Return `sides` of places at contact positions of their own, shape (n - 1, 2, m).

        Args:
            places: Fractional cutter points, shape (n,).
            t: Contact positions, shape (n, m).
        """
        if self.sides is None:
            return None
        above = np.searchsorted(self.field.contact_positions, t)
        below = np.pad(self.sides[places[:-1].astype(int), 0], ((0, 0), (1, 0)))
        both = [np.take_along_axis(below, rows, axis=1) for rows in (above[:-1], above[1:])]
        return np.stack(both, axis=1)

    @property
    def off_wheel(self) -> np.ndarray:
        """Which edges from a cutter point to the next leave the wheel, shape (N - 1,)."""
        return np.asarray(np.diff(self.points.pass_index) != 0)

    @property
    def cuts(self) -> np.ndarray:
        """Where the part would sink too deep into the wheel, shape (N, M)."""
        return np.asarray(self.wheel_distance < -self.cell.planned_penetration)

    def cuts_at(
        self, places: Array, points: CutterPoints, t: Array, doubted: np.ndarray | bool = False
    ) -> np.ndarray:
        """Return where the part would sink too deep into the wheel, shape (n, m).

        Where all nodes of the field around a place and contact position are free, so is what lies
        between them: a motion that is not free for all that is refused when it is checked. Where
        all of them cut in, so does what lies between them if the ways from place to place are shut.

        Args:
            places: Fractional cutter points, shape (n,).
            points: The same as points of their own.
            t: Contact positions in belt units, shape (n, m).
            doubted: What is measured though all around it are free, shape (n, m) or one for all.
        """
        cut, unsure = self.sure_cuts(places, t, doubted)
        return np.asarray(nearer_nodes(self.scene, points, t, unsure) | cut)

    def sure_cuts(
        self, places: Array, t: Array, doubted: np.ndarray | bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return where the part cuts in as `cuts_at` does, and where that is to be measured.

        Both of shape (n, m); nothing is measured here.
        """
        field, cuts = self.field.contact_positions, self.cuts
        after = np.clip(np.searchsorted(field, t), 1, len(field) - 1)
        before = np.floor(places).astype(int)[:, None]
        near = np.zeros(t.shape, dtype=int)
        for column in (before, np.ceil(places).astype(int)[:, None]):
            near += cuts[column, after - 1].astype(int) + cuts[column, after]
        on_way, shut = (places % 1.0 > 0.0)[:, None], np.pad(self.shut, ((0, 1), (0, 0)))
        cut = (near == 4) & (~on_way | (shut[before, after - 1] & shut[before, after]))
        return np.asarray(cut), np.asarray(((near > 0) | doubted) & ~cut)

    def solutions(self, columns: np.ndarray) -> Array:
        """Solve all IK branches at some cutter points, at the contact positions of the field.

        Return principal angles in [rad], NaN where there are none, shape (n, M, 8, 6).
        """
        frames = self.points.Ts_workpiece_cutter[columns, None]
        return inverse_solutions(self.cell, frames, self.field.contact_positions)

    def angles(self, ik_branch: int, columns: np.ndarray) -> Array:
        """Return one IK branch of `solutions`, shape (n, M, 6); those with matrices are known."""
        known = self.field.angles.get(ik_branch)
        if known is not None:
            return np.asarray(known[columns])
        found = np.empty((len(columns), len(self.field.contact_positions), 6))
        for block in blocks_of(*found.shape[:2]):
            found[block] = self.solutions(columns[block])[:, :, ik_branch]
        return found

    def free_nodes(self, nodes: NodeMatrix, columns: slice | int = slice(None)) -> np.ndarray:
        """Return which nodes exist and do not cut into the wheel, shape (N, n_rows).

        Of all columns, of some, or those of one, shape (n_rows,).
        """
        cuts = self.cuts[columns][..., nodes.position_index]
        return np.ascontiguousarray(nodes.exists[columns] & ~cuts)

    def over_nodes(
        self, places: Array, points: CutterPoints, t: Array, matrices: Sequence[NodeMatrix]
    ) -> GrindingProblem:
        """Return the problem of some places over nodes of their own, none of which cuts in.

        Args:
            places: Fractional cutter points, shape (n,).
            points: The same as points of their own.
            t: Contact positions in belt units, shape (n, m).
            matrices: Of these contact positions, one in each row.
        """
        rule = self.interpolation
        if (np.diff(places) > 1.0).any():
            # places far apart: joints may turn as far between them as they like
            rule = replace(rule, max_joint_step=np.inf)
        return replace(
            self,
            points=points,
            field=NodeField(t[0], self.field.reached[:0], {}, tuple(matrices)),
            wheel_distance=np.zeros(t.shape),
            known_sides=self.sides_at(places, t),
            interpolation=rule,
            spacing=np.diff(places),
        )

    def ladder(self, nodes: NodeMatrix, free: np.ndarray) -> Ladder:
        """Return a node matrix as the search sees it."""
        rule = self.interpolation
        return Ladder(
            nodes.q,
            free,
            nodes.contact_position,
            self.off_wheel,
            rule.max_contact_step,
            rule.max_joint_step,
            np.where(self.off_wheel, np.inf, rule.max_contact_change * self.spacing),
            None if self.sides is None else self.sides[:, :, nodes.position_index].copy(),
        )


def build_problem(
    scene: PlanningScene,
    points: CutterPoints,
    contact_positions: Array,
    interpolation: Interpolation,
    process: ProcessSettings,
    clock: Callable[[str], AbstractContextManager[object]] = nullcontext,
) -> GrindingProblem:
    """Build the node matrices, and the distances of part and wheel at every node.

    `clock` measures the stages ``nodes`` and ``clearance``.
    """
    with clock("nodes"):
        field = build_nodes(scene.cell, points, contact_positions)
    with clock("clearance"):
        layer = wheel_distances(scene, points, contact_positions)
    return GrindingProblem(scene, points, field, layer, interpolation, process)


def wheel_distances(scene: PlanningScene, points: CutterPoints, contact_positions: Array) -> Array:
    """Return the signed distance of the part to the wheel at all nodes in [m], shape (N, M).

    As in `signed_wheel_distance`: exact where it is less than the belt penetration permits, else
    anything that is not, or infinite. Contact positions are for all cutter points, shape (M,).
    """
    wheel, depth = scene.cell.wheel, -scene.cell.planned_penetration
    # on the flat the part slides along the axle, by half of the wheel's width at the most: where it
    # keeps off a wheel that is wider by so much, it does at every contact position there
    wide = replace(wheel, width=2.0 * wheel.width)
    Ts = wheel.T_contact0_contact(0.0) @ inverse(points.Ts_workpiece_cutter)
    keeps_off = signed_wheel_distance(scene.part, wide, Ts, depth, depth) >= depth
    asked = ~(keeps_off[:, None] & (np.abs(contact_positions) <= wheel.flat_end))
    allowed = np.full((len(points), 1), depth)
    layer = _measured(scene, points, contact_positions, asked, allowed, -np.inf)
    layer[~asked] = np.inf
    return layer


def nearer_nodes(
    scene: PlanningScene,
    points: CutterPoints,
    contact_positions: Array,
    asked: np.ndarray,
    needed: Array | None = None,
) -> np.ndarray:
    """Return at which nodes the part is nearer to the wheel than needed, shape (N, M).

    Args:
        scene: The part and the wheel.
        points: The cutter points.
        contact_positions: Of each, shape (N, M).
        asked: Which nodes are looked at, shape (N, M); of all others it is said that it is not.
        needed: In [m], of each cutter point, shape (N, 1); if not given what the belt permits.
    """
    if needed is None:
        needed = np.full((len(points), 1), -scene.cell.planned_penetration)
    layer = _measured(scene, points, contact_positions, asked, needed, needed)
    return np.asarray(asked & (layer < needed))


def _measured(
    scene: PlanningScene,
    points: CutterPoints,
    contact_positions: Array,
    asked: np.ndarray,
    needed: Array,
    enough: Array | float,
) -> Array:
    """Return distances as `signed_wheel_distance` does of nodes asked about, any of all others."""
    wheel = scene.cell.wheel
    layer = np.empty(asked.shape)
    Ts_cutter_workpiece = inverse(points.Ts_workpiece_cutter)
    t = np.broadcast_to(contact_positions, asked.shape)
    stops = np.broadcast_to(enough, needed.shape)
    for block in blocks_of(*asked.shape):
        now = asked[block]
        columns, _ = np.nonzero(now)
        # cutter and contact coincide, whatever robot brings the part there
        Ts = wheel.T_contact0_contact(t[block][now]) @ Ts_cutter_workpiece[block][columns]
        told = needed[block][columns, 0], stops[block][columns, 0]
        layer[block][now] = signed_wheel_distance(scene.part, wheel, Ts, *told)
    return layer
