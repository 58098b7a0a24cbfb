"""What an outcome depends on beside its inputs: opl itself and the libraries it computes with."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from opl.files.resources import folder
from opl.version import VERSION

_COMPUTE = ("coal", "cadquery-ocp-novtk", "jinja2", "matplotlib", "numba", "numpy", "ompl", "pin",
            "pybullet", "scipy", "toppra", "trimesh")  # fmt: skip
_SUFFIXES = {".py", ".yaml", ".urdf", ".j2", ".js", ".css"}


@cache
def made_with() -> Mapping[str, str]:
    """Return versions by name: of opl, of its code to the byte, of Python and the libraries."""
    return {
        "opl": VERSION,
        "code": _code(),
        "python": platform.python_version(),
        "machine": platform.machine(),
        **{name: _version(name) for name in _COMPUTE},
    }


def job_id(inputs: Mapping[str, str | None], request: Mapping[str, Any]) -> str:
    """Return the id of a job: a digest of everything that its outcome depends on.

    Args:
        inputs: Digests of its files by name, None for a file that is not there.
        request: What is to be done with them, in plain values.
    """
    date = os.environ.get("SOURCE_DATE_EPOCH")  # without it a program is dated when it is made
    whole = [dict(inputs), dict(request), dict(made_with()), date]
    return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()[:32]


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "none"


def _code() -> str:
    """Return a digest of the code, the robots and the templates of opl."""
    package = Path(__file__).resolve().parents[1]
    whole = hashlib.sha256()
    for root in (package, folder("robots"), folder("templates")):
        for path in sorted(root.rglob("*")):
            if path.suffix in _SUFFIXES and "node_modules" not in path.parts:
                whole.update(f"{path.relative_to(root)}\0".encode())
                whole.update(path.read_bytes())
    return whole.hexdigest()[:16]
