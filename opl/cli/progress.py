"""The progress of a run on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import opl

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

    columns = (TextColumn("{task.description:30}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=len(STAGES))
        order = list(STAGES)
        furthest = 0.0  # a stage may come twice

        def show(stage: opl.Stage, fraction: float) -> None:
            nonlocal furthest
            furthest = max(furthest, order.index(stage.value) + fraction)
            bar.update(task, description=STAGES[stage.value], completed=furthest)

        yield opl.Watch(show)
