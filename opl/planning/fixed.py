"""What the same work costs when the contact is kept at t = 0, as a teacher at the pendant would."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from opl.cell.workcell import PART, WHEEL
from opl.field.layer import wheel_layer
from opl.field.nodes import build_nodes
from opl.geometry.frames import Array
from opl.planning.plan import try_recursive
from opl.planning.problem import GrindingProblem
from opl.planning.starts import Start
from opl.search.recursive import add_dead_ends, descend

MOST_CHECKS = 50  # of contact-fixed motions, which differ in the counts of turns only


@dataclass(frozen=True)
class FixedContact:
    """The contact-fixed path, for comparison.

    Attributes:
        q: The posture at each cutter point in [rad], shape (N, 6); None if some point is out of
            reach or limits at t = 0.
        feasible: Whether the motion is free of collision.
        reason: Why it is not, empty if it is.
    """

    q: Array | None
    feasible: bool
    reason: str

    @property
    def joint_ranges(self) -> Array | None:
        """Largest minus smallest value of each joint in [rad], shape (6,)."""
        return None if self.q is None else np.ptp(self.q, axis=0)


def keep_contact(problem: GrindingProblem) -> FixedContact:
    """Return the path with the contact in the middle of the wheel, collisions or not.

    Of all branches and turns the one with the least joint range sum is taken; whether it is free of
    collision is told, but does not matter for its ranges.
    """
    middle = np.zeros(1)
    fixed = replace(
        problem,
        field=build_nodes(problem.cell, problem.points, middle),
        wheel_clearance=wheel_layer(problem.cell, problem.part, problem.points, middle),
    )
    best = np.inf
    q = None
    for nodes in fixed.field.branches:
        ladder = fixed.ladder(nodes, nodes.exists)
        dead, blocked = np.zeros_like(nodes.exists), np.empty(0, dtype=np.int64)
        add_dead_ends(ladder, blocked, dead)
        for start in np.flatnonzero(nodes.exists[0]):
            descent = descend(ladder, int(start), blocked, dead, best)
            if descent.rows is not None:
                best = descent.joint_range_sum
                q = nodes.q[np.arange(len(descent.rows)), descent.rows]
    if q is None:
        return FixedContact(None, False, "no continuous path within reach and limits at t = 0")
    cut = np.flatnonzero(fixed.wheel_clearance[:, 0] < -problem.cell.planned_penetration)
    if len(cut):
        deepest = -1e3 * float(fixed.wheel_clearance.min())
        return FixedContact(
            q,
            False,
            f"{PART} cuts into {WHEEL} at {len(cut)} of {len(q)} cutter points "
            f"({runs_of(cut)}), {deepest:.2f} mm deep at most",
        )
    if try_recursive(fixed, Start.BEST, MOST_CHECKS) is None:
        return FixedContact(q, False, "every motion that was checked collides")
    return FixedContact(q, True, "")


def runs_of(numbers: np.ndarray) -> str:
    """Write increasing numbers as runs, e.g. ``3-7, 12``."""
    breaks = np.flatnonzero(np.diff(numbers) > 1) + 1
    runs = np.split(numbers, breaks)
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)
