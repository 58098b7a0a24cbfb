"""RESULTS.md: the table, the profiles, the plot, and what became slower since the one before."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from benchmarks.measuring import Row, Timing

FILE, PLOT = "RESULTS.md", "cost.svg"
SLOWER = 1.25  # times the median of before
LIBRARIES = (
    "numpy", "scipy", "numba", "pin", "coal", "pybullet", "toppra", "ompl", "EAIK",
    "py-opw-kinematics", "python-fcl", "geomdl",
)  # fmt: skip
_ROW = re.compile(r"\| (?P<name>[^|]+) \| (?P<median>[0-9.e+-]+) (?P<unit>us|s) \|")


def write_results(
    folder: Path,
    rows: Sequence[Row],
    profiles: Mapping[str, Mapping[str, float]],
    sizes: Mapping[int, Timing],
) -> list[str]:
    """Write the results; return what became slower, one line each."""
    path = folder / FILE
    before = _medians(path.read_text(encoding="utf-8")) if path.exists() else {}
    slower = [
        f"slower than before: {row.name}, {row.ours.median / before[row.name]:.2f} times"
        for row in rows
        if row.name in before and row.ours.median > SLOWER * before[row.name]
    ]
    lines = ["# Benchmarks", "", "Written by `python -m benchmarks`; medians, with the spread.", ""]
    lines += [_machine(), "", *_table(rows), "", *_profiles(profiles)]
    if len(sizes) > 1:
        (folder / PLOT).write_text(_plot(sizes), encoding="utf-8")
        lines += ["", f"![cost against size]({PLOT})"]
    if before:
        lines += ["", "## Against the results before", "", *(slower or ["Nothing became slower."])]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return slower


def _medians(text: str) -> dict[str, float]:
    factors = {"us": 1e-6, "s": 1.0}
    found = (_ROW.match(line) for line in text.splitlines())
    return {one["name"]: float(one["median"]) * factors[one["unit"]] for one in found if one}


def _machine() -> str:
    versions = []
    for name in LIBRARIES:
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    load = os.getloadavg()[0]
    return (
        f"Python {platform.python_version()}, {os.cpu_count()} cores, load {load:.1f} at the end; "
        + ", ".join(versions)
        + "."
    )


def _table(rows: Sequence[Row]) -> list[str]:
    lines = [
        "| what | median | spread | computing | memory | wanted | reference | ratio |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        unit, factor = row.unit
        ours, theirs = row.ours, row.theirs
        memory = f"{ours.memory / 1e9:.2f} GB" if ours.memory else ""
        bar = "" if row.bar is None else f"{factor * row.bar:g} {unit}"
        told = "" if theirs is None else f"{row.reference}: {factor * theirs.median:.3g} {unit}"
        ratio = "" if theirs is None else f"{theirs.median / ours.median:.1f}"
        lines.append(
            f"| {row.name} | {factor * ours.median:.4g} {unit} | {factor * ours.least:.3g} to "
            f"{factor * ours.most:.3g} | {factor * ours.cpu:.3g} {unit} | {memory} | {bar} | "
            f"{told} | {ratio} |"
        )
    return lines


def _profiles(profiles: Mapping[str, Mapping[str, float]]) -> list[str]:
    """Return the share of each stage in percent; the rest of a run is loading and its page."""
    if not profiles:
        return []
    stages = list(dict.fromkeys(key for one in profiles.values() for key in one if key != "total"))
    lines = ["## Profiles, in percent of the stages", ""]
    lines += ["| run | " + " | ".join(stages) + " |", "|---" * (1 + len(stages)) + "|"]
    for name, seconds in profiles.items():
        total = seconds["total"]
        shares = " | ".join(f"{100.0 * seconds.get(stage, 0.0) / total:.0f}" for stage in stages)
        lines.append(f"| {name} | {shares} |")
    return lines


def _plot(sizes: Mapping[int, Timing]) -> str:
    """Return the cost of whole runs against their cutter points, both logarithmic, as SVG."""
    import io

    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    count = list(sizes)
    axes.loglog(count, [one.median for one in sizes.values()], "o-", label="on the wall")
    axes.loglog(count, [one.cpu for one in sizes.values()], "s--", label="computing")
    axes.set(xlabel="cutter points", ylabel="seconds of a whole run")
    axes.grid(visible=True, which="both", linewidth=0.3)
    axes.legend()
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()
