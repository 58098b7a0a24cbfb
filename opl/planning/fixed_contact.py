"""What the same work costs when the contact is kept at t = 0, as in programs taught by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.workcell import PART, WHEEL
from opl.geometry.frames import Array
from opl.planning.multi_start import tracks_from_best_start, try_recursive
from opl.planning.open_matrix import Ladders, OpenMatrix
from opl.planning.plan import Found
from opl.planning.problem import GrindingProblem, build_problem
from opl.planning.settings import Start

MOST_CHECKS = 50  # of contact-fixed motions, which differ in the counts of turns only


@dataclass(frozen=True)
class FixedContact:
    """The contact-fixed path, for comparison.

    Attributes:
        q: The configuration at each cutter point in [rad], shape (N, 6); None if some point is out
            of reach or limits at t = 0.
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

    Of all matrices the track with the least joint range sum is taken; whether it is free of
    collision is reported, but does not matter for its ranges.
    """
    fixed = build_problem(
        problem.scene, problem.points, np.zeros(1), problem.interpolation, problem.process
    )
    ladders = Ladders(fixed)
    everywhere = [OpenMatrix(nodes, nodes.exists, ladders) for nodes in fixed.field.matrices]
    track = next(tracks_from_best_start(everywhere), None)
    if track is None:
        return FixedContact(None, False, "no continuous path within reach and limits at t = 0")
    q = everywhere[track.matrix].nodes.along(track.rows)
    cut = np.flatnonzero(fixed.cuts)
    if len(cut):
        deepest = -1e3 * float(fixed.wheel_distance.min())
        where = f"{len(cut)} of {len(q)} cutter points ({runs_of(cut)})"
        reason = f"{PART} cuts into {WHEEL} at {where}, {deepest:.2f} mm deep at most"
        return FixedContact(q, False, reason)
    if not isinstance(try_recursive(fixed, Start.BEST, MOST_CHECKS), Found):
        return FixedContact(q, False, "every motion that was checked collides")
    return FixedContact(q, True, "")


def runs_of(numbers: np.ndarray) -> str:
    """Write increasing numbers as runs, e.g. ``3-7, 12``."""
    breaks = np.flatnonzero(np.diff(numbers) > 1) + 1
    runs = np.split(numbers, breaks)
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)
