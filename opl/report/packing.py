"""Arrays as text: small enough for a page, and unpacked there by the browser itself.

All arrays lie behind each other in one block, which is deflated and written in base64. The page's
script reads an array by its `Packed` reference.
"""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

ABSENT = -32768  # what stands for NaN in quantised arrays
LARGEST = 32767
_LEVEL = 6

Packed = dict[str, Any]


class Packer:
    """Collects arrays."""

    def __init__(self) -> None:
        self._block = bytearray()

    def copy(self) -> Packer:
        """Return one that has collected the same, to go on with."""
        other = Packer()
        other._block[:] = self._block
        return other

    def floats(self, values: ArrayLike) -> Packed:
        """Pack numbers with seven digits."""
        return self._append(np.asarray(values, dtype="<f4"), "f32")

    def counts(self, values: ArrayLike) -> Packed:
        """Pack whole numbers from -2^31 to 2^31."""
        array = np.asarray(values)
        low, high = int(array.min(initial=0)), int(array.max(initial=0))
        if low >= 0 and high < 256:
            return self._append(array.astype("<u1"), "u8")
        if low >= -32768 and high < 32768:
            return self._append(array.astype("<i2"), "i16")
        return self._append(array.astype("<i4"), "i32")

    def rounded(self, values: ArrayLike) -> Packed:
        """Pack numbers to 1 in 65 000 of the largest; NaN stays NaN.

        The last axis is taken for the smooth one: neighbours along it cost next to nothing.
        """
        array = np.asarray(values, dtype=float)
        scale = float(np.nanmax(np.abs(array), initial=0.0)) / LARGEST or 1.0
        missing = np.isnan(array)
        codes = np.where(missing, 0.0, np.rint(np.where(missing, 0.0, array) / scale))
        whole = np.where(missing, ABSENT, codes).astype("<i2").view("<u2").ravel()
        steps = np.diff(whole, prepend=np.zeros(1, dtype="<u2"))
        return {**self._append(steps.reshape(array.shape), "i16"), "scale": scale}

    def text(self, text: str) -> Packed:
        """Pack a text."""
        return self._append(np.frombuffer(text.encode("utf-8"), dtype="<u1"), "u8")

    def block(self) -> str:
        """Return all that was packed, deflated and in base64."""
        return base64.b64encode(zlib.compress(bytes(self._block), _LEVEL)).decode("ascii")

    def _append(self, array: np.ndarray, kind: str) -> Packed:
        self._block += bytes(-len(self._block) % 4)
        at = len(self._block)
        self._block += np.ascontiguousarray(array).tobytes()
        return {"at": at, "kind": kind, "shape": list(array.shape)}
