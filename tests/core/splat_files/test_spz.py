"""The versions of .spz, packed here by hand from the format's description."""

from __future__ import annotations

import gzip
import struct
from dataclasses import replace

import numpy as np
import pytest
import zstandard

from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.splat_files.splats.spz import (
    HEADER,
    SpzParts,
    decode_spz,
    encode_spz,
    unpack,
)
from tests.core.splat_files.clouds import gaussians, matched

HALF = np.sqrt(0.5)
POSITION = np.array([1.5, -0.25, 3.0])
OURS = POSITION * [1, -1, -1]


def head(version: int, flags: int = 0, degree: int = 0) -> bytes:
    return HEADER.pack(b"NGSP", version, 1, degree, 12, flags, 0)


def fixed(position: np.ndarray) -> bytes:
    return b"".join(int(value * 4096).to_bytes(3, "little", signed=True) for value in position)


REST = (
    bytes([204]) + bytes([128, 128, 128]) + bytes([160, 128, 96])
)  # alpha .8, grey, e^0 e^-2 e^-4
# a quarter turn about the file's y axis
TURN_2 = bytes([128, round(127.5 + 127.5 * HALF), 128])
TURN_3 = struct.pack("<I", (3 << 30) | (511 << 10))  # w is left out: x = z = 0, y = sqrt(1/2)


def check(data: bytes, turn_error: float) -> None:
    cloud = decode_spz(data)
    np.testing.assert_allclose(cloud.means, [OURS], atol=1e-3)
    np.testing.assert_allclose(cloud.opacities, [0.8], atol=1e-6)
    np.testing.assert_allclose(cloud.scales, [np.exp([0, -2, -4])], rtol=1e-5)
    np.testing.assert_allclose(cloud.colors, 0.5, atol=0.004)
    # The longest axis was x of the file; turned about y it lies along -z of the file, z of ours
    axis = np.linalg.eigh(cloud.covariances()[0])[1][:, -1]
    np.testing.assert_allclose(np.abs(axis), [0, 0, 1], atol=turn_error)


def test_version_1_has_half_floats():
    body = POSITION.astype("<f2").tobytes() + REST + TURN_2
    check(gzip.compress(head(1) + body), 0.02)


def test_version_2_has_three_components_of_the_quaternion():
    check(gzip.compress(head(2) + fixed(POSITION) + REST + TURN_2), 0.02)


def test_version_3_has_the_smallest_three():
    check(gzip.compress(head(3) + fixed(POSITION) + REST + TURN_3), 0.003)


def version_4(flags: int = 0, records: bytes = b"", degree: int = 0) -> bytes:
    columns = [fixed(POSITION), REST[:1], REST[1:4], REST[4:], TURN_3]
    columns += [bytes(9)] if degree == 1 else []
    packed = [zstandard.ZstdCompressor().compress(column) for column in columns]
    table = b"".join(
        struct.pack("<QQ", len(p), len(c)) for p, c in zip(packed, columns, strict=True)
    )
    start = HEADER.pack(b"NGSP", 4, 1, degree, 12, flags, len(columns))
    start += struct.pack("<I", 32 + len(records)) + bytes(12)
    return start + records + table + b"".join(packed)


@pytest.mark.parametrize("degree", [0, 1])
def test_version_4_packs_each_column_by_itself(degree):
    check(version_4(degree=degree), 0.003)


def test_harmonics_are_passed_over():
    check(gzip.compress(head(3, degree=1) + fixed(POSITION) + REST + TURN_3 + bytes(9)), 0.003)


AXES = struct.Struct("<III")


@pytest.mark.parametrize("is_4", [False, True])
def test_an_extension_may_say_that_y_is_down(is_4):
    record = struct.pack("<II", 0x12340001, 3) + b"abc" + AXES.pack(0xADBE0003, 4, 6)
    if is_4:
        data = version_4(2, record)
    else:
        data = gzip.compress(head(3, 2) + fixed(POSITION) + REST + TURN_3 + record)
    np.testing.assert_allclose(decode_spz(data).means, [POSITION], atol=1e-3)


def test_axes_that_mirror_are_refused():
    record = AXES.pack(0xADBE0003, 4, 8)
    with pytest.raises(ValueError, match="system 8"):
        decode_spz(gzip.compress(head(3, 2) + fixed(POSITION) + REST + TURN_3 + record))


def test_positions_are_as_fine_as_their_reach_allows():
    bits = [unpack(encode_spz(scaled(s))).fractional_bits for s in (0.01, 0.5, 1.0, 100.0, 1e5)]
    assert bits == sorted(bits, reverse=True)
    assert bits[0] == 24
    assert bits[2] >= 20


def scaled(scale: float) -> Gaussians:
    cloud = gaussians(50)
    return replace(cloud, means=cloud.means / np.abs(cloud.means).max() * np.float32(scale))


def test_version_3_is_written_and_its_columns_have_the_described_sizes():
    parts = unpack(encode_spz(gaussians(7)))
    assert isinstance(parts, SpzParts)
    assert parts.version == 3
    columns = (parts.positions, parts.colors, parts.scales, parts.rotations)
    assert [c.shape for c in columns] == [(7, 9), (7, 3), (7, 3), (7, 4)]
    body = gzip.decompress(encode_spz(gaussians(7)))
    assert len(body) == 16 + 7 * 20


def test_an_empty_file_has_no_gaussians():
    assert len(decode_spz(gzip.compress(HEADER.pack(b"NGSP", 3, 0, 0, 12, 0, 0)))) == 0


def test_trailing_bytes_are_passed_over():
    body = gzip.decompress(encode_spz(gaussians(30)))
    matched(decode_spz(gzip.compress(body + b"more")), gaussians(30))
