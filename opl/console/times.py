"""What the command line shows of times: the feed where it is not kept, and the cycle time."""

from __future__ import annotations

from collections.abc import Iterator

from opl.motion.feed import Share
from opl.outcome import Outcome


def told_times(outcome: Outcome) -> Iterator[str]:
    """Yield lines about the times of a program."""
    assert outcome.program is not None and outcome.slow is not None
    job, slow, cycle = outcome.job, outcome.slow, outcome.program.cycle
    feed = f"feed: {1e3 * job.process.feed:g} mm/s"
    if not slow:
        yield f"{feed} all over"
    else:
        worst = min(slow, key=lambda one: one.slowest)
        names = job.cell.robot.joint_names
        why = ", ".join(_cause(share, names) for share in worst.shares)
        yield (
            f"{feed}, less on {len(slow)} stretches, which take {sum(s.longer for s in slow):.1f} "
            f"s longer; {1e3 * worst.slowest:.1f} mm/s at the least, pass {worst.pass_index + 1} "
            f"cutter points {worst.start:.1f} to {worst.end:.1f} ({why})"
        )
        dwell = max(slow, key=lambda one: one.dwell)
        if dwell.dwell > 0.0:
            yield (
                f"longest dwell on one spot: {dwell.dwell:.2f} s at cutter point "
                f"{dwell.dwell_at:.1f}, {job.process.max_dwell:g} s allowed"
            )
    if cycle is not None:
        waits = f", {cycle.waits:.1f} s waiting" if cycle.waits else ""
        open_end = "; and as long as inputs and other programs take" if cycle.open_ended else ""
        yield (
            f"cycle time: {cycle.total:.1f} s, of it {cycle.passes:.1f} s on the wheel, "
            f"{cycle.leads:.1f} s to it and away, {cycle.air:.1f} s in the air{waits}{open_end}"
        )
    if job.cell.robot.acceleration_assumed:
        yield (
            f"joint accelerations of {job.cell.robot.title} are assumed, and these times with "
            "them; process.max_acceleration_deg_s2 knows better"
        )


def _cause(share: Share, joint_names: tuple[str, ...]) -> str:
    if share.joint is None:
        return share.cause.value
    return f"{share.cause.value} of joint {joint_names[share.joint]}"
