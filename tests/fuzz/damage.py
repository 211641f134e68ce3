"""Files made wrong, with a sense for their structure: one seed gives one damaged file.

A flipped bit in a zip file or a PNG is found by a checksum, and nothing behind that is reached.
So what is packed is unpacked, damaged inside, and packed again with checksums that are right.
"""

from __future__ import annotations

import gzip
import io
import json
import random
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence
from typing import Any

from .zips import zipped

MOST = 1 << 20  # bytes of a damaged file
MOST_UNPACKED = 4 << 20  # bytes that are looked into
INTEGERS = (
    0, 1, 2, 3, 7, 8, 16, 32, 127, 128, 255, 256, 32767, 32768, 65535, 65536, 2**24, 2**31 - 1,
    2**31, 2**32 - 1, 2**32, 2**53, 2**63 - 1, 2**63, 2**64 - 1, -1, -2, -128, -(2**31), -(2**63),
)  # fmt: skip
FLOATS = (
    0.0, -0.0, 1.0, -1.0, 0.5, 1e-45, 1e-310, 1e38, -1e38, 1e300, float("inf"), float("-inf"),
    float("nan"),
)  # fmt: skip
TEXTS = (
    "", " ", "a", "A" * 5000, "../../../etc/passwd", "/etc/passwd", "C:\\Windows\\win.ini", "..",
    ".", "~", "a/b", "a\\b", "\0", "a\0b", "\n", "‮gnp.x", "ä€😀", "ａ", "\u0301", "\ud800", "%s%n",
    "{0}", "${HOME}", "file:///etc/passwd", "http://localhost:1/x", "data:,x", "nan", "inf", "-1",
    "1e999", "true", "null", "CON", "x" * 300 + ".png", "\ufeff", "__class__",
)  # fmt: skip
PACKED_NAMES = ("document.json", "arrays.npz", "../x", "/abs", "a\\..\\b", "ünï", "x" * 70000)


