"""A folder that jobs come into, and one that their files go to."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from opl.errors import InputError
from opl.job.files import Digests
from opl.run.batch import BatchRow, find_jobs
from opl.work.batch import BatchSettings, run_batch, write_batch_page
from opl.work.wanted import ask


def watch_inbox(
    inbox: Path,
    outbox: Path,
    settings: BatchSettings,
    done: Callable[[BatchRow], None],
    every: float = 1.0,
) -> None:
    """Run the jobs of a folder as they come or change, until whoever calls is stopped.

    A job is run when it and its files have stayed as they are between two looks. The files of jobs
    that leave the folder stay.

    Args:
        inbox: The folder of the jobs.
        outbox: Each job's files go to the folder of its name in here; the page of all beside them.
        settings: How jobs are run.
        done: Called with each job that was run.
        every: Time between two looks in [s].

    Raises:
        InputError: If there is no such folder, or the store cannot be used.
    """
    if not inbox.is_dir():
        raise InputError(str(inbox), "must be the folder that jobs come into, is none")
    digests = Digests()
    seen: set[str] = set()
    ran: set[str] = set()
    while True:
        try:
            paths = find_jobs([inbox])
        except InputError:  # it is empty, or was removed and may come back
            paths = []
        request = ask(paths, outbox, digests)
        now = {one if isinstance(one, str) else f"{one.job} {one.message}" for one in request.order}
        if now and now == seen and now != ran:
            rows = run_batch(
                paths, outbox, settings, lambda row: None if row.unchanged else done(row)
            )
            write_batch_page(rows, outbox)
            ran = now
        seen = now
        time.sleep(every)
