"""Progress of a run, the time of its stages, its cancellation, and the end of its search."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import Enum
from threading import Event

from opl.errors import Cancelled
from opl.planning.so_far import Follow, SoFar


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
    """Follows one run: passes on progress, measures its stages, can end its search or all of it.

    A run is cancelled by `cancel`, from the progress function or from another thread. It ends with
    `Cancelled` when its progress is next reported: between two stages, and often during the
    search for the path and the verification. `take_best` ends that search alone.

    Args:
        progress: Called with the stage and the fraction of it that is done, 0 to 1, in the thread
            of the run. A stage may come twice. What it raises ends the run.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress
        self._seconds: dict[Stage, float] = {}
        self._cancelled, self._enough = Event(), Event()
        self._so_far: SoFar | None = None

    @property
    def seconds(self) -> dict[Stage, float]:
        """Time of each stage up to now in [s]."""
        return dict(self._seconds)

    @property
    def so_far(self) -> SoFar | None:
        """The best path and the lower bound that are known by now; None before its search."""
        return self._so_far

    def take_best(self) -> None:
        """End the search for the path with the best so far, or with the first if there is none yet.

        The run goes on with it. Its bound is true; its result tells that the proof was not
        complete. Only the search by proof (`search.method: optimal`) is ended.
        """
        self._enough.set()

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

    @contextmanager
    def search(self) -> Iterator[Follow]:
        """Measure the search for the path; yields what follows it.

        Raises:
            Cancelled: If the run was cancelled.
        """
        with self.stage(Stage.SEARCH) as report:

            def follow(so_far: SoFar) -> bool:
                self._so_far = so_far
                report(so_far.done)
                return not self._enough.is_set()

            yield follow
