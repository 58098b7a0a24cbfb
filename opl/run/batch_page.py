"""The page of a batch."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from opl.report.html import batch_page as sortable_page
from opl.report.html import text
from opl.run.batch import BatchRow
from opl.run.result import PAGE


def batch_page(rows: Sequence[BatchRow], folder: Path) -> str:
    """Return the page of a batch: its jobs in a table that sorts, with links to their pages.

    Args:
        rows: What became of each job.
        folder: Where the page will lie; links are relative to it.
    """
    good = sum(row.exit_status == 0 for row in rows)
    lines = []
    for row in rows:
        result = row.result
        path = None if result is None else result.path
        job = text(" ".join([str(row.job), *(f"{k} {v}" for k, v in row.variant.items())]))
        if row.folder is not None:
            link = Path(os.path.relpath(row.folder / PAGE, folder)).as_posix()
            job = f'<a href="{text(link)}">{job}</a>'
        cycle = None if result is None else result.cycle
        found = None if result is None else result.verification
        cells = [
            text(row.status),
            "" if result is None else text(result.cutter_points),
            "" if path is None else f"{path.joint_range_sum_rad:.4f}",
            "" if path is None or path.gap is None else f"{100.0 * path.gap:.3f}",
            "" if path is None else _small_bars(path.joint_ranges_rad),
            "" if cycle is None else f"{cycle.total_s:.1f}",
            "" if found is None else f"{found.min_clearance_mm:.1f}",
            _folded(row.message),
        ]
        lines.append((job, cells))
    heads = (
        "job",
        "status",
        "cutter points",
        "range sum rad",
        "gap %",
        "joint ranges",
        "cycle s",
        "clearance mm",
        "why not",
    )
    summary = f"{good} of {len(rows)} jobs have a program"
    return sortable_page("Batch", summary, heads, lines)


def _folded(message: str) -> str:
    """Return the first line of a message, the others where they are asked for."""
    first, *others = message.split("\n")
    if not others:
        return text(first)
    inside = text("\n".join(others))
    return f"<details><summary>{text(first)}</summary>{inside}</details>"


def _small_bars(values: Sequence[float]) -> str:
    """Return a bar for each value, the largest as high as there is room."""
    most = max(values) or 1.0
    bars = "".join(
        f'<rect x="{15 * k + 1}" y="{20 - 20 * value / most:.1f}" width="12" '
        f'height="{20 * value / most:.1f}"/>'
        for k, value in enumerate(values)
    )
    label = ", ".join(f"{value:.3f}" for value in values)
    return f'<svg class="small" viewBox="0 0 90 20" role="img" aria-label="{label}">{bars}</svg>'
