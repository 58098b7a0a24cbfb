"""Where the keys of a job or a cell come from: for messages, and for the files that they name."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Source:
    """A job or cell file, or a mapping that a program has made.

    Attributes:
        label: How messages name it: the file as the user wrote it, or ``job``.
        folder: Where the relative file names in it are looked up.
    """

    label: str
    folder: Path

    @classmethod
    def of_file(cls, path: Path) -> Source:
        """Return the source that a file is."""
        return cls(str(path), path.parent)

    def at(self, key: str) -> str:
        """Return how a message names a key path in it, e.g. ``job.yaml: wheel.width_mm``."""
        return f"{self.label}: {key}"

    def file(self, name: str) -> Path:
        """Return the path of a file that it names."""
        return self.folder / name
