"""Measures opl, beside what else does the same: python -m benchmarks [--runs 5] [--sizes 100 300].

Writes RESULTS.md and a plot of cost against size here; what became slower than in the RESULTS.md
before is named. Every figure is the median of the runs, with the shortest and the longest.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from benchmarks.jobs import WORKPIECES, v_document
from benchmarks.measuring import SECOND, Row, Timing, timed_process
from benchmarks.results import write_results

SIZES = (100, 300, 1000, 3000, 10_000)
POSITIONS = (35, 140, 560)
V_STEP, V_POINTS = 4.0, 300  # of the V job: longest step in [mm], cutter points
EQUAL_FIELD = (1000, 140)  # cutter points and contact positions for opl and Descartes
BARS = {"opl --help": 0.3, "opl show": 0.5, "V, 300 points x 140": 3.0}
SIZE_BARS = {1000: 8.0, 10_000: 75.0}


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--sizes", type=int, nargs="*", default=SIZES)
    parser.add_argument("--positions", type=int, nargs="*", default=POSITIONS)
    parser.add_argument("--most-seconds", type=float, default=600.0, help="of a whole run")
    parser.add_argument(
        "--descartes",
        type=Path,
        metavar="PYTHON",
        help="of a virtual environment with tesseract-robotics-nanobind (0.35.0.3 was used)",
    )
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    asked = parser.parse_args()
    rows: list[Row] = []
    profiles: dict[str, dict[str, float]] = {}
    sizes: dict[int, Timing] = {}
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for row, profile in _wholes(place, asked):
            rows.append(row)
            profiles |= {row.name: profile} if profile else {}
            _tell(row)
        for n_points in asked.sizes:
            document = v_document(passes={"max_step_mm": V_STEP * V_POINTS / n_points})
            name = f"growing V, {n_points} points x 140"
            found = _run(place / str(n_points), document, name, asked)
            if found is not None:
                row, profile = found
                rows.append(row)
                sizes[n_points], profiles[name] = row.ours, profile
                _tell(row)
    # not before: a process begins with the memory of the one that starts it
    from benchmarks.stages import equal_field, stage_rows

    for row in stage_rows(asked.runs):
        rows.append(row)
        _tell(row)
    if asked.descartes is not None:
        from benchmarks.descartes import descartes_row

        with tempfile.TemporaryDirectory() as folder:
            field = equal_field(*EQUAL_FIELD)
            beside = descartes_row(field, asked.descartes, Path(folder), asked.most_seconds)
        if beside is not None:
            rows.append(beside)
            _tell(beside)
    slower = write_results(asked.out, rows, profiles, sizes)
    print("\n".join(slower) or "nothing became slower")


def _wholes(place: Path, asked: argparse.Namespace) -> Iterator[tuple[Row, dict[str, float]]]:
    """Measure whole commands."""
    found = timed_process(_opl("--help"), asked.runs, asked.most_seconds)
    if found is not None:
        yield Row("opl --help", SECOND, found, bar=BARS["opl --help"]), {}
    for count in asked.positions:
        document = v_document(search={"contact_positions": count})
        name = f"V, 300 points x {count}"
        run = _run(place / f"v{count}", document, name, asked)
        if run is not None:
            yield run
    programs = sorted(place.glob("*/out/*.JBI"))
    if programs:
        shown = timed_process(
            _opl("show", str(programs[-1]), "--robot", "mh24"), asked.runs, asked.most_seconds
        )
        if shown is not None:
            yield Row("opl show", SECOND, shown, bar=BARS["opl show"]), {}
    for part in ("s_shape", "faucet"):
        text = (WORKPIECES / part / "job.yaml").read_text(encoding="utf-8")
        run = _run(place / part, yaml.safe_load(text), part, asked, part)
        if run is not None:
            yield run


def _run(
    place: Path,
    document: dict[str, Any],
    name: str,
    asked: argparse.Namespace,
    part: str = "v_shape",
) -> tuple[Row, dict[str, float]] | None:
    """Measure a whole run of a job as a process; return it and the seconds of its stages."""
    shutil.copytree(WORKPIECES / part, place)
    job, out = place / "job.yaml", place / "out"
    if "cell" in document:
        document["cell"] = str((WORKPIECES / part / document["cell"]).resolve())
    job.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
    command = _opl("run", str(job), "--out", str(out), "-q")
    found = timed_process(command, asked.runs, asked.most_seconds)
    if found is None:
        print(f"{name}: refused, or over {asked.most_seconds:g} s", file=sys.stderr)
        return None
    seconds = json.loads((out / "result.json").read_text(encoding="utf-8"))["seconds"]
    bar = BARS.get(name)
    if part == "v_shape" and name.startswith("growing"):
        bar = next((SIZE_BARS[size] for size in SIZE_BARS if f" {size} " in name), None)
    return Row(name, SECOND, found, bar=bar), seconds


def _opl(*arguments: str) -> list[str]:
    return [sys.executable, "-c", "from opl.cli.commands import main; main()", *arguments]


def _tell(row: Row) -> None:
    unit, factor = row.unit
    print(f"{row.name}: {factor * row.ours.median:.3g} {unit}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
