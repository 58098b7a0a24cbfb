"""Kinds of faults that are put into written programs: what each does to a program of any language.

A kind is a function of a `Case`; it returns the text with the fault, or None where its language, or
the program, has no place for it. Kinds marked harmless do not change what a robot does, or make
another right program: they must be proven.
"""

import re
from dataclasses import dataclass, field
from itertools import pairwise

from tests.attacks.scripts import LANGUAGES, Script

KINDS = {}


@dataclass(frozen=True)
class Kind:
    """A kind of fault: its name, where the table shows it, whether it does no harm."""

    name: str
    group: str
    apply: object
    harmless: bool = False


def kind(group, name, harmless=False):
    def register(apply):
        assert name not in KINDS, name
        KINDS[name] = Kind(name, group, apply, harmless)
        return apply

    return register


@dataclass
class Case:
    """A program to be tampered with, and where in it is what."""

    controller: str
    text: str
    labels: list  # kind of each move, by its name
    passes: list  # pass of each move
    language: object = None
    script: Script = None
    on_wheel: list = field(default_factory=list)

    def __post_init__(self):
        self.language = LANGUAGES[self.controller]
        self.script = self.language.parse(self.text)
        wheel = ("GRIND", "BETWEEN")
        self.on_wheel = [k for k, one in enumerate(self.labels) if one in wheel]

    def first_of(self, label, after=0):
        """Return the first move of a kind from a place on, None if there is none."""
        return next((k for k, one in enumerate(self.labels) if one == label and k >= after), None)

    def last_of_first(self, label):
        """Return the last move of the first run of a kind."""
        k = self.first_of(label)
        while k + 1 < len(self.labels) and self.labels[k + 1] == label:
            k += 1
        return k

    @property
    def middle(self):
        """A move in the middle of the first pass, amid others on the wheel; to a cutter point."""
        own = [k for k in self.on_wheel if self.passes[k] == self.passes[self.on_wheel[0]]]
        inner = [k for k in own[2:-1] if self.labels[k] == "GRIND"] or own[2:-1]
        return inner[len(inner) // 2]

    @property
    def pass_of(self):
        """The moves on the wheel of the first pass, first and last index."""
        own = [k for k in self.on_wheel if self.passes[k] == self.passes[self.on_wheel[0]]]
        return own[0], own[-1]

    def render(self, script):
        return self.language.render(script)

    def word(self, name):
        return self.language.words[name]

    def events(self):
        """Return where lines behind moves do something: numbers of move, piece and line."""
        found = []
        for k, move in enumerate(self.script.moves):
            for j, lines in enumerate(move.lines):
                found += [(k, j, n) for n, line in enumerate(split(lines)) if says(line)]
        return found


def split(piece):
    """Return the lines of a piece of text, with their ends."""
    return re.findall(r"[^\n]*\n|[^\n]+", piece)


def says(line):
    """Whether a line is more than a remark; the first sign of a remark differs by language."""
    bare = line.strip()
    return bool(bare) and bare[0] not in "'!;#" and not bare.startswith("BAS(")


# targets

SIZES = {"a last digit": None, "0.02 deg": 0.02, "0.1 deg": 0.1, "0.5 deg": 0.5, "5 deg": 5.0}


def _turned(case, k, axis, degrees):
    script = case.script.copy()
    target = script.moves[k].target
    if degrees is None:
        number = target[axis]
        digit = 10.0 ** -len(number.partition(".")[2])
        decimals = len(number.partition(".")[2])
        target[axis] = f"{float(number) + digit:.{decimals}f}"
    else:
        target[axis] = case.language.degrees(target[axis], degrees, axis)
    return case.render(script)


for _size, _degrees in SIZES.items():
    for _axis in range(6):
        kind("target", f"axis {_axis + 1} of a ground point off by {_size}")(
            lambda case, axis=_axis, degrees=_degrees: _turned(case, case.middle, axis, degrees)
        )
for _axis in (0, 3, 5):
    kind("target", f"axis {_axis + 1} of an approach off by 1 deg")(
        lambda case, axis=_axis: _turned(case, case.first_of("APPROACH"), axis, 1.0)
    )
    kind("target", f"axis {_axis + 1} of a retract off by 1 deg")(
        lambda case, axis=_axis: _turned(case, case.first_of("RETRACT"), axis, 1.0)
    )


@kind("target", "a full turn of the last axis at a ground point")
def _(case):
    return _turned(case, case.middle, 5, 360.0)


@kind("target", "the wrist folded over at a ground point")
def _(case):
    script, k = case.script.copy(), case.middle
    numbers = script.moves[k].target
    turn = 180.0 if float(numbers[3]) < 0.0 else -180.0
    numbers[3] = case.language.degrees(numbers[3], turn, 3)
    numbers[4] = numbers[4][1:] if numbers[4].startswith("-") else "-" + numbers[4]
    return case.render(script)


@kind("target", "the sign of an angle of a ground point lost")
def _(case):
    script, k = case.script.copy(), case.middle
    axis = next((a for a in range(6) if script.moves[k].target[a].startswith("-")), None)
    if axis is None:
        return None
    script.moves[k].target[axis] = script.moves[k].target[axis][1:]
    return case.render(script)


@kind("target", "a digit of a target lost")
def _(case):
    script, k = case.script.copy(), case.middle
    number = max(script.moves[k].target, key=len)
    axis = script.moves[k].target.index(number)
    at = 1 if number.startswith("-") else 0
    script.moves[k].target[axis] = number[:at] + number[at + 1 :]
    return case.render(script)


@kind("target", "a target is not a number")
def _(case):
    script = case.script.copy()
    script.moves[case.middle].target[2] = "NAN"
    return case.render(script)


@kind("target", "all targets of a pass shifted by 0.1 deg about axis 1")
def _(case):
    script, (first, last) = case.script.copy(), case.pass_of
    for move in script.moves[first : last + 1]:
        move.target[0] = case.language.degrees(move.target[0], 0.1, 0)
    return case.render(script)


@kind("target", "the whole program shifted by 0.1 deg about axis 1")
def _(case):
    script = case.script.copy()
    for move in script.moves:
        move.target[0] = case.language.degrees(move.target[0], 0.1, 0)
    return case.render(script)


for _percent in (0.01, 0.02, 0.05, 0.1, 1.0):
    for _axis in range(6):

        @kind("ratio", f"the ratio of axis {_axis + 1} wrong by {_percent:g} %")
        def _(case, axis=_axis, factor=1.0 + 0.01 * _percent):
            # a controller that counts so many more to a turn: all numbers of the axis are so larger
            script = case.script.copy()
            if any(move.word == "LIN" for move in script.moves):
                return None  # its controller makes joint angles of poses
            for move in script.moves:
                number = move.target[axis]
                decimals = len(number.partition(".")[2])
                move.target[axis] = f"{float(number) * factor:.{decimals}f}"
            return case.render(script)


for _name, _place in (("start", 0), ("end", -1)):

    @kind("target", f"the {_name} 1 deg from home")
    def _(case, place=_place):
        return _turned(case, place % len(case.script.moves), 0, 1.0)

    @kind("target", f"the {_name} 0.1 deg from home")
    def _(case, place=_place):
        return _turned(case, place % len(case.script.moves), 4, 0.1)


# order


def _rearranged(case, order):
    script = case.script.copy()
    script.moves = [script.copy().moves[k] for k in order]
    return case.render(script)


@kind("order", "two ground points exchanged")
def _(case):
    script, k = case.script.copy(), case.middle
    one, other = script.moves[k], script.moves[k + 1]
    one.target, other.target = other.target, one.target
    return case.render(script)


@kind("order", "a ground point replaced by the one before it")
def _(case):
    script, k = case.script.copy(), case.middle
    script.moves[k].target = list(script.moves[k - 1].target)
    return case.render(script)


@kind("order", "a ground point left out")
def _(case):
    n = len(case.script.moves)
    return _rearranged(case, [k for k in range(n) if k != case.middle])


@kind("order", "five moves left out")
def _(case):
    n, m = len(case.script.moves), case.middle
    return _rearranged(case, [k for k in range(n) if not m - 2 <= k <= m + 2])


@kind("order", "a stretch ground twice")
def _(case):
    n, m = len(case.script.moves), case.middle
    return _rearranged(case, [*range(m + 3), *range(m - 2, n)])


@kind("order", "back and forth over a stretch")
def _(case):
    n, m = len(case.script.moves), case.middle
    return _rearranged(case, [*range(m + 1), *range(m - 1, m - 4, -1), *range(m - 2, n)])


@kind("order", "a pass ground backwards")
def _(case):
    script, (first, last) = case.script.copy(), case.pass_of
    targets = [move.target for move in script.moves[first : last + 1]]
    for move, target in zip(script.moves[first : last + 1], targets[::-1], strict=True):
        move.target = target
    return case.render(script)


@kind("order", "the last pass left out")
def _(case):
    n = len(case.script.moves)
    own = [k for k in case.on_wheel if case.passes[k] == case.passes[case.on_wheel[-1]]]
    return _rearranged(case, [k for k in range(n) if not own[0] - 3 <= k < n - 1])


@kind("order", "the end of a pass left out")
def _(case):
    n, last = len(case.script.moves), case.pass_of[1]
    return _rearranged(case, [k for k in range(n) if not last - 2 <= k <= last])


@kind("order", "the beginning of a pass left out")
def _(case):
    n, first = len(case.script.moves), case.pass_of[0]
    return _rearranged(case, [k for k in range(n) if not first <= k <= first + 2])


@kind("order", "onto the wheel without approach")
def _(case):
    n = len(case.script.moves)
    gone = [k for k, label in enumerate(case.labels) if label == "APPROACH"]
    before = {min(gone) - 1, *gone} if gone else None
    return before and _rearranged(case, [k for k in range(n) if k not in before])


@kind("order", "off the wheel without retract")
def _(case):
    n = len(case.script.moves)
    gone = {k for k, label in enumerate(case.labels) if label == "RETRACT"}
    return gone and _rearranged(case, [k for k in range(n) if k not in gone])


@kind("order", "no way home")
def _(case):
    return _rearranged(case, range(len(case.script.moves) - 1))


@kind("order", "no start at home")
def _(case):
    return _rearranged(case, range(1, len(case.script.moves)))


@kind("order", "the wheel visited on a free move")
def _(case):
    script, link = case.script.copy(), case.first_of("LINK")
    if link is None:
        return None
    extra = script.copy().moves[link]
    extra.target, extra.lines = list(script.moves[case.middle].target), []
    script.moves.insert(link, extra)
    return case.render(script)


@kind("order", "the whole program twice")
def _(case):
    n = len(case.script.moves)
    script = case.script.copy()
    script.moves = [*script.moves, *script.copy().moves[1:n]]
    return case.render(script)


@kind("order", "a straight move on the wheel instead of a joint move")
def _(case):
    return _straight(case, case.middle)


@kind("order", "a straight move from home instead of a joint move")
def _(case):
    return _straight(case, 1)


def _straight(case, k):
    if case.language.straight is None:
        return None
    script = case.script.copy()
    script.moves[k].word = case.language.straight
    return case.render(script)


# speeds

_NUMBER = re.compile(r"[0-9]+(?:\.[0-9]+)?(?=$|msec|%)")


def faster(case, speed, factor):
    """Return the text of a speed so many times faster."""
    found = _NUMBER.search(speed)
    time = case.language.seconds and ("T:=" in speed or "msec" in speed or speed.startswith("t="))
    decimals = len(found[0].partition(".")[2])
    value = float(found[0]) / factor if time else float(found[0]) * factor
    return speed[: found.start()] + f"{value:.{decimals}f}" + speed[found.end() :]


def _at_speed(case, moves, factor):
    script = case.script.copy()
    before = [script.moves[k].speed for k in moves]
    for k in moves:
        script.moves[k].speed = faster(case, script.moves[k].speed, factor)
    return None if before == [script.moves[k].speed for k in moves] else case.render(script)


for _factor in (10.0, 5.0, 2.0, 1.5, 1.2, 1.02, 0.8, 0.5, 0.2, 0.05):
    kind("speed", f"a move on the wheel at {_factor:g} times its speed")(
        lambda case, factor=_factor: _at_speed(case, [case.middle], factor)
    )
for _factor in (2.0, 1.1, 1.05, 1.01, 0.95, 0.5):
    kind("speed", f"a pass at {_factor:g} times its speed")(
        lambda case, factor=_factor: _at_speed(
            case, range(case.pass_of[0] + 1, case.pass_of[1] + 1), factor
        )
    )
for _name, _label in (("an approach", "APPROACH"), ("a retract", "RETRACT"), ("a link", "LINK")):
    kind("speed", f"{_name} at 2 times its speed")(
        lambda case, label=_label: _at_speed(case, [case.first_of(label)], 2.0)
    )
    kind("speed", f"{_name} at 0.2 times its speed")(
        lambda case, label=_label: _at_speed(case, [case.first_of(label)], 0.2)
    )


@kind("speed", "a fast first move")
def _(case):
    return _at_speed(case, [0], 10.0)


@kind("speed", "the last move at 3 times its speed")
def _(case):
    return _at_speed(case, [len(case.script.moves) - 1], 3.0)


@kind("speed", "a move without a speed")
def _(case):
    script = case.script.copy()
    script.moves[case.middle].speed = "v1000" if case.controller == "RAPID" else ""
    return None if case.controller in ("KRL", "FANUC") else case.render(script)


@kind("speed", "a speed of nothing")
def _(case):
    return _at_speed(case, [case.middle], 0.0 if not case.language.seconds else 1e9)


# corners


def _cornered(case, k, which):
    if k is None:
        return None
    script, corner = case.script.copy(), case.language.corners[which]
    if script.moves[k].corner == corner:
        return None
    script.moves[k].corner = corner
    return case.render(script)


kind("corner", "a wide corner on the wheel")(lambda case: _cornered(case, case.middle, 2))
kind("corner", "a stop on the wheel")(lambda case: _cornered(case, case.middle, 0))
kind("corner", "no stop at the end of a retract")(
    lambda case: _cornered(case, case.last_of_first("RETRACT"), 1)
)
kind("corner", "no stop before an approach")(
    lambda case: _cornered(case, case.first_of("APPROACH") - 1, 1)
)
kind("corner", "no stop at home")(lambda case: _cornered(case, len(case.script.moves) - 1, 1))
kind("corner", "no stop where the robot starts")(lambda case: _cornered(case, 0, 2))
kind("corner", "a wide corner on an approach")(
    lambda case: _cornered(case, case.first_of("APPROACH"), 2)
)


@kind("corner", "a move without a corner")
def _(case):
    script = case.script.copy()
    script.moves[case.middle].corner = ""
    return case.render(script) if case.controller == "DX200" else None


for _tag in ("ACC=20", "DEC=20"):

    @kind("corner", f"a move with {_tag}")
    def _(case, tag=_tag):
        script = case.script.copy()
        script.moves[case.middle].more = f" {tag}"
        return case.render(script) if case.controller == "DX200" else None


# events

PLACES = {
    "on the wheel": lambda case: case.middle,
    "at the end of a pass": lambda case: case.pass_of[1],
    "on an approach": lambda case: case.first_of("APPROACH"),
    "on a retract": lambda case: case.first_of("RETRACT"),
    "on a link": lambda case: case.first_of("LINK"),
    "at home, at the start": lambda case: 0,
    "at home, at the end": lambda case: len(case.script.moves) - 1,
}


def _with_line(case, k, word, before=False):
    if k is None:
        return None
    end = {"DX200": "\r\n", "FANUC": "\r\n", "URSCRIPT": "\n"}.get(case.controller, "\r\n")
    script, lines = case.script.copy(), case.word(word).split("\r\n")
    lines = [part for line in lines for part in line.split("\n")]
    if case.controller not in ("DX200", "FANUC"):
        lines = [line + end for line in lines]
    own = script.moves[k].lines
    own[:] = [*lines, *own] if before else [*own, *lines]
    return case.render(script)


for _word in LANGUAGES["DX200"].words:
    if _word != "remark":
        kind("event", f"{_word} added on the wheel")(
            lambda case, word=_word: _with_line(case, case.middle, word)
        )
for _place, _where in PLACES.items():
    for _word in ("output on", "another output", "dwell", "wait", "pause", "known call"):
        if _place != "on the wheel":
            kind("event", f"{_word} added {_place}")(
                lambda case, word=_word, where=_where: _with_line(case, where(case), word)
            )


def _event_changed(case, change):
    """Return the program with one event changed: the first that the change changes."""
    for k, j, n in case.events():
        script = case.script.copy()
        lines = split(script.moves[k].lines[j])
        changed = change(lines[n])
        if changed is not None and changed != lines[n]:
            lines[n] = changed
            script.moves[k].lines[j] = "".join(lines)
            return case.render(script)
    return None


def _event_lines(case, pick, change):
    """Return the program with one of its events changed; `pick` chooses it by its number."""
    places = case.events()
    k, j, n = places[pick(len(places))]
    script = case.script.copy()
    lines = split(script.moves[k].lines[j])
    lines[n : n + 1] = change(lines[n])
    script.moves[k].lines[j : j + 1] = lines
    return case.render(script)


for _share in range(8):

    def _pick(count, share=_share):
        return (count - 1) * share // 7

    kind("event", f"event {_share + 1} of 8 left out")(
        lambda case, pick=_pick: _event_lines(case, pick, lambda line: [])
    )
    kind("event", f"event {_share + 1} of 8 twice")(
        lambda case, pick=_pick: _event_lines(case, pick, lambda line: [line, line])
    )

_INVERTED = (("ON", "OFF"), ("TRUE", "FALSE"), ("True", "False"), (", 1", ", 0"))


def _inverted(line):
    if not re.search(r"DOUT|SetDO|\$OUT|DO\[|set_standard", line):
        return None
    for one, other in _INVERTED:
        for a, b in ((one, other), (other, one)):
            if re.search(rf"{re.escape(a)}\b", line):
                return re.sub(rf"{re.escape(a)}\b", b, line)
    return None


@kind("event", "an output inverted")
def _(case):
    return _event_changed(case, _inverted)


@kind("event", "all outputs inverted")
def _(case):
    script = case.script.copy()
    for move in script.moves:
        move.lines = [
            "".join(_inverted(one) or one for one in split(piece)) for piece in move.lines
        ]
    return case.render(script)


@kind("event", "another number of an output")
def _(case):
    return _event_changed(
        case, lambda line: line.replace("12", "13") if re.search(r"DO|OUT|out", line) else None
    )


@kind("event", "another number of an input")
def _(case):
    pattern = r"(IN#\(|di|IN\[|DI\[|digital_in\()4\b"
    return _event_changed(case, lambda line: re.sub(pattern, r"\g<1>6", line))


@kind("event", "a wait for the other state")
def _(case):
    def change(line):
        if not re.search(r"WAIT IN|WaitDI|WAIT FOR \$|WAIT DI|while get", line):
            return None
        return re.sub(
            r"\b(ON|OFF|TRUE|FALSE|True|False|1|0)(?=;|\)|:|\b)(?!.*\b(ON|OFF|TRUE|FALSE|True|False)\b)",
            lambda m: {"ON": "OFF", "OFF": "ON", "TRUE": "FALSE", "FALSE": "TRUE", "True": "False",
                       "False": "True", "1": "0", "0": "1"}[m[1]],
            line, count=1,
        )  # fmt: skip

    return _event_changed(case, change)


@kind("event", "a longer time-out")
def _(case):
    pattern = r"2\.50|250\b|2500\b|1\.50|150\b|1500\b"
    return _event_changed(case, lambda line: re.sub(pattern, "99", line))


@kind("event", "a longer dwell")
def _(case):
    return _event_changed(case, lambda line: line.replace("0.50", "60.00"))


@kind("event", "a shorter dwell")
def _(case):
    return _event_changed(case, lambda line: line.replace("0.50", "0.49"))


@kind("event", "another program called")
def _(case):
    return _event_changed(case, lambda line: line.replace("PARK", "PARL"))


@kind("event", "two events exchanged")
def _(case):
    script = case.script.copy()
    places = case.events()
    for (k, j, n), (k2, j2, m) in pairwise(places):
        if k != k2:
            continue
        lines = script.moves[k].lines
        one = split(lines[j])[n]
        other = split(lines[j2])[m]
        if one.strip() == other.strip():
            continue
        if j == j2:
            parts = split(lines[j])
            parts[n], parts[m] = parts[m], parts[n]
            lines[j] = "".join(parts)
        else:
            lines[j], lines[j2] = lines[j2], lines[j]
        return case.render(script)
    return None


@kind("event", "an event one move too late")
def _(case):
    script = case.script.copy()
    k, j, n = case.events()[-3]
    lines = split(script.moves[k].lines[j])
    moved = lines.pop(n)
    script.moves[k].lines[j] = "".join(lines)
    if k + 1 >= len(script.moves):
        k -= 2
    script.moves[k + 1].lines.insert(0, moved)
    return case.render(script)


@kind("event", "an event one move too early")
def _(case):
    script = case.script.copy()
    k, j, n = next(place for place in case.events() if place[0] > 1)
    lines = split(script.moves[k].lines[j])
    moved = lines.pop(n)
    script.moves[k].lines[j] = "".join(lines)
    script.moves[k - 1].lines.append(moved)
    return case.render(script)


@kind("event", "all events left out")
def _(case):
    script = case.script.copy()
    for move in script.moves:
        move.lines = ["".join(one for one in split(p) if not says(one)) for p in move.lines]
    return case.render(script)


# what stands around the moves

HEADS = {
    "another name": {
        "DX200": ("//NAME ", "//NAME X"), "RAPID": ("PROC ", "PROC X"), "KRL": ("DEF ", "DEF X"),
        "FANUC": ("/PROG  ", "/PROG  X"), "URSCRIPT": ("def ", "def X"),
    },
    "another tool": {
        "DX200": ("///TOOL 0", "///TOOL 2"), "RAPID": ("tool0;", "tool2;"),
        "KRL": ("$TOOL = $NULLFRAME", "$TOOL = TOOL_DATA[2]"),
        "FANUC": ("UTOOL_NUM=0", "UTOOL_NUM=2"),
        "URSCRIPT": ("set_tcp(p[0.000000", "set_tcp(p[0.100000"),
    },
    "another frame": {
        "DX200": ("///ATTR SC,RW\r\n", "///ATTR SC,RW,RJ\r\n////FRAME USER 3\r\n"),
        "KRL": ("$BASE = $NULLFRAME", "$BASE = BASE_DATA[3]"),
        "FANUC": ("UFRAME_NUM=0", "UFRAME_NUM=3"),
    },
    "no group": {
        "DX200": ("///GROUP1 RB1\r\n", ""), "FANUC": ("DEFAULT_GROUP   = 1,*,*,*,*;\r\n", ""),
    },
    "another group": {
        "DX200": ("///GROUP1 RB1", "///GROUP1 RB2"), "FANUC": ("= 1,*,*,*,*", "= *,1,*,*,*"),
    },
    "a second group": {
        "DX200": ("///GROUP1 RB1", "///GROUP1 RB1,BS1"), "FANUC": ("= 1,*,*,*,*", "= 1,1,*,*,*"),
    },
    "a position variable": {"DX200": ("//INST", "P00001=0,0,0,0,0,0\r\n//INST")},
    "a wrong count of positions": {"DX200": ("///NPOS ", "///NPOS 1")},
    "a position that no move uses": {"DX200": ("//INST", "C09999=0,0,0,0,0,0\r\n//INST")},
    "a head line nobody knows": {
        "DX200": ("//INST", "///SPEEDY 3\r\n//INST"),
        "FANUC": ("CONTROL_CODE", "SPEEDY  = 3;\r\nCONTROL_CODE"),
        "RAPID": ("  VAR bool late", "  VAR num x := 3;\r\n  VAR bool late"),
        "KRL": ("BAS(#INITMOV", "DECL INT X\r\nBAS(#INITMOV"),
        "URSCRIPT": ("  set_tcp", "  x = 3\n  set_tcp"),
    },
    "a macro job": {"DX200": ("///ATTR SC,RW", "///ATTR SC,RW,MC")},
    "a concurrent job's attributes": {"DX200": ("///ATTR SC,RW", "///ATTR JD,RO")},
    "wide corners for all": {"KRL": ("$APO.CPTP = 1", "$APO.CPTP = 50")},
    "no start of the interpreter": {"KRL": ("BAS(#INITMOV, 0)\r\n", "")},
    "no base": {"KRL": ("$BASE = $NULLFRAME\r\n", "")},
    "configurations watched": {"RAPID": ("ConfL\\Off;", "ConfL\\On;")},
    "no variable for the time-out": {"RAPID": ("  VAR bool late := FALSE;\r\n", "")},
    "no tool": {"URSCRIPT": ("  set_tcp(", "  # set_tcp("), "FANUC": ("UTOOL_NUM=0", "!NONE")},
    "acceleration for all": {
        "KRL": ("BAS(#INITMOV, 0)", "BAS(#INITMOV, 0)\r\nBAS(#ACC_PTP, 20)"),
        "RAPID": ("ConfL\\Off;", "ConfL\\Off;\r\n    AccSet 20, 20;"),
    },
    "a load for all": {
        "URSCRIPT": ("  set_tcp", "  set_payload(9.0)\n  set_tcp"),
        "RAPID": ("ConfL\\Off;", "ConfL\\Off;\r\n    GripLoad load9;"),
        "KRL": ("$BASE", "$LOAD = LOAD_DATA[9]\r\n$BASE"),
        "FANUC": ("UTOOL_NUM", "PAYLOAD[9] ;\r\n   9:  UTOOL_NUM"),
    },
    "a program around it that never ends": {
        "DX200": ("NOP\r\n", "NOP\r\n*TOP\r\n"),
        "URSCRIPT": ("  set_tcp", "  while True:\n  set_tcp"),
        "KRL": ("BAS(#INITMOV", "LOOP\r\nBAS(#INITMOV"),
        "RAPID": ("    ConfL\\Off", "    WHILE TRUE DO\r\n    ConfL\\Off"),
    },
}  # fmt: skip

for _name, _changes in HEADS.items():

    @kind("around the moves", _name)
    def _(case, changes=_changes):
        if case.controller not in changes:
            return None
        old, new = changes[case.controller]
        if "APO.CPTP" in old and "C_PTP" not in case.text:
            return None  # no corner of the program is of that kind
        return case.text.replace(old, new, 1) if old in case.text else None


@kind("around the moves", "the tool of one position only")
def _(case):
    script, k = case.script.copy(), case.middle
    if case.controller == "RAPID":
        script.moves[k].tool = "tool2"
        return case.render(script)
    if case.controller == "FANUC":
        script.moves[k].tool = "2"
        return case.render(script)
    if case.controller == "DX200":
        label = f"C{k:05d}="
        return case.text.replace(label, f"///TOOL 2\r\n{label}", 1)
    return None


@kind("around the moves", "cut off half way")
def _(case):
    return case.text[: len(case.text) // 2]


@kind("around the moves", "the last line lost")
def _(case):
    return case.text.rstrip().rpartition("\n")[0] + "\n"


@kind("around the moves", "another program behind it")
def _(case):
    return case.text + case.text.replace("_SHAPE", "_OTHER")


@kind("around the moves", "a sign that is not ASCII")
def _(case):
    return case.text.replace("HOME", "H\u00d6ME", 1)


@kind("around the moves", "bare line feeds")
def _(case):
    return case.text.replace("\r\n", "\n") if case.controller == "DX200" else None


# what does no harm


@kind("no harm", "another remark", harmless=True)
def _(case):
    return case.text.replace("HOME", "AT HOME", 1)


@kind("no harm", "a remark added on the wheel", harmless=True)
def _(case):
    return _with_line(case, case.middle, "remark")


@kind("no harm", "another date", harmless=True)
def _(case):
    return re.sub(r"20(\d\d)([-/])(\d\d)", r"20\g<1>\g<2>01", case.text, count=1).replace(
        "DATE 26-", "DATE 25-"
    )


@kind("no harm", "a link at 0.8 times its speed", harmless=True)
def _(case):
    return _at_speed(case, [case.first_of("LINK")], 0.8)


@kind("no harm", "the program as it is, put together anew", harmless=True)
def _(case):
    return case.render(case.script)
