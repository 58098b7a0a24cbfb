"""What happens to jobs, written to a file on request."""

from __future__ import annotations

import logging
from pathlib import Path

import opl


def log_to(path: Path | None) -> None:
    """Write what happens to jobs to the end of a file, a line of JSON each; None for nowhere."""
    if path is not None:
        opl.check_folder(path.parent)
        handler = logging.FileHandler(path, encoding="utf-8")
        handler.setFormatter(logging.Formatter("%(message)s"))
        logging.getLogger("opl.jobs").addHandler(handler)
