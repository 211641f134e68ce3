"""Kernels that several processes compile at once are never taken for each other."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

from numba.core import caching

from objectmorpher_core.base import kernel_files  # noqa: F401  (names the files)
from tests.tree import parsed

ROOT = Path(__file__).parents[2]
Files: Any = caching.IndexDataCacheFile
KEYS = ("8 bits", "16 bits")


def test_two_processes_that_write_at_once_leave_no_wrong_kernel(tmp_path: Path) -> None:
    """Each has read the list before the other wrote it; the first one's data come last."""
    one, other = Files(str(tmp_path), "blend", 1), Files(str(tmp_path), "blend", 1)
    write, lists = one._save_data, {"now": True}

    def late(name: str, data: str) -> None:
        if lists.pop("now", None):
            other._load_index = dict  # as it was before
            other.save(KEYS[1], KEYS[1])
        write(name, data)

    one._save_data = late
    one.save(KEYS[0], KEYS[0])
    found = Files(str(tmp_path), "blend", 1)
    assert all(found.load(key) in (None, key) for key in KEYS)
    assert any(found.load(key) == key for key in KEYS)


def test_what_was_compiled_is_found_again(tmp_path: Path) -> None:
    files = Files(str(tmp_path), "blend", 1)
    for key in (*KEYS, KEYS[0]):
        files.save(key, key)
    assert [Files(str(tmp_path), "blend", 1).load(key) for key in KEYS] == list(KEYS)
    assert len(list(tmp_path.glob("*.nbc"))) == len(KEYS)
    assert Files(str(tmp_path), "blend", 2).load(KEYS[0]) is None  # of other sources


def test_no_kernel_is_kept_otherwise() -> None:
    for package in ("objectmorpher_core", "app"):
        for path in sorted((ROOT / package).rglob("*.py")):
            is_here = path.name == "kernel_files.py"
            lines = path.read_text(encoding="utf-8").splitlines()
            assert is_here or "import numba" not in lines, path


def options_of(function: ast.FunctionDef) -> set[str | None] | None:
    """The options of a kernel; None for what is none."""
    for mark in function.decorator_list:
        if isinstance(mark, ast.Call) and ast.unparse(mark.func) == "numba.njit":
            return {keyword.arg for keyword in mark.keywords}
    return None


def test_python_calls_no_kernel_that_has_no_way_in() -> None:
    """It would end the process."""
    folders = ("objectmorpher_core", "app", "research", "tests", "docs")
    paths = [p for name in folders for p in sorted((ROOT / name).rglob("*.py"))]
    texts = {path: path.read_text(encoding="utf-8") for path in paths}
    kernels = {
        (path.stem, item.name): options
        for path, text in texts.items() if "numba.njit" in text for item in ast.walk(parsed(path))
        if isinstance(item, ast.FunctionDef) and (options := options_of(item)) is not None
    }  # fmt: skip
    hidden = {place for place, options in kernels.items() if "cache" not in options}
    assert len(hidden) > 50
    calls = re.compile(rf"(?<!def )\b(?:{'|'.join({name for _, name in hidden})})\(")
    for path in [path for path, text in texts.items() if calls.search(text)]:
        tree = parsed(path)
        compiled = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef) and options_of(n)]
        inside = {id(n) for function in compiled for n in ast.walk(function)}
        known = {name: (path.stem, name) for stem, name in hidden if stem == path.stem}
        modules = {}
        for item in ast.walk(tree):
            if isinstance(item, ast.ImportFrom):
                stem = (item.module or "").rpartition(".")[2]
                known |= {a.asname or a.name: (stem, a.name) for a in item.names}
                modules |= {a.asname or a.name: a.name for a in item.names}
        for item in ast.walk(tree):
            if id(item) in inside or not isinstance(item, ast.Name | ast.Attribute):
                continue
            place = ("", "")
            if isinstance(item, ast.Name):
                place = known.get(item.id, place)
            elif isinstance(item.value, ast.Name):
                place = (modules.get(item.value.id, ""), item.attr)
            assert place not in hidden, f"{path}:{item.lineno}: {place[1]}"
