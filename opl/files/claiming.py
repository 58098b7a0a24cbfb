"""A folder that one process at a time writes to."""

from __future__ import annotations

import errno
import fcntl
import os
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from opl.errors import InputError
from opl.files.switching import LOCK, recover, switch
from opl.files.writing import check_folder, unwritable

# what this process holds: folders, and which of them were made for it, by the open lock
_HELD: dict[int | None, tuple[Path, list[Path]]] = {}

ATTEMPTS = 20  # to make a folder and lock it while others remove it


@dataclass(frozen=True)
class Claim:
    """A folder that nobody else writes to through `claimed`.

    Attributes:
        folder: The folder, as it was named.
        place: The same without symbolic links.
    """

    folder: Path
    place: Path

    def switch(
        self, contents: Mapping[str, str | bytes], leaving: Set[str] = frozenset()
    ) -> list[Path]:
        """Put files into the folder by name, and take other files out of it, in one step.

        Line ends stay as they are. `opl.files.switching` says what one step is.

        Args:
            contents: Texts or bytes; the last is the one whose presence says that all are there.
            leaving: Names of files that go, if they are there.

        Raises:
            InputError: If the folder cannot be written to; it is then whole, with the old
                files or the new.
        """
        files = {
            name: content if isinstance(content, bytes) else content.encode("utf-8")
            for name, content in contents.items()
        }
        try:
            self.place.mkdir(parents=True, exist_ok=True)  # somebody may have removed it
            switch(self.place, files, leaving)
        except OSError as error:
            raise unwritable(self.folder, error) from error
        return [self.folder / name for name in contents]


@contextmanager
def claimed(folder: Path) -> Iterator[Claim]:
    """Claim a folder, which is made if needed, and bring it to a whole state if it is not in one.

    A folder that was made and stays empty is removed again.

    Raises:
        InputError: If another process holds it, or it cannot be written to.
    """
    check_folder(folder)
    place = folder.resolve()
    missing = _missing(place)
    lock = None
    try:
        try:
            for attempt in range(ATTEMPTS):
                try:
                    for one in reversed(missing):
                        one.mkdir(exist_ok=True)
                    lock = _lock(place, folder)
                    break
                except FileNotFoundError:
                    # a run that held it until now has removed what it had made and left empty
                    missing = _missing(place) or missing
                    if attempt == ATTEMPTS - 1:
                        raise
            recover(place)
        except OSError as error:
            raise unwritable(folder, error) from error
        _HELD[lock] = (place, missing)
        yield Claim(folder, place)
    finally:
        _HELD.pop(lock, None)
        if lock is not None:
            _unlock(place)
            os.close(lock)
        _remove_empty(missing)


def release_folders() -> None:
    """Release all folders that this process holds, because it ends here and now."""
    for place, missing in _HELD.values():
        _unlock(place)
        _remove_empty(missing)


def clear_after_others(parent: Path) -> None:
    """Bring the folders in a folder to a whole state whose processes were killed.

    Those that stay empty are removed; those that a process still holds are left alone.
    """
    for lock in sorted(parent.glob(f"*/{LOCK}")):
        with suppress(InputError):
            with claimed(lock.parent):
                pass
            _remove_empty([lock.parent])


def _unlock(place: Path) -> None:
    with suppress(OSError):
        (place / LOCK).unlink(missing_ok=True)


def _remove_empty(folders: Sequence[Path]) -> None:
    for folder in folders:
        with suppress(OSError):  # it is not empty
            folder.rmdir()


def write_files(folder: Path, contents: Mapping[str, str] | Mapping[str, bytes]) -> list[Path]:
    """Write texts or bytes by name into a folder, which is made if needed, in one step.

    Raises:
        InputError: If another process holds the folder, or it cannot be written to.
    """
    with claimed(folder) as claim:
        return claim.switch(contents)


def _missing(place: Path) -> list[Path]:
    """Return the folders that are to be made for a place, the innermost first."""
    missing = []
    while not place.exists():
        missing.append(place)
        place = place.parent
    return missing


def _is_at(lock: int, path: Path) -> bool:
    """Return whether an open file is the one at a path."""
    with suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(lock), path.lstat())
    return False


def _lock(place: Path, name: Path) -> int:
    """Lock a folder by a file in it; the system ends the lock with the process that holds it."""
    path = place / LOCK
    while True:
        try:
            lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
        except FileNotFoundError:
            if place.is_dir():  # another run has just exchanged it for a new one
                continue
            raise
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # whoever held it before may have removed the file
            if _is_at(lock, path):
                with suppress(OSError):  # a full disk hinders the message of others only
                    os.ftruncate(lock, 0)
                    os.write(lock, f"{os.getpid()}\n".encode())
                return lock
        except OSError as error:
            holder = os.read(lock, 20).decode("ascii", "replace").strip() or "unknown"
            os.close(lock)
            if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                message = (
                    f"another run writes to it (process {holder}); wait for it, or name "
                    "another folder"
                )
                raise InputError(str(name), message) from error
            raise
        except BaseException:
            os.close(lock)
            raise
        os.close(lock)
