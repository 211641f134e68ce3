"""Compiled kernels of several processes in one folder, in files named by their contents.

numba numbers the files of a kernel's variants (of 8 and of 16 bits, say) in the order in which they
are compiled. Two processes that compile different variants at the same time both take the next
number, and the list may then name one variant while the file holds the other: whoever loads it runs
code for other arrays than it was given, and writes past their ends. Here the name is of the variant
itself; of two that write at once one entry of the list may be lost, and is compiled again.

Every module with kernels takes `numba` from here. What only kernels call gets no way in from
Python: that was a fifth of the time that compiling takes. No garbage is looked for meanwhile, which
was a twelfth.
"""

from __future__ import annotations

import gc
import hashlib
import os
import pickle
from functools import cache
from pathlib import Path
from subprocess import Popen
from typing import Any

import numba as _numba
from numba.core import caching, config, event

from .installation import inside, written_build

# The lookup of an installed copy's compiled kernels (`installation.prepare`).

Locator: Any = caching._CacheLocator
settings: Any = config


class InstalledLocator(Locator):
    """Names a kernel's place by the way from the program's folder to its source.

    Kernels of another build are compiled anew and take the place of the old ones.
    """

    def __init__(self, function: Any, source: str) -> None:
        self._py_file, self._line = source, function.__code__.co_firstlineno
        path, folder = Path(source).resolve(), inside().resolve()
        way = path.parent.relative_to(folder) if folder in path.parents else Path("elsewhere")
        self._folder = Path(settings.CACHE_DIR) / "-".join(way.parts)

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return _build()

    def get_disambiguator(self) -> str:
        return str(self._line)

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> InstalledLocator:
        """Kernels are kept in a scratch folder where the user's cannot be written."""
        locator = cls(py_func, py_file)
        try:
            locator.ensure_cache_path()
        except OSError:
            locator._folder = _scratch()
        return locator


@cache
def _build() -> str:
    return written_build(inside())


@cache
def _scratch() -> Path:
    """A folder of this process, which goes with it."""
    import atexit
    import shutil
    import tempfile

    folder = Path(tempfile.mkdtemp(prefix=f"objectmorpher-{os.getpid()}-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


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


def is_kept(kernel: Any) -> bool:
    """Whether a variant of the kernel as it is now lies on the disk, or none ever will."""
    kept = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    return kept is None or bool(kept._load_index())


# By the names of modules: the processes that are compiling their kernels just now.
elsewhere: dict[str, Popen[bytes]] = {}


def _load(self: Any, key: Any) -> Any:
    """What is kept under `key`, or None. What another process is compiling is waited for."""
    found = _load_now(self, key)
    if found is None and (process := elsewhere.get(self._index_name.partition(".")[0])):
        process.wait()
        found = _load_now(self, key)
    return found


def _load_index(self: Any) -> dict[Any, str]:
    """The list of variants; empty where it is of an older version, and names what is gone.

    numba reads a list before it looks at whose it is.
    """
    try:
        return _load_index_now(self)
    except UNREADABLE:
        return {}


def _load_data(self: Any, name: str) -> Any:
    """A variant. Raises OSError, after which it is compiled anew, where it cannot be read."""
    try:
        return _load_data_now(self, name)
    except UNREADABLE as error:
        raise OSError(f"{name} cannot be read") from error


UNREADABLE = (ImportError, AttributeError, EOFError, ValueError, TypeError, pickle.UnpicklingError)
files: Any = caching.IndexDataCacheFile
_load_now, _load_index_now, _load_data_now = files.load, files._load_index, files._load_data
files.save, files.load = _save, _load
files._load_index, files._load_data = _load_index, _load_data


class _WithoutCollecting(event.Listener):
    """Leaves out Python's search for circles of garbage while a kernel is compiled.

    Compiling makes many objects, most of which stay or go by themselves. Only one thread compiles
    at a time (numba has a lock), also what a kernel calls.
    """

    def __init__(self) -> None:
        self._depth, self._was_on = 0, False

    def on_start(self, event: Any) -> None:
        if self._depth == 0:
            self._was_on = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0 and self._was_on:
            gc.enable()


event.register("numba:compile", _WithoutCollecting())


class _Kernels:
    """What modules with kernels know as `numba`."""

    @staticmethod
    def njit(**options: Any) -> Any:
        """`numba.njit`. Python must not call kernels that leave open whether they are kept.

        It would jump to nowhere; a test looks for such calls.
        """
        if "cache" not in options:
            options |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        return _numba.njit(**options)


numba: Any = _Kernels
