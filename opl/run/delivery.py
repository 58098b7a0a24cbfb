"""What a run leaves in its folder."""

from __future__ import annotations

from pathlib import Path

from opl.files.claiming import Claim
from opl.run.job_folder import claim_folder, put_files
from opl.run.page import run_page
from opl.run.reporting import make_report
from opl.run.result import PAGE, RESULT, to_json
from opl.run.values import Refused, Written


def deliver(run: Written | Refused, folder: Path | Claim) -> list[Path]:
    """Put the files of a run, its page and its ``result.json`` into a folder, in one step.

    Program files that an earlier run of the job left there go in the same step: a folder never
    holds a program that its ``result.json`` does not describe. A refused run leaves its page and
    ``result.json`` only. All other files stay. What one step is, and where it can only be one file
    after the other with ``result.json`` last, `opl.files.switching` says.

    Args:
        run: The run.
        folder: The folder, which is made if needed, or one that `claim_folder` holds.

    Returns:
        The files, ``result.json`` last.

    Raises:
        InputError: If another run holds the folder, it cannot be written to, or it belongs to
            another job.
    """
    if isinstance(folder, Path):
        with claim_folder(folder, run.surfaced.job.name) as claim:
            return deliver(run, claim)
    files = run.contents if isinstance(run, Written) else {}
    report = make_report(run)
    whole: dict[str, str | bytes] = {
        **files,
        PAGE: run_page(run, report),
        RESULT: to_json(report) + "\n",
    }
    return put_files(folder, whole)
