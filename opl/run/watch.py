"""Progress of a run, the time of its stages, and its cancellation."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import Enum
from threading import Event

from opl.errors import Cancelled


class Stage(Enum):
    """What a run is doing; the values are the keys of ``seconds`` in ``result.json``."""

    CUTTER_POINTS = "cutter_points"
    NODES = "nodes"
    CLEARANCE = "clearance"
    COMPARISON = "comparison"
    SEARCH = "search"
    REMEDIES = "remedies"
    MOTION = "motion"
    VERIFICATION = "verification"
    EXPORT = "export"
    READ_BACK = "read_back"


Progress = Callable[[Stage, float], None]


class Watch:
    """Follows one run: passes on its progress, measures its stages, and can cancel it.

    A run is cancelled by `cancel`, from the progress function or from another thread. It ends with
    `Cancelled` when its progress is next reported: between two stages, and often during the
    verification.

    Args:
        progress: Called with the stage and the fraction of it that is done, 0 to 1, in the thread
            of the run. A stage may come twice. What it raises ends the run.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress
        self._seconds: dict[Stage, float] = {}
        self._cancelled = Event()

    @property
    def seconds(self) -> dict[Stage, float]:
        """Time of each stage up to now in [s]."""
        return dict(self._seconds)

    def cancel(self) -> None:
        """End the run with `Cancelled` as soon as it reports its progress."""
        self._cancelled.set()

    @contextmanager
    def stage(self, stage: Stage) -> Iterator[Callable[[float], None]]:
        """Measure a stage; yields what reports the fraction of it that is done.

        Raises:
            Cancelled: If the run was cancelled.
        """

        def report(fraction: float) -> None:
            if self._progress is not None:
                self._progress(stage, fraction)
            if self._cancelled.is_set():
                raise Cancelled(f"cancelled during stage {stage.value}")

        report(0.0)
        start = time.perf_counter()
        try:
            yield report
        finally:
            spent = time.perf_counter() - start
            self._seconds[stage] = self._seconds.get(stage, 0.0) + spent
        report(1.0)
