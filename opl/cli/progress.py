"""The progress of a run on a terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import opl

REDRAWN = 0.1  # [s] between two drawings of the bar
STAGES = {
    "cutter_points": "cutter points",
    "nodes": "node matrix",
    "clearance": "clearance to the wheel",
    "comparison": "comparison with fixed contact",
    "search": "search",
    "remedies": "what would help",
    "motion": "motion",
    "verification": "verification in PyBullet",
    "export": "program and pictures",
    "read_back": "proof of the written files",
}


@contextmanager
def progress_bar(quiet: bool) -> Iterator[opl.Watch]:
    """Show a bar with the stage at work, on a terminal only; yields what follows the run."""
    if quiet or not sys.stderr.isatty():
        yield opl.Watch()
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:36}"), BarColumn(), TimeElapsedColumn())
    # no thread that draws it: the pictures are drawn in a copy of a process that has none
    quiet_bar = Progress(*columns, console=Console(stderr=True), transient=True, auto_refresh=False)
    with quiet_bar as bar:
        task = bar.add_task("", total=len(STAGES))
        order = list(STAGES)
        furthest = 0.0  # a stage may come twice
        drawn = [0.0]

        def show(stage: opl.Stage, fraction: float) -> None:
            nonlocal furthest
            furthest = max(furthest, order.index(stage.value) + fraction)
            text = STAGES[stage.value]
            if stage is opl.Stage.SEARCH and watch.so_far is not None:
                text = f"{text}, {so_far_text(watch.so_far.value, watch.so_far.lower_bound)}"
            bar.update(task, description=text, completed=furthest)
            if time.monotonic() - drawn[0] > REDRAWN or fraction == 0.0:
                drawn[0] = time.monotonic()
                bar.refresh()

        watch = opl.Watch(show)
        yield watch


def so_far_text(value: float | None, lower_bound: float) -> str:
    """Return what a search knows, in the unit of what it keeps small."""
    bound = f"bound {lower_bound:.3f}"
    return bound if value is None else f"found {value:.3f}, {bound}"
