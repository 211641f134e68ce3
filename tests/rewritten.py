"""Rewrites the tests' assertions before they are collected: `python -m tests.rewritten`.

pytest does so when it imports a file, and keeps the bytecode. All processes of a run begin together
and import the same files in the same order: each of them would rewrite all. Here every file is
rewritten once, on all cores, and nothing is imported.
"""

from __future__ import annotations

import os
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from _pytest.assertion import rewrite

ROOT = Path(__file__).parents[1]
FEW = 20  # files that are not worth a process
CHUNK = 8  # files that a process is given at a time


def kept_in(source: Path) -> Path:
    """Where pytest keeps the bytecode of a file with tests."""
    return rewrite.get_cache_dir(source) / (source.stem + rewrite.PYC_TAIL)


def is_kept(source: Path) -> bool:
    """Whether pytest would take what it has kept of this file."""
    return rewrite._read_pyc(source, kept_in(source)) is not None


def rewrite_file(source: Path) -> None:
    """What cannot be written is left to pytest."""
    stat, code = rewrite._rewrite_test(source, None)  # pyright: ignore[reportArgumentType]
    if rewrite.try_makedirs(kept_in(source).parent):
        state: Any = SimpleNamespace(trace=print)
        rewrite._write_pyc(state, code, stat, kept_in(source))


def main(folder: Path = ROOT / "tests") -> None:
    """All files of the folder that pytest rewrites, and has not kept as they are now."""
    sources = [*folder.rglob("test_*.py"), *folder.rglob("conftest.py")]
    left = sorted(source for source in sources if not is_kept(source))
    if len(left) > FEW:
        with get_context("spawn").Pool(os.cpu_count()) as pool:
            pool.map(rewrite_file, left, CHUNK)
    else:
        for source in left:
            rewrite_file(source)


if __name__ == "__main__":
    main()
