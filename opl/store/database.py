"""A file of SQLite that threads and processes share."""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from opl.errors import InputError

PATIENCE = 60.0  # [s] to wait for others that write


class Database:
    """A file, which is made if needed; each thread has a connection of its own.

    It must lie on a disk of this machine: what SQLite shares among processes (its write-ahead log)
    is not for network shares.

    Args:
        path: The file.
        version: Of what is in it.
        tables: Statements that make it.

    Raises:
        InputError: If it cannot be made or used, or is of another version.
    """

    def __init__(self, path: Path, version: int, tables: Sequence[str]) -> None:
        self._path = path
        self._here = threading.local()
        with self.refusing():
            path.parent.mkdir(parents=True, exist_ok=True)
            with self.changing() as file:
                found = file.execute("PRAGMA user_version").fetchone()[0]
                if found == 0:
                    for statement in tables:
                        file.execute(statement)
                    file.execute(f"PRAGMA user_version = {version}")
                elif found != version:
                    message = (
                        f"is of another version of opl ({found}, not {version}); remove it: jobs "
                        "are done again, their files stay"
                    )
                    raise InputError(str(path), message)

    def connection(self) -> sqlite3.Connection:
        """Return the connection of this thread."""
        found: sqlite3.Connection | None = getattr(self._here, "connection", None)
        if found is None:
            found = sqlite3.connect(self._path, timeout=PATIENCE, isolation_level=None)
            found.execute("PRAGMA journal_mode = WAL")
            self._here.connection = found
        return found

    @contextmanager
    def changing(self, durable: bool = True) -> Iterator[sqlite3.Connection]:
        """Change the file in one step; no other process changes it meanwhile.

        Args:
            durable: Wait until the change is on the disk; else it may be lost with the system, not
                with this process.
        """
        with self.refusing():
            file = self.connection()
            file.execute(f"PRAGMA synchronous = {'FULL' if durable else 'NORMAL'}")
            file.execute("BEGIN IMMEDIATE")
            try:
                yield file
                file.execute("COMMIT")
            except BaseException:
                if file.in_transaction:
                    file.execute("ROLLBACK")
                raise

    @contextmanager
    def refusing(self) -> Iterator[None]:
        """Let what is wrong with the file be told as an `InputError`."""
        try:
            yield
        except sqlite3.DatabaseError as error:
            help_ = "; if it is damaged, remove it: jobs are done again, their files stay"
            raise InputError(str(self._path), f"cannot be used: {error}{help_}") from error
        except OSError as error:
            raise InputError(str(self._path), f"cannot be made: {error.strerror}") from error
