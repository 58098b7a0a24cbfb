"""Where the keys of a job or a cell come from: for messages, and for the files that they name."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from opl.errors import InputError
from opl.files.confining import require_inside


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

    def file(self, name: str, key: str | None = None) -> Path:
        """Return the path of a file or folder that it names.

        Args:
            name: The name.
            key: The key that names it; not needed where the caller tells it.

        Raises:
            InputError: If it lies outside of what may be read.
        """
        try:
            require_inside(self.folder / name)
        except InputError as error:
            raise InputError(
                "" if key is None else self.at(key), f"{name} {error.message}"
            ) from error
        return self.folder / name
