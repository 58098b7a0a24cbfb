"""Where the robots, templates and example workpieces that come with opl lie."""

from __future__ import annotations

from pathlib import Path

from opl.errors import InputError
from opl.files.writing import check_folder, write_folder


def folder(name: str) -> Path:
    """Return the folder ``robots``, ``templates`` or ``workpieces``.

    In an installed wheel they lie inside the package, in a checkout beside it.
    """
    package = Path(__file__).resolve().parents[1]
    installed = package / name
    return installed if installed.is_dir() else package.parent / name


def start_job(directory: Path) -> Path:
    """Start a job: copy the V-shaped example to a new folder, to be changed.

    Returns:
        The job file.

    Raises:
        InputError: If the folder exists, or cannot be made.
    """
    if directory.exists():
        raise InputError(str(directory), "exists already; name a new folder")
    check_folder(directory)
    write_folder(folder("workpieces") / "v_shape", directory)
    return directory / "job.yaml"
