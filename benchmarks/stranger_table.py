"""Random jobs that were run, as a table."""

from __future__ import annotations

import os
import platform
import subprocess
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

import opl
from benchmarks.stranger_parts import FAMILIES
from opl.planning.plan import AT_REST

CLOSED = 0.002  # gap that counts as closed
QUICK = 10.0  # [s] that a search should take at the most
LIBRARIES = ("numpy", "scipy", "numba", "pin", "pybullet")
# of each objective, what is found
UNITS = {
    "range": "joint range sum in rad",
    "travel": "joint travel on the wheel in rad",
    "time": "time on the wheel in s",
    "weighted": "the weighted sum, at the weights a job has by default",
}
# what counts; the others are drawn again
SEARCHED = ("ok", "unsafe", "not found", "timed out", "error")


@dataclass(frozen=True)
class Outcome:
    """What became of a job.

    Attributes:
        index: Which job.
        attempt: Which draw of it.
        status: ``ok``, ``unsafe``, ``no_path`` (every way is shut), ``not found`` (none within the
            work allowed), ``bad input``, ``not reached``, ``timed out`` or ``error``.
        family: Of its part.
        robot: Its arm.
        axle: How the axle of its wheel lies.
        points: Number of cutter points, 0 if they are not known.
        passes: Number of passes.
        found: Value of the objective of the path found; None if there is none.
        bound: Its lower bound.
        search_s: Wall-clock time of search and clearance in [s].
        processor_s: Processor time of both.
        total_s: Wall-clock time from the job file on in [s].
        cause: Why there is no path or program, or why the gap is not closed.
    """

    index: int
    attempt: int
    status: str
    family: str
    robot: str
    axle: str
    points: int = 0
    passes: int = 0
    found: float | None = None
    bound: float | None = None
    search_s: float = 0.0
    processor_s: float = 0.0
    total_s: float = 0.0
    cause: str = ""

    @property
    def gap(self) -> float | None:
        """Fraction by which the path may miss the least; None if nothing is proven."""
        if self.found is None or self.bound is None:
            return None
        return 0.0 if self.found <= AT_REST else 1.0 - self.bound / self.found

    @property
    def closed(self) -> bool:
        """Whether the gap is as small as it should be."""
        return self.gap is not None and self.gap <= CLOSED


def row(outcome: Outcome) -> str:
    """Return a line of the table."""
    gap = "-" if outcome.gap is None else f"{100.0 * outcome.gap:.3f} %"
    found = "-" if outcome.found is None else f"{outcome.found:.4f}"
    cause = outcome.cause.split("\n")[0].replace("|", "/")[:160]
    cells = (
        f"{outcome.index}.{outcome.attempt}",
        outcome.family,
        outcome.robot,
        outcome.axle,
        f"{outcome.points} in {outcome.passes}",
        outcome.status,
        "yes" if outcome.closed else "no",
        gap,
        found,
        f"{outcome.search_s:.1f}",
        f"{outcome.processor_s:.1f}",
        f"{outcome.total_s:.1f}",
        cause,
    )
    return "| " + " | ".join(cells) + " |"


HEAD = (
    "| job | part | arm | axle | points, passes | status | closed | gap | found | search, s "
    "| processor, s | total, s | cause |\n|" + "---|" * 13
)


def revision() -> str:
    """Return the commit that is measured."""
    return subprocess.run(
        ["git", "describe", "--always", "--dirty"],
        capture_output=True, text=True, cwd=Path(__file__).parent, check=False,
    ).stdout.strip()  # fmt: skip


def page(
    seed: int,
    outcomes: Sequence[Outcome],
    objective: str = "range",
    families: Sequence[str] = tuple(FAMILIES),
    uncommon: bool = False,
) -> str:
    """Return the results of a seed, an objective and families of parts as a page of Markdown."""
    chosen = "" if objective == "range" else f" --objective {objective}"
    if tuple(families) != tuple(FAMILIES):
        chosen += f" --families {' '.join(families)}"
    chosen += " --uncommon" if uncommon else ""
    searched = [one for one in outcomes if one.status in SEARCHED]
    closed = [one for one in searched if one.closed]
    quick = [one for one in closed if one.search_s <= QUICK]
    without_path = [one for one in searched if one.found is None]
    unproven = [one for one in searched if one.bound is None]
    gaps = [100.0 * one.gap for one in searched if one.gap is not None]
    half, most = np.quantile(gaps, (0.5, 0.95)).tolist() if gaps else (np.nan, np.nan)
    again = Counter(one.status for one in outcomes if one.status not in SEARCHED)
    slowest = max((one.search_s for one in outcomes), default=0.0)
    versions = ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
    drawn_again = ", ".join(f"{count} {status}" for status, count in sorted(again.items()))
    return "\n".join(
        [
            f"# Strangers, seed {seed}",
            "",
            "Random jobs that nothing was tuned to, written by "
            f"`python -m benchmarks.strangers --seed {seed}{chosen}`. Each line is a draw, which "
            "the seed and its numbers draw again.",
            "",
            f"{len(searched)} jobs searched: {len(closed)} with a gap of at most "
            f"{100.0 * CLOSED:g} %, {len(quick)} of them within {QUICK:g} s; half of the gaps are "
            f"below {half:.2f} %, 95 of 100 below {most:.2f} %, all below "
            f"{max(gaps, default=np.nan):.2f} %; "
            f"{len(without_path)} without a path, {len(unproven)} without a bound; slowest "
            f"{slowest:.1f} s of all drawn. Drawn again: {drawn_again or 'none'}.",
            "",
            f"opl {opl.__version__} at {revision()}, Python {platform.python_version()}, "
            f"{versions}; {os.cpu_count()} processors. Search: wall clock of search and clearance; "
            "processor: that of both; total: wall clock from the job file on. "
            f"Found: {UNITS[objective]}.",
            "",
            HEAD,
            *map(row, outcomes),
            "",
        ]
    )
