"""Sessions as an attacker makes them: `python -m tests.fuzz.hostile [--session FILE]`.

Every member is replaced, added, doubled, renamed and inflated, with hashes and checksums made
right, and what reading takes of memory and time is compared with the session as it was. Prints a
table; exits with 1 where something took too much, or was neither read nor refused in one sentence.
"""

from __future__ import annotations

import argparse
import gc
import hashlib
import io
import json
import struct
import sys
import time
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from objectmorpher_core.pictures.image import encode_mask
from objectmorpher_core.session.file import SessionError, decode_session

from .checks import check_sentence

MOST = 500 << 20  # bytes of memory beyond what the session takes as it was
SLOWEST = 10.0  # s of the processor beyond that
ZEROS = 768 << 20  # bytes that a member is inflated by
PIECE = 16 << 20
RECENT = 16  # contents of which the sums are remembered
DOCUMENT, ARRAYS = "document.json", "arrays.npz"


@dataclass(frozen=True)
class Entry:
    """A member as it lies in the zip file: `start`, then `zeros`, packed where there are any."""

    name: str
    start: bytes
    zeros: int = 0

    @property
    def size(self) -> int:
        return len(self.start) + self.zeros

    @property
    def packed(self) -> bytes:
        """Its bytes in the file: zeros are a thousandth there."""
        if not self.zeros:
            return self.start
        packer = zlib.compressobj(9, zlib.DEFLATED, -15)
        start = packer.compress(self.start) + packer.flush(zlib.Z_FULL_FLUSH)
        return start + _packed_zeros() * (self.zeros // PIECE) + packer.flush()

    def digest(self) -> str:
        """Its SHA-256."""
        return _digest(self.start, self.zeros)

    def crc(self) -> int:
        return _crc(zlib.crc32(self.start), self.zeros)


@lru_cache(RECENT)
def _digest(start: bytes, zeros: int) -> str:
    found = hashlib.sha256(start)
    for block in _blocks(zeros):
        found.update(block)
    return found.hexdigest()


@lru_cache(RECENT)
def _crc(start: int, zeros: int) -> int:
    """The checksum of zeros after what has the checksum `start`."""
    for block in _blocks(zeros):
        start = zlib.crc32(block, start)
    return start


def _blocks(zeros: int) -> Iterator[bytes]:
    if zeros:
        yield from repeat(bytes(PIECE), zeros // PIECE)


@cache
def _packed_zeros() -> bytes:
    """A piece of them, which may follow anything that was flushed."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    return packer.compress(bytes(PIECE)) + packer.flush(zlib.Z_FULL_FLUSH)


def written(entries: list[Entry]) -> bytes:
    """The zip file."""
    out, directory = io.BytesIO(), []
    for entry in entries:
        name, method, packed = entry.name.encode(), 8 if entry.zeros else 0, entry.packed
        facts = struct.pack("<HHHHIIIHH", 0x800, method, 0, 33, entry.crc(), len(packed),
                            entry.size, len(name), 0)  # fmt: skip
        place = struct.pack("<HHHII", 0, 0, 0, 0, out.tell())
        directory.append(struct.pack("<4sHH", b"PK\1\2", 20, 20) + facts + place + name)
        out.write(struct.pack("<4sH", b"PK\3\4", 20) + facts + name + packed)
    start = out.tell()
    out.write(b"".join(directory))
    count, size = min(len(entries), 0xFFFF), out.tell() - start
    out.write(struct.pack("<4sHHHHIIH", b"PK\5\6", 0, 0, count, count, size, start, 0))
    return out.getvalue()


def entries_of(data: bytes) -> list[Entry]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return [Entry(name, archive.read(name)) for name in archive.namelist()]


def mended(entries: list[Entry]) -> bytes:
    """The session file, with the hashes of its members as they are."""
    head = json.loads(entries[0].start)
    head["sha256"] = {entry.name: entry.digest() for entry in entries[1:]}
    return written([Entry(DOCUMENT, json.dumps(head).encode()), *entries[1:]])


def with_head(entries: list[Entry], change: Callable[[Any], None]) -> bytes:
    """The session file, document.json changed."""
    head = json.loads(entries[0].start)
    change(head)
    return mended([Entry(DOCUMENT, json.dumps(head).encode()), *entries[1:]])


def with_entry(entries: list[Entry], k: int, entry: Entry) -> list[Entry]:
    return [*entries[:k], entry, *entries[k + 1 :]]


Attack = tuple[str, Callable[[], bytes]]  # what is done, and the file when it is wanted


def attacks(session: bytes) -> Iterator[Attack]:
    """All that is done to a session."""
    entries = entries_of(session)
    assert entries[0].name == DOCUMENT
    more = [*entries, Entry("more.bin", b"", ZEROS)]
    yield "a member that nothing names", partial(mended, more)
    yield "one without a hash", partial(written, more)
    many = [*entries, *(Entry(f"{k}", b"") for k in range(400_000))]
    yield "400,000 members", partial(written, many)
    for k, entry in enumerate(entries[1:], 1):
        name = entry.name
        another = replace(entries[1 + k % (len(entries) - 1)], name=name)
        for what, found in (
            ("replaced", another),
            ("is noise", Entry(name, bytes(range(256)))),
            ("renamed", replace(entry, name=f"x/{name}")),
            ("inflated", replace(entry, zeros=ZEROS)),
            ("is zeros", Entry(name, b"", ZEROS)),
        ):
            yield f"{name} {what}", partial(mended, with_entry(entries, k, found))
        yield f"{name} twice", partial(mended, [*entries, entry])
    yield from attacks_on_arrays(entries)
    yield from attacks_on_pictures(entries)
    yield from attacks_on_the_document(entries)


def attacks_on_arrays(entries: list[Entry]) -> Iterator[Attack]:
    """The same for what is in arrays.npz."""
    at = next(k for k, e in enumerate(entries) if e.name == ARRAYS)
    arrays = entries_of(entries[at].start)

    def session(change: Callable[[], list[Entry]]) -> bytes:
        return mended(with_entry(entries, at, Entry(ARRAYS, written(change()))))

    def changed(k: int, entry: Callable[[], Entry]) -> Callable[[], bytes]:
        return partial(session, lambda: with_entry(arrays, k, entry()))

    yield (
        "an array that nothing names",
        partial(session, lambda: [*arrays, Entry("more.npy", b"", ZEROS)]),
    )
    share = 4 * ZEROS // len(arrays)
    yield "all arrays grow", partial(session, lambda: [grown(entry, share) for entry in arrays])
    for k, entry in enumerate(arrays):
        name = entry.name
        yield f"{name} longer", changed(k, partial(grown, entry, ZEROS))
        yield f"{name} another", changed(k, partial(Entry, name, arrays[k - 1].start))


def grown(entry: Entry, zeros: int) -> Entry:
    """An array of the same type of numbers with more rows, which are zeros."""
    array = np.load(io.BytesIO(entry.start))
    zeros = zeros // PIECE * PIECE
    row = array[:1].nbytes if array.ndim and len(array) else array.itemsize
    tail = array.shape[1:] if zeros % row == 0 else ()
    shape = (zeros // (row if tail else array.itemsize), *tail)
    head = io.BytesIO()
    facts = {"descr": array.dtype.str, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(head, facts)
    return Entry(entry.name, head.getvalue(), zeros)


def attacks_on_pictures(entries: list[Entry]) -> Iterator[Attack]:
    """Pictures of 240 million pixels in a quarter of a megabyte."""
    large = cache(lambda: encode_mask(np.zeros((12_000, 20_000), bool)))

    def blank(k: int) -> bytes:
        return mended(with_entry(entries, k, Entry(entries[k].name, large())))

    for k, entry in enumerate(entries):
        if entry.name.endswith((".png", ".jpg")):
            yield f"{entry.name} of 240 MP", partial(blank, k)

    def claim(head: Any) -> None:
        camera = head["document"]["photo"]["camera"]
        camera["width"], camera["height"] = 10, 10

    yield "a camera of 100 px", partial(with_head, entries, claim)


def attacks_on_the_document(entries: list[Entry]) -> Iterator[Attack]:
    """Trees that take much more than their text."""

    def objects(head: Any) -> None:
        head["document"]["objects"] *= 2000

    def named(head: Any) -> None:
        head["document"]["objects"] = [{"name": ""}] * 300_000

    def hints(head: Any) -> None:
        head["document"]["hints"] = head["document"].get("hints", []) * 60_000

    for name, change in (("objects", objects), ("bare objects", named), ("hints", hints)):
        yield f"thousands of {name}", partial(with_head, entries, change)
    blanks = Entry(DOCUMENT, entries[0].start + b" " * PIECE, ZEROS)
    yield "document.json goes on", partial(written, [blanks, *entries[1:]])
    for text in (b"[" * 8_000_000, b"[" + b"[]," * 2_700_000 + b"[]]", b"[" + b"{}," * 2_700_000):
        trees = [Entry(DOCUMENT, text), *entries[1:]]
        yield f"document.json is {text[:4]!r} ...", partial(written, trees)


@dataclass(frozen=True)
class Reading:
    """What one session took, and what was said."""

    attack: str
    memory: int  # bytes at most, beyond what the process had
    seconds: float
    told: str


def read(attack: str, data: bytes) -> Reading:
    """Reads a session with a watch on the memory (Linux)."""
    gc.collect()
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
    before, start, told = _status("VmRSS"), time.process_time(), "read"
    try:
        decode_session(data)
    except SessionError as error:
        told = str(error)
        check_sentence(told)
    seconds = time.process_time() - start
    return Reading(attack, _status("VmHWM") - before, seconds, told)


def _status(key: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) << 10 for line in lines if line.startswith(key))


def readings(
    session: bytes, chosen: Callable[[str], bool] = lambda attack: True
) -> Iterator[tuple[Reading, bool]]:
    """Each chosen attack, and whether it stayed within bounds; the session as it was comes first.

    Raises AssertionError where it was neither read nor refused with one sentence.
    """
    read("", session)  # what is imported late
    plain = read("as it was", session)
    yield plain, plain.told == "read"
    gc.freeze()  # what is there already is not looked through before each reading
    try:
        for attack, make in attacks(session):
            if not chosen(attack):
                continue
            found = read(attack, make())
            is_bounded = found.memory < plain.memory + MOST
            yield found, is_bounded and found.seconds < plain.seconds + SLOWEST
    finally:
        gc.unfreeze()


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.hostile", description=__doc__)
    parser.add_argument("--session", type=Path, help="the session that is attacked")
    options = parser.parse_args()
    if options.session:
        session = options.session.read_bytes()
    else:
        from .documents import session_seeds

        session = session_seeds()[0]
    worst = 0
    for reading, is_bounded in readings(session):
        worst += not is_bounded
        took = f"{reading.memory / 2**20:6.0f} MiB {reading.seconds:5.2f} s"
        print(f"{'ok ' if is_bounded else 'BAD'} {took}  {reading.attack}: {reading.told}")
    return int(worst > 0)


if __name__ == "__main__":
    sys.exit(main())
