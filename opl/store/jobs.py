"""The store: jobs in a file of SQLite, which many processes may use at once.

Every change is one transaction, so a process that is killed leaves the store as it was or as it
should be. A running job has an owner and a lease: it is free for others when its owner is known to
have ended, or has not renewed the lease. What a job made is delivered before the job is called
done; the job is done again if that comes apart.
"""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from opl.store.database import Database
from opl.store.owners import is_gone, this_process
from opl.store.values import FileRecord, Outcome, Progress, State, StoredJob, Task

LEASE = 30.0  # [s] that a job stays with an owner who says nothing
MOST_DEATHS = 3  # of workers, before their job fails
VERSION = 3
_TABLE = """
CREATE TABLE jobs (
    id TEXT PRIMARY KEY, target TEXT NOT NULL UNIQUE, name TEXT NOT NULL, task TEXT NOT NULL,
    state TEXT NOT NULL, stage TEXT NOT NULL, fraction REAL NOT NULL, value REAL, lower_bound REAL,
    cancelling INTEGER NOT NULL, attempts INTEGER NOT NULL, outcome TEXT, created REAL NOT NULL,
    started REAL, ended REAL, owner TEXT, lease REAL, deaths INTEGER NOT NULL
) WITHOUT ROWID
"""
_INDEX = "CREATE INDEX jobs_by_state ON jobs (state, created)"
_COLUMNS = (
    "id, target, name, task, state, stage, fraction, value, lower_bound, cancelling, attempts, "
    "outcome, created, started, ended"
)


