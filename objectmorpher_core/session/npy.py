"""Arrays as NumPy's .npy bytes: of numbers only, and no larger than the bytes that are there."""

from __future__ import annotations

import io
import math

import numpy as np

from ..base.arrays import all_finite

HEADER = 1 << 17  # bytes, more than any header has
KINDS = "fiub"  # floating point, whole numbers, truths; never objects


class ArrayError(ValueError):
    """The bytes are no array that can be taken; what they are, as the end of a sentence."""


def read_npy(data: bytes | bytearray) -> np.ndarray:
    """The array in a .npy file's bytes, a view of them. Raises ArrayError.

    The header is compared with the bytes before anything is allocated.
    """
    file = io.BytesIO(bytes(memoryview(data)[:HEADER]))
    try:
        version = np.lib.format.read_magic(file)
        if version == (1, 0):
            shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(file)
        else:
            shape, is_fortran, dtype = np.lib.format.read_array_header_2_0(file)
    except Exception as error:  # the header is a Python literal: whatever parsing it stumbles over
        raise ArrayError("no array") from error
    if dtype.kind not in KINDS:
        raise ArrayError("no array of numbers")
    if not all(0 <= n < 1 << 40 for n in shape) or len(shape) > 8:
        raise ArrayError("no array")
    if math.prod(shape) * dtype.itemsize != len(data) - file.tell():
        raise ArrayError("an array that is longer or shorter than its bytes")
    if math.prod(shape) == 0 and max(shape, default=0) > 1 << 24:
        raise ArrayError("no array")  # an empty one that claims memory which nothing backs
    flat = np.frombuffer(data, dtype, math.prod(shape), file.tell())
    array = flat.reshape(shape, order="F" if is_fortran else "C")
    if dtype.kind == "f" and not all_finite(array):
        raise ArrayError("an array with values that are not finite")
    return array
