"""What the command line prints of the feed and of times: lines from the report of a run."""

from __future__ import annotations

from collections.abc import Iterator

import opl


def feed_and_cycle(report: opl.Report, robot: str) -> Iterator[str]:
    """Yield where the feed is not kept, and how long the program takes."""
    feed, cycle = report.feed, report.cycle
    if feed is not None and feed.lowered:
        worst = min(feed.lowered, key=lambda one: one.lowest_mm_s)
        why = ", ".join(
            limit.kind if limit.joint is None else f"{limit.kind} of joint {limit.joint}"
            for limit in worst.limits
        )
        yield (
            f"feed: {feed.set_mm_s:g} mm/s, less on {len(feed.lowered)} stretches, which take "
            f"{sum(one.longer_s for one in feed.lowered):.1f} s longer; {worst.lowest_mm_s:.1f} "
            f"mm/s at the least, pass {worst.pass_} cutter points {worst.from_cutter_point:.1f} to "
            f"{worst.to_cutter_point:.1f} ({why})"
        )
        if feed.longest_dwell_at is not None:
            yield (
                f"longest dwell on one spot: {feed.longest_dwell_s:.2f} s at cutter point "
                f"{feed.longest_dwell_at:.1f}, {feed.max_dwell_s:g} s allowed"
            )
    elif feed is not None:
        yield f"feed: {feed.set_mm_s:g} mm/s all over"
    if feed is not None:
        yield (
            "the belt is met and left in motion; from move to move the speed along the surface "
            f"changes by a factor of {feed.largest_speed_ratio:.2f} at most (less than a fifth of "
            "the feed counts as that, a slow move under 0.04 s the less the shorter it is; not "
            "where pivoting makes the ground point slower than 0.4 of the feed)"
        )
    if cycle is None:
        return
    waits = f", {cycle.waits_s:.1f} s waiting" if cycle.waits_s else ""
    open_end = "; and as long as inputs and other programs take" if cycle.open_ended else ""
    yield (
        f"cycle time: {cycle.total_s:.1f} s, of it {cycle.passes_s:.1f} s on the wheel, "
        f"{cycle.approach_and_retract_s:.1f} s to it and away, {cycle.air_s:.1f} s in the air"
        f"{waits}{open_end}"
    )
    if cycle.accelerations_assumed:
        yield (
            f"joint accelerations of {robot} are assumed, and these times with them; "
            f"{opl.keys.PROCESS_MAX_ACCELERATION} knows better"
        )


_PARTS = {
    "from_home": "from home to pass {}",
    "approach": "approach of pass {}",
    "pass": "pass {}",
    "retract": "retract of pass {}",
    "link": "link to pass {}",
    "to_home": "to home",
}


def parts_of_cycle(report: opl.Report) -> Iterator[str]:
    """Yield how long each part of the cycle takes."""
    for one in () if report.cycle is None else report.cycle.parts:
        yield f"  {_PARTS[one.part].format(one.pass_)}: {one.seconds:.2f} s of the cycle"
