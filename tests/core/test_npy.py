"""Arrays out of bytes: numbers only, no more than there are bytes for."""

from __future__ import annotations

import io

import numpy as np
import pytest

from objectmorpher_core.session.tree import ArrayError, read_npy
from tests.tree import over


def saved(array: np.ndarray, version: tuple[int, int] | None = None) -> bytes:
    out = io.BytesIO()
    np.lib.format.write_array(out, array, version=version, allow_pickle=True)
    return out.getvalue()


THREE = saved(np.arange(3.0))


@over("version", [(1, 0), (2, 0)])
@pytest.mark.parametrize(
    "array",
    [
        np.arange(6.0).reshape(2, 3), np.array(True), np.zeros((0, 3), np.float32),
        np.asfortranarray(np.arange(12, dtype=np.int16).reshape(3, 4)), np.array(2.5),
    ],
    ids=str,
)  # fmt: skip
def test_an_array_comes_back(array: np.ndarray, version: tuple[int, int]) -> None:
    back = read_npy(saved(array, version))
    assert back.dtype == array.dtype
    np.testing.assert_array_equal(back, array)


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (b"", "no array"),
        (THREE[:-1], "longer or shorter"),
        (THREE + b"x", "longer or shorter"),
        (
            THREE.replace(b"(3,), }" + b" " * 20, b"(2147483648, 2147483648), }"),
            "longer or shorter",
        ),
        (THREE.replace(b"(3,), }" + b" " * 10, b"(99999999999,), }"), "longer or shorter"),
        (saved(np.array([{}])), "no array of numbers"),
        (saved(np.array(["a"])), "no array of numbers"),
        (saved(np.array([1j])), "no array of numbers"),
        (saved(np.array([1.0, np.nan])), "not finite"),
        (THREE.replace(b"(3,)", b"(-3,)"), "no array"),
    ],
)
def test_what_lies_is_refused(data: bytes, told: str) -> None:
    with pytest.raises(ArrayError, match=told):
        read_npy(data)
