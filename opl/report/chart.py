"""The contact chart of a page: its cells as arrays, the lines over them and its frame as HTML."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from opl.cell.collision import BodyPair
from opl.cell.nearest import Nearest
from opl.geometry.frames import Array
from opl.motion.motion import Motion
from opl.report.html import text
from opl.report.packing import Packer

STILL = 'vector-effect="non-scaling-stroke"'


def chart_cells(
    contact_positions: Array,
    states: np.ndarray,
    names: Sequence[str],
    q: Array,
    hit: tuple[np.ndarray, Sequence[BodyPair]],
    singularity: Array,
    grid: tuple[np.ndarray, np.ndarray, np.ndarray],
    nearest: Nearest,
    packer: Packer,
) -> dict[str, Any]:
    """Return what every node is, as the viewer reads it.

    Args:
        contact_positions: Shape (M,).
        states: Code of each node, shape (N, M).
        names: Of the codes.
        q: Configuration of each node in [rad], NaN where there is none, shape (N, M, 6).
        hit: Which pair collides at each, -1 for none, shape (N, M), and the pairs.
        singularity: How far each is from a singularity, shape (N, M).
        grid: Cutter points and contact positions at which clearance was measured, and at which of
            both it was.
        nearest: What was measured there.
        packer: Takes the arrays.
    """
    columns, positions, measured = grid
    distance, pair = np.full(measured.shape, np.nan), np.zeros(measured.shape, dtype=int)
    distance[measured], pair[measured] = nearest.distance, nearest.pair
    return {
        "t": packer.floats(contact_positions),
        "states": packer.counts(states),
        "names": list(names),
        "q": packer.rounded(np.moveaxis(q, -1, 0)),
        "hit": packer.counts(hit[0]),
        "pairs": [list(names) for names in hit[1]],
        "singularity": packer.rounded(singularity),
        "columns": packer.counts(columns),
        "positions": packer.counts(positions),
        "clearance": packer.floats(distance),
        "nearest": packer.counts(pair),
        "near_pairs": [list(names) for names in nearest.pairs],
    }


def chart_frame(
    title: str,
    contact_positions: Array,
    pass_index: np.ndarray,
    flat_end: float,
    motion: Motion | None,
    fixed: bool,
    legend: Sequence[tuple[int, str, float]],
) -> str:
    """Return the chart's frame with its lines and legend; the script fills the cells.

    Args:
        title: What it says to those who do not see it.
        contact_positions: Evenly spaced, shape (M,).
        pass_index: Of each cutter point, shape (N,).
        flat_end: Contact position where the flat ends.
        motion: The motion whose path is drawn, None for none.
        fixed: Whether the line t = 0 is drawn.
        legend: Code, name and share of the states that there are.
    """
    n, m = len(pass_index), len(contact_positions)
    step = float(np.ptp(contact_positions)) / max(m - 1, 1) or 1.0

    def down(t: Array | float) -> Any:
        return m - 0.5 - (np.asarray(t) - contact_positions[0]) / step

    borders = "".join(f"M{k + 1} 0V{m}" for k in np.flatnonzero(np.diff(pass_index)))
    zones = "".join(f"M0 {down(t):.3f}H{n}" for t in (flat_end, -flat_end) if 0 < down(t) < m)
    lines = [("border", borders), ("zone", zones)]
    if fixed:
        lines.append(("fixed", f"M0 {down(0.0):.3f}H{n}"))
    if motion is not None:
        rows = np.flatnonzero(motion.on_wheel)
        starts = set(np.flatnonzero(~motion.grinding).tolist())
        x, y = motion.cutter_point + 0.5, down(motion.contact_position)
        path = "".join(f"{'M' if k in starts else 'L'}{x[k]:.2f} {y[k]:.2f}" for k in rows)
        between = "".join(f"M{x[k]:.2f} {y[k]:.2f}h0" for k in rows if motion.cutter_point[k] % 1.0)
        lines += [("outline", path), ("path", path), ("between", between)]
    drawn = "".join(f'<path class="{kind}" d="{d}" {STILL}/>' for kind, d in lines if d)
    keys = "".join(
        f'<li><span class="key state-{code}"></span>{text(name)} {100.0 * share:.1f} %</li>'
        for code, name, share in legend
    )
    ends = f"<span>t {contact_positions[-1]:g}</span><span>{contact_positions[0]:g}</span>"
    found = '<li><span class="key line-path"></span>path found, dots: intermediate nodes</li>'
    kept = '<li><span class="key line-fixed"></span>contact kept at t = 0</li>'
    return f"""<div class="chart"><div class="axis">{ends}</div>
<div id="chart" tabindex="0" role="application" aria-label="{text(title)}">
<canvas id="chart-cells"></canvas>
<svg id="chart-lines" viewBox="0 0 {n} {m}" preserveAspectRatio="none" aria-hidden="true">{drawn}
</svg><div id="chart-cursor" hidden></div></div>
<div class="ends"><span>0</span><span>cutter point</span><span>{n - 1}</span></div></div>
<ul class="legend">{keys}{found if motion is not None else ""}{kept if fixed else ""}
<li><span class="key singular"></span>near a singularity</li></ul>"""
