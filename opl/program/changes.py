"""How two programs differ, for people: what changed everywhere in one line, then move by move.

A language gives what a program says as a list of `Line`, in order: moves with their targets in
degrees and millimetres and their settings, and everything else as a text that does not change with
spaces, dates, comments, labels and zeros at the end of a number. Here the two lists are laid side
by side.
"""

from __future__ import annotations

import difflib
from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count, takewhile

import numpy as np

# Most values of a setting that get a line each when they changed alike wherever they stood.
_MOST_VALUES = 3
# Digits that are shown of a coordinate, and as many as decide whether two shifts are the same.
_DIGITS = 3


@dataclass(frozen=True)
class Coordinate:
    """One number of where a move leads.

    Attributes:
        name: The joint, or x, y, z, rx, ry, rz.
        value: In `unit`.
        unit: ``deg``, ``mm`` or ``pulses``.
    """

    name: str
    value: float
    unit: str


@dataclass(frozen=True)
class Line:
    """One thing that a program says.

    Attributes:
        place: Line number, "" for what has none.
        text: Its whole meaning: two programs do the same if these are the same in order.
        target: Where it leads, if it is a move.
        settings: What else a person would look for in it, by name: speed, corner, tool.
    """

    place: str
    text: str
    target: tuple[Coordinate, ...] = ()
    settings: tuple[tuple[str, str], ...] = ()

    @property
    def moves(self) -> bool:
        """Whether it is a move or a position."""
        return bool(self.target)

    @property
    def shown(self) -> str:
        """The same for people."""
        if not self.moves:
            return self.text
        numbers = " ".join(f"{c.name} {c.value:.{_DIGITS}f}" for c in self.target)
        return " ".join([*(f"{name} {value}" for name, value in self.settings), "to", numbers])


_Pair = tuple[Line, Line]
_Row = tuple[Line | None, Line | None]


def changed_lines(before: Sequence[Line], after: Sequence[Line]) -> list[str]:
    """Return how two programs differ, one line each; empty if they do the same.

    Args:
        before: What the first says.
        after: What the second says.
    """
    rows = list(_side_by_side(before, after))
    if all(a is not None and b is not None and a.text == b.text for a, b in rows):
        return []
    pairs = [(a, b) for a, b in rows if a is not None and b is not None and a.moves and b.moves]
    in_all, everywhere = _everywhere(pairs)
    table, others = [], []
    number = count(1)
    for a, b in rows:
        moves = (a or b) is not None and (a.moves if a is not None else b is not None and b.moves)
        index = next(number) if a is not None and a.moves else None
        if not moves:
            others.append((a, b))
        elif a is None or b is None or a.text != b.text:
            what = _what(a, b, everywhere)
            if what:
                table.append((index, a, b, what))
    return [
        *_summary(before, after, rows, pairs),
        *in_all,
        *_rows(table),
        *_others(others),
    ]


def _side_by_side(before: Sequence[Line], after: Sequence[Line], level: int = 0) -> Iterator[_Row]:
    """Give what belongs together, in order: at first what is the same, then what is alike."""
    if level == len(_LIKENESS):
        yield from ((a, None) for a in before)
        yield from ((None, b) for b in after)
        return
    first, second = ([_LIKENESS[level](one) for one in some] for some in (before, after))
    if first == second:  # matching blocks of equal keys would be slow to find
        yield from zip(before, after, strict=True)
        return
    # no line is too common to matter: autojunk would skip them
    matcher = difflib.SequenceMatcher(None, first, second, autojunk=False)
    for tag, a, b, c, d in matcher.get_opcodes():
        if tag == "equal":
            yield from zip(before[a:b], after[c:d], strict=True)
        else:
            yield from _side_by_side(before[a:b], after[c:d], level + 1)


# In what two things are alike, strictest first.
_LIKENESS: tuple[Callable[[Line], Hashable], ...] = (
    lambda one: one.text,
    lambda one: one.target or one.text,
    lambda one: tuple(c.name for c in one.target) or one.text.partition(" ")[0],
)


def _summary(
    before: Sequence[Line],
    after: Sequence[Line],
    rows: Sequence[_Row],
    pairs: Sequence[_Pair],
) -> Iterator[str]:
    had, has = (sum(one.moves for one in some) for some in (before, after))
    changed = sum(a.text != b.text for a, b in pairs)
    moves = f"{had} moves" if had == has else f"{had} moves against {has}"
    parts = [f"{changed} differ"]
    parts += [f"{had - len(pairs)} only in the first"] if had > len(pairs) else []
    parts += [f"{has - len(pairs)} only in the second"] if has > len(pairs) else []
    yield f"{moves}: {', '.join(parts)}"
    others = sum(
        a is None or b is None or a.text != b.text
        for a, b in rows
        if not any(one is not None and one.moves for one in (a, b))
    )
    if others:
        yield f"{others} other {'line differs' if others == 1 else 'lines differ'}"


