"""The frame of the view in three dimensions: canvas, what it says, and its controls."""

from __future__ import annotations

from collections.abc import Iterable

from opl.report.html import section, text

VIEWS = {
    "cell": "whole cell",
    "contact": "contact",
    "axle": "along the axle",
    "top": "from above",
    "part": "oblique",
    "side": "from beside",
}
PAINTS = {
    "none": "nothing",
    "t": "contact position",
    "clearance": "clearance",
    "feed": "feed",
    "ridge": "ridge height",
    "pass": "pass",
}
BOXES = {
    "section": ("section through the wheel", False),
    "line": ("line to the nearest pair", True),
    "frames": ("frames", False),
    "robot": ("robot", True),
    "surroundings": ("surroundings", True),
}


def view_frame(
    heading: str, views: Iterable[str], paints: Iterable[str], boxes: Iterable[str], moving: bool
) -> str:
    """Return the view's frame.

    Args:
        heading: Of its section.
        views: From where it can be looked at.
        paints: What the passes can be coloured by, as they are at first before all others.
        boxes: What can be shown or left out; what is not named has no box.
        moving: Whether there is a motion to play.
    """
    wanted = set(boxes)
    ticks = "".join(
        f"<label{'' if name in wanted else ' hidden'}>"
        f'<input type="checkbox" id="{name}"{" checked" if on else ""}> {label}</label>'
        for name, (label, on) in BOXES.items()
    )
    painted = {name: PAINTS[name] for name in paints}
    return section(
        "cell",
        heading,
        '<canvas id="view" tabindex="0" role="img" aria-label="the cell in three dimensions; drag '
        'or use the arrow keys to look around; what it shows is said below"></canvas>',
        '<p id="posture" role="status"></p><p id="angles" class="mono"></p>',
        f"""<div class="controls"{"" if moving else " hidden"}>
<button type="button" id="play">play</button>
<input type="range" id="time" min="0" max="1" step="any" value="0" aria-label="time">
<output id="clock"></output>
<label>speed <input type="range" id="speed" min="0" max="6" step="1" value="2">
<output id="speed-text">1 x</output></label></div>""",
        f'<div class="controls">{choice("look", "view", {name: VIEWS[name] for name in views})}'
        f"{ticks}{choice('paint', 'colour of the passes', painted)}"
        '<span id="scale" hidden><output id="scale-low"></output><i></i>'
        '<output id="scale-high"></output></span>'
        '<button type="button" id="save">save as glTF</button>'
        '<button type="button" id="picture">save as PNG</button></div>',
    )


def hover() -> str:
    """Return where the script says what the pointer is on."""
    return '<p class="status" id="hover" aria-live="polite">&nbsp;</p>'


def choice(name: str, label: str, options: dict[str, str]) -> str:
    """Return a choice of one of some options, hidden where there is nothing to choose."""
    inside = "".join(
        f'<option value="{key}">{text(title)}</option>' for key, title in options.items()
    )
    hidden = " hidden" if len(options) < 2 else ""
    return f'<label{hidden}>{label} <select id="{name}">{inside}</select></label>'
