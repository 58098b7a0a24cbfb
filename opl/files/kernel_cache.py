"""Where compiled kernels are kept, so that a start takes seconds: settled before numba is loaded.

Kernels lie beside the code of opl, in a folder of the user, or where NUMBA_CACHE_DIR says; there in
a folder of their own for each state of the code. Numba looks at the file of a kernel only, but what
it compiled holds other kernels as well, so after a change of those it would go on with old ones.
Where nothing can be written to, kernels are compiled anew at every start, and that is said.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import logging
import os
import shutil
import tempfile
from functools import cache
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
_PASSING = "passing-kernels"


def settle_kernel_cache(package: Path) -> None:
    """Name a folder that can be written to in NUMBA_CACHE_DIR.

    Args:
        package: Folder of all code of opl.
    """
    name = f"kernels-{_mark(package)}"
    given = os.environ.get(VARIABLE)
    if given is not None and Path(given).name in (name, _PASSING):
        return
    tried = [package / "__pycache__"] if given is None else [Path(given)]
    with contextlib.suppress(RuntimeError):  # nobody's home
        if given is None:
            own = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "opl"
            tried.append(own)
    for folder in tried:
        if _can_be_written(folder / name):
            os.environ[VARIABLE] = str(folder / name)
            return
    made = Path(tempfile.mkdtemp(prefix="opl-"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    passing = made / _PASSING
    passing.mkdir()
    os.environ[VARIABLE] = str(passing)  # for the processes of a batch, too
    os.environ.setdefault("MPLCONFIGDIR", str(passing))
    logging.getLogger(__name__).warning(
        "kernels are compiled anew at every start, which takes a minute: %s cannot be written to; "
        "set %s to a folder that can",
        " and ".join(map(str, tried)),
        VARIABLE,
    )


@cache
def _mark(package: Path) -> str:
    """Return the digest of all modules of a package that compile, and of how they do, short."""
    digest, how = hashlib.sha256(), package / "files" / "kernels.py"
    for path in sorted(package.rglob("*.py")):
        content = path.read_bytes()
        if path == how or b"opl.files.kernels" in content:
            digest.update(content)
    return digest.hexdigest()[:12]


def _can_be_written(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False
