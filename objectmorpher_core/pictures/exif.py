"""The few EXIF fields that matter here, read and patched in place.

The block is never re-written by a library: maker notes hold absolute offsets, and only an
untouched layout keeps them valid.
"""

from __future__ import annotations

import struct

ORIENTATION = 0x0112
EXIF_IFD = 0x8769
FOCAL_LENGTH_35MM = 0xA405
MAKER_NOTE = 0x927C
SIZES = ((0x0100, 0x0101), (0xA002, 0xA003))  # width and height: of the file, and its EXIF's own
ON_ITS_SIDE = 5  # from this orientation on rows are columns
THUMBNAIL_OFFSET, THUMBNAIL_LENGTH = 0x0201, 0x0202
SHORT, LONG = 3, 4
PREFIX = b"Exif\0\0"  # what JPEG and some WebP files put before the block


def orientation(block: bytes) -> int:
    """Return the orientation of the stored rows, 1..8; 1 (upright) where the block does not say."""
    try:
        value = _Walker(block).value(ORIENTATION)
    except (struct.error, ValueError):
        return 1
    return value if value is not None and 1 <= value <= 8 else 1


def focal_35mm(block: bytes) -> float | None:
    """The 35-mm equivalent focal length in mm, or None where it is not given (or 0)."""
    try:
        walker = _Walker(block)
        exif_ifd = walker.value(EXIF_IFD)
        focal = None if exif_ifd is None else walker.value(FOCAL_LENGTH_35MM, exif_ifd)
    except (struct.error, ValueError):
        return None
    return float(focal) if focal else None


def upright(block: bytes) -> bytes:
    """The block for the upright picture: orientation 1, its width and height, and no thumbnail of
    the unedited photo.

    A block that cannot be read comes back as it is.
    """
    patched = bytearray(block)
    try:
        walker = _Walker(block)
        field = walker.fields().get(ORIENTATION)
        if field is not None and field[0] in (SHORT, LONG):
            number = "H" if field[0] == SHORT else "I"
            struct.pack_into(walker.order + number, patched, field[1], 1)
        if orientation(block) >= ON_ITS_SIDE:
            _swap_sizes(walker, patched)
    except (struct.error, ValueError):
        return block
    try:
        link = walker.next_link()
        thumbnail_ifd = walker.unpack("I", link)
        if thumbnail_ifd:
            start = walker.value(THUMBNAIL_OFFSET, thumbnail_ifd)
            length = walker.value(THUMBNAIL_LENGTH, thumbnail_ifd)
            if start is not None and length is not None and start + length <= len(patched):
                patched[start : start + length] = bytes(length)
            struct.pack_into(walker.order + "I", patched, link, 0)
    except (struct.error, ValueError):
        pass  # it ends with its first directory
    return bytes(patched)


def _swap_sizes(walker: _Walker, patched: bytearray) -> None:
    """Writes width as height and height as width, wherever the block says both."""
    for ifd in (walker.first, walker.value(EXIF_IFD)):
        fields = {} if ifd is None else walker.fields(ifd)
        for tags in SIZES:
            pair = [fields[tag] for tag in tags if tag in fields]
            if len(pair) < 2 or not all(kind in (SHORT, LONG) for kind, _ in pair):
                continue
            codes = [walker.order + ("H" if kind == SHORT else "I") for kind, _ in pair]
            values = [
                struct.unpack_from(code, walker.block, offset)[0]
                for code, (_, offset) in zip(codes, pair, strict=True)
            ]
            for code, (_, offset), value in zip(codes, pair, reversed(values), strict=True):
                struct.pack_into(code, patched, offset, value)


class _Walker:
    """Reads the fields of a TIFF structure; `struct.error` or ValueError where it is broken."""

    def __init__(self, block: bytes) -> None:
        marks = {b"II*\0": "<", b"MM\0*": ">"}
        if block[:4] not in marks:
            raise ValueError("no TIFF header")
        self.block = block
        self.order = marks[block[:4]]
        self.first = self.unpack("I", 4)

    def unpack(self, kind: str, offset: int) -> int:
        return struct.unpack_from(self.order + kind, self.block, offset)[0]

    def fields(self, ifd: int | None = None) -> dict[int, tuple[int, int]]:
        """tag -> (type, offset of its value) of one directory, for single values only."""
        ifd = self.first if ifd is None else ifd
        found = {}
        for k in range(self.unpack("H", ifd)):
            entry = ifd + 2 + 12 * k
            tag, kind, count = struct.unpack_from(self.order + "HHI", self.block, entry)
            if count == 1:
                found[tag] = (kind, entry + 8)
        return found

    def value(self, tag: int, ifd: int | None = None) -> int | None:
        """A SHORT or LONG value, or None where the directory does not hold it."""
        kind, offset = self.fields(ifd).get(tag, (0, 0))
        if kind not in (SHORT, LONG):
            return None
        return self.unpack("H" if kind == SHORT else "I", offset)

    def next_link(self) -> int:
        """Offset of the first directory's pointer to the next one (the thumbnail's)."""
        return self.first + 2 + 12 * self.unpack("H", self.first)
