"""Zip files whose members are called whatever one likes."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from collections.abc import Sequence

BROKEN_ZIP = (  # what Python's zip files raise
    zipfile.BadZipFile, ValueError, KeyError, OSError, EOFError, RuntimeError, zlib.error,
    NotImplementedError, IndexError, struct.error,
)  # fmt: skip


def zipped(members: Sequence[tuple[str, bytes]]) -> bytes:
    """A zip file, whatever its members are called."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive._didModify = True
        for name, data in members:
            info = zipfile.ZipInfo("x")
            info.filename = name.encode("utf-8", "replace")[:65000].decode("utf-8", "ignore")
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.NameToInfo.pop(info.filename, None)  # twice the same: that is the point
            archive.writestr(info, data)
    return out.getvalue()
