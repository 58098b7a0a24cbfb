"""The digests of everything that a job is made of: what was proven is told by them.

Of job and cell files counts what they say, not how they are laid out; of all other files every
byte. Surfaces and solids that a program gives as values count with all their numbers.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from opl.cell.robot import Robot
from opl.files.digests import digest
from opl.files.documents import content_of
from opl.files.reading import read_bytes
from opl.job.files import MOST_BYTES, named_files, shape_files
from opl.job.source import Source


def input_digests(
    source: Source, content: object, robot: Robot, given: Mapping[str, object]
) -> dict[str, str]:
    """Return the SHA-256 of each input of a job by its name.

    Args:
        source: The job file or mapping.
        content: What it says, validated before.
        robot: The robot that it names.
        given: What a program gives beside it, by the name of the argument; None is not given.

    Raises:
        InputError: If a file that it names cannot be read.
    """
    found = {"job": _of_content(content), **_files_in(source, content)}
    cell = content.get("cell") if isinstance(content, Mapping) else None
    if isinstance(cell, str):
        inside = content_of(source.file(cell))
        found[cell] = _of_content(inside)
        of_cell = _files_in(Source.of_file(source.file(cell)), inside)
        found |= {f"{cell}: {name}": one for name, one in of_cell.items()}
    found |= {f"robot: {name}": _of_file(path) for name, path in _robot_files(robot)}
    for name, value in given.items():
        if value is not None:
            found[f"argument {name}"] = digest("\n".join(_numbers(value)).encode())
    return dict(sorted(found.items()))


def _of_content(content: object) -> str:
    return digest(json.dumps(content, sort_keys=True, default=str).encode())


def _files_in(source: Source, content: object) -> dict[str, str]:
    """Return the digests of the files that a job or cell file names, by the names it has."""
    return {name: _of_file(source.file(name)) for name in named_files(content)}


def _robot_files(robot: Robot) -> Iterator[tuple[str, Path]]:
    folder = robot.urdf.parent
    yield "robot.yaml", folder / "robot.yaml"
    yield robot.urdf.name, robot.urdf
    yield from shape_files(robot.urdf)


def _of_file(path: Path) -> str:
    return digest(read_bytes(path, MOST_BYTES))


def _numbers(value: object) -> Iterator[str]:
    """Give everything that a value is made of as text, to the last bit."""
    if is_dataclass(value) and not isinstance(value, type):
        yield type(value).__name__
        for field in fields(value):
            if field.init:
                yield from _numbers(getattr(value, field.name))
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype}{value.shape}"
        yield value.tobytes().hex()
    elif isinstance(value, (list, tuple)):
        yield f"{len(value)} items"
        for item in value:
            yield from _numbers(item)
    elif isinstance(value, Enum):
        yield str(value.value)
    else:
        text = repr(value)
        # where an object lies in memory says nothing of it
        yield type(value).__name__ if " at 0x" in text else text
