"""What a link that was not found rules out: all nodes that are no better off than those it joins.

Two postures off the wheel that a free straight move joins can be left and come to in the same ways.
So where a search from one of them was in vain, the other need not be tried; and mostly all contact
positions of a branch are joined in this manner.
"""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.motion.air import BlockedLinkError, UnreachableApproachError, lead
from opl.motion.motion import Motion, MoveKind
from opl.planning.branch import Branch
from opl.planning.problem import GrindingProblem


def block_link(
    problem: GrindingProblem,
    branch: Branch,
    rows: np.ndarray,
    motion: Motion,
    blocked: BlockedLinkError,
) -> None:
    """Take out of the ladder what a link that was not found rules out.

    Args:
        problem: What is to be planned.
        branch: The branch of the track.
        rows: The row in each column, shape (N,).
        motion: The motion, its free moves straight.
        blocked: Which of them found no way, and why.
    """
    move, error = blocked.move, blocked.error
    index = int(motion.pass_index[move])
    column = len(rows) if index < 0 else int(np.argmax(problem.points.pass_index == index))
    between = motion.kind[move] is MoveKind.LINK
    way = "way between passes" if between else "way home" if index < 0 else "way from home"
    cause = f"{error}" if between else f"{way}: {error}"
    home_end = None if between else int(index < 0)
    if error.end in (None, home_end):
        branch.cut_off[way, error.pair] += 1
    before, after = column - 1, column  # the cutter points on either side of the link
    if between and error.end == 0:
        branch.block_node(before, int(rows[before]), f"retract: {cause}")
    elif between and error.end == 1:
        branch.block_node(after, int(rows[after]), f"approach: {cause}")
    elif between:
        start, goal = motion.q[move - 1], motion.q[move]
        from_rows = _joined(problem, branch, MoveKind.RETRACT, before, int(rows[before]), start)
        to_rows = _joined(problem, branch, MoveKind.APPROACH, after, int(rows[after]), goal)
        branch.block_steps(before, from_rows, to_rows, f"link: {cause}")
    else:
        lead_there = MoveKind.RETRACT if index < 0 else MoveKind.APPROACH
        end, posture = (before, move - 1) if index < 0 else (after, move)
        for row in _joined(problem, branch, lead_there, end, int(rows[end]), motion.q[posture]):
            branch.block_node(end, row, cause)


def _joined(
    problem: GrindingProblem,
    branch: Branch,
    kind: MoveKind,
    column: int,
    row: int,
    q_away: Array,
) -> list[int]:
    """Return the rows whose postures off the wheel are joined to one of them by free moves.

    Args:
        problem: What is to be planned.
        branch: The branch.
        kind: Whether they are off the wheel before it, approach, or after it, retract.
        column: The cutter point.
        row: A row, which is among those returned.
        q_away: Its posture at the end of approach or retract in [rad], shape (6,).
    """
    t = branch.nodes.contact_position
    free = np.flatnonzero(branch.free[column])
    found = [row]
    # outwards on either side, from each to the next that is joined
    for side in (free[t[free] > t[row]], free[t[free] < t[row]], free[t[free] == t[row]]):
        last = q_away
        for other in side[np.argsort(np.abs(t[side] - t[row]), kind="stable")].tolist():
            q = _away(problem, branch, kind, column, other)
            if other != row and q is not None and problem.links.joined(last, q):
                found.append(other)
                last = q
    return found


def _away(
    problem: GrindingProblem, branch: Branch, kind: MoveKind, column: int, row: int
) -> Array | None:
    """Return where approach or retract of a node is farthest off, None if it cannot be made."""
    try:
        away: Array = lead(
            problem.cell,
            problem.points,
            problem.process,
            kind,
            branch.nodes.branch,
            column,
            branch.nodes.contact_position[row],
            branch.nodes.q[column, row],
        )[-1]
    except UnreachableApproachError:
        return None
    return away
