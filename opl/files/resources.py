"""Where robots, templates, workpieces and plug-ins that come with opl lie; copies of them."""

from __future__ import annotations

import shutil
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


def install_plugin(directory: Path) -> Path:
    """Copy the workbench for FreeCAD into the folder of its add-ons.

    Returns:
        The folder of the workbench; one that was there, of an older opl, is replaced.

    Raises:
        InputError: If the folder is not there, or cannot be written to.
    """
    if not directory.is_dir():
        raise InputError(str(directory), "is not there; name the folder Mod of FreeCAD's user data")
    target = directory / "opl"
    try:
        if target.exists():
            if not (target / "opl_workbench").is_dir():
                raise InputError(str(target), "is there, and is not the workbench of opl")
            shutil.rmtree(target)
        source = Path(__file__).resolve().parents[1] / "plugins" / "freecad"
        shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
    except OSError as error:
        raise InputError(str(target), f"cannot be written: {error.strerror}") from error
    return target