class Damage:
    """Makes damaged files out of whole ones."""

    def __init__(self, seed: str, pool: Sequence[bytes]) -> None:
        """`pool`: whole files, of which parts are put into others."""
        self._random, self._pool = random.Random(seed), pool

    def file(self) -> bytes:
        """One of the pool, damaged in a few places."""
        data = self._random.choice(self._pool)
        for _ in range(self._random.choice((0, 1, 1, 1, 2, 2, 3, 5, 9))):
            data = self.once(data)[:MOST]
        return data

    def once(self, data: bytes) -> bytes:
        """Damaged in one place: as what it is, or as mere bytes."""
        if self._random.random() < 0.3:
            return self._bytes(data)
        for is_kind, damaged in self._kinds():
            if is_kind(data):
                try:
                    return damaged(data)
                except Exception:
                    break  # it was damaged before, and is no such file any more
        return self._bytes(data)

    def _kinds(self) -> list[tuple[Callable[[bytes], bool], Callable[[bytes], bytes]]]:
        def begins(*marks: bytes) -> Callable[[bytes], bool]:
            return lambda data: data.startswith(marks)

        return [
            (begins(b"PK\3\4"), self._zip), (begins(b"\x89PNG"), self._png),
            (begins(b"\x1f\x8b"), self._gzip), (begins(b"\x93NUMPY"), self._npy),
            (begins(b"{", b"["), self._json), (begins(b"ply", b"OFF", b"solid"), self._head),
            (begins(b"RIFF"), self._riff), (begins(b"glTF"), self._glb),
            (begins(b"\xff\xd8"), self._jpeg), (begins(b"8BPS"), self._psd),
            (lambda data: data[4:8] in (b"ftyp", b"JXL "), self._boxes),
            (lambda data: data[4:10] == b"\0\0\0\0{\"", self._safetensors),
            (_is_text, self._text),
        ]  # fmt: skip

    # Mere bytes

    def _bytes(self, data: bytes) -> bytes:
        way = self._random.choice((
            self._flip, self._flip, self._number, self._number, self._number, self._cut,
            self._delete, self._repeat, self._noise, self._splice, self._blank,
        ))  # fmt: skip
        return bytes(way(bytearray(data)))

    def _place(self, data: bytearray) -> int:
        """Where headers are, rather than where pixels are."""
        end = len(data) if self._random.random() < 0.5 else min(len(data), 200)
        return self._random.randrange(max(end, 1))

    def _span(self, data: bytearray) -> tuple[int, int]:
        start = self._place(data)
        return start, min(len(data), start + self._random.choice((1, 2, 4, 8, 12, 32, 200, 5000)))

    def _flip(self, data: bytearray) -> bytearray:
        for _ in range(self._random.choice((1, 1, 3, 20))):
            if data:
                data[self._place(data)] ^= 1 << self._random.randrange(8)
        return data

    def _number(self, data: bytearray) -> bytearray:
        order = self._random.choice("<>")
        if self._random.random() < 0.3:
            kind, number = self._random.choice("fd"), self._random.choice(FLOATS)
            too_large = kind == "f" and 3e38 < abs(number) < float("inf")
            value = struct.pack(order + kind, 3e38 if too_large else number)
        else:
            size = self._random.choice((1, 2, 4, 8))
            number = self._random.choice(INTEGERS) % (1 << 8 * size)
            value = number.to_bytes(size, "little" if order == "<" else "big")
        at = self._place(data)
        data[at : at + len(value)] = value
        return data

    def _cut(self, data: bytearray) -> bytearray:
        return data[: self._random.randrange(len(data) + 1)]

    def _delete(self, data: bytearray) -> bytearray:
        start, end = self._span(data)
        del data[start:end]
        return data

    def _repeat(self, data: bytearray) -> bytearray:
        start, end = self._span(data)
        times = self._random.choice((1, 2, 50))
        data[end:end] = bytes(data[start:end]) * times
        return data

    def _noise(self, data: bytearray) -> bytearray:
        start, end = self._span(data)
        data[start:end] = self._random.randbytes(end - start)
        return data

    def _blank(self, data: bytearray) -> bytearray:
        start, end = self._span(data)
        data[start:end] = bytes([self._random.choice((0, 255))]) * (end - start)
        return data

    def _splice(self, data: bytearray) -> bytearray:
        other = bytearray(self._random.choice(self._pool))
        start, end = self._span(other)
        at = self._place(data)
        data[at:at] = other[start:end]
        return data

    # Text

    def _text(self, data: bytes) -> bytes:
        text = data.decode("utf-8", "replace")
        lines = text.split("\n")
        at = self._random.randrange(len(lines))
        way = self._random.randrange(6)
        if way == 0:
            lines.insert(at, self._random.choice(lines))
        elif way == 1:
            del lines[at]
        elif way == 2:
            lines[at] = self._with_number(lines[at])
        elif way == 3:
            words = lines[at].split(" ")
            words[self._random.randrange(len(words))] = self._random.choice(TEXTS)
            lines[at] = " ".join(words)
        elif way == 4:
            deep = self._random.choice((50, 3000, 100_000))
            begin, end = self._random.choice(("[]", "{}", "()"))
            lines[at] = lines[at].partition("=")[0] + "= " + begin * deep + end * deep
        else:
            lines[at] = lines[at] * self._random.choice((2, 300))
        return "\n".join(lines).encode("utf-8", "surrogatepass")

    def _with_number(self, text: str) -> str:
        """Another number in the place of one that stands there."""
        found = list(re.finditer(r"-?\d+(\.\d+)?(e[+-]?\d+)?", text))
        if not found:
            return text
        match = self._random.choice(found)
        number = self._random.choice((*INTEGERS, *FLOATS, "9" * 5000, "1" * 30))
        return text[: match.start()] + str(number) + text[match.end() :]

    def _head(self, data: bytes) -> bytes:
        """The text that a file begins with."""
        mark = b"end_header\n"
        head, sign, rest = data.partition(mark)
        if not sign and not _is_text(data):
            return self._bytes(data)
        return self._text(head) + sign + rest

    # Trees

    def _json(self, data: bytes) -> bytes:
        if self._random.random() < 0.1:
            return self._text(data)
        tree = self._tree(json.loads(data))
        text = json.dumps(tree, ensure_ascii=self._random.random() < 0.5)
        text = text.replace('"\\u0000deep"', "[" * 100_000 + "]" * 100_000)
        if self._random.random() < 0.1 and text.startswith("{"):  # the first name twice
            text = "{" + text[1:-1] + ", " + text[1:]
        return text.encode("utf-8", "surrogatepass")

    def _tree(self, tree: Any) -> Any:
        """With another value, fewer or more in one place."""
        if isinstance(tree, dict) and tree and self._random.random() < 0.85:
            names = list(tree)
            name = self._random.choice(names)
            way = self._random.randrange(12)
            if way == 0:
                return {k: v for k, v in tree.items() if k != name}
            if way == 1:
                return {(self._word() if k == name else k): v for k, v in tree.items()}
            if way == 2:
                return tree | {self._word(): self._value(tree)}
            if way == 3:
                return tree | {name: tree[self._random.choice(names)]}
            return tree | {name: self._tree(tree[name])}
        if isinstance(tree, list) and tree and self._random.random() < 0.8:
            at = self._random.randrange(len(tree))
            way = self._random.randrange(8)
            if way == 0:
                return tree[:at] + tree[at + 1 :]
            if way == 1:
                return tree + [tree[at]] * self._random.choice((1, 2, 1000))
            return [*tree[:at], self._tree(tree[at]), *tree[at + 1 :]]
        return self._value(tree)

    def _value(self, old: Any) -> Any:
        if isinstance(old, str) and self._random.random() < 0.3:
            return self._with_number(old) if self._random.random() < 0.5 else old + self._word()
        if isinstance(old, int | float) and self._random.random() < 0.3:
            return self._random.choice((-old, old * 2, old + 1, old / 3, old * 1e6))
        nest: Any = 0
        for _ in range(self._random.choice((2, 30, 600))):
            nest = [nest] if self._random.random() < 0.5 else {"a": nest}
        return self._random.choice((
            None, True, False, self._random.choice(INTEGERS), self._random.choice(FLOATS),
            self._random.choice(FLOATS), self._word(), self._word(), [], {}, [[]], nest, "\0deep",
            [self._random.choice(INTEGERS)] * 4, int("9" * 4000),
        ))  # fmt: skip

    def _word(self) -> str:
        return self._random.choice(TEXTS)

    # What is packed

    def _zip(self, data: bytes) -> bytes:
        if self._random.random() < 0.1:
            return self._zip_lie(data)
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            infos = archive.infolist()
            if sum(info.file_size for info in infos) > MOST_UNPACKED:
                return self._bytes(data)
            members = [(info.filename, archive.read(info)) for info in infos]
        at = self._random.randrange(len(members))
        name, inner = members[at]
        way = self._random.randrange(12)
        if way == 0:
            del members[at]
        elif way == 1:
            members[at] = self._random.choice((*PACKED_NAMES, *TEXTS)) or "x", inner
        elif way == 2:
            members.append((name, self.once(inner)))
        elif way == 3:
            members[at] = name, members[self._random.randrange(len(members))][1]
        else:
            members[at] = name, self.once(inner)
        return zipped(members)

    def _zip_lie(self, data: bytes) -> bytes:
        """A directory that says other sizes than the members have, or another way of packing."""
        lie = bytearray(data)
        at = lie.find(b"PK\1\2", self._random.randrange(len(lie)))
        if at < 0:
            return bytes(lie)
        offset, size = self._random.choice(((10, 2), (20, 4), (24, 4), (8, 2), (42, 4), (38, 4)))
        value = self._random.choice(INTEGERS) % (1 << 8 * size)
        lie[at + offset : at + offset + size] = value.to_bytes(size, "little")
        return bytes(lie)

    def _gzip(self, data: bytes) -> bytes:
        packer = zlib.decompressobj(31)
        inner = packer.decompress(data, MOST_UNPACKED)
        return gzip.compress(self.once(inner), 1)

    def _npy(self, data: bytes) -> bytes:
        """The header, which is a Python literal; its length is put right."""
        size = int.from_bytes(data[8:10], "little")
        head = data[10 : 10 + size].decode("latin-1")
        head = self._random.choice((
            self._with_number(head), head.replace("'<f4'", "'<f8'"), head.replace("'<f4'", "'|O'"),
            head.replace("False", "True"), head.replace("(", "(2147483648, "),
            head.replace("(", "(0, 99999999999, "), head.replace("(", "(" * 300),
            head.replace("'<f4'", "[('a', '<f4')]"), head.replace("'<f4'", "'<M8[s]'"),
            re.sub(r"\(.*\)", "()", head), "{}", head.replace("'<f8'", "'<c16'"),
        ))  # fmt: skip
        length = len(head).to_bytes(2, "little")
        return data[:8] + length + head.encode("latin-1") + data[10 + size :]

    def _png(self, data: bytes) -> bytes:
        chunks, at = [], 8
        while at + 12 <= len(data):
            length = int.from_bytes(data[at : at + 4], "big")
            chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + length]))
            at += 12 + length
        k = self._random.randrange(len(chunks))
        kind, body = chunks[k]
        way = self._random.randrange(8)
        if way == 0:
            del chunks[k]
        elif way == 1:
            chunks.insert(k, chunks[self._random.randrange(len(chunks))])
        elif way == 2 and kind == b"IDAT":
            inner = zlib.decompressobj().decompress(body, MOST_UNPACKED)
            chunks[k] = kind, zlib.compress(self._bytes(inner), 1)
        elif way == 3:
            more = self._random.choice((b"eXIf", b"iCCP", b"tRNS", b"PLTE", b"tEXt", b"acTL",
                                        b"zTXt", b"iTXt", b"gAMA", b"cICP"))  # fmt: skip
            text = b"x\0\0" + zlib.compress(bytes(self._random.choice((10, 3_000_000))))
            own = self._random.choice((text, self._random.randbytes(30), EXIF, b""))
            chunks.insert(self._random.randrange(1, len(chunks)), (more, own))
        else:
            chunks[k] = kind, self._bytes(body)
        return data[:8] + b"".join(
            len(b).to_bytes(4, "big") + t + b + zlib.crc32(t + b).to_bytes(4, "big")
            for t, b in chunks
        )

    def _riff(self, data: bytes) -> bytes:
        """WebP: one chunk damaged, lengths right."""
        chunks, at = [], 12
        while at + 8 <= len(data):
            length = int.from_bytes(data[at + 4 : at + 8], "little")
            chunks.append((data[at : at + 4], data[at + 8 : at + 8 + length]))
            at += 8 + length + length % 2
        k = self._random.randrange(len(chunks))
        chunks[k] = chunks[k][0], self._bytes(chunks[k][1])
        body = b"".join(t + len(b).to_bytes(4, "little") + b + b"\0" * (len(b) % 2)
                        for t, b in chunks)  # fmt: skip
        return b"RIFF" + (len(body) + 4).to_bytes(4, "little") + b"WEBP" + body

    def _jpeg(self, data: bytes) -> bytes:
        """A marker's body damaged, its length right."""
        at, markers = 2, []
        while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] != 0xDA:
            length = int.from_bytes(data[at + 2 : at + 4], "big")
            markers.append((data[at + 1], data[at + 4 : at + 2 + length]))
            at += 2 + length
        k = self._random.randrange(len(markers))
        if self._random.random() < 0.15:
            markers.insert(k, (0xE1, b"Exif\0\0" + EXIF))
        markers[k] = markers[k][0], self._bytes(markers[k][1])[:65000]
        head = b"".join(bytes([255, m]) + (len(b) + 2).to_bytes(2, "big") + b for m, b in markers)
        return data[:2] + head + data[at:]

    def _boxes(self, data: bytes) -> bytes:
        """JPEG XL, HEIC and AVIF: a box damaged, dropped, doubled or renamed; lengths right."""
        boxes, at = [], 0
        while at + 8 <= len(data):
            length = int.from_bytes(data[at : at + 4], "big") or len(data) - at
            boxes.append((data[at + 4 : at + 8], data[at + 8 : at + length]))
            at += max(length, 8)
        k, way = self._random.randrange(len(boxes)), self._random.random()
        kind, body = boxes[k]
        if way < 0.6:
            boxes[k] = kind, self._bytes(body)
        elif way < 0.7:
            del boxes[k]
        elif way < 0.8:
            boxes.insert(self._random.randrange(len(boxes) + 1), boxes[k])
        elif way < 0.9:
            boxes[k] = self._random.choice(boxes)[0], body
        else:
            boxes.insert(k, (b"Exif", bytes(4) + EXIF))
        return b"".join((8 + len(b)).to_bytes(4, "big") + t + b for t, b in boxes)

    def _psd(self, data: bytes) -> bytes:
        """Photoshop: one of the three sections damaged, its length right."""
        sections, at = [], 26
        for _ in range(3):
            length = int.from_bytes(data[at : at + 4], "big")
            sections.append(data[at + 4 : at + 4 + length])
            at += 4 + length
        k = self._random.randrange(3)
        sections[k] = self._bytes(sections[k])
        parts = b"".join(len(s).to_bytes(4, "big") + s for s in sections)
        return data[:26] + parts + data[at:]

    def _glb(self, data: bytes) -> bytes:
        length = int.from_bytes(data[12:16], "little")
        text, rest = data[20 : 20 + length], data[20 + length :]
        text = self._json(text.rstrip(b" "))
        text += b" " * (-len(text) % 4)
        total = 20 + len(text) + len(rest)
        return data[:8] + struct.pack("<II", total, len(text)) + data[16:20] + text + rest

    def _safetensors(self, data: bytes) -> bytes:
        """The header's JSON, and the tree of JSON in it."""
        length = int.from_bytes(data[:8], "little")
        head, rest = json.loads(data[8 : 8 + length]), data[8 + length :]
        about = head.get("__metadata__", {})
        if "tree" in about and self._random.random() < 0.6:
            about["tree"] = self._json(about["tree"].encode()).decode("utf-8", "replace")
            text = json.dumps(head).encode()
        else:
            text = self._json(json.dumps(head).encode())
        return len(text).to_bytes(8, "little") + text + rest


def _is_text(data: bytes) -> bool:
    return bool(data) and not any(b < 9 for b in data[:200])


def _exif() -> bytes:
    """A TIFF directory with an orientation, a thumbnail and a focal length."""
    entries = [(0x0112, 3, 1, 6), (0x8769, 4, 1, 38), (0x010F, 2, 4, 0x00414141)]
    body = b"II*\0" + struct.pack("<IH", 8, len(entries))
    body += b"".join(struct.pack("<HHII", *entry) for entry in entries)
    return body + struct.pack("<IH", 50, 1) + struct.pack("<HHII", 0xA405, 3, 1, 50) + bytes(40)


EXIF = _exif()
