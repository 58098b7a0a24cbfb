"""What a track that is not free rules out: the nodes and edges that no other track need try.

A free move that was not found rules out all nodes that are no better off than those it joins. From
two configurations off the wheel that a free straight move joins, the same others can be reached. So
where a search from one of them was in vain, the other need not be tried; and mostly all contact
positions of a matrix are joined like this.
"""

from __future__ import annotations

import numpy as np

from opl.cell.workcell import PART, WHEEL
from opl.geometry.frames import Array
from opl.motion.collision_check import CollidingMove
from opl.motion.motion import Motion, MoveKind
from opl.motion.path import PassEnd
from opl.motion.whole_motion import UnreachableApproachError
from opl.planning.filling import BrokenEdgesError
from opl.planning.open_matrix import FreeMove, OpenMatrix
from opl.planning.problem import GrindingProblem
from opl.planning.track_check import Blocked, Collides, NoFreeMove


def block(problem: GrindingProblem, matrix: OpenMatrix, rows: np.ndarray, blocked: Blocked) -> None:
    """Take out of a matrix what is known not to be free.

    `rows` are those of the track that was checked, shape (N,).
    """
    track = rows.tolist()
    if isinstance(blocked, Collides):
        pass_index = problem.points.pass_index
        starts = np.flatnonzero(np.diff(pass_index, prepend=-1, append=-1)).tolist()
        for fault in blocked.faults:
            index = int(blocked.motion.pass_index[fault.move])
            ends = starts[index], starts[index + 1] - 1
            _block_fault(problem, matrix, track, ends, blocked.motion, fault)
    elif isinstance(blocked, NoFreeMove):
        _block_link(problem, matrix, track, blocked)
    elif isinstance(blocked.error, BrokenEdgesError):
        for column, cause in blocked.error.causes.items():
            _block_edge(matrix, track, column, cause)
    else:
        column = blocked.error.column
        matrix.block_node(column, track[column], f"approach: {blocked.error.cause}")


def _block_edge(matrix: OpenMatrix, track: list[int], column: int, cause: str) -> None:
    matrix.block_edges(column, [track[column]], [track[column + 1]], cause)


def _block_fault(
    problem: GrindingProblem,
    matrix: OpenMatrix,
    track: list[int],
    ends: tuple[int, int],
    motion: Motion,
    fault: CollidingMove,
) -> None:
    """Block the node or the edge that a colliding move belongs to; its pass has these ends."""
    cause = " and ".join(fault.pair)
    kind, (first, last) = motion.kind[fault.move], ends
    if kind.on_wheel:
        point = motion.cutter_point[fault.move]
        end = int(np.ceil(point))
        if point == end and fault.at_end and fault.pair != (PART, WHEEL):
            matrix.sweep(problem.scene.collision, end, cause)
        if end == first:
            matrix.block_node(end, track[end], cause)
        elif matrix.free[end, track[end]]:
            _block_edge(matrix, track, end - 1, cause)
    elif kind is MoveKind.RETRACT:
        matrix.block_node(last, track[last], f"retract: {cause}")
    else:  # a free move ends where the approach begins
        matrix.block_node(first, track[first], f"approach: {cause}")


def _block_link(
    problem: GrindingProblem, matrix: OpenMatrix, track: list[int], blocked: NoFreeMove
) -> None:
    """Block what a free move that was not found rules out."""
    motion, move, error = blocked.motion, blocked.error.move, blocked.error.error
    index = int(motion.pass_index[move])
    after = len(track) if index < 0 else int(np.argmax(problem.points.pass_index == index))
    before = after - 1  # the cutter points on either side of the free move
    from_home, to_home = motion.at_home[[move - 1, move]]
    if not from_home and not to_home:
        kind, cause, home_end = FreeMove.BETWEEN_PASSES, str(error), None
    else:
        kind = FreeMove.TO_HOME if to_home else FreeMove.FROM_HOME
        cause, home_end = f"{kind.value}: {error}", int(to_home)
    if error.end in (None, home_end):
        matrix.cut_off[kind, error.pair] += 1
    if error.end == 0 and home_end != 0:  # where the lead ends, no free move begins
        matrix.block_node(before, track[before], f"retract: {error}")
    elif error.end == 1 and home_end != 1:
        matrix.block_node(after, track[after], f"approach: {error}")
    elif kind is FreeMove.TO_HOME:
        for row in _joined(problem, matrix, MoveKind.RETRACT, before, track[before]):
            matrix.block_node(before, row, cause)
    elif kind is FreeMove.FROM_HOME:
        for row in _joined(problem, matrix, MoveKind.APPROACH, after, track[after]):
            matrix.block_node(after, row, cause)
    else:
        from_rows = _joined(problem, matrix, MoveKind.RETRACT, before, track[before])
        to_rows = _joined(problem, matrix, MoveKind.APPROACH, after, track[after])
        matrix.block_edges(before, from_rows, to_rows, f"link: {cause}")


def _joined(
    problem: GrindingProblem, matrix: OpenMatrix, kind: MoveKind, column: int, row: int
) -> list[int]:
    """Return the rows whose configurations off the wheel are joined to one of them by free moves.

    Off the wheel before it, where the approach begins, or after it, where the retract ends. The row
    itself is among them.
    """
    t = matrix.nodes.contact_position[column]
    free = np.flatnonzero(matrix.free[column])
    found, q_row = [row], _away(problem, matrix, kind, column, row)
    # outwards on either side, from each to the next that is joined
    for side in (free[t[free] > t[row]], free[t[free] < t[row]], free[t[free] == t[row]]):
        last = q_row
        for other in side[np.argsort(np.abs(t[side] - t[row]), kind="stable")].tolist():
            q = _away(problem, matrix, kind, column, other)
            if other == row or q is None or last is None:
                continue
            if problem.scene.free_moves.joined(last, q):
                found.append(other)
                last = q
    return found


def _away(
    problem: GrindingProblem, matrix: OpenMatrix, kind: MoveKind, column: int, row: int
) -> Array | None:
    """Return where approach or retract of a node is farthest off, None if it cannot be made."""
    nodes, leads = matrix.nodes, problem.scene.free_leads
    t = float(nodes.contact_position[column, row])
    end = PassEnd(kind, int(nodes.ik_branch[column]), column, t, nodes.at(column, row))
    try:
        away = leads.find(problem.points, problem.process, end)
    except UnreachableApproachError:
        return None
    return np.asarray(away[-1])
