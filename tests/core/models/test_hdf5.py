"""Keras's weight files are read as h5py reads them, and damaged ones end in one sentence."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_core import models
from objectmorpher_core.models.hdf5 import read_arrays

SMALL = Path(__file__).parent / "small.weights.h5"  # written by h5py 3.16: see `small_arrays`
MANY = 20  # arrays in one group: more than one table of names holds


def small_arrays() -> dict[str, np.ndarray]:
    """What the file holds."""
    found = {
        "block1/layers/conv2d/vars/0": np.arange(2 * 3 * 4 * 5, dtype=np.float32).reshape(
            2, 3, 4, 5
        ),
        "block1/layers/conv2d/vars/1": np.linspace(-1, 1, 7, dtype=np.float32),
        "single": np.array([[np.pi]], np.float32),
    }
    found |= {f"many/{k}": np.full(3, k, np.float32) for k in range(MANY)}
    return found


def write_small(path: Path) -> None:
    """As Keras does: groups, attributes, arrays in one piece."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name, values in small_arrays().items():
            file.create_dataset(name, data=values)
        file["block1/layers/conv2d"].attrs["name"] = "block1_conv1"


def check(found: dict[str, np.ndarray]) -> None:
    expected = small_arrays()
    assert set(found) == set(expected)
    for name, values in expected.items():
        assert found[name].dtype == np.float32
        np.testing.assert_array_equal(found[name], values)


def test_every_array_comes_out_by_its_path():
    check(read_arrays(SMALL))


def test_what_h5py_writes_today_is_read(tmp_path):
    write_small(tmp_path / "new.h5")
    check(read_arrays(tmp_path / "new.h5"))


def test_the_arrays_of_the_real_file_are_h5pys():
    h5py = pytest.importorskip("h5py")
    path = models.path("hed-vgg")
    if path is None:
        pytest.skip("hed-vgg is not in the cache")
    found = read_arrays(path)
    with h5py.File(path) as file:
        assert all(np.array_equal(file[name], values) for name, values in found.items())
    assert len(found) == 38 and found["block5/layers/conv2d_2/vars/0"].shape == (3, 3, 512, 512)


@pytest.mark.parametrize("share", [0, 0.001, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99])
def test_a_file_cut_off_is_one_sentence(tmp_path, share):
    whole = SMALL.read_bytes()
    (tmp_path / "cut.h5").write_bytes(whole[: int(len(whole) * share)])
    with pytest.raises(models.ModelError, match=r"cut\.h5 is damaged, or no HDF5 file"):
        read_arrays(tmp_path / "cut.h5")


def test_changed_bytes_give_arrays_or_one_sentence(tmp_path):
    """Addresses, counts and sizes that lie: never another error, a hang, or much memory."""
    random, whole = np.random.default_rng(0), SMALL.read_bytes()
    odd = (0, 1, 255, 2**31, 2**63, 2**64 - 1)
    refused = 0
    for _ in range(1500):
        data = bytearray(whole)
        at = int(random.integers(0, len(data) - 8))
        struct.pack_into("<Q", data, at, int(odd[random.integers(len(odd))]))
        (tmp_path / "odd.h5").write_bytes(data)
        try:
            found = read_arrays(tmp_path / "odd.h5")
        except models.ModelError:
            refused += 1
        else:
            assert sum(values.nbytes for values in found.values()) <= 2 * len(whole)
    assert 100 < refused < 1500


def test_chunks_and_filters_are_refused(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "packed.h5", "w") as file:
        file.create_dataset("a", data=np.zeros((64, 64), np.float32), compression="gzip")
    with pytest.raises(models.ModelError, match="no HDF5 file that we can read"):
        read_arrays(tmp_path / "packed.h5")


def test_a_file_that_is_not_there_is_one_sentence(tmp_path):
    with pytest.raises(models.ModelError, match=r"gone\.h5 cannot be read"):
        read_arrays(tmp_path / "gone.h5")
