"""Compiled kernels of several processes in one folder, in files named by their contents.

numba numbers the files of a kernel's variants (of 8 and of 16 bits, say) in the order in which they
are compiled. Two processes that compile different variants at the same time both take the next
number, and the list may then name one variant while the file holds the other: whoever loads it runs
code for other arrays than it was given, and writes past their ends. Here the name is of the variant
itself; of two that write at once one entry of the list may be lost, and is compiled again.

Every module with kernels takes `numba` from here.
"""

from __future__ import annotations

import hashlib
from typing import Any

import numba
from numba.core import caching

__all__ = ["numba"]

DIGITS = 16  # hexadecimal, of the name's hash


def _save(self: Any, key: Any, data: Any) -> None:
    """Keeps `data` under `key`: the variant's types, the processor and the hash of its code."""
    name = f"{self._index_name.removesuffix('.nbi')}.{_digest(key, self._source_stamp)}.nbc"
    self._save_data(name, data)  # first: what the list names is there
    overloads = self._load_index()
    if overloads.get(key) != name:
        overloads[key] = name
        self._save_index(overloads)


def _digest(*parts: Any) -> str:
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:DIGITS]


files: Any = caching.IndexDataCacheFile
files.save = _save
