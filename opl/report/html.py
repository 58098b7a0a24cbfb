"""Pieces of a page: text made safe, tables, lists, a small bar chart; and the page around them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

_VIEWER = Path(__file__).parent / "viewer"
MOST_ON_PAPER = 9  # rows of a table, or lines of a list; the style leaves out as many
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"


def page(title: str, body: str, data: Mapping[str, Any], block: str) -> str:
    """Return a whole page: nothing in it is fetched from anywhere, and its policy forbids it.

    Args:
        title: What the page is called.
        body: Its content as HTML.
        data: What its script draws.
        block: The arrays of the data, packed.
    """
    plain = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    carried = (
        f'<script type="application/json" id="page-data">{plain}</script>\n'
        f'<script type="text/plain" id="page-block">{block}</script>'
    )
    return _whole(title, f"{body}\n{carried}", "viewer.js")


def batch_page(
    title: str, subtitle: str, heads: Sequence[str], rows: Sequence[tuple[str, Sequence[str]]]
) -> str:
    """Return a page with one table that is sorted by a click on a heading.

    Args:
        title: What the page is called.
        subtitle: A line below it.
        heads: Of the columns.
        rows: First cell and others of each row, as HTML.
    """
    head = "".join(f'<th scope="col">{text(one)}</th>' for one in heads)
    lines = "\n".join(
        f'<tr><th scope="row">{first}</th>{"".join(f"<td>{cell}</td>" for cell in cells)}</tr>'
        for first, cells in rows
    )
    body = (
        f"<header><h1>{text(title)}</h1><p>{text(subtitle)}</p></header>\n"
        f'<div class="scroll"><table class="words sortable"><thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{lines}\n</tbody></table></div>"
    )
    return _whole(title, body, "batch.js")


def _cut_on_paper(count: int) -> str:
    """Return what paper says of more rows or lines than it shows."""
    more = count - MOST_ON_PAPER
    return f'<p class="paper">and {more} more: on the page</p>' if more > 0 else ""


def _whole(title: str, body: str, script: str) -> str:
    style = (_VIEWER / "page.css").read_text(encoding="utf-8")
    code = (_VIEWER / script).read_text(encoding="utf-8")
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{text(title)}</title>
<style>
{style}</style>
</head>
<body>
{body}
<script>
{code}</script>
</body>
</html>
"""


def text(value: object) -> str:
    """Return anything as text that is safe in HTML."""
    return escape(str(value))


def section(name: str, heading: str, *content: str) -> str:
    """Return a section with its heading; nothing without content."""
    inside = "\n".join(piece for piece in content if piece)
    if not inside:
        return ""
    label = f'aria-labelledby="{name}-heading"'
    return (
        f'<section id="{name}" {label}>\n<h2 id="{name}-heading">{text(heading)}</h2>\n'
        f"{inside}\n</section>"
    )


def bullets(lines: Iterable[str], marks: Sequence[str | None] = ()) -> str:
    """Return lines as a list, nothing if there are none; marks as of `table`."""
    items = "\n".join(
        f"<li>{marked(line, marks[k] if k < len(marks) else None)}</li>"
        for k, line in enumerate(lines)
    )
    if not items:
        return ""
    return f"<ul>\n{items}\n</ul>{_cut_on_paper(items.count('<li>'))}"


def marked(content: object, mark: str | None) -> str:
    """Return text, as a button if it leads to a place in the viewer."""
    if mark is None:
        return text(content)
    return f'<button type="button" data-mark="{text(mark)}">{text(content)}</button>'


def table(
    caption: str,
    heads: Sequence[str],
    rows: Sequence[Sequence[object]],
    marks: Sequence[str | None] = (),
    kind: str = "",
) -> str:
    """Return a table; the first column heads its rows. Nothing without rows.

    Args:
        caption: What it shows.
        heads: Of its columns.
        rows: Its cells.
        marks: The place that each row leads to in the viewer, None for none.
        kind: Class for the style.
    """
    if not rows:
        return ""
    lines = []
    for k, row in enumerate(rows):
        first = marked(row[0], marks[k] if k < len(marks) else None)
        cells = "".join(f"<td>{text(cell)}</td>" for cell in row[1:])
        lines.append(f'<tr><th scope="row">{first}</th>{cells}</tr>')
    head = "".join(f'<th scope="col">{text(one)}</th>' for one in heads)
    body = "\n".join(lines)
    return (
        f'<div class="scroll"><table class="{kind}"><caption>{text(caption)}</caption>'
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table>"
        f"{_cut_on_paper(len(rows))}</div>"
    )


def bars(
    caption: str, starts: Sequence[float], step: float, values: Sequence[float], unit: str
) -> str:
    """Return a bar chart as SVG: values over bins that begin at places, a step wide."""
    most = max(values) or 1.0
    width = 100.0 / len(values)
    shapes = "".join(
        f'<rect x="{k * width:.2f}" y="{40.0 - 40.0 * value / most:.2f}" width="{0.86 * width:.2f}"'
        f' height="{40.0 * value / most:.2f}"><title>{start:g} to {start + step:g}: {value:.2f} '
        f"{text(unit)}</title></rect>"
        for k, (start, value) in enumerate(zip(starts, values, strict=True))
    )
    label = f"{caption}; most is {most:.2f} {unit}"
    ends = f"<span>{starts[0]:g}</span><span>t</span><span>{starts[-1] + step:g}</span>"
    return (
        f'<figure class="bars"><figcaption>{text(label)}</figcaption><svg viewBox="0 0 100 40" '
        f'preserveAspectRatio="none" role="img" aria-label="{text(label)}">{shapes}</svg>'
        f'<div class="ends">{ends}</div></figure>'
    )