def _everywhere(pairs: Sequence[_Pair]) -> tuple[list[str], set[str]]:
    """Return what changed alike wherever it stood, in words, and the names that need no table."""
    lines, done = [], set()
    if len(pairs) < 2:
        return [], set()
    for name in dict.fromkeys(name for a, _ in pairs for name, _ in a.settings):
        values = [(dict(a.settings).get(name), dict(b.settings).get(name)) for a, b in pairs]
        found = list(_values_everywhere(name, values))
        if found:
            lines += found
            done.add(name)
    for name in dict.fromkeys(c.name for a, _ in pairs for c in a.target):
        shifts = [_shift(a, b, name) for a, b in pairs]
        known = [shift for shift in shifts if shift is not None]
        if len(known) > 1 and np.ptp([shift.value for shift in known]) < 0.5 * 10**-_DIGITS:
            mean = float(np.mean([shift.value for shift in known]))
            if abs(mean) >= 0.5 * 10**-_DIGITS:
                lines.append(f"every {name}: {mean:+.{_DIGITS}f} {known[0].unit}")
                done.add(name)
    return lines, done


def _values_everywhere(name: str, values: Sequence[tuple[str | None, str | None]]) -> Iterator[str]:
    """Give the lines for a setting that changed by one rule, none if it did not."""
    becomes = defaultdict(set)
    for old, new in values:
        becomes[old].add(new)
    changed = {old for old, new in becomes.items() if new != {old}}
    if not changed:
        return
    times = Counter(old for old, _ in values)
    alike = all(len(becomes[old]) == 1 and times[old] > 1 for old in changed)
    if alike and len(changed) <= _MOST_VALUES:
        for old in sorted(changed, key=str):
            (new,) = becomes[old]
            yield f"every {name} {old or 'none'} is {new or 'none'} now ({times[old]} moves)"
        return
    try:
        old_new = np.array([(float(old or ""), float(new or "")) for old, new in values])
    except ValueError:
        return
    first, second = old_new.T
    half = 0.5 * 10.0 ** -max(len((new or "").partition(".")[2]) for _, new in values)
    if (first <= half).any():
        return
    low, high = ((second - half) / first).max(), ((second + half) / first).min()
    # the roundest factor that gives all of the second from the first
    for digits in range(1, 5):
        factor = round(0.5 * (low + high), digits)
        if low - 1e-9 <= factor <= high + 1e-9:
            yield f"every {name} is {factor:g} times as much ({len(values)} moves)"
            return


def _what(a: Line | None, b: Line | None, everywhere: set[str]) -> str:
    """Say in what two moves differ that did not change everywhere, or which one is not there."""
    if a is None or b is None:
        only = a or b
        assert only is not None
        return f"only in the {'first' if b is None else 'second'}: {only.shown}"
    parts = []
    for name in dict.fromkeys([c.name for c in a.target + b.target]):
        shift = _shift(a, b, name)
        if shift is None:
            parts.append(f"{name} in one only")
        elif shift.value and name not in everywhere:
            old, new = (next(c.value for c in one.target if c.name == name) for one in (a, b))
            digits = _digits(shift.value)
            parts.append(f"{name} {old:.{digits}f} -> {new:.{digits}f} {shift.unit}")
    first, second = dict(a.settings), dict(b.settings)
    different = [
        name for name in dict.fromkeys([*first, *second]) if first.get(name) != second.get(name)
    ]
    parts += [
        f"{name} {first.get(name, 'none')} -> {second.get(name, 'none')}"
        for name in different
        if name not in everywhere
    ]
    if not parts and not different and a.target == b.target:
        parts.append(f"{a.text} -> {b.text}")
    return ", ".join(parts)


def _shift(a: Line, b: Line, name: str) -> Coordinate | None:
    """Return how far a coordinate moved, None where one of the moves has none in that unit."""
    old = next((c for c in a.target if c.name == name), None)
    new = next((c for c in b.target if c.name == name), None)
    if old is None or new is None or old.unit != new.unit:
        return None
    return Coordinate(name, new.value - old.value, old.unit)


def _digits(shift: float) -> int:
    """Return how many digits it takes to see a shift."""
    finer = takewhile(lambda digits: abs(shift) < 0.5 * 10.0**-digits, range(_DIGITS, 9))
    return _DIGITS + sum(1 for _ in finer)


def _rows(
    table: Sequence[tuple[int | None, Line | None, Line | None, str]],
) -> Iterator[str]:
    if not table:
        return
    yield ""
    yield "move   lines          what differs"
    for index, a, b, what in table:
        lines = f"{a.place if a else '-'} / {b.place if b else '-'}"
        yield f"{index or '-':>4}   {lines:13}  {what}"


def _others(rows: Sequence[_Row]) -> Iterator[str]:
    """Give what differs besides the moves; what changed in the same way is told once."""
    groups: dict[tuple[str | None, str | None], list[_Row]] = {}
    for a, b in rows:
        key = (a.text if a else None, b.text if b else None)
        if key[0] != key[1]:
            groups.setdefault(key, []).append((a, b))
    if groups:
        yield ""
    for same in groups.values():
        times = f", {len(same)} times" if len(same) > 1 else ""
        for mark, one in zip("-+", same[0], strict=True):
            if one is not None:
                place = f" line {one.place}" if one.place else ""
                yield f"{mark}{place}{times}: {one.text}"
