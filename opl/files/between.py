"""What a process and its copy pass to each other: values, and which of them takes what.

Everything is made before the copy and then used by both.
"""

from __future__ import annotations

import io
import mmap
import os
import pickle
import struct
import tempfile
from collections.abc import Iterator
from typing import Any

_PLACE = struct.Struct("<QQ")  # where a message begins in its file, and how long it is
_COUNT = struct.Struct("<I")


class Known:
    """Objects that both have: what holds them is passed with their numbers in their place."""

    def __init__(self) -> None:
        self._objects: list[object] = []
        self._numbers: dict[int, int] = {}

    def add(self, one: object) -> None:
        """Add an object, in the same order in both."""
        self._numbers[id(one)] = len(self._objects)
        self._objects.append(one)

    def dumps(self, value: object) -> bytes:
        """Return a value as bytes."""
        content = io.BytesIO()
        _Pickler(content, self._numbers).dump(value)
        return content.getvalue()

    def loads(self, content: bytes) -> Any:
        """Return a value from its bytes."""
        return _Unpickler(io.BytesIO(content), self._objects).load()


class _Pickler(pickle.Pickler):
    def __init__(self, file: io.BytesIO, numbers: dict[int, int]) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._numbers = numbers

    def persistent_id(self, one: object) -> int | None:
        return self._numbers.get(id(one))


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, objects: list[object]) -> None:
        super().__init__(file)
        self._objects = objects

    def persistent_load(self, number: int) -> object:
        return self._objects[number]


class Line:
    """Messages of any size from one to the other: nobody waits until they are read."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - open as long as this is
        self._out, self._in = os.pipe()
        self._end = 0

    def send(self, message: bytes) -> None:
        """Send a message.

        Raises:
            OSError: If there is no room for it, or nobody to read it.
        """
        place = _PLACE.pack(self._end, len(message))
        rest = memoryview(message)
        while rest:
            written = os.pwrite(self._file.fileno(), rest, self._end)
            self._end, rest = self._end + written, rest[written:]
        os.write(self._in, place)

    def receive(self) -> bytes | None:
        """Wait for the next message; None if there will be none."""
        place = os.read(self._out, _PLACE.size)
        if len(place) < _PLACE.size:
            return None
        start, length = _PLACE.unpack(place)
        message = bytearray()
        while len(message) < length:
            message += os.pread(self._file.fileno(), length - len(message), start + len(message))
        return bytes(message)

    def only_receive(self) -> None:
        """Give up sending, so that receiving ends with the other one."""
        os.close(self._in)
        self._in = -1

    def only_send(self) -> None:
        """Give up receiving, so that sending fails without the other one."""
        os.close(self._out)
        self._out = -1

    def close(self) -> None:
        """Give up both."""
        self._file.close()
        for end in (self._out, self._in):
            if end >= 0:
                os.close(end)
        self._out = self._in = -1


class Turns:
    """Lists of items that are taken one by one, each by whoever asks first."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - open as long as this is
        self._next = mmap.mmap(-1, mmap.PAGESIZE)

    @property
    def most_lists(self) -> int:
        """How many lists there can be."""
        return len(self._next) // _COUNT.size

    def taken(self, of: int, length: int) -> Iterator[int]:
        """Yield the items of a list that are taken here, by their numbers.

        Args:
            of: Number of the list.
            length: How many items it has.
        """
        import fcntl  # where processes are copied there is one

        while True:
            fcntl.lockf(self._file, fcntl.LOCK_EX)  # let go of at the end of a process, too
            try:
                (item,) = _COUNT.unpack_from(self._next, of * _COUNT.size)
                _COUNT.pack_into(self._next, of * _COUNT.size, item + 1)
            finally:
                fcntl.lockf(self._file, fcntl.LOCK_UN)
            if item >= length:
                return
            yield item

    def close(self) -> None:
        """Give them up."""
        self._file.close()
        self._next.close()
