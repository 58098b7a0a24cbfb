"""Sweeps: a list where a job file has one value stands for a job with each of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any

from opl.errors import InputError
from opl.job import keys

MOST_VARIANTS = 1000
LONGEST_NAME = 28


def with_value(content: Any, path: str, value: Any) -> Any:
    """Return keys and values with one of them set; keys on its way are made where they lack.

    Args:
        content: Keys and values; anything else is returned as it is.
        path: Key path, as ``wheel.radius_mm``; a number counts within a list.
        value: What it is set to.
    """
    first, _, rest = path.partition(".")
    if isinstance(content, Mapping):
        inner = with_value(content.get(first, {}), rest, value) if rest else value
        return {**content, first: inner}
    if isinstance(content, list) and first.isdecimal() and int(first) < len(content):
        inner = with_value(content[int(first)], rest, value) if rest else value
        return [inner if k == int(first) else one for k, one in enumerate(content)]
    return content


def variants(label: str, content: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the changes that make each job of a sweep, names included; none if it is no sweep.

    Several lists mean every combination of their values. The variants are named as the job with
    their number behind it, in the order in which the lists stand in the file.

    Args:
        label: How messages name the job file.
        content: What it says.

    Raises:
        InputError: If there are too many, a list is empty, or the name leaves no room for a number.
    """
    swept = dict(_swept(content, ""))
    if not swept:
        return []
    count = 1
    for path, values in swept.items():
        if not values:
            raise InputError(f"{label}: {path}", "must be a value, or a list of values to be tried")
        if len({repr(value) for value in values}) < len(values):
            raise InputError(
                f"{label}: {path}", "has a value twice, which makes the same job twice"
            )
        count *= len(values)
    if count > MOST_VARIANTS:
        raise InputError(label, f"makes {count} jobs, at most {MOST_VARIANTS} are made of a file")
    name, digits = str(content.get(keys.NAME, "")), len(str(count))
    if len(name) + 1 + digits > LONGEST_NAME:
        raise InputError(
            f"{label}: {keys.NAME}",
            f"must leave room for the numbers of {count} jobs: {LONGEST_NAME - 1 - digits} "
            f"characters at the most, got {len(name)}",
        )
    return [
        {keys.NAME: f"{name}_{number:0{digits}}", **dict(zip(swept, values, strict=True))}
        for number, values in enumerate(product(*swept.values()), start=1)
    ]


def _swept(content: Any, path: str) -> Iterator[tuple[str, list[Any]]]:
    """Yield the lists that stand where there is one value, by key path."""
    if isinstance(content, Mapping):
        for key, value in content.items():
            inner = f"{path}.{key}" if path else str(key)
            if isinstance(value, list) and key not in keys.LISTS and _plain(value):
                yield inner, value
            else:
                yield from _swept(value, inner)
    elif isinstance(content, list):
        for k, value in enumerate(content):
            yield from _swept(value, f"{path}.{k}")


def _plain(values: list[Any]) -> bool:
    return not any(isinstance(value, (list, Mapping)) for value in values)
