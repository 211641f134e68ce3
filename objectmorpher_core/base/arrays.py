"""Names of the array types, arrays that are read-only, and pixels as integers or in [0, 1]."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any, Protocol

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


def freeze(owner: object, **dtypes: npt.DTypeLike | None) -> None:
    """Make the named arrays of a frozen dataclass read-only, as `frozen` does.

    A field that is None stays None; a dtype of None leaves the array's own.
    """
    for name, dtype in dtypes.items():
        if (array := getattr(owner, name)) is not None:
            object.__setattr__(owner, name, frozen(array, dtype))


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


def same_values(one: Any, other: Any) -> bool:
    """Whether two arrays, dataclasses or tuples hold equal values; those that share them do."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other)
    if is_dataclass(one):
        return all(same_values(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same_values, one, other))
    return bool(one == other)


class PixelSource(Protocol):
    """The stored pixels of a picture file (H, W, 1..4): an array, or a source of rows like one."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    @property
    def dtype(self) -> np.dtype: ...

    def __getitem__(self, rows: slice, /) -> np.ndarray: ...


def unit_pixels(pixels: Pixels) -> F32:
    """u8 or u16 pixels of any shape as sRGB values in [0, 1]."""
    return pixels.astype(np.float32) * np.float32(1.0 / np.iinfo(pixels.dtype).max)


def pixels_from_unit(values: np.ndarray, dtype: np.dtype) -> Pixels:
    """sRGB values, clipped to [0, 1], as u8 or u16, rounded to nearest."""
    return np.rint(np.clip(values, 0, 1) * np.iinfo(dtype).max).astype(dtype)


def crop(
    image: np.ndarray, own: tuple[int, int, int, int], box: tuple[int, int, int, int]
) -> np.ndarray:
    """`image`, which covers the box `own` of the photo, cut or padded with 0 to `box`."""
    x0, y0, x1, y1 = box
    result = np.zeros((y1 - y0, x1 - x0, *image.shape[2:]), image.dtype)
    left, top = max(x0, own[0]), max(y0, own[1])
    right, bottom = min(x1, own[2]), min(y1, own[3])
    if left < right and top < bottom:
        result[top - y0 : bottom - y0, left - x0 : right - x0] = image[
            top - own[1] : bottom - own[1], left - own[0] : right - own[0]
        ]
    return result
