"""Damaged and malicious splat files: one sentence each, in bounded time and memory."""

from __future__ import annotations

import gzip
import struct
from collections.abc import Callable
from contextlib import suppress

import numpy as np
import pytest
import zstandard

from objectmorpher_core.splat_files import FORMATS, SplatFileError, read
from objectmorpher_core.splat_files.splats.ply import READ
from objectmorpher_core.splat_files.splats.spz import HEADER
from tests.core.splat_files.clouds import gaussians
from tests.core.splat_files.refusal import measured, refusal

PLY, PACKED, SPLAT, SPZ = (
    FORMATS[ending].encode(gaussians(300))
    for ending in (".ply", ".compressed.ply", ".splat", ".spz")
)
BODY = gzip.decompress(SPZ)
TEXT = (
    "ply\nformat ascii 1.0\nelement vertex 2\n"
    + "".join(f"property float {name}\n" for name in READ)
    + "end_header\n"
).encode()
ROW = b" ".join([b"0.5"] * 14) + b"\n"


def spz_head(count: int, version: int = 3, degree: int = 0, bits: int = 12) -> bytes:
    return HEADER.pack(b"NGSP", version, count, degree, bits, 0, 0)


def spz_4(count: int, rows: list[tuple[int, int]], streams: bytes, table: int = 32) -> bytes:
    head = HEADER.pack(b"NGSP", 4, count, 0, 12, 0, len(rows)) + struct.pack("<I", table)
    return head.ljust(32, b"\0") + b"".join(struct.pack("<QQ", *row) for row in rows) + streams


def zstandard_bomb() -> bytes:
    """Five streams of a MiB each where 100 Gaussians need a few hundred bytes."""
    whole = zstandard.ZstdCompressor(level=1)
    packed = whole.compress(bytes(1 << 20))
    sizes = [900, 100, 300, 300, 400]
    return spz_4(100, [(len(packed), size) for size in sizes], packed * 5) + b"rest"


def gzip_bomb(count: int) -> bytes:
    """64 MiB of zeros in 64 KiB, under a header for `count` Gaussians."""
    return gzip.compress(spz_head(count) + bytes(64 << 20), 9)


