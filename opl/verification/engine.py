"""PyBullet, started without its banners.

Its C code prints the build time when it is imported and its arguments when a server starts,
straight to the file descriptors: in front of the JSON that a caller reads from standard output.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def _no_banners() -> Iterator[None]:
    """Send what C code prints to nowhere."""
    sys.stdout.flush()
    sys.stderr.flush()
    _flush_c()
    kept = [os.dup(descriptor) for descriptor in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for descriptor in (1, 2):
            os.dup2(nowhere, descriptor)
        yield
    finally:
        _flush_c()
        os.close(nowhere)
        for descriptor, original in zip((1, 2), kept, strict=True):
            os.dup2(original, descriptor)
            os.close(original)


def _flush_c() -> None:
    """Write out what C code has printed: into files and pipes it goes when the process ends."""
    if os.name == "posix":
        ctypes.CDLL(None).fflush(None)


# Bullet ends its search for the nearest point where the next one is within 0.01 of its lengths of
# the last: in metres it saw the rim of a wheel of 119 mm radius farther away by up to 0.24 mm. Ten
# times as big, that is less than 0.001 mm. All lengths it is given, and gives, are times this.
SCALE = 10.0

with _no_banners():
    import pybullet
    from pybullet_utils.bullet_client import BulletClient


def start() -> BulletClient:
    """Return a new physics server in this process, without a window."""
    with _no_banners():
        client = BulletClient(pybullet.DIRECT)
    # meshes by file name would be kept for as long as the process lives, and not read again
    client.setPhysicsEngineParameter(enableFileCaching=0)
    return client


def version() -> str:
    """Return the version of the engine."""
    return str(pybullet.getAPIVersion())


__all__ = ["SCALE", "BulletClient", "pybullet", "start", "version"]
