"""Who works on a job: a process of a machine, and whether it still lives."""

from __future__ import annotations

import os
import socket
from pathlib import Path


def this_process() -> str:
    """Return how this process signs what it works on."""
    return f"{socket.gethostname()} {os.getpid()} {_began(os.getpid())}"


def is_gone(owner: str) -> bool:
    """Return whether a process is known to have ended; of other machines nothing is known."""
    host, pid, began = owner.rsplit(" ", 2)
    if host != socket.gethostname() or began == "unknown":
        return False
    return _began(int(pid)) != began  # its number may be that of another process by now


def _began(pid: int) -> str:
    """Return when a process began as the system tells it, ``unknown`` where it does not (/proc)."""
    if not Path("/proc/self/stat").exists():
        return "unknown"
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return "gone"
    state, *others = fields.rsplit(")", 1)[1].split()
    return "gone" if state in "ZX" else others[18]
