"""A job of the store as a value: what is asked for, how far it is, what became of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Literal


class State(str, Enum):
    """How far a job is. A failed one ended without what was asked for, and says why."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def ended(self) -> bool:
        """Whether nothing more will become of it by itself."""
        return self not in (State.QUEUED, State.RUNNING)


@dataclass(frozen=True)
class Task:
    """What is to be done.

    Attributes:
        kind: ``run``, ``check``, ``points``, ``verify`` or ``faces``.
        job: The job file, of ``faces`` the part file, as messages name it.
        out: Folder for the files; of a run in a batch the folder that the job's folder lies in.
        home: The folder that relative names start in; empty for that of the process.
        method: Search to use instead of the job's own.
        programs: Program files to be verified.
        changes: Values by key path that stand instead of those of the job file.
        unit: Of a mesh whose faces are asked for, ``mm`` or ``m``.
        confined: Whether nothing outside of ``home`` may be read.
    """

    kind: str
    job: str
    out: str
    home: str = ""
    method: str | None = None
    programs: tuple[str, ...] = ()
    changes: Mapping[str, Any] = field(default_factory=dict)
    unit: Literal["mm", "m"] | None = None
    confined: bool = False


@dataclass(frozen=True)
class FileRecord:
    """A file as it was written.

    Attributes:
        digest: SHA-256 of its bytes.
        size: In bytes.
        changed_ns: When it was last written to, as the system counts it.
    """

    digest: str
    size: int
    changed_ns: int


@dataclass(frozen=True)
class Outcome:
    """What became of a task.

    Attributes:
        status: ``ok``, or why there is nothing: ``no_path``, ``unsafe``, ``not proven``,
            ``bad input``, ``error``.
        exit_status: What the command of the command line would have ended with.
        message: Why there is nothing; empty if there is something.
        folder: Where the files lie, None if there are none.
        result: Name of the file with the figures, None if there is none.
        files: The files by name.
        final: Whether the same task would end so again; not where a limit or a crash ended it.
    """

    status: str
    exit_status: int
    message: str = ""
    folder: str | None = None
    result: str | None = None
    files: Mapping[str, FileRecord] = field(default_factory=dict)
    final: bool = True


@dataclass(frozen=True)
class Progress:
    """How far a running job is.

    Attributes:
        stage: What it does.
        fraction: How much of the stage is done, 0 to 1.
        value: Of the best path that its search has found by now, of what the search keeps small, in
            [rad] or [s]; None before there is one.
        lower_bound: What it has proven by now that no path is below; None before it began.
    """

    stage: str = ""
    fraction: float = 0.0
    value: float | None = None
    lower_bound: float | None = None


@dataclass(frozen=True)
class StoredJob:
    """A job of the store.

    Attributes:
        id: Digest of everything that its outcome depends on.
        target: What it makes; a store has one job for each.
        name: For people.
        task: What is to be done.
        state: How far it is.
        progress: How far it is while it is running.
        cancelling: Whether somebody has asked to cancel it.
        attempts: How often it was begun.
        outcome: What became of it, None while nothing has.
        created, started, ended: Seconds since 1970; None for what has not come.
    """

    id: str
    target: str
    name: str
    task: Task
    state: State
    progress: Progress
    cancelling: bool
    attempts: int
    outcome: Outcome | None
    created: float
    started: float | None
    ended: float | None
