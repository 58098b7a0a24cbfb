"""What each part of the proof is worth: random jobs, with one part left out at a time.

By hand: python -m benchmarks.without --seed 7 --count 60. The same jobs are searched with
everything and without each part; the table goes into WITHOUT.md. Jobs that are proven to have no
motion count beside those that are closed. What leaves no more jobs open without it, in a run of
many, and has none take much longer, is not worth its lines.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import opl
from benchmarks.stranger_table import SEARCHED, Outcome, revision
from benchmarks.strangers import LONGEST, MOST_DRAWS, Draw, run_strangers
from opl.least import box_nodes, search_space
from opl.least.hope import Hope
from opl.least.passages import NO_PASSAGES, Rectangles
from opl.walls.shut_leads import ShutLeads
from opl.walls.sides import ANY_SIDE

TABLE = Path(__file__).with_name("WITHOUT.md")
ROOMS = Path(opl.__file__).parent


@dataclass(frozen=True)
class Part:
    """A part of the proof that can be left out.

    Attributes:
        what: What it knows.
        modules: Those that nothing else needs.
        instead: What stands in its place: what has it, its name there, and the other.
    """

    what: str
    modules: Sequence[str]
    instead: Sequence[tuple[Any, str, Any]]

    @property
    def lines(self) -> int:
        """How many lines its modules have."""
        texts = ((ROOMS / name).read_text(encoding="utf-8") for name in self.modules)
        return sum(text.count("\n") for text in texts)


PARTS: Mapping[str, Part] = {
    "barriers": Part(
        "contact positions at which the part cuts into the wheel along many cutter points",
        ("walls/barriers.py", "walls/sides.py"),
        [(search_space, "all_sides", lambda problem: [[ANY_SIDE]] * problem.points.n_passes)],
    ),
    "passages": Part(
        "chains of places and contact positions, and ways past them, between cutter points",
        ("least/passages.py", "least/rectangle.py", "search/passage.py"),
        [(Rectangles, "held", lambda self, *box: NO_PASSAGES)],
    ),
    "shut leads": Part(
        "where a pass cannot begin or end, because its lead collides",
        ("walls/shut_leads.py", "walls/lead_cells.py"),
        [
            (ShutLeads, "at", lambda self, T, family, flip, t, reserve=0.0: t > np.inf),
            (
                ShutLeads,
                "surely",
                lambda self, piece, flip, low, high: (low > np.inf, low > np.inf),
            ),
        ],
    ),
    "sinking": Part(
        "that a motion sinks into the wheel between two places, and how to spare that",
        ("least/sinking.py",),
        [(box_nodes, "first_sunk", lambda problem, hits: None)],
    ),
    "hope": Part(
        "that boxes larger than one that holds a motion are of no interest",
        ("least/hope.py",),
        [
            (Hope, "guess", lambda self, proven, best: best),
            (Hope, "told", lambda self, size, hoped: hoped),
        ],
    ),
}


def leave_out(name: str | None) -> None:
    """Leave a part out in this process, from now on; None for nothing."""
    for owner, attribute, other in PARTS[name].instead if name else ():
        patch.object(owner, attribute, other).start()


def settled(outcome: Outcome) -> bool:
    """Return whether a job is closed, or proven to have no motion."""
    return outcome.closed or outcome.status == "no_path"


def line(name: str, lines: int, outcomes: Mapping[Draw, Outcome], among: set[Draw]) -> str:
    """Return a line of the table: what became of the jobs that are settled with everything."""
    closed = [key for key in among if outcomes[key].closed]
    none = [key for key in among if outcomes[key].status == "no_path"]
    left = [outcomes[key] for key in sorted(among) if not settled(outcomes[key])]
    without_path = [one for one in left if one.found is None]
    gaps = [one.gap for one in left if one.gap is not None]
    jobs = ", ".join(f"{one.index}.{one.attempt}" for one in left)
    seconds = sum(outcomes[key].processor_s for key in among)
    largest = f"{100.0 * max(gaps):.1f} %" if gaps else "-"
    count = str(lines) if lines else "-"
    counts = len(closed), len(none), len(without_path)
    cells = name, count, *counts, largest, f"{seconds:.0f}", jobs or "-"
    return "| " + " | ".join(map(str, cells)) + " |"


def page(seed: int, measured: str, found: Mapping[str, Mapping[Draw, Outcome]]) -> str:
    """Return the table of a revision as Markdown; what was found with everything comes first."""
    everything, *others = found
    among = {key for key, one in found[everything].items() if settled(one)}
    count = 1 + max(index for index, _ in found[everything])
    return "\n".join(
        [
            f"# The proof without one of its parts, seed {seed}",
            "",
            f"Written by `python -m benchmarks.without --seed {seed} --count {count}`, opl "
            f"{opl.__version__} at {measured}. Of the {len(among)} random jobs that are closed, or "
            "proven to have no motion, with everything: how many still are without a part, of how "
            "many of the others neither a motion is found nor proven that there is none (or took "
            f"more than {LONGEST:g} s), the largest gap of the rest, and the processor time of "
            "search and clearance of all of them, side by side with others.",
            "",
            "| without | lines of its own | closed | proven to have none | neither | largest gap "
            "| processor, s | open |",
            "|" + "---|" * 8,
            line(everything, 0, found[everything], among),
            *(line(f"{name}: {PARTS[name].what}", PARTS[name].lines, found[name], among)
              for name in others),
            "",
        ]
    )  # fmt: skip


def main() -> None:
    """Run the jobs with everything and without each part, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--workers", type=int, default=2, help="jobs run at once")
    parser.add_argument("--folder", type=Path, default=Path("strangers"), help="of the jobs")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    draws: list[list[Draw]] = [
        [(index, attempt) for attempt in range(MOST_DRAWS)] for index in range(arguments.count)
    ]
    found: dict[str, dict[Draw, Outcome]] = {}
    measured = revision()  # before the table is written anew
    for name in ("nothing left out", *PARTS):
        outcomes = found[name] = {}

        def done(outcome: Outcome, outcomes: dict[Draw, Outcome] = outcomes) -> None:
            outcomes[outcome.index, outcome.attempt] = outcome

        begin = partial(leave_out, name if name in PARTS else None)
        given = arguments.seed, draws, arguments.folder, arguments.workers, False, done, begin
        run_strangers(*given)
        if name not in PARTS:  # the others search the same draws
            kept = (*SEARCHED, "no_path")
            draws = [[key] for key, one in sorted(outcomes.items()) if one.status in kept]
        print(name, sum(one.closed for one in outcomes.values()), flush=True)
        TABLE.write_text(page(arguments.seed, measured, found), encoding="utf-8")


if __name__ == "__main__":
    main()
