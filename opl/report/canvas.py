"""What the pictures are drawn on: one style, passes drawn alike, SVG that repeats to the byte.

Whatever the user's matplotlib is set to does not matter. Text stays text, so a picture can be
searched and read aloud.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeAlias

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from opl.geometry.frames import Array

SIZE = (11.0, 6.0)  # [inch], fills a landscape page
_POINTS = 72.0  # in an inch
Picture: TypeAlias = Figure  # drawn, not yet SVG or PNG
PNG_DPI = 200
INK, FAINT, RULE = "#22303c", "#5b6670", "#9aa5ae"
STYLE: dict[Any, Any] = {
    "svg.hashsalt": "opl",
    "svg.fonttype": "none",
    "text.parse_math": False,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial"],  # the first comes with matplotlib
    "font.size": 11.0,
    "text.color": INK,
    "axes.edgecolor": RULE,
    "axes.labelcolor": INK,
    "axes.labelsize": 12.0,
    "xtick.color": RULE,
    "xtick.labelcolor": INK,
    "ytick.color": RULE,
    "ytick.labelcolor": INK,
    "lines.solid_capstyle": "round",
    "lines.solid_joinstyle": "round",
    "lines.dash_capstyle": "round",
    "legend.frameon": False,
}
LEGEND_ROW = 20.0  # [point] of a legend
GAP = np.array([np.nan])
LONE_STROKE = np.array([-0.25, 0.25])  # in cutter points


@contextmanager
def house_style() -> Iterator[None]:
    """Let matplotlib draw in our style, and only ours, for as long as the context lasts."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


@dataclass(frozen=True)
class Margins:
    """What is left free around charts and between them, in points.

    Attributes:
        left: For labels and numbers beside all of them.
        right: Beside them.
        top: For the title of the figure, and what stands over charts.
        bottom: For labels and numbers under them, without the legend.
        beside: Between one and the next to its right.
        between: Between one and the next under it.
    """

    left: float
    right: float
    top: float
    bottom: float
    beside: float = 0.0
    between: float = 0.0


def blank_figure(title: str) -> Figure:
    """Return an empty figure with its title; what is drawn in it is fitted together."""
    layout = ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.08, wspace=0.03, hspace=0.04)
    return _titled(title, layout)


def _titled(title: str, layout: ConstrainedLayoutEngine | None) -> Figure:
    figure = Figure(figsize=SIZE, layout=layout, facecolor="white")
    figure.suptitle(title, x=0.012, ha="left", fontsize=16, fontweight="bold")
    return figure


def charts(
    title: str, rows: int, columns: int, margins: Margins, handles: Sequence[Artist]
) -> tuple[Figure, list[Axes]]:
    """Return a figure with empty charts, row by row, and a legend; the charts share their x.

    Where they are is known, so nothing has to be drawn to fit it together: a third of the time.
    """
    figure = _titled(title, None)
    legend_below(figure, handles)
    wide, high = (_POINTS * side for side in SIZE)
    bottom = margins.bottom + LEGEND_ROW * -(-len(handles) // _legend_columns(len(handles)))
    across = (wide - margins.left - margins.right - (columns - 1) * margins.beside) / columns
    up = (high - margins.top - bottom - (rows - 1) * margins.between) / rows
    places = {
        "left": margins.left / wide,
        "right": 1.0 - margins.right / wide,
        "top": 1.0 - margins.top / high,
        "bottom": bottom / high,
        "wspace": margins.beside / across,
        "hspace": margins.between / up,
    }
    axes = figure.subplots(rows, columns, sharex=True, squeeze=False, gridspec_kw=places)
    return figure, list(axes.flat)


def legend_below(figure: Figure, handles: Sequence[Artist]) -> None:
    """Explain the handles under the axes."""
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=_legend_columns(len(handles)),
        fontsize=11.5,
        columnspacing=2.4,
        handlelength=1.8,
    )


def points_wide(axes: Axes) -> float:
    """Return how wide a chart is in points."""
    return float(axes.get_position().width * _POINTS * SIZE[0])


def _legend_columns(entries: int) -> int:
    return 2 if entries == 4 else 3


def by_pass(pass_index: np.ndarray) -> list[np.ndarray]:
    """Return for each pass the indices of what belongs to it."""
    return np.split(np.arange(len(pass_index)), np.flatnonzero(np.diff(pass_index)) + 1)


def line_by_pass(pass_index: np.ndarray, x: Array, y: Array) -> tuple[Array, Array]:
    """Return a line, shapes (n,) before, with NaN where the pass changes.

    A configuration alone in its pass becomes a short stroke.
    """
    across: list[Array] = []
    up: list[Array] = []
    for one in by_pass(pass_index):
        alone = len(one) == 1
        across += [x[one] + LONE_STROKE if alone else x[one], GAP]
        up += [np.repeat(y[one], 2) if alone else y[one], GAP]
    return np.concatenate(across[:-1]), np.concatenate(up[:-1])


def draw_pass_borders(axes: Axes, pass_index: np.ndarray) -> None:
    """Draw a thin vertical line wherever a pass ends and the next begins."""
    for border in np.flatnonzero(np.diff(pass_index)):
        axes.axvline(border + 0.5, color=RULE, linewidth=0.8, zorder=1.5)


@house_style()
def svg(figure: Figure, title: str) -> str:
    """Return the figure as SVG text without date, version or random names."""
    text = io.StringIO()
    metadata = {"Title": title, "Creator": "opl", "Date": None}
    # savefig would draw the figure twice: once to lay it out, for nothing to be seen
    canvas = FigureCanvasSVG(figure)
    canvas.print_svg(text, metadata=metadata)  # type: ignore[no-untyped-call]
    return text.getvalue()


@house_style()
def png(figure: Figure) -> bytes:
    """Return the figure as PNG, without date or version."""
    file = io.BytesIO()
    metadata: dict[str, Any] = {"Software": None}
    figure.savefig(file, format="png", dpi=PNG_DPI, metadata=metadata)
    return file.getvalue()
