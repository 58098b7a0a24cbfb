"""Refusals of a planned path in words that name the keys of the job."""

from __future__ import annotations

from opl.errors import NoPathError
from opl.job import keys
from opl.motion.feed import SlowStretch
from opl.motion.process_settings import ProcessSettings


def dwell_refusal(
    stretches: tuple[SlowStretch, ...], process: ProcessSettings
) -> NoPathError | None:
    """Return why a path is refused on which the belt would dwell too long, None if it is not.

    Args:
        stretches: Where the path is slower than the feed.
        process: For the longest dwell allowed.
    """
    too_long = [one for one in stretches if one.dwell > process.max_dwell]
    if not too_long:
        return None
    return NoPathError(
        f"the belt would dwell on one spot for more than {process.max_dwell:g} s beyond the time "
        f"at the feed ({keys.PROCESS_MAX_DWELL}); raise {keys.PROCESS_CONTACT_SPEED} or lower "
        f"{keys.PROCESS_FEED}, or let the contact move less ({keys.SEARCH_CONTACT_WEIGHT})",
        [
            f"pass {one.pass_index + 1}, cutter point {one.dwell_at:.2f}: {one.dwell:.2f} s"
            for one in too_long
        ],
    )
