"""Files of a folder changed in one step.

The new state of the folder is written beside it: its new files, and hard links to all others that
are to stay. When it is on the disk, the two folders exchange their names, which the system does in
one step (``renameat2`` of Linux with ``RENAME_EXCHANGE``). Until then the old state is untouched.

Where that cannot be (no such call, a share or a file system without links, a mounted folder, one
with folders in it, one that this process stands in, a parent that cannot be written to), the new
files wait in the folder itself and are moved one by one, the last of them last: cut short between
two moves, the folder lacks that last file, and whoever next switches it moves the others first.

Either way `recover` brings a folder that was left half way to its old or its new state.
"""

from __future__ import annotations

import ctypes
import errno
import json
import os
import shutil
from collections.abc import Mapping, Set
from pathlib import Path

from opl.files.writing import HIDDEN, sync_folder, write_through

LOCK = HIDDEN + "lock"  # whoever writes to a folder has locked this file in it
MARK = HIDDEN + "switch"  # in a new state: the names that the switch changes
WAITING = HIDDEN + "waiting"  # folder of files to be moved one by one, not yet complete
MOVING = HIDDEN + "moving"  # the same, complete
MOST_TRIES = 100  # to remove an old state in which others look for the lock
MOST_LINKS = 1000  # a folder with more files is changed one by one

# the system's ways to say that folders cannot be exchanged here
NOT_HERE = {
    errno.EACCES, errno.EBUSY, errno.EINVAL, errno.EMLINK, errno.ENAMETOOLONG, errno.ENOSYS,
    errno.EOPNOTSUPP, errno.EPERM, errno.EROFS, errno.EXDEV,
}  # fmt: skip


def switch(folder: Path, files: Mapping[str, bytes], leaving: Set[str]) -> None:
    """Put files into a folder and take others out of it.

    Args:
        folder: The folder, without symbolic links on its way, and nobody else switching it.
        files: Content by name; the last is the one whose presence says that all are there.
        leaving: Names of files that go, if they are there.

    Raises:
        OSError: If the folder cannot be written to; it is then whole, with the old files or
            the new.
    """
    recover(folder)
    changed = {*files, *leaving}
    try:
        if _may_be_exchanged(folder, changed):
            _exchange(folder, files, changed)
        else:
            _move_one_by_one(folder, files, leaving)
    finally:
        recover(folder)


def recover(folder: Path) -> None:
    """Bring a folder whose switch was cut short to its old or its new state.

    Raises:
        OSError: If the folder cannot be written to.
    """
    aside = _aside(folder)
    if (aside / MARK).exists():  # not exchanged yet
        for name in os.listdir(aside):
            if name != MARK:
                os.unlink(aside / name)
        os.unlink(aside / MARK)
        os.rmdir(aside)
    elif aside.is_dir() and not aside.is_symlink():
        _remove_old(aside, folder)
    (folder / MARK).unlink(missing_ok=True)
    if (folder / MOVING).exists():
        _move_all(folder)
    if (folder / WAITING).exists():
        shutil.rmtree(folder / WAITING)


def _aside(folder: Path) -> Path:
    return folder.with_name(HIDDEN + "aside-" + folder.name)


def _may_be_exchanged(folder: Path, changed: Set[str]) -> bool:
    """Return whether nothing is known that speaks against it."""
    if not folder.name or os.path.ismount(folder) or not os.access(folder.parent, os.W_OK):
        return False
    if _stands_in(folder):  # and would be left in the old one
        return False
    with os.scandir(folder) as entries:
        staying = [entry for entry in entries if entry.name not in changed]
    return len(staying) <= MOST_LINKS and not any(
        entry.is_dir(follow_symlinks=False) for entry in staying
    )


def _stands_in(folder: Path) -> bool:
    try:
        return Path.cwd().is_relative_to(folder)
    except OSError:  # this process stands in a folder that was removed
        return False


def _exchange(folder: Path, files: Mapping[str, bytes], changed: Set[str]) -> None:
    aside = _aside(folder)
    try:
        os.mkdir(aside)
        write_through(aside / MARK, json.dumps(sorted(changed)).encode())
        for name, content in files.items():
            write_through(aside / name, content)
        _make_alike(folder, aside)
        for name in os.listdir(folder):
            if name not in changed:
                os.link(folder / name, aside / name, follow_symlinks=False)
        sync_folder(aside)
        _exchange_names(folder, aside)
        sync_folder(folder.parent)
    except OSError as error:
        if error.errno not in NOT_HERE or (folder / MARK).exists():
            raise
        recover(folder)
        _move_one_by_one(folder, files, {*changed} - files.keys())


def _make_alike(folder: Path, aside: Path) -> None:
    """Give a folder the owner, the rights and the lists of rights of another."""
    wanted, found = folder.stat(), aside.stat()
    if (wanted.st_uid, wanted.st_gid) != (found.st_uid, found.st_gid):
        os.chown(aside, wanted.st_uid, wanted.st_gid)
    shutil.copystat(folder, aside)


def _exchange_names(one: Path, other: Path) -> None:
    """Let two folders exchange their names in one step.

    Raises:
        OSError: If the system cannot, ``ENOSYS`` where it has no such call.
    """
    call = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if call is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    here, exchange = -100, 2  # AT_FDCWD and RENAME_EXCHANGE of linux/fcntl.h and linux/fs.h
    if call(here, os.fsencode(one), here, os.fsencode(other), ctypes.c_uint(exchange)) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def _remove_old(old: Path, new: Path) -> None:
    """Remove the old state; what strangers put there while the folders were exchanged is kept.

    But for a lock: a process on its way to the folder may still come upon the old state, and make
    one in there, which it then finds not to be that of the folder.
    """
    exchanged = (new / MARK).exists()
    changed = {LOCK, MARK, *json.loads((new / MARK).read_bytes())} if exchanged else {LOCK}
    for tries_left in reversed(range(MOST_TRIES)):
        for name in os.listdir(old):
            if name in changed or _same(old / name, new / name):
                os.unlink(old / name)
            elif exchanged:
                os.replace(old / name, new / name)
        try:
            return os.rmdir(old)
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST) or tries_left == 0:
                raise


def _same(one: Path, other: Path) -> bool:
    try:
        return os.path.samestat(one.lstat(), other.lstat())
    except FileNotFoundError:
        return False


def _move_one_by_one(folder: Path, files: Mapping[str, bytes], leaving: Set[str]) -> None:
    waiting = folder / WAITING
    os.mkdir(waiting)
    for name, content in files.items():
        write_through(waiting / name, content)
    order = {"leaving": sorted(leaving), "files": list(files)}
    write_through(waiting / MARK, json.dumps(order).encode())
    sync_folder(waiting)
    os.rename(waiting, folder / MOVING)
    sync_folder(folder)
    _move_all(folder)


def _move_all(folder: Path) -> None:
    moving = folder / MOVING
    if (moving / MARK).exists():
        order = json.loads((moving / MARK).read_bytes())
        *others, last = order["files"]
        if (moving / last).exists():  # else all are moved
            for name in (last, *order["leaving"]):
                (folder / name).unlink(missing_ok=True)
        sync_folder(folder)
        for name in (*others, last):
            if (moving / name).exists():
                os.replace(moving / name, folder / name)
        sync_folder(folder)
        os.unlink(moving / MARK)
    os.rmdir(moving)
