"""Names of the array types, and the one way to make an array of the document read-only."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Sparse = Any  # a scipy.sparse.csr_array: its own type hints leave its fields unknown
F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]
U8 = npt.NDArray[np.uint8]
U16 = npt.NDArray[np.uint16]
Selection = npt.NDArray[Any]  # (H, W) bool, or u8: how much of a pixel is meant, 255 for all
RGB = npt.NDArray[np.uint8]  # (H, W, 3)
Pixels = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]  # (H, W, 3), the photo's own bit depth


AT_A_TIME = 1 << 20  # numbers that are looked at together


def frozen(array: np.ndarray, dtype: npt.DTypeLike | None = None) -> np.ndarray:
    """`array` or a view, contiguous and read-only: a slip that would change the document raises.

    Compiled kernels take only frozen arrays, too: numba compiles anew for each mixture of
    writable and read-only arguments, and that costs seconds.
    """
    if _is_frozen(array) and (dtype is None or array.dtype == dtype):
        return array  # a solve asks for it thousands of times
    array = np.ascontiguousarray(array, dtype=dtype).view()
    array.setflags(write=False)
    return array


def _is_frozen(array: np.ndarray) -> bool:
    if type(array) is not np.ndarray or array.ndim == 0:
        return False
    return array.flags.c_contiguous and not array.flags.writeable


def all_finite(array: np.ndarray) -> bool:
    """Whether none of the numbers is infinite or none at all; a photo's worth takes no memory."""
    flat = array.ravel(order="K")  # no copy of what is contiguous
    pieces = range(0, flat.size, AT_A_TIME)
    return all(bool(np.isfinite(flat[k : k + AT_A_TIME]).all()) for k in pieces)


def frozen_rows(matrix: Sparse) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the row starts, columns and values of a sparse matrix as kernels take them.

    scipy's indices are of 64 bits after some sums: a kernel would be compiled anew for them.
    """
    return frozen(matrix.indptr, np.int32), frozen(matrix.indices, np.int32), frozen(matrix.data)
