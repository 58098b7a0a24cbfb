"""Which search a job wants, and how what it finds compares with the others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from opl.errors import NoPathError
from opl.files.beside import Beside, Later
from opl.job import keys
from opl.job.methods import Method, Objective, Search
from opl.least.borders import Nameable, clear_of_borders
from opl.least.equals import quickest_of_equals
from opl.least.least_range import NoMotionError, plan_optimal
from opl.least.weighted import plan_weighted
from opl.motion.figures import Figures, figures_of_path, figures_of_points
from opl.motion.short_ways import shortened
from opl.planning.multi_start import held_back, plan_recursive, try_recursive
from opl.planning.open_matrix import columns_without_nodes
from opl.planning.plan import Exhausted, Found, OutOfBudget, Plan
from opl.planning.problem import GrindingProblem
from opl.planning.reasons import cut_off_in, explain, leads_stop, no_path
from opl.planning.settings import ObjectiveWeights, Start
from opl.planning.so_far import Follow, SoFar, to_the_end
from opl.run.values import Prepared
from opl.walls.images import Seams

# of motions from the paper's start node, which are searched for comparison only
MOST_CHECKS = 20
# of motions of the recursive search, before the proof begins without it, and units of work on them
MOST_FIRST_CHECKS = 40
MOST_FIRST_WORK = 3000.0
NONE_IS_FREE = (
    "no motion along these passes, at any contact positions, on along each pass and never back, "
    "each on an IK branch and count of full turns of its own, keeps reach, limits and the plan's "
    "clearances, with leads as the job sets them"
)
BEGINNING = 0.3  # of the search for another objective: the least joint range sum


@dataclass(frozen=True)
class FoundPaths:
    """What the searches of a job found.

    Attributes:
        plan: The path by the method and for the objective of the job, the quickest of its equals.
            Its approaches and retracts are no longer than they need be.
        recursive: That of the paper's search; the same if the job wants nothing better, None where
            only the proof found one.
    """

    plan: Plan
    recursive: Plan | None


def search_path(
    search: Search,
    problem: GrindingProblem,
    nameable: Nameable | None = None,
    follow: Follow = to_the_end,
    seams: Later[Seams] | None = None,
    beside: Beside | None = None,
) -> FoundPaths:
    """Search the path by the method and for the objective of a job.

    Args:
        search: What the job wants.
        problem: What is to be planned.
        nameable: Which configurations the program names without doubt; None for all.
        follow: Given what is known of the path, often; may end the search with its best.
        seams: Where full turns are counted from, where that is worked out beside.
        beside: What may work beside this process, if anything.

    Raises:
        NoPathError: If there is none.
    """
    if proves_range(search):
        plan, recursive = _search_range(search, problem, follow, seams, beside)
    elif search.method is Method.OPTIMAL:
        plan, recursive = _search_best(search, problem, follow, seams, beside)
    else:
        plan = recursive = plan_recursive(problem, search.start)
    return FoundPaths(_finished(search, problem, plan, nameable), recursive)


def proves_range(search: Search) -> bool:
    """Return whether the least joint range sum is searched for, with its proof."""
    return search.method is Method.OPTIMAL and search.objective is Objective.RANGE


def _search_range(
    search: Search,
    problem: GrindingProblem,
    follow: Follow,
    seams: Later[Seams] | None,
    beside: Beside | None,
) -> tuple[Plan, Plan | None]:
    """Return the plan of least joint range sum, and the recursive one where there is one."""
    last = try_recursive(problem, search.start, MOST_FIRST_CHECKS, MOST_FIRST_WORK)
    known = last.plan if isinstance(last, Found) else None
    if isinstance(last, Exhausted) and cut_off_in(last.matrices):
        raise no_path(problem, last.matrices)
    try:
        counted_from = None if seams is None else seams.value()
        untried = isinstance(last, OutOfBudget) and last.checks == 0  # too many points, most likely
        shut = [] if isinstance(last, Found) else columns_without_nodes(last.matrices)
        best = plan_optimal(
            problem, search.optimal, known, follow, counted_from, untried, shut, beside
        )
    except NoMotionError as error:
        least, proven, spent = error.lower_bound, error.proven, error.spent
    else:
        return best, known
    assert not isinstance(last, Found), "what was found is a plan"
    if isinstance(last, Exhausted) and (proven or cut_off_in(last.matrices)):
        raise no_path(problem, last.matrices, f"proven: {NONE_IS_FREE}")
    if proven:
        reasons = explain(problem, last.matrices)
        at_leads = leads_stop(last.matrices)
        raise NoPathError(f"no path: it is proven that {NONE_IS_FREE}", reasons, at_leads=at_leads)
    reasons = list[str]()
    tried = f"the {last.checks} best motions of the recursive search are not free"
    if last.checks == 1:
        tried = "the best motion of the recursive search is not free"
    if isinstance(last, Exhausted):
        tried = f"at {len(problem.field.contact_positions)} contact positions none is free"
        if held_back(problem, last.matrices):
            tried += f" that keeps {keys.SEARCH_CONTACT_CHANGE}"
        else:
            reasons = explain(problem, last.matrices)
    elif last.checks == 0:
        tried = "the recursive search came to no motion in the work allowed"
    in_work, more = (" in the work allowed", "more work") if spent else ("", "more positions")
    raise NoPathError(
        f"no path found: {tried}, and the proof found none{in_work}, only that none along these "
        f"passes has a joint range sum below {least:.4f} rad; {more}, or more room around the "
        "robot, may help",
        reasons,
        lower_bound=least,
        at_leads=leads_stop(last.matrices),
    )


def _finished(
    search: Search, problem: GrindingProblem, plan: Plan, nameable: Nameable | None
) -> Plan:
    """Return the quickest of the equals of a plan, its leads no longer than they need be."""
    quickest = quickest_of_equals(problem, plan, search.counts_ranges, nameable)
    if nameable is not None:
        quickest = clear_of_borders(problem, quickest, nameable)
    motion = shortened(quickest.motion, problem.scene.free_moves.joined)
    return replace(quickest, motion=motion)


def _search_best(
    search: Search,
    problem: GrindingProblem,
    follow: Follow,
    seams: Later[Seams] | None,
    beside: Beside | None,
) -> tuple[Plan, Plan | None]:
    """Return the plan of another objective, and the recursive one where there is one."""
    weights = search.objective_weights
    if search.objective is not Objective.WEIGHTED:
        travel, time = (0.0, 1.0) if search.objective is Objective.TIME else (1.0, 0.0)
        weights = ObjectiveWeights(0.0, travel, time)
    known, recursive = list[Plan](), None
    if weights.joint_range == 0.0:
        found = try_recursive(problem, search.start, MOST_FIRST_CHECKS, MOST_FIRST_WORK)
        recursive = found.plan if isinstance(found, Found) else None
    if recursive is None:

        def begin(so_far: SoFar) -> bool:
            least = weights.joint_range * so_far.lower_bound
            return follow(SoFar(BEGINNING * so_far.done, None, least))

        smallest, recursive = _search_range(search, problem, begin, seams, beside)
        known.append(smallest)
    if recursive is not None:
        known.append(recursive)

    def go_on(so_far: SoFar) -> bool:
        return follow(replace(so_far, done=BEGINNING + (1.0 - BEGINNING) * so_far.done))

    return plan_weighted(problem, weights, search.optimal.costs, known, go_on), recursive


def from_paper_start(problem: GrindingProblem) -> Figures | None:
    """Return the figures of what the paper's search finds from its own start node, if anything.

    Nothing else needs what it finds.
    """
    found = try_recursive(problem, Start.NEAREST, MOST_CHECKS)
    return _figures(problem, found.plan) if isinstance(found, Found) else None


def compare(prepared: Prepared, found: FoundPaths) -> Mapping[str, Figures]:
    """Return the figures of the contact-fixed path and of all that were found, by what they are.

    Args:
        prepared: What was to be planned.
        found: What was found.
    """
    problem, q = prepared.problem, prepared.fixed.q
    compared: dict[str, Figures] = {}
    if q is not None:
        compared["fixed"] = figures_of_points(
            q, problem.points, problem.process, problem.cell.robot
        )
    paper_start = prepared.paper_start.value()
    if paper_start is not None:
        compared["paper_start"] = paper_start
    if found.recursive is not None:
        compared["recursive"] = _figures(problem, found.recursive)
    if prepared.surfaced.job.search.method is Method.OPTIMAL:
        compared["optimal"] = _figures(problem, found.plan)
    return compared


def _figures(problem: GrindingProblem, plan: Plan) -> Figures:
    robot = problem.cell.robot
    return figures_of_path(plan.path, plan.motion, problem.points, problem.process, robot)
