"""The contact chart of a page: its cells as arrays, the lines over them and its frame as HTML."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from opl.cell.collision import BodyPair
from opl.cell.nearest import Nearest
from opl.geometry.frames import Array
from opl.motion.motion import Motion
from opl.report.html import text
from opl.report.packing import Packer

# of each state, free first: which pixels of an image are darker
HATCHES: tuple[Callable[[Any, Any], Any], ...] = (
    lambda x, y: np.zeros(np.broadcast_shapes(x.shape, y.shape), dtype=bool),
    lambda x, y: (x % 9 == 4) | (y % 9 == 4),
    lambda x, y: (x % 6 < 2) & (y % 6 < 2),
    lambda x, y: (x + y) % 8 == 0,
    lambda x, y: ((x - y) % 5 == 0) | ((x + y) % 15 == 0),
    lambda x, y: (y % 5 == 0) | ((x % 10 == 0) & (y % 10 < 5)),
)
LEAST, MOST = 0.005, 0.1  # [m] clearance that is shown darkest, and lightest
LEAST_PIXELS = (1200, 420)  # across and up
STRIP = 200  # columns painted at a time
NEAR_SINGULAR = 0.1  # of the margin that is 0 at a singularity; the viewer's is the same
MOST_TICKS = 16  # numbers of passes below the chart
MM = 1e3
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
    pair: np.ndarray = np.zeros(measured.shape, dtype=int)
    pair[measured] = nearest.pair
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
        "clearance": packer.floats(measured_clearance(measured, nearest)),
        "nearest": packer.counts(pair),
        "near_pairs": [list(names) for names in nearest.pairs],
    }


def measured_clearance(measured: np.ndarray, nearest: Nearest) -> Array:
    """Return the clearances at the places of a grid in [m], NaN where none was measured."""
    distance = np.full(measured.shape, np.nan)
    distance[measured] = nearest.distance
    return distance


def chart_image(
    states: np.ndarray, singular: np.ndarray, clearance: Array, grid: tuple[np.ndarray, np.ndarray]
) -> str:
    """Return the cells as an image for HTML, each state with a hatch beside its colour.

    Args:
        states: Code of each node, shape (N, M).
        singular: Which are near a singularity, shape (N, M).
        clearance: In [m], NaN where none was measured, shape (columns, positions); free nodes are
            the darker, the less of it there is at the place measured nearest to them.
        grid: Cutter points and contact positions at which it was measured.
    """
    from matplotlib.image import imsave

    columns, rows = (_nearest(places, n) for places, n in zip(grid, states.shape, strict=True))
    across, up = (-(-least // n) for least, n in zip(LEAST_PIXELS, states.shape, strict=True))
    image = np.empty((up * states.shape[1], across * states.shape[0], 3), dtype=np.uint8)
    for first in range(0, len(states), STRIP):
        strip = slice(first, first + STRIP)
        room = clearance[np.ix_(columns[strip], rows)]
        pixels = slice(across * first, across * (first + STRIP))
        image[:, pixels] = _pixels(
            states[strip], singular[strip], room, (across, up), across * first
        )
    file = io.BytesIO()
    # no version in it
    metadata: dict[str, Any] = {"Software": None}
    imsave(file, image, format="png", metadata=metadata)
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode("ascii")


def _pixels(
    states: np.ndarray, singular: np.ndarray, room: Array, size: tuple[int, int], left: int
) -> np.ndarray:
    """Return the pixels of some columns of the chart, of uint8, shape (height, width, 3).

    Args:
        states: Code of each node, shape (n, M).
        singular: Which are near a singularity, shape (n, M).
        room: Clearance measured nearest to each in [m], shape (n, M).
        size: Pixels of a node across and up.
        left: Pixels to the left of these columns.
    """
    from matplotlib.colors import to_rgb

    from opl.report.pictures import STATE_COLOURS

    part = np.clip(np.log(np.maximum(room, 1e-4) / LEAST) / np.log(MOST / LEAST), 0.0, 1.0)
    colours = np.array([to_rgb(STATE_COLOURS[code]) for code in range(len(HATCHES))])[states]
    shaded = (states == 0) & ~np.isnan(room)
    tight, roomy = np.array(to_rgb("#8cbd9d")), np.array(to_rgb("#f6fbf7"))
    colours[shaded] = (tight + part[..., None] * (roomy - tight))[shaded]

    def pixels(cells: np.ndarray) -> np.ndarray:
        of_columns = cells.repeat(size[0], axis=0).repeat(size[1], axis=1)
        return np.asarray(of_columns.swapaxes(0, 1)[::-1])

    image, code = pixels(colours), pixels(states)
    y, x = np.ogrid[: code.shape[0], left : left + code.shape[1]]
    for state, hatch in enumerate(HATCHES):
        image[(code == state) & hatch(x, y)] *= 0.45
    image[pixels(singular & (states == 0)) & ((x % 9 - 4) ** 2 + (y % 9 - 4) ** 2 == 4)] *= 0.3
    return np.asarray((np.clip(image, 0.0, 1.0) * 255).astype(np.uint8))


def _tick(side: str, part: float, said: str) -> str:
    """Return a label at a part of the length of its axis, 0 to 1."""
    return f'<span style="{side}:{100.0 * part:.2f}%">{said}</span>'


def _nearest(places: np.ndarray, count: int) -> np.ndarray:
    """Return which of some increasing places is nearest to each of 0, 1, ..., shape (count,)."""
    return np.asarray(np.abs(np.arange(count)[:, None] - places).argmin(axis=1))


def chart_frame(
    title: str,
    image: str,
    contact_positions: Array,
    pass_index: np.ndarray,
    flat_end: float,
    motion: Motion | None,
    fixed: bool,
    legend: Sequence[tuple[int, str, float]],
) -> str:
    """Return the chart with its lines and legend, which need no script.

    Args:
        title: What it says to those who do not see it.
        image: Its cells, see `chart_image`.
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
    shade = f", the darker the nearer ({MM * LEAST:g} to {MM * MOST:g} mm)"
    keys = "".join(
        f'<li><span class="key state-{code}"></span>{text(name)}{"" if code else shade} '
        f"{100.0 * share:.1f} %</li>"
        for code, name, share in legend
    )
    inside = [t for t in (flat_end, 0.0, -flat_end) if 0.0 < down(t) < m]
    ends = "".join(
        _tick("top", float(down(t)) / m, f"{t:g}")
        for t in (contact_positions[-1], *inside, contact_positions[0])
    )
    middles = [
        (k, float(np.flatnonzero(pass_index == k).mean() + 0.5) / n)
        for k in range(pass_index[-1] + 1)
    ]
    spaced = middles[:: -(-len(middles) // MOST_TICKS)]
    passes = "".join(
        _tick("left", at, f"pass {k + 1}" if k == 0 else f"{k + 1}") for k, at in spaced
    )
    found = '<li><span class="key line-path"></span>path found, dots: intermediate nodes</li>'
    kept = '<li><span class="key line-fixed"></span>contact kept at t = 0</li>'
    return f"""<div class="chart"><div class="axis"><b>t</b>{ends}</div>
<div id="chart" tabindex="0" role="application" aria-label="{text(title)}">
<img id="chart-cells" src="{image}" alt="{text(title)}">
<svg id="chart-lines" viewBox="0 0 {n} {m}" preserveAspectRatio="none" aria-hidden="true">{drawn}
</svg><div id="chart-cursor" hidden></div></div>
<div class="passes">{passes}</div>
<div class="ends"><span>0</span><span>cutter point</span><span>{n - 1}</span></div></div>
<ul class="legend">{keys}{found if motion is not None else ""}{kept if fixed else ""}
<li><span class="key singular"></span>near a singularity</li></ul>"""
