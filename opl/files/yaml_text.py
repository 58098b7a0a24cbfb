"""YAML 1.2 text as values, with limits; the one home of yaml.

The words of plain scalars are those of the core schema of YAML 1.2 and no others: ``yes``, ``on``,
``1:30``, ``1_000`` and dates are text, ``010`` is ten. Merges (``<<``) of YAML 1.1 are taken, since
hand-written files live by them. Nothing here calls itself: text of any depth ends in a refusal.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import yaml

MOST_DEPTH = 60
MOST_VALUES = 600_000  # with each alias counted as what it stands for
MOST_DIGITS = 64  # of a number
_TOO_DEEP = f"is nested more than {MOST_DEPTH} deep"

_BOOL = re.compile(r"true|True|TRUE|false|False|FALSE")
_NULL = re.compile(r"~|null|Null|NULL|")
_INT = re.compile(r"[-+]?[0-9]+")
_OTHER_INT = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"([-+]?)\.(inf|Inf|INF)")
_NAN = re.compile(r"\.(nan|NaN|NAN)")


class YamlError(Exception):
    """Text that is not YAML, or more of it than any file of a person."""


def load(text: str) -> Any:
    """Return the value of a YAML document, None if it is empty.

    Raises:
        YamlError: If it is not one document, or beyond the limits; the message names line and
            column.
    """
    builder = _Builder()
    try:
        for event in yaml.parse(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
            builder.take(event)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        found = [getattr(error, name, None) for name in ("context", "problem")]
        problem = ", ".join(text for text in found if text) or "is not YAML"
        if "nesting depth" in problem:  # a limit of the parser, which reads ahead
            problem = _TOO_DEEP
        raise YamlError(_at(mark, problem)) from error
    return builder.value


def written(value: bool | float | None) -> str:
    """Return a word or a number as YAML writes it."""
    return str(yaml.safe_dump(value)).splitlines()[0]


def _at(mark: Any, message: str) -> str:
    return f"line {mark.line + 1}, column {mark.column + 1}: {message}" if mark else message


@dataclass
class _Open:
    """A list or a mapping that is being built.

    Attributes:
        value: What is built.
        anchor: Its name for aliases.
        key: The key whose value comes next; `_NO_KEY` if a key comes next.
        merged: What `<<` names.
        size, height: Number of values in it, and how deep they lie.
    """

    value: list[Any] | dict[Any, Any]
    anchor: str | None
    key: Any
    merged: list[dict[Any, Any]] = field(default_factory=list)
    size: int = 1
    height: int = 1


_NO_KEY, _MERGE = object(), object()


class _Builder:
    """Builds the value of a document from its events."""

    def __init__(self) -> None:
        self.value: Any = None
        self._open: list[_Open] = []
        self._anchors: dict[str, tuple[Any, int, int]] = {}
        self._documents = 0
        self._total = 0

    def take(self, event: yaml.Event) -> None:
        if isinstance(event, yaml.ScalarEvent):
            value = _scalar(event, self._waits_for_key)
            if event.anchor is not None:
                self._anchors[event.anchor] = (value, 1, 0)
            self._put(value, 1, 0, event)
        elif isinstance(event, (yaml.SequenceStartEvent, yaml.MappingStartEvent)):
            if event.tag not in (None, "!"):
                raise YamlError(_at(event.start_mark, f"tags such as {event.tag} are not taken"))
            if self._waits_for_key:
                raise YamlError(_at(event.start_mark, "a key must be text or a number"))
            if event.anchor is not None:
                self._anchors.pop(event.anchor, None)  # not known inside of itself
            new: list[Any] | dict[Any, Any] = (
                [] if isinstance(event, yaml.SequenceStartEvent) else {}
            )
            self._open.append(_Open(new, event.anchor, _NO_KEY))
            self._limit(1, 0, event)
        elif isinstance(event, yaml.CollectionEndEvent):
            done = self._open.pop()
            for merged in done.merged:
                done.value = {**merged, **done.value}  # type: ignore[dict-item]
            if done.anchor is not None:
                self._anchors[done.anchor] = (done.value, done.size, done.height)
            self._put(done.value, done.size, done.height, event)
        elif isinstance(event, yaml.AliasEvent):
            if event.anchor not in self._anchors:
                raise YamlError(_at(event.start_mark, f"nothing whole is named {event.anchor}"))
            self._put(*self._anchors[event.anchor], event)
        elif isinstance(event, yaml.DocumentStartEvent):
            self._documents += 1
            if self._documents > 1:
                raise YamlError(_at(event.start_mark, "expected a single document"))

    @property
    def _waits_for_key(self) -> bool:
        inner = self._open[-1] if self._open else None
        return inner is not None and isinstance(inner.value, dict) and inner.key is _NO_KEY

    def _put(self, value: Any, size: int, height: int, event: yaml.Event) -> None:
        """Put a value where the innermost open list or mapping wants it."""
        if not self._open:
            self.value = value
            return
        inner = self._open[-1]
        inner.size += size
        inner.height = max(inner.height, height + 1)
        if not isinstance(event, yaml.CollectionEndEvent):  # its values are counted
            self._limit(size, height, event)
        if isinstance(inner.value, list):
            inner.value.append(value)
        elif inner.key is _NO_KEY:
            if isinstance(value, (list, dict)):  # by an alias
                raise YamlError(_at(event.start_mark, "a key must be text or a number"))
            if value in inner.value and value is not _MERGE:
                raise YamlError(_at(event.start_mark, f"key {value!r} is given twice"))
            inner.key = value
        else:
            key, inner.key = inner.key, _NO_KEY
            if key is _MERGE:
                self._merge(value, inner, event)
            else:
                inner.value[key] = value

    def _merge(self, value: Any, inner: _Open, event: yaml.Event) -> None:
        named = value if isinstance(value, list) else [value]
        if not all(isinstance(one, dict) for one in named):
            raise YamlError(_at(event.start_mark, "<< must name keys and values"))
        inner.merged += named

    def _limit(self, size: int, height: int, event: yaml.Event) -> None:
        if len(self._open) + height > MOST_DEPTH:
            raise YamlError(_at(event.start_mark, _TOO_DEEP))
        self._total += size
        if self._total > MOST_VALUES:
            raise YamlError(_at(event.start_mark, f"holds more than {MOST_VALUES} values"))


def _scalar(event: yaml.ScalarEvent, is_key: bool) -> Any:
    text = event.value
    if event.tag not in (None, "!", "tag:yaml.org,2002:str"):
        raise YamlError(_at(event.start_mark, f"tags such as {event.tag} are not taken"))
    if event.tag is not None or not event.implicit[0]:  # quoted, or said to be text
        return text
    if is_key and text == "<<":
        return _MERGE
    try:
        return _plain(text)
    except ValueError as error:
        raise YamlError(_at(event.start_mark, str(error))) from error


def _plain(text: str) -> Any:
    """Return a plain scalar by the core schema of YAML 1.2, section 10.3.2."""
    if _NULL.fullmatch(text):
        return None
    if _BOOL.fullmatch(text):
        return text.lower() == "true"
    if _FLOAT.fullmatch(text) or _OTHER_INT.fullmatch(text):
        if len(text) > MOST_DIGITS:
            raise ValueError(f"a number of more than {MOST_DIGITS} characters")
        if _INT.fullmatch(text):
            return int(text)
        return int(text, 0) if _OTHER_INT.fullmatch(text) else float(text)
    if found := _INFINITE.fullmatch(text):
        return float(found[1] + "inf")
    return float("nan") if _NAN.fullmatch(text) else text
