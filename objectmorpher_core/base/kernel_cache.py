"""The lookup of an installed copy's compiled kernels (`installation.prepare`)."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path
from typing import Any

from numba.core import caching, config

from .installation import inside, written_build

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