SPOILT: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "ply empty": (".ply", lambda: b"", "not a .ply file"),
    "ply of another kind": (".ply", lambda: b"solid\n" + PLY, "not a .ply file"),
    "ply magic alone": (".ply", lambda: b"ply\n", "header does not end"),
    "ply cut in its header": (".ply", lambda: PLY[:100], "header does not end"),
    "ply endless header": (
        ".ply", lambda: b"ply\n" + b"comment x\n" * 2_000_000, "header does not end"),
    "ply one byte short": (".ply", lambda: PLY[:-1], "ends early"),
    "ply cut in the middle": (".ply", lambda: PLY[: len(PLY) // 2], "ends early"),
    "ply negative count": (".ply", lambda: PLY.replace(b"vertex 300", b"vertex -3"), "damaged"),
    "ply huge count": (
        ".ply", lambda: PLY.replace(b"vertex 300", b"vertex 4294967295"), "more than"),
    "ply count of the limit": (
        ".ply", lambda: PLY.replace(b"vertex 300", b"vertex 20000000"), "ends early"),
    "ply count of 5000 digits": (
        ".ply", lambda: PLY.replace(b"vertex 300", b"vertex " + b"9" * 5000), "damaged"),
    "ply count in another script": (
        ".ply", lambda: PLY.replace(b"vertex 300", "vertex ٣٠٠".encode()), "damaged"),
    "ply huge element before": (
        ".ply", lambda: PLY.replace(
            b"element vertex", b"element x 99999999999\nproperty double d\nelement vertex"),
        "ends early"),
    "ply unknown type": (".ply", lambda: PLY.replace(b"float x", b"quad x"), "damaged"),
    "ply no format": (
        ".ply", lambda: PLY.replace(b"format binary_little_endian 1.0\n", b""), "damaged"),
    "ply unknown format": (
        ".ply", lambda: PLY.replace(b"binary_little", b"binary_middle"), "damaged"),
    "ply binary noise for a header": (
        ".ply", lambda: b"ply\n" + bytes(range(256)) * 8 + b"end_header\n", "damaged"),
    "ply property before any element": (
        ".ply", lambda: PLY.replace(b"element vertex 300\n", b""), "damaged"),
    "ply property twice": (".ply", lambda: PLY.replace(b"float nx", b"float ny"), "damaged"),
    "ply list among the properties": (
        ".ply", lambda: PLY.replace(b"property float nx", b"property list uchar int nx"), "mesh"),
    "ply without vertices": (".ply", lambda: PLY.replace(b"vertex", b"corner"), "no vertices"),
    "ply without opacity": (
        ".ply", lambda: PLY.replace(b"float opacity", b"float opaqueness"), "opacity is missing"),
    "ply nothing but NaN": (
        ".ply", lambda: PLY.split(b"end_header\n")[0] + b"end_header\n"
        + np.full(300 * 17, np.nan, "<f4").tobytes(), "can be drawn"),
    "ply text of words": (".ply", lambda: TEXT + b"a b c\nd e f\n", "damaged or ends early"),
    "ply text too short": (".ply", lambda: TEXT + ROW, "damaged or ends early"),
    "ply text of ragged rows": (".ply", lambda: TEXT + ROW[:-5] + b"\n" + ROW, "damaged"),
    "ply text in one endless line": (".ply", lambda: TEXT + b"1 " * 20_000_000, "damaged"),
    "points without positions": (
        ".ply", lambda: b"ply\nformat ascii 1.0\nelement vertex 1\nproperty uchar red\n"
        b"end_header\n7\n", "x, y or z is missing"),
    "points nowhere": (
        ".ply", lambda: b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
        b"property float y\nproperty float z\nend_header\nnan 0 0\n", "finite position"),
    "points none": (
        ".ply", lambda: b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\n"
        b"property float y\nproperty float z\nend_header\n", "no points"),
    "packed too few chunks": (
        ".compressed.ply", lambda: PACKED.replace(b"chunk 2", b"chunk 1"), "1 chunks of 256"),
    "packed too many chunks": (
        ".compressed.ply", lambda: PACKED.replace(b"chunk 2", b"chunk 99999999999"), "chunks"),
    "packed no chunks": (
        ".compressed.ply", lambda: PACKED.replace(b"element chunk", b"element lump"), "no chunks"),
    "packed without bounds": (
        ".compressed.ply", lambda: PACKED.replace(b"min_scale_y", b"min_scale_q"), "min_scale_y"),
    "packed words of another size": (
        ".compressed.ply", lambda: PACKED.replace(b"uint packed_scale", b"float packed_scale"),
        "packed_scale is missing"),
    "packed cut": (".compressed.ply", lambda: PACKED[:-7], "ends early"),
    "packed NaN bounds": (
        ".compressed.ply", lambda: PACKED.split(b"end_header\n")[0] + b"end_header\n"
        + np.full(36, np.nan, "<f4").tobytes() + bytes(4800), "can be drawn"),
    "packed huge count": (
        ".compressed.ply", lambda: PACKED.replace(b"vertex 300", b"vertex 99999999999"),
        "more than"),
    "splat empty": (".splat", lambda: b"", "empty"),
    "splat odd length": (".splat", lambda: SPLAT[:-1], "no multiple of 32"),
    "splat of NaN": (
        ".splat", lambda: np.full(80, np.nan, "<f4").tobytes(), "can be drawn"),
    "splat negative scales": (
        ".splat", lambda: np.full(80, -1, "<f4").tobytes(), "negative scales"),
    "spz empty": (".spz", lambda: b"", "not an .spz file"),
    "spz of another kind": (".spz", lambda: PLY, "not an .spz file"),
    "spz gzip of another kind": (".spz", lambda: gzip.compress(PLY), "not an .spz file"),
    "spz gzip cut": (".spz", lambda: SPZ[: len(SPZ) // 2], "ends early"),
    "spz gzip damaged": (
        ".spz", lambda: SPZ[:40] + bytes([b ^ 255 for b in SPZ[40:90]]) + SPZ[90:], "unpacked"),
    "spz gzip magic alone": (".spz", lambda: b"\x1f\x8b", "ends early"),
    "spz body cut": (".spz", lambda: gzip.compress(BODY[:-5]), "ends early"),
    "spz future version": (
        ".spz", lambda: gzip.compress(spz_head(1, 9) + bytes(64)), "version 9"),
    "spz unknown degree": (
        ".spz", lambda: gzip.compress(spz_head(1, 3, 77) + bytes(64)), "damaged"),
    "spz 255 fractional bits": (
        ".spz", lambda: gzip.compress(spz_head(1, 3, 0, 255) + bytes(64)), "damaged"),
    "spz huge count": (
        ".spz", lambda: gzip.compress(spz_head(2**32 - 1) + bytes(64)), "more than"),
    "spz count beyond its bytes": (
        ".spz", lambda: gzip.compress(spz_head(19_000_000) + bytes(64)), "ends early"),
    "spz unpacks too far": (
        ".spz", lambda: gzip.compress(spz_head(19_000_000, 3, 4) + bytes(64)), "1 GiB"),
    "spz gzip bomb": (".spz", lambda: gzip_bomb(2_000_000_000), "more than"),
    "spz 4 cut": (".spz", lambda: spz_4(1, [], b"")[:20], "ends early"),
    "spz 4 without streams": (".spz", lambda: spz_4(100, [], b""), "table of streams"),
    "spz 4 table outside": (
        ".spz", lambda: spz_4(100, [(9, 900)] * 5, b"", 2**32 - 1), "table of streams"),
    "spz 4 streams outside": (
        ".spz", lambda: spz_4(100, [(2**63, s) for s in (900, 100, 300, 300, 400)], b""),
        "table of streams"),
    "spz 4 unpacked size of another count": (
        ".spz", lambda: spz_4(100, [(4, 2**62)] * 5, b"abcd" * 5), "table of streams"),
    "spz 4 noise": (
        ".spz", lambda: spz_4(100, [(4, s) for s in (900, 100, 300, 300, 400)], b"abcd" * 5),
        "unpacked"),
}  # fmt: skip


@pytest.mark.parametrize("name", SPOILT)
def test_each_gives_one_sentence_in_bounded_time_and_memory(name, tmp_path):
    ending, make, told = SPOILT[name]
    path = tmp_path / f"object{ending}"
    path.write_bytes(make())
    assert told in refusal(path)


def test_a_gzip_bomb_is_unpacked_only_as_far_as_its_header_says(tmp_path):
    """100 Gaussians and 64 MiB of zeros behind them: what is there is read, no more."""
    path = tmp_path / "bomb.spz"
    path.write_bytes(gzip_bomb(100))
    with measured():
        assert len(read(path)) == 100


def test_a_zstandard_bomb_is_unpacked_only_as_far_as_its_header_says(tmp_path):
    path = tmp_path / "bomb.spz"
    path.write_bytes(zstandard_bomb())
    with measured():
        assert len(read(path)) == 100


@pytest.mark.parametrize("ending", FORMATS)
def test_random_damage_never_escapes_as_anything_else(ending, tmp_path):
    """A byte changed here and there, or the end cut off: read, or refused with a sentence."""
    data = {".ply": PLY, ".compressed.ply": PACKED, ".splat": SPLAT, ".spz": SPZ}[ending]
    rng = np.random.default_rng(5)
    for _ in range(150):
        spoilt = bytearray(data[: rng.integers(1, len(data)) if rng.random() < 0.3 else len(data)])
        for at in rng.integers(0, len(spoilt), 3):
            spoilt[at] = rng.integers(256)
        with suppress(SplatFileError):
            FORMATS[ending].decode(bytes(spoilt))
