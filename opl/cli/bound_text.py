"""What the command line prints of lower bounds, and of what holds them up."""

from __future__ import annotations

from collections.abc import Iterator

import opl

# what every bound covers, and what it is not about
COVERED = (
    "at any contact positions, on along each pass and never back, each on an IK branch and count "
    "of full turns of its own (approach, links and retract not counted), with the plan's "
    "clearances and leads as the job sets them"
)
MOST_HOLDERS = 4  # that are named
OBJECTIVES = {
    "travel": ("joint travel", "{:.4f} rad"),
    "time": ("time on the wheel", "{:.2f} s"),
    "weighted": ("weighted sum", "{:.4f}"),
}


def bound_lines(report: opl.Report) -> Iterator[str]:
    """Yield what the lower bounds say of the path, and what keeps it from being better."""
    yield from _certified(report)
    yield from _held(report)


def _certified(report: opl.Report) -> Iterator[str]:
    path = report.path
    if path is None:
        return
    known = path.objective_value
    if known is not None:
        name, form = OBJECTIVES[path.objective]
        yield (
            f"no motion along these passes has a {name} below {form.format(known.lower_bound)}, "
            f"{COVERED}: the one found has {form.format(known.value)}, at most "
            f"{100.0 * known.gap:.3f} % of it too much{_why(path.open_because)}"
        )
    bound, gap = path.lower_bound_rad, path.gap
    if bound is None or gap is None:
        return
    yield (
        f"no motion along these passes has a joint range sum below {bound:.4f} rad, {COVERED}: "
        f"the one found is within {100.0 * gap:.3f} % of the least{_why(path.open_because)}"
    )


def _why(open_because: str | None) -> str:
    return "" if open_because is None else f"; more than wanted: {open_because}"


def _held(report: opl.Report) -> Iterator[str]:
    """Yield what keeps the joint range sum from being smaller."""
    path = report.path
    if path is None:
        return
    if not path.held_by:
        proven = path.method == "optimal" and path.objective == "range"
        if proven and path.lower_bound_rad:  # at rest there is nothing to be held up
            yield "which cutter points hold the joint range sum up was not found in the work for it"
        return
    places = [
        f"cutter point {one.cutter_point:g} (pass {one.pass_}: {', '.join(one.joints)}) "
        f"{one.most_gain_rad:.4f} rad"
        for one in path.held_by[:MOST_HOLDERS]
    ]
    yield (
        "the joint range sum is held up by these; what could be gained at the most if one of them "
        f"need not be ground: {'; '.join(places)}"
    )
