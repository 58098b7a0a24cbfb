"""Which page shows a job, a folder or a program."""

from __future__ import annotations

from pathlib import Path

from opl.errors import InputError
from opl.files import documents
from opl.files.digests import digest
from opl.files.reading import read_bytes
from opl.job import keys
from opl.proof.digest import digests_in, read_result
from opl.run.job_folder import MOST_RESULT
from opl.run.listings import read_program
from opl.run.result import PAGE, RESULT

JOBS = (".yaml", ".yml")


def find_page(target: Path, out: Path) -> Path:
    """Return the page of a run.

    Args:
        target: The folder of the run or of a batch, a program in it, or the job file.
        out: Where the folders of jobs lie.

    Raises:
        InputError: If there is no such page, or if the program is not the one that it shows.
    """
    if not target.exists():
        raise InputError(str(target), "no such file or folder")
    if target.is_dir():
        return _page_in(target, f"opl run JOB.yaml --out {target}")
    if target.suffix in JOBS:
        name = documents.keys(target).get(keys.NAME)
        if not isinstance(name, str):
            raise InputError(f"{target}: {keys.NAME}", "must be given, else there is no page")
        return _page_in(out / name, f"opl run {target}")
    page = _page_in(target.parent, "opl run on its job")
    result = target.parent / RESULT
    known = digests_in(read_result(read_bytes(result, MOST_RESULT))) if result.is_file() else {}
    if digest(read_program(target)) not in known.values():
        raise InputError(
            str(target), f"is not the program that {page} shows, says the {RESULT} beside it"
        )
    return page


def _page_in(folder: Path, made_by: str) -> Path:
    page = folder / PAGE
    if not page.is_file():
        raise InputError(str(page), f"no such file; made by: {made_by}")
    return page
