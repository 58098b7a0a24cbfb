"""What is not free and why: the cutter points that stop a path."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from opl.cell.full_turns import full_turns
from opl.cell.workcell import PART, WHEEL, WorkCell
from opl.errors import NoFreeMoveError, NoPathError
from opl.motion.free_move_search import Blocker
from opl.planning.open_matrix import FreeMove, OpenMatrix
from opl.planning.problem import GrindingProblem
from opl.search.impasse import impasses

MOST_RUNS = 8  # of cutter points listed one by one; a hundred lines would hide the first
# columns and positions of a run that are looked at; the shares of causes change little with more
MOST_COLUMNS = 8
MOST_POSITIONS = 30
MOST_FREE_MOVES = 3  # blocked free moves listed
MOST_ENDS = 3  # cutter points listed, where tracks came through but none was free


def unreachable_points(problem: GrindingProblem) -> np.ndarray:
    """Return the cutter points that the arm reaches at no contact position at all."""
    return np.flatnonzero(~problem.field.reached.any(axis=1))


def no_path(problem: GrindingProblem, matrices: list[OpenMatrix], scope: str = "") -> NoPathError:
    """Return the error with how far the searches came and what stopped them.

    Args:
        problem: What was planned.
        matrices: What is blocked.
        scope: For what that holds, where it is not for the contact positions of the field alone.
    """
    cut_off = cut_off_in(matrices)
    if cut_off:
        where = (
            "no path: the passes can be ground, but no collision-free move to, from or between "
            "them was found"
        )
        return NoFreeMoveError(where, explain_free_moves(problem.cell, cut_off))
    n, reached = len(problem.points), max((matrix.reached for matrix in matrices), default=0)
    if reached == 0:
        where = f"no path: no free configuration at cutter point 0 (0 of {n} reached)"
    elif reached == n:
        where = f"no path: every track through the {n} cutter points collides"
    else:
        where = f"no path beyond cutter point {reached - 1} ({reached} of {n} reached)"
    positions = len(problem.field.contact_positions)
    scope = scope or f"looked for at {positions} contact positions, not between them"
    return NoPathError(where, [*explain(problem, matrices), scope], at_leads=leads_stop(matrices))


def leads_stop(matrices: list[OpenMatrix]) -> bool:
    """Return whether approaches and retracts collide, or end too near to the wheel to move on.

    By the causes that `opl.planning.blocking` notes.
    """
    causes = {cause for matrix in matrices for _, cause in matrix.causes}
    at_the_wheel = f": {PART} and {WHEEL}"  # with a free move before it
    return any(
        cause.startswith(("approach: ", "retract: ")) or cause.endswith(at_the_wheel)
        for cause in causes
    )


def cut_off_in(matrices: list[OpenMatrix]) -> Counter[tuple[FreeMove, Blocker]]:
    """Return the free moves that alone stopped motions, what blocked them, and how often."""
    return sum((matrix.cut_off for matrix in matrices), Counter())


def explain(problem: GrindingProblem, matrices: list[OpenMatrix]) -> list[str]:
    """Return lines on the cutter points where nothing is free, and why.

    Returns:
        One line for each run of cutter points where no configuration is free; if there is none,
        lines on the cutter points where the search ended.
    """
    shut = np.array([not free_at(problem, column) for column in range(len(problem.points))])
    if not shut.any():
        return _where_it_ended(len(problem.points), matrices)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], shut, [False]]).astype(int)))
    runs = list(zip(edges[::2], edges[1::2] - 1, strict=True))
    lines = [_describe_run(problem, int(first), int(last)) for first, last in runs[:MOST_RUNS]]
    if len(runs) > MOST_RUNS:
        lines.append(f"and {len(runs) - MOST_RUNS} more runs of cutter points")
    return lines


def explain_free_moves(cell: WorkCell, cut_off: Counter[tuple[FreeMove, Blocker]]) -> list[str]:
    """Return lines on the free moves that are blocked, by what, and what would help."""
    met = sorted(cut_off.items(), key=lambda item: (-item[1], item[0]))[:MOST_FREE_MOVES]
    lines = [f"{move.value}: {' and '.join(pair)} ({count} times)" for (move, pair), count in met]
    from_or_to_home = any(move is not FreeMove.BETWEEN_PASSES for (move, _), _ in met)
    movable = {body.name for body in cell.obstacles}
    elsewhere = sorted({name for (_, pair), _ in met for name in pair if name in movable})
    helps = ["another home configuration"] if from_or_to_home else ["a longer approach"]
    helps += [f"{name} elsewhere or smaller" for name in elsewhere]
    lines.append(f"would help: {', or '.join(helps)}; no change of wheel or fixture was tried")
    return lines


def free_at(problem: GrindingProblem, column: int) -> bool:
    """Return whether any node of a column is free of limits, wheel and robot collisions."""
    collides = problem.scene.collision.collides
    return any(
        not collides(nodes.at(column, np.flatnonzero(problem.free_nodes(nodes, column)))).all()
        for nodes in problem.field.matrices
    )


def _describe_run(problem: GrindingProblem, first: int, last: int) -> str:
    counts: Counter[str] = Counter()
    for column in np.unique(np.linspace(first, last, MOST_COLUMNS).astype(int)):
        counts.update(_causes_at(problem, int(column)))
    total = sum(counts.values())
    parts = [f"{100 * count / total:.0f} % {cause}" for cause, count in counts.most_common()]
    pass_index = int(problem.points.pass_index[first])
    line = f"{_run(first, last)} (pass {pass_index + 1}): nothing is free: {', '.join(parts)}"
    if problem.cuts[first : last + 1].all():
        at_best = -1e3 * float(problem.wheel_distance[first : last + 1].max())
        line += f"; the part cuts {at_best:.2f} mm into the wheel at best"
    return line


def _run(first: int, last: int) -> str:
    return f"cutter point {first}" if first == last else f"cutter points {first} to {last}"


def _causes_at(problem: GrindingProblem, column: int) -> Counter[str]:
    """Weigh, over the contact positions of a column, what rules each out."""
    cell, robot = problem.cell, problem.cell.robot
    counts: Counter[str] = Counter()
    cuts = problem.cuts[column]
    every = problem.solutions(np.array([column]))[0]
    for position in np.unique(np.linspace(0, len(every) - 1, MOST_POSITIONS).astype(int)):
        q = every[position]
        q = q[~np.isnan(q[:, 0])]
        turned = q[:, None] + full_turns(robot.lower, robot.upper)
        within = cell.within_limits(turned)
        if not len(q):
            counts["out of reach"] += 1
        elif not within.any():
            # the configuration that breaks the fewest shows best what is wrong
            names = min(map(cell.broken_limits, turned.reshape(-1, 6)), key=len)
            counts[f"beyond the limits of {' '.join(names)}"] += 1
        elif cuts[position]:
            counts[f"{PART} cuts into {WHEEL}"] += 1
        else:
            # a full turn of the wrist brings the same bodies to the same places
            solutions = np.flatnonzero(within.any(axis=1))
            for solution in solutions:
                q_within = turned[solution, np.argmax(within[solution])]
                pairs = problem.scene.collision.colliding_pairs(q_within)
                cause = " hits ".join(pairs[0]) if pairs else "free"
                counts[cause] += 1 / len(solutions)  # type: ignore[assignment]
    return counts


def _where_it_ended(n_points: int, matrices: list[OpenMatrix]) -> list[str]:
    """Return what stopped the edges where every cutter point has a free configuration."""
    farthest = max(matrices, key=lambda matrix: matrix.reached)
    reached, causes = farthest.reached, sum((matrix.causes for matrix in matrices), Counter())
    lines = []
    near: Sequence[int] = range(max(reached - 2, 0), min(reached + 1, n_points))
    shut = impasses(farthest.ladder, farthest.blocked_edges)
    if shut:
        first, last = min(shut, key=lambda run: run[1] - run[0])
        lines.append(
            f"{_run(first, last)}: the shortest run that cannot be passed, on the IK branch that "
            "came farthest"
        )
        near = range(first, last + 1)
    if reached == n_points:  # it came through: what counts is what it met most often
        met_at = Counter[int]()
        for (column, _), count in causes.items():
            met_at[column] += count
        near = sorted(sorted(met_at, key=lambda column: (-met_at[column], column))[:MOST_ENDS])
    n_before = len(lines)
    for column in near:
        met = [(cause, count) for (where, cause), count in causes.items() if where == column]
        met.sort(key=lambda item: (-item[1], item[0]))
        if met:
            refused = ", ".join(f"{cause} ({count} times)" for cause, count in met[:4])
            lines.append(f"cutter point {column}: edges refused: {refused}")
    if len(lines) == n_before:
        ladder = farthest.ladder
        most = float(ladder.contact_changes.min(initial=np.inf))
        slow = most < np.ptp(ladder.contact_position)
        further = (
            f", the contact move by more than {most:g} mm or deg between cutter points"
            if slow
            else ""
        )
        lines.append(
            f"no continuous edge leads on: the arm would have to change its IK branch{further} or "
            "jump; a wider range of contact positions or a turned fixture may help"
        )
    return lines
