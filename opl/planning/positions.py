"""Which configurations of a motion are written: as few as keep the contact, the rest lies between.

A search needs nodes close together; a controller does better with few positions and long moves. On
each pass the fewest are taken whose joint lines keep the contact error at every place between, and
touch nothing. Places that are not written stay in the motion, moved onto the lines: what is proven
is what the written positions make of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from opl.cell.workcell import WorkCell
from opl.errors import UnsafeError
from opl.files.beside import Beside
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.bows import bowed_lines, freedom
from opl.motion.colliding_lines import CollidingLines
from opl.motion.fewest import ChainRule, Lines
from opl.motion.gradual import PLANNED_RATIO
from opl.motion.line_error import Run, Screws, line_errors, screws_of
from opl.motion.long_runs import fewest_of_long
from opl.motion.motion import Motion
from opl.motion.process_settings import ProcessSettings
from opl.motion.timing import on_wheel, time_motion
from opl.planning.speed_steps import with_moves_cut

if TYPE_CHECKING:
    from opl.planning.scene import PlanningScene


# Part of the allowed contact error that is used, bows between places included: in the
# proof, which looks at others, a little more is found.
USED = 0.97
# The same of rounded corners, which are looked at as the proof does, at fewer places.
USED_AT_CORNERS = 0.99
# Times that moves are halved next to a corner that is too wide: what is left then is for the proof.
HALVINGS = 3
# Speeds of neighbouring lines may differ by three steps of `opl.motion.gradual`, and the faster one
# is slowed then: a position for every step would cost more than the time it saves.
STEPS_AT_ONCE = PLANNED_RATIO**3

Rows = tuple[int, ...]  # indices of configurations: two of a line, three of a corner


@dataclass(frozen=True)
class PositionRule:
    """What the written positions have to keep.

    Attributes:
        max_contact_error: Largest distance of a ground point from the wheel's surface in [m].
        max_chord_error: What of it is spent on the surface between two cutter points, in the middle
            of which it is largest, in [m].
        shortest: Least time of a move on the wheel that the controller follows, in [s].
        zone: How far from a written position on the wheel in [m] the controller may leave its move,
            infinite where nobody knows; no earlier than half-way.
        tool_points: Gives the tool point that the zone counts by, at configurations (n, 6) in [m],
            shape (n, 3).
        too_wide: Gives the corners between moves on the wheel that the proof would not let pass, by
            the indices of three written configurations each.
    """

    max_contact_error: float
    max_chord_error: float
    shortest: float
    zone: float
    tool_points: Callable[[Array], Array]
    too_wide: Callable[[Motion], Iterable[tuple[int, int, int]]]

    @property
    def chain(self) -> ChainRule:
        """What each chain of lines has to keep."""
        corner = USED_AT_CORNERS * self.max_contact_error
        return ChainRule(self.shortest, STEPS_AT_ONCE, self.zone, corner)

    def allowed(self, place: Array) -> Array:
        """Return how far off a line may be at fractional cutter points in [m], shape (n,)."""
        fraction = place % 1.0
        on_chord = self.max_chord_error * 4.0 * fraction * (1.0 - fraction)
        return np.asarray(USED * (self.max_contact_error - on_chord))


def with_fewest_positions(
    scene: PlanningScene,
    points: CutterPoints,
    motion: Motion,
    process: ProcessSettings,
    rule: PositionRule,
    beside: Beside | None = None,
) -> tuple[Motion, list[Rows]]:
    """Return a motion with the fewest written positions on the wheel, the others on their lines.

    And the corners that are too wide all the same, as no positions are left to put in.

    Args:
        scene: The cell.
        points: The cutter points.
        motion: The motion, its configurations in the digits of the program.
        process: How fast it is ground.
        rule: What the positions have to keep.
        beside: What may work beside this process, if anything.

    Raises:
        UnsafeError: If there are none on some pass: only where the motion itself breaks the rule.
    """
    runs = list(on_wheel_runs(scene.cell, points, motion, process, rule))
    chosen = (beside or Beside()).share(
        _choosing, (scene, points, motion, rule), runs, length=lambda of_pass: len(of_pass[1].q)
    )
    thinned, screws = motion, screws_of(scene.cell.robot)
    for (first, run), (kept, _) in zip(runs, chosen, strict=True):
        thinned = _thinned(screws, thinned, first, run, kept)
    return thinned, [corner for _, corners in chosen for corner in corners]


@contextmanager
def _choosing(
    scene: PlanningScene, points: CutterPoints, motion: Motion, rule: PositionRule
) -> Iterator[Callable[[tuple[int, Run]], tuple[NDArray[np.intp], list[Rows]]]]:
    """Open what chooses the positions of a pass, given as `on_wheel_runs` does."""
    yield lambda of_pass: _chosen(scene, points, motion, rule, *of_pass)


def _chosen(
    scene: PlanningScene,
    points: CutterPoints,
    motion: Motion,
    rule: PositionRule,
    first: int,
    run: Run,
) -> tuple[NDArray[np.intp], list[Rows]]:
    """Return which configurations of a run are written, and the corners that are still too wide."""
    screws = screws_of(scene.cell.robot)
    # what the positions hit or cut off depends on no more than the configurations next to the run
    start = max(first - 1, 0)
    alone = motion.take(np.arange(start, min(first + len(run.q) + 1, len(motion))))
    lines, blocked = Lines(screws, run), frozenset[Rows]()
    colliding = CollidingLines(
        scene.moves, alone.take(np.arange(first - start, first - start + len(run.q))), lines
    )
    while True:
        kept = fewest_of_long(screws, run, rule.chain, blocked, lines)
        if kept is None:
            index = motion.pass_index[first] + 1
            raise UnsafeError(f"pass {index}: no positions keep the contact error")
        thinned = _thinned(screws, alone, first - start, run, kept)
        corners = [_moved(turn, start) for turn in rule.too_wide(thinned)]
        bowed = bowed_lines(scene.cell, points, thinned, rule.max_contact_error)
        off = [*corners, *(_moved(line, start) for line in bowed)]
        barred = {*colliding.known_after(kept), *(_moved(rows, -first) for rows in off)}
        # of neighbouring configurations there are none to put in between
        barred = {rows for rows in barred if rows[-1] - rows[0] > len(rows) - 1}
        if barred <= blocked:
            return kept, corners
        blocked |= barred


def _moved(rows: Rows, by: int) -> Rows:
    return tuple(row + by for row in rows)


def with_shorter_moves(motion: Motion, corners: Iterable[Rows]) -> Motion:
    """Return a motion with configurations in the middle of its moves on the wheel next to corners.

    They lie on the lines, so they move nothing; but no corner is cut off beyond half of a move.
    `corners` are indices of three configurations each.
    """
    moves = {move for first, _, last in corners for move in range(first + 1, last + 1)}
    return with_moves_cut(motion, {move: np.array([0.5]) for move in sorted(moves)})


def _thinned(
    screws: Screws, motion: Motion, first: int, run: Run, kept: NDArray[np.intp]
) -> Motion:
    """Return a motion with some configurations of a run written, the others on their lines.

    `first` is the index of the run in the motion, `kept` are those in the run.
    """
    q, written = motion.q.copy(), np.array(motion.written)
    written[first : first + len(run.q)] = False
    written[first + kept] = True
    for start, end in pairwise(kept.tolist()):
        shares, _ = line_errors(screws, run, start, end)
        here, there = motion.q[first + start], motion.q[first + end]
        q[first + start + 1 : first + end] = here + shares[:, None] * (there - here)
    return replace(motion, q=q, written=written)


def on_wheel_runs(
    cell: WorkCell,
    points: CutterPoints,
    motion: Motion,
    process: ProcessSettings,
    rule: PositionRule,
) -> Iterator[tuple[int, Run]]:
    """Yield what is on the wheel of each pass, with the index of its first configuration."""
    timed = time_motion(motion, points, process, cell.robot).timed
    distance, least = on_wheel(motion, points, process)
    pace = np.cumsum([timed.duration, least, distance / process.feed], axis=1).T
    for index in range(points.n_passes):
        rows = np.flatnonzero(motion.on_wheel & (motion.pass_index == index))
        place, t = motion.cutter_point[rows], motion.contact_position[rows]
        run = Run(
            motion.q[rows],
            cell.T_flange_workpiece @ points.frames_at(place),
            cell.wheel.T_base_contact(t),
            *freedom(cell.wheel, t),
            rule.allowed(place),
            pace[rows] - pace[rows[0]],
            rule.tool_points(motion.q[rows]),
        )
        yield int(rows[0]), run
