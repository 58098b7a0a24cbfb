"""Where compiled kernels are kept, so that a start takes seconds: settled before numba is loaded.

Kernels lie beside the code of opl, in a folder of the user, or where NUMBA_CACHE_DIR says. Where
none of these can be written to, they are compiled anew at every start, and that is said.
"""

from __future__ import annotations

import atexit
import logging
import os
import shutil
import tempfile
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"


def settle_kernel_cache(package: Path) -> None:
    """Name a folder that can be written to in NUMBA_CACHE_DIR, unless numba finds one by itself.

    Args:
        package: Folder of modules with kernels.
    """
    given = os.environ.get(VARIABLE)
    if given is not None:
        if _can_be_written(Path(given)):
            return
        tried = [Path(given)]
    else:
        if _can_be_written(package / "__pycache__"):
            return
        tried = [package / "__pycache__"]
        try:
            own = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "opl"
        except RuntimeError:  # nobody's home
            pass
        else:
            if _can_be_written(own):
                os.environ[VARIABLE] = str(own)
                return
            tried.append(own)
    passing = Path(tempfile.mkdtemp(prefix="opl-kernels-"))
    atexit.register(shutil.rmtree, passing, ignore_errors=True)
    os.environ[VARIABLE] = str(passing)  # for the processes of a batch, too
    os.environ.setdefault("MPLCONFIGDIR", str(passing))
    logging.getLogger(__name__).warning(
        "kernels are compiled anew at every start, which takes a minute: %s cannot be written to; "
        "set %s to a folder that can",
        " and ".join(map(str, tried)),
        VARIABLE,
    )


def _can_be_written(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False
