"""The files that a job is made of, found without looking at what they mean: quick, for any job."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from opl.errors import InputError
from opl.files.confining import require_inside
from opl.files.digests import digest
from opl.files.documents import content_of
from opl.files.reading import MB, read_bytes

MOST_BYTES = 100 * MB  # of a file that a job names
_FILES = ("surface", "mesh", "pulse_ratios", "template")  # keys that name a file
_SHAPE = re.compile(r"""filename\s*=\s*["']([^"']+)["']""")


def files_of_job(path: Path, content: Any) -> dict[str, Path]:
    """Return the files of a job by the names it has for them: the job, its cell, what these name.

    Those of a robot of the user's own are among them, none that come with opl. Whether a file is
    there is not looked at.

    Args:
        path: The job file.
        content: What it says, unchecked.
    """
    found = {"job": path}
    cell = content.get("cell") if isinstance(content, Mapping) else None
    places = [(path, content, "")]
    if isinstance(cell, str):
        place = path.parent / cell
        found[cell] = place
        with suppress(InputError):  # told when the job is loaded
            places.append((place, content_of(place), f"{cell}: "))
    for place, inside, prefix in places:
        found |= {prefix + name: place.parent / name for name in named_files(inside)}
        robot = inside.get("robot") if isinstance(inside, Mapping) else None
        if isinstance(robot, str):
            home = place.parent / robot
            found |= {f"robot: {one.name}": one for one in _robot_files(home)}
    return found


def named_files(content: object) -> Iterator[str]:
    """Yield the names of the files that the keys of a job or cell file name."""
    if isinstance(content, Mapping):
        for key, value in content.items():
            if key in _FILES and isinstance(value, str):
                yield value
            else:
                yield from named_files(value)
    elif isinstance(content, (list, tuple)):
        for item in content:
            yield from named_files(item)


def shape_files(urdf: Path) -> Iterator[tuple[str, Path]]:
    """Yield the files of shapes that a URDF names and that are there, by name."""
    names = _SHAPE.findall(read_bytes(urdf, MOST_BYTES).decode("utf-8", "replace"))
    for name in sorted(set(names)):
        path = urdf.parent / name.split("://")[-1]
        require_inside(path)
        if path.is_file():
            yield name, path


class Digests:
    """Digests of files; one that has not changed meanwhile is read once."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, int, int], str] = {}

    def of(self, path: Path) -> str | None:
        """Return the digest of a file, None if it cannot be read."""
        try:
            status = os.stat(path)
            key = (os.fspath(path), status.st_size, status.st_mtime_ns)
            if key not in self._known:
                self._known[key] = digest(read_bytes(path, MOST_BYTES))
            return self._known[key]
        except (InputError, OSError, ValueError):
            return None


def _robot_files(home: Path) -> Iterator[Path]:
    """Yield what lies in a robot's folder; nothing if that is none of the user's own."""
    file = home / "robot.yaml"
    try:
        if not file.is_file():
            return
        yield file
        urdf = content_of(file).get("urdf")
        yield home / urdf
        yield from (path for _, path in shape_files(home / urdf))
    except (InputError, AttributeError, TypeError, ValueError, OSError):
        return  # told when the job is loaded
