"""Refusals of the rooms below, which know no keys, in words that name the keys of the job."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from opl.errors import (
    InputError,
    NoPathError,
    OplError,
    PassTimeError,
    SettingError,
    TimeLawError,
    UnsafeError,
)
from opl.geometry.toolpath import CutterPoints
from opl.job import keys
from opl.job.source import Source
from opl.motion.feed import SlowStretch
from opl.motion.motion import TimedMotion
from opl.motion.process_settings import ProcessSettings
from opl.motion.repeats import short_passes


@contextmanager
def keys_named(source: Source) -> Iterator[None]:
    """Name file and keys in what is refused while a motion is timed or a program is written.

    Args:
        source: The job file or mapping.

    Raises:
        InputError: Instead of a `SettingError`.
        OplError: Instead of a `PassTimeError`; names the keys that help.
        UnsafeError: Instead of a `TimeLawError`; names the key that helps.
    """
    try:
        yield
    except SettingError as error:
        key = keys.OF_PROGRAM.get(error.where, error.where)  # a post of a site names its own
        raise InputError(source.at(key), error.message) from error
    except PassTimeError as error:
        advice = (
            f"raise {keys.PROCESS_FEED}, or write {keys.PROGRAM_MOTION}: straight; where the part "
            f"hardly moves while the contact slides over it, a smaller "
            f"{keys.SEARCH_CONTACT_CHANGE} may help"
        )
        raise OplError(f"{error}; {advice}") from error
    except TimeLawError as error:
        advice = f"raise {keys.PROCESS_MAX_ACCELERATION} if the robot can do more"
        raise UnsafeError(f"{error}; {advice}") from error


def rest_refusal(
    timed: TimedMotion, points: CutterPoints, process: ProcessSettings
) -> NoPathError | None:
    """Return why a path is refused that rests where a pass begins or ends, None if it is not.

    Args:
        timed: The motion with its times.
        points: Its cutter points.
        process: For the feed.
    """
    short = list(short_passes(timed, points, process.feed))
    if not short:
        return None
    return NoPathError(
        "the part would rest on the wheel where a pass begins or ends, while the contact slides "
        f"over the wheel, and no program says for how long; a smaller {keys.SEARCH_CONTACT_CHANGE} "
        f"or another {keys.SEARCH_OBJECTIVE} may give a path that moves",
        [
            f"pass {one.pass_index + 1}: {one.takes:.2f} s of moves on the wheel, "
            f"{one.at_feed:.2f} s at the feed"
            for one in short
        ],
    )


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
