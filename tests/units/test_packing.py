"""Arrays as pages carry them, read by another reader than the viewer's."""

import base64
import math
import zlib

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from opl.report.packing import Packer

TYPES = {"f32": "<f4", "u8": "<u1", "i16": "<i2", "i32": "<i4"}


def unpacked(packer, packed):
    """Read an array as written down in the viewer's own words."""
    block = zlib.decompress(base64.b64decode(packer.block()))
    count = math.prod(packed["shape"])
    array = np.frombuffer(block, TYPES[packed["kind"]], count, packed["at"])
    if "scale" in packed:
        total = np.cumsum(array.astype(np.int64))
        whole = (total + 32768) % 65536 - 32768
        array = np.where(whole == -32768, np.nan, whole * packed["scale"])
    return array.reshape(packed["shape"])


FLOATS = hnp.arrays(
    float,
    hnp.array_shapes(max_dims=3, max_side=6),
    elements=st.one_of(st.floats(-50.0, 50.0), st.just(math.nan)),
)


@given(FLOATS)
def test_rounded_numbers_are_right_to_half_a_step_and_nan_stays(values):
    packer = Packer()
    packer.text("abc")  # what follows begins at a whole number of words
    found = unpacked(packer, packer.rounded(values))
    assert (np.isnan(found) == np.isnan(values)).all()
    largest = np.nanmax(np.abs(values), initial=0.0)
    assert np.nanmax(np.abs(found - values), initial=0.0) <= largest / 32767 / 2 + 1e-12


@given(hnp.arrays(np.int64, st.integers(0, 30), elements=st.integers(-(2**31), 2**31 - 1)))
def test_whole_numbers_stay(values):
    packer = Packer()
    assert (unpacked(packer, packer.counts(values)) == values).all()


def test_several_arrays_lie_side_by_side():
    packer = Packer()
    text = packer.text("läuft")
    floats = packer.floats([[1.5, math.nan], [-2.25, 0.0]])
    counts = packer.counts([0, 255])
    assert bytes(unpacked(packer, text)).decode() == "läuft"
    assert np.array_equal(unpacked(packer, floats), [[1.5, math.nan], [-2.25, 0.0]], equal_nan=True)
    assert counts["kind"] == "u8" and unpacked(packer, counts).tolist() == [0, 255]
