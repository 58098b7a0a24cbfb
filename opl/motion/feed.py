"""Where the ground point is slower than the set feed, why, and where the belt dwells."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from opl.motion.process_settings import ProcessSettings
from opl.motion.timing import Cause, Timing

# The belt dwells where the ground point is slower than this part of the feed.
HARDLY_MOVES = 0.5


@dataclass(frozen=True)
class Share:
    """What one cause costs on a slow part of a pass.

    Attributes:
        cause: The cause.
        joint: The joint to blame, None where none is.
        longer: Time beyond that at the feed in [s].
    """

    cause: Cause
    joint: int | None
    longer: float


@dataclass(frozen=True)
class SlowStretch:
    """A part of a pass on which the ground point is slower than the feed.

    Attributes:
        pass_index: The pass, counted from 0.
        start: Cutter point it begins at, fractional between two.
        end: Cutter point it ends at.
        slowest: Lowest speed along the surface on any move of it in [m/s].
        slowest_at: Cutter point where that move ends.
        shares: What makes it slow, the dearest first.
        dwell: Time that the part of it on which the ground point hardly moves takes beyond that at
            the feed, in [s]; of several such parts the longest.
        dwell_at: Cutter point of the slowest move in that part; NaN where there is none.
    """

    pass_index: int
    start: float
    end: float
    slowest: float
    slowest_at: float
    shares: tuple[Share, ...]
    dwell: float
    dwell_at: float

    @property
    def longer(self) -> float:
        """Time beyond that at the feed in [s]."""
        return sum(share.longer for share in self.shares)


def slow_stretches(timing: Timing, process: ProcessSettings) -> tuple[SlowStretch, ...]:
    """Return the parts of the passes that are slower than the feed by a hundredth or more.

    The approaches and retracts are not among them.
    """
    slow = np.array([cause is not Cause.NONE for cause in timing.cause])
    index = timing.timed.motion.pass_index
    return tuple(_stretch(timing, process, moves) for moves in _runs(slow, index))


def _runs(wanted: np.ndarray, index: np.ndarray) -> Iterator[np.ndarray]:
    """Yield each run of neighbouring moves that are wanted and of one pass."""
    moves = np.flatnonzero(wanted)
    breaks = (np.diff(moves) > 1) | (np.diff(index[moves]) != 0)
    yield from (run for run in np.split(moves, np.flatnonzero(breaks) + 1) if len(run))


def _stretch(timing: Timing, process: ProcessSettings, moves: np.ndarray) -> SlowStretch:
    motion, duration = timing.timed.motion, timing.timed.duration
    speed = timing.surface_distance / np.maximum(duration, 1e-12)
    longer = duration - timing.surface_distance / process.feed
    shares: dict[tuple[Cause, int], float] = {}
    for move in moves:
        key = (timing.cause[move], int(timing.joint[move]))
        shares[key] = shares.get(key, 0.0) + float(longer[move])
    slowest = int(moves[speed[moves].argmin()])
    hardly = np.isin(np.arange(len(motion)), moves) & (speed < HARDLY_MOVES * process.feed)
    dwells = _runs(hardly, motion.pass_index)
    dwell = max(dwells, key=lambda run: longer[run].sum(), default=moves[:0])
    return SlowStretch(
        pass_index=int(motion.pass_index[slowest]),
        start=float(motion.cutter_point[moves[0] - 1]),
        end=float(motion.cutter_point[moves[-1]]),
        slowest=float(speed[slowest]),
        slowest_at=float(motion.cutter_point[slowest]),
        shares=tuple(
            Share(cause, joint if joint >= 0 else None, time)
            for (cause, joint), time in sorted(shares.items(), key=lambda item: -item[1])
        ),
        dwell=float(longer[dwell].sum()),
        dwell_at=(
            float(motion.cutter_point[dwell[speed[dwell].argmin()]]) if len(dwell) else np.nan
        ),
    )
