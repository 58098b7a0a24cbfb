"""The motion of least joint range sum: the proof run to its end, or to the end of its work."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from opl.files.beside import Beside
from opl.least.optimal import OptimalSearch
from opl.planning.plan import Plan
from opl.planning.problem import GrindingProblem
from opl.planning.settings import OptimalSettings
from opl.planning.so_far import ENDED, Follow, SoFar, to_the_end
from opl.walls.images import Seams


class NoMotionError(Exception):
    """No motion was found.

    Args:
        lower_bound: No motion has a smaller joint range sum, in [rad].
        proven: Whether it is proven that there is none.
        spent: Whether all of the work allowed was done.
    """

    def __init__(self, lower_bound: float, proven: bool, spent: bool) -> None:
        super().__init__(f"no motion found; none is below {lower_bound:.4f} rad")
        self.lower_bound, self.proven, self.spent = lower_bound, proven, spent


def plan_optimal(
    problem: GrindingProblem,
    settings: OptimalSettings,
    fallback: Plan | None,
    follow: Follow = to_the_end,
    seams: Seams | None = None,
    untried: bool = False,
    without_nodes: Sequence[int] = (),
    beside: Beside | None = None,
) -> Plan:
    """Find the collision-free motion with the least joint range sum, the smoothest of these.

    Args:
        problem: What is to be planned.
        settings: What is wanted.
        fallback: A motion that is known, if one is: joints and contact should travel no further.
        follow: Given the joint range sum of the best motion and its lower bound after every step.
        seams: Where full turns are counted from, where that is known.
        untried: Whether no motion was tried: else where none is known, those tried collide.
        without_nodes: Cutter points at which no node is free: walls to begin with.
        beside: What may work beside this process, if anything.

    Returns:
        The plan with its lower bound.

    Raises:
        NoMotionError: If no motion was known and none was found.
    """
    search = OptimalSearch(problem, settings, fallback, seams, untried, without_nodes)
    widest = float((problem.cell.robot.upper - problem.cell.robot.lower).sum())
    ended = False
    while not search.finished and not ended:
        search.step()
        value = None if search.plan is None else search.motions.value
        so_far = SoFar(min(search.work_share, 1.0), value, search.lower_bound)
        ended = not follow(so_far) and search.plan is not None
    if search.plan is None:
        least = search.lower_bound
        raise NoMotionError(least, least > widest, search.work_share >= 1.0)
    found = replace(search.plan, lower_bound=search.lower_bound, holders=search.holders(beside))
    return replace(found, open_because=_open_because(found, settings, search, ended))


def _open_because(
    plan: Plan, settings: OptimalSettings, search: OptimalSearch, ended: bool
) -> str | None:
    """Return why the bound is further off than wanted, None if it is not."""
    assert plan.gap is not None
    if plan.gap <= settings.widen:
        return None
    if ended:
        return ENDED
    if search.work_share >= 1.0:
        return "the work allowed for the proof was done before it was complete"
    stopped = search.motions.stopped.most_common(1)
    which = (
        f"; those tried last were stopped above all at cutter point {place:g}: {cause}"
        for (place, cause), _ in stopped
    )
    return "no motion was found nearer to the bound" + "".join(which)