class Store:
    """The jobs in a file, which is made if needed.

    Args:
        path: The file.

    Raises:
        InputError: If it cannot be made or used.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = Database(path, VERSION, (_TABLE, _INDEX))
        self._owner = this_process()

    # what is asked for

    def submit(
        self, id_: str, target: str, name: str, task: Task, again: bool = False
    ) -> StoredJob:
        """Ask for a job, unless it is asked for already.

        One that ended for good is answered as it is. Of a target there is one job: another takes
        the place of the one before, unless somebody is at work on that one.

        Args:
            id_: Digest of everything that its outcome depends on.
            target: What it makes.
            name: For people.
            task: What is to be done.
            again: Do it again even if it is done.

        Returns:
            The job of the target as it is now: that of another id is still being worked on.
        """
        with self._file.changing() as file:
            self._free_lost(file)
            same = file.execute("SELECT id, state, outcome FROM jobs WHERE target = ?", [target])
            found = same.fetchone()
            if found is not None:
                state = State(found[1])
                if state is State.RUNNING:
                    return self._job(file, found[0])
                settled = found[0] == id_ and not again
                if settled and (state is State.QUEUED or _is_final(state, found[2])):
                    return self._job(file, id_)
                file.execute("DELETE FROM jobs WHERE target = ?", [target])
            file.execute(
                "INSERT INTO jobs VALUES (?, ?, ?, ?, 'queued', '', 0, NULL, NULL, 0, 0, NULL, ?, "
                "NULL, NULL, NULL, NULL, 0)",
                [id_, target, name, json.dumps(asdict(task)), time.time()],
            )
            return self._job(file, id_)

    def cancel(self, id_: str) -> StoredJob | None:
        """Cancel a job: at once if it is queued, else its worker is asked to; None if unknown."""
        with self._file.changing() as file:
            file.execute(
                "UPDATE jobs SET state = 'cancelled', ended = ? WHERE id = ? AND state = 'queued'",
                [time.time(), id_],
            )
            file.execute("UPDATE jobs SET cancelling = 1 WHERE id = ? AND state = 'running'", [id_])
        return self.get(id_)

    def remove(self, id_: str) -> bool:
        """Forget a job that ended; return whether there was such a job."""
        with self._file.changing() as file:
            gone = file.execute(
                "DELETE FROM jobs WHERE id = ? AND state NOT IN ('queued', 'running')", [id_]
            )
            return gone.rowcount > 0

    # what is worked on

    def claim(self, id_: str | None = None) -> StoredJob | None:
        """Take a queued job to work on it: the one asked for, else the oldest; None without one."""
        with self._file.changing() as file:
            self._free_lost(file)
            which, values = ("AND id = ?", [id_]) if id_ is not None else ("", [])
            order = "ORDER BY created, id LIMIT 1"
            found = file.execute(
                f"SELECT id FROM jobs WHERE state = 'queued' {which} {order}", values
            ).fetchone()
            if found is None:
                return None
            now = time.time()
            file.execute(
                "UPDATE jobs SET state = 'running', attempts = attempts + 1, started = ?, "
                "owner = ?, lease = ? WHERE id = ?",
                [now, self._owner, now + LEASE, found[0]],
            )
            return self._job(file, found[0])

    def renew(self, id_: str, progress: Progress) -> bool:
        """Say how far a job is and keep it; return whether to go on, not after a cancellation."""
        # what is lost with a failing system is progress only
        with self._file.changing(durable=False) as file:
            kept = file.execute(
                "UPDATE jobs SET stage = ?, fraction = ?, value = ?, lower_bound = ?, lease = ? "
                "WHERE id = ? AND owner = ? AND state = 'running' AND cancelling = 0",
                [*vars(progress).values(), time.time() + LEASE, id_, self._owner],
            )
            return kept.rowcount > 0

    def finish(self, id_: str, outcome: Outcome | None) -> None:
        """Write down what became of a job of this process; None for a job that was cancelled."""
        if outcome is None:
            state, text = State.CANCELLED, None
        else:
            state = State.DONE if outcome.exit_status == 0 else State.FAILED
            text = json.dumps(asdict(outcome))
        with self._file.changing() as file:
            file.execute(
                "UPDATE jobs SET state = ?, outcome = ?, ended = ?, owner = NULL "
                "WHERE id = ? AND owner = ? AND state = 'running'",
                [state.value, text, time.time(), id_, self._owner],
            )

    def give_back(self, id_: str, died: bool) -> None:
        """Put a job of this process back into the queue.

        Args:
            id_: The job.
            died: Whether its worker died of it: it fails when `MOST_DEATHS` have. Not where all
                that is at work was stopped.
        """
        with self._file.changing() as file:
            if died:
                file.execute("UPDATE jobs SET deaths = deaths + 1 WHERE id = ?", [id_])
            self._requeue(file, id_)

    # what is there

    def get(self, id_: str) -> StoredJob | None:
        """Return a job, None if there is none of this id."""
        with self._file.refusing():
            return self._find(self._file.connection(), id_)

    def of_target(self, target: str) -> StoredJob | None:
        """Return the job that makes a target, None if there is none."""
        with self._file.refusing():
            query = f"SELECT {_COLUMNS} FROM jobs WHERE target = ?"
            row = self._file.connection().execute(query, [target]).fetchone()
            return None if row is None else _stored(row)

    def jobs(self, state: State | None = None, most: int = -1) -> list[StoredJob]:
        """Return the jobs, the newest first, of one state or of all."""
        where, values = ("", []) if state is None else ("WHERE state = ?", [state.value])
        query = f"SELECT {_COLUMNS} FROM jobs {where} ORDER BY created DESC, id LIMIT ?"
        with self._file.refusing():
            return [_stored(row) for row in self._file.connection().execute(query, [*values, most])]

    def counts(self) -> dict[str, int]:
        """Return how many jobs there are by state."""
        with self._file.refusing():
            found = dict(
                self._file.connection().execute("SELECT state, count(*) FROM jobs GROUP BY state")
            )
        return {state.value: found.get(state.value, 0) for state in State}

    def check(self) -> list[str]:
        """Return what is damaged in the file, one line each."""
        with self._file.refusing():
            found = [row[0] for row in self._file.connection().execute("PRAGMA quick_check")]
        return [] if found == ["ok"] else found

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep other processes from changing the store meanwhile."""
        with self._file.changing():
            yield

    # inside

    def _find(self, file: sqlite3.Connection, id_: str) -> StoredJob | None:
        row = file.execute(f"SELECT {_COLUMNS} FROM jobs WHERE id = ?", [id_]).fetchone()
        return None if row is None else _stored(row)

    def _job(self, file: sqlite3.Connection, id_: str) -> StoredJob:
        found = self._find(file, id_)
        assert found is not None
        return found

    def _free_lost(self, file: sqlite3.Connection) -> None:
        """Put jobs whose owners are gone back into the queue."""
        now = time.time()
        running = "SELECT id, owner, lease FROM jobs WHERE state = 'running'"
        for id_, owner, lease in file.execute(running).fetchall():
            if owner != self._owner and (lease < now or is_gone(owner)):
                self._requeue(file, id_)

    def _requeue(self, file: sqlite3.Connection, id_: str) -> None:
        died = Outcome("error", 1, f"its worker process died, {MOST_DEATHS} times", final=False)
        file.execute(
            "UPDATE jobs SET state = 'failed', outcome = ?, ended = ?, owner = NULL "
            "WHERE id = ? AND state = 'running' AND deaths >= ?",
            [json.dumps(asdict(died)), time.time(), id_, MOST_DEATHS],
        )
        file.execute(
            "UPDATE jobs SET state = CASE cancelling WHEN 1 THEN 'cancelled' ELSE 'queued' END, "
            "stage = '', fraction = 0, value = NULL, lower_bound = NULL, owner = NULL "
            "WHERE id = ? AND state = 'running'",
            [id_],
        )


def _is_final(state: State, outcome: str | None) -> bool:
    return state.ended and outcome is not None and bool(json.loads(outcome)["final"])


def _stored(row: tuple[Any, ...]) -> StoredJob:
    id_, target, name, task, state, *progress, cancelling, attempts, outcome = row[:-3]
    fields = json.loads(task)
    return StoredJob(
        id_,
        target,
        name,
        Task(**{**fields, "programs": tuple(fields["programs"])}),
        State(state),
        Progress(*progress),
        bool(cancelling),
        attempts,
        None if outcome is None else _outcome(json.loads(outcome)),
        *row[-3:],
    )


def _outcome(found: dict[str, Any]) -> Outcome:
    files = {name: FileRecord(**record) for name, record in found["files"].items()}
    return Outcome(**{**found, "files": files})
