"""What is to be planned: the scene, the points and the free nodes, as one value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.process_settings import ProcessSettings
from opl.planning.depths import nearer_nodes, wheel_distances
from opl.planning.nodes import NodeField, NodeMatrix, build_nodes, inverse_solutions
from opl.planning.scene import PlanningScene
from opl.planning.settings import Interpolation
from opl.planning.shut_ways import shut_ways
from opl.planning.turned import blocks_of
from opl.search.ladder import Ladder


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
        """Between which cutter points the part cuts in all the way, as `shut_ways` tells."""
        positions = self.field.contact_positions
        return shut_ways(self.scene, self.points, positions, self.wheel_distance)

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
