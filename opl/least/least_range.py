"""The motion of least joint range sum: the proof run to its end, or to the end of its work."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from opl.files.beside import Beside
from opl.least.optimal import OptimalSearch
from opl.planning.plan import Plan
from opl.planning.problem import GrindingProblem
from opl.planning.settings import OptimalSettings
from opl.planning.so_far import ENDED, Follow, SoFar, to_the_end
from opl.walls.images import Seams

# of the work at the least: a motion sought in another way, where the proof found none
OTHERWISE_SHARE = 0.3


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
    otherwise: Callable[[float], Plan | None] | None = None,
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
        otherwise: Looks for a motion in another way, where the proof finds none, nor that there is
            none, given how many units of work are left for that.
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
    share = 1.0 if otherwise is None else 1.0 - OTHERWISE_SHARE

    def goes_on() -> bool:
        value = None if search.plan is None else search.motions.value
        return follow(SoFar(min(search.work_share, 1.0), value, search.lower_bound))

    def go_on(share: float) -> bool:
        """Work up to a share of the work allowed; return whether that was ended before."""
        while not search.finished and (search.plan is not None or search.work_share < share):
            search.step()
            if not goes_on() and search.plan is not None:
                return True
        return False

    ended = go_on(share)
    if search.plan is None and otherwise is not None and search.lower_bound <= widest:
        left = max(OTHERWISE_SHARE, 1.0 - search.work_share)  # a step may take more than was left
        search.keep(otherwise(left * settings.max_subproblems))
        ended = go_on(1.0)
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
