"""Files that jobs made: noted as they are written, and told when they are no longer the same."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from opl.files.digests import digest
from opl.store.values import FileRecord


def note_files(paths: Iterable[Path]) -> dict[str, FileRecord]:
    """Return what is written down of files by name; all lie in one folder."""
    found = {}
    for path in paths:
        content, status = path.read_bytes(), path.stat()
        found[path.name] = FileRecord(digest(content), len(content), status.st_mtime_ns)
    return found


def changed_files(
    folder: Path, files: Mapping[str, FileRecord], every_byte: bool = False
) -> list[str]:
    """Return the files that are gone or not what they were.

    Args:
        folder: Where they lie.
        files: As they were.
        every_byte: Read all of them; else only those whose size or time has changed.
    """
    return [name for name, record in files.items() if not _same(folder / name, record, every_byte)]


def _same(path: Path, record: FileRecord, every_byte: bool) -> bool:
    try:
        status = path.stat()
        if status.st_size != record.size:
            return False
        if status.st_mtime_ns == record.changed_ns and not every_byte:
            return True
        return digest(path.read_bytes()) == record.digest
    except OSError:
        return False
