"""Why nothing is free: the cutter points that stop a path, and what stops them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from opl.cell.full_turns import full_turns
from opl.cell.workcell import PART, WHEEL, WorkCell
from opl.motion.links import Blocker
from opl.planning.impasse import Impasse
from opl.planning.problem import GrindingProblem


def unreachable_points(problem: GrindingProblem) -> np.ndarray:
    """Return the cutter points that the arm reaches at no contact position at all."""
    return np.flatnonzero(np.isnan(problem.field.q[..., 0]).all(axis=(1, 2)))


MOST_RUNS = 8  # of cutter points told one by one; a hundred lines would hide the first
# of a run that are asked what stops them; their shares change little with more
MOST_COLUMNS = 8
MOST_POSITIONS = 30
MOST_WAYS = 3  # blocked ways through the air told of
MOST_ENDS = 3  # cutter points told of, where tracks came through but none was free


def explain(
    problem: GrindingProblem,
    reached: int,
    causes: Counter[tuple[int, str]],
    impasse: Impasse | None = None,
) -> list[str]:
    """Say at which cutter points nothing is free, and why.

    Args:
        problem: What was to be planned.
        reached: Number of cutter points the search came through.
        causes: How often the search met each cause, by cutter point.
        impasse: The shortest run of cutter points that no track leads through, if there is one.

    Returns:
        One line for each run of cutter points where no posture is free; if there is none, lines on
        the cutter points where the search ended.
    """
    shut = np.array([not free_at(problem, column) for column in range(len(problem.points))])
    if not shut.any():
        return _where_it_ended(problem, reached, causes, impasse)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], shut, [False]]).astype(int)))
    runs = list(zip(edges[::2], edges[1::2] - 1, strict=True))
    lines = [_describe_run(problem, int(first), int(last)) for first, last in runs[:MOST_RUNS]]
    if len(runs) > MOST_RUNS:
        lines.append(f"and {len(runs) - MOST_RUNS} more runs of cutter points")
    return lines


def explain_air(cell: WorkCell, cut_off: Counter[tuple[str, Blocker]]) -> list[str]:
    """Say which ways through the air are blocked, by what, and what would help.

    Args:
        cell: The cell.
        cut_off: How many tracks were refused for each way and pair in it; not empty.
    """
    met = sorted(cut_off.items(), key=lambda item: (-item[1], item[0]))[:MOST_WAYS]
    lines = [f"{way}: {' and '.join(pair)} ({count} times)" for (way, pair), count in met]
    from_or_to_home = any("home" in way for (way, _), _ in met)
    movable = {body.name for body in cell.obstacles}
    elsewhere = sorted({name for (_, pair), _ in met for name in pair if name in movable})
    helps = ["another home posture"] if from_or_to_home else ["a longer approach"]
    helps += [f"{name} elsewhere or smaller" for name in elsewhere]
    lines.append(f"would help: {', or '.join(helps)}; no change of wheel or fixture was tried")
    return lines


def free_at(problem: GrindingProblem, column: int) -> bool:
    """Return whether any node of a column is free of limits, wheel and robot collisions."""
    for nodes in problem.field.branches:
        free = problem.free_nodes(nodes)[column]
        if any(not problem.scene.collides(q[None])[0] for q in nodes.q[column, free]):
            return True
    return False


def _describe_run(problem: GrindingProblem, first: int, last: int) -> str:
    counts: Counter[str] = Counter()
    for column in np.unique(np.linspace(first, last, MOST_COLUMNS).astype(int)):
        counts.update(_causes_at(problem, int(column)))
    total = sum(counts.values())
    parts = [f"{100 * count / total:.0f} % {cause}" for cause, count in counts.most_common()]
    where = f"cutter point {first}" if first == last else f"cutter points {first} to {last}"
    pass_index = int(problem.points.pass_index[first])
    line = f"{where} (pass {pass_index + 1}): nothing is free: {', '.join(parts)}"
    deepest_free = float(problem.wheel_clearance[first : last + 1].max())
    if deepest_free < -problem.cell.planned_penetration:
        line += f"; the part cuts {-1e3 * deepest_free:.2f} mm into the wheel at best"
    return line


def _causes_at(problem: GrindingProblem, column: int) -> Counter[str]:
    """Weigh, over the contact positions of a column, what rules each out."""
    cell, robot = problem.cell, problem.cell.robot
    allowed = problem.wheel_clearance[column] >= -problem.cell.planned_penetration
    counts: Counter[str] = Counter()
    n_positions = len(problem.field.contact_positions)
    for position in np.unique(np.linspace(0, n_positions - 1, MOST_POSITIONS).astype(int)):
        q = problem.field.q[column, position]
        q = q[~np.isnan(q[:, 0])]
        turned = q[:, None] + full_turns(robot.lower, robot.upper)
        within = cell.within_limits(turned)
        if not len(q):
            counts["out of reach"] += 1
        elif not within.any():
            # the posture that breaks the fewest tells best what is in the way
            names = min(map(cell.broken_limits, turned.reshape(-1, 6)), key=len)
            counts[f"beyond the limits of {' '.join(names)}"] += 1
        elif not allowed[position]:
            counts[f"{PART} cuts into {WHEEL}"] += 1
        else:
            # a full turn of the wrist brings the same bodies to the same places
            branches = np.flatnonzero(within.any(axis=1))
            for branch in branches:
                posture = turned[branch, np.argmax(within[branch])]
                pairs = problem.scene.colliding_pairs(posture)
                cause = " hits ".join(pairs[0]) if pairs else "free"
                counts[cause] += 1 / len(branches)  # type: ignore[assignment]
    return counts


def _where_it_ended(
    problem: GrindingProblem,
    reached: int,
    causes: Counter[tuple[int, str]],
    impasse: Impasse | None,
) -> list[str]:
    """Every cutter point has a free posture: say what stopped the steps between them."""
    lines = []
    near: Sequence[int] = range(max(reached - 2, 0), min(reached + 1, len(problem.points)))
    if impasse is not None:
        first, last = impasse.first, impasse.last
        run = f"cutter point {first}" if first == last else f"cutter points {first} to {last}"
        lines.append(
            f"{run}: the shortest run that cannot be passed, on the branch that came farthest"
        )
        near = range(first, last + 1)
    if reached == len(problem.points):  # it came through: what counts is what it met most often
        met_at = Counter[int]()
        for (column, _), count in causes.items():
            met_at[column] += count
        near = sorted(sorted(met_at, key=lambda column: (-met_at[column], column))[:MOST_ENDS])
    told_of = len(lines)
    for column in near:
        met = [(cause, count) for (where, cause), count in causes.items() if where == column]
        met.sort(key=lambda item: (-item[1], item[0]))
        if met:
            told = ", ".join(f"{cause} ({count} times)" for cause, count in met[:4])
            lines.append(f"cutter point {column}: steps refused: {told}")
    if len(lines) == told_of:
        lines.append(
            "no continuous step leads on: the arm would have to change its branch or jump; "
            "a wider range of contact positions or a turned fixture may help"
        )
    return lines
