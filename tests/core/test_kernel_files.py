"""Kernels that several processes compile at once are never taken for each other."""

from __future__ import annotations

import ast
import gc
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import pytest
from numba.core import caching, event
from numba.core.errors import TypingError

from objectmorpher_core import warm_up
from objectmorpher_core.base import kernel_files  # noqa: F401  (names the files)
from objectmorpher_core.base.threads import core_count
from tests.tree import PYTHONPATH, ROOT

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


class Seen(event.Listener):
    """Whether garbage would be looked for where a kernel begins to be compiled."""

    def __init__(self) -> None:
        self.states: list[bool] = []

    def on_start(self, event: Any) -> None:
        self.states.append(gc.isenabled())

    def on_end(self, event: Any) -> None:
        pass


def test_no_garbage_is_looked_for_while_kernels_are_compiled_and_again_afterwards() -> None:
    """Also what one calls, and where one cannot be compiled; who has turned it off finds it so."""

    @numba.njit
    def half(one: float) -> float:
        return one / 2

    def both(one: float, other: float) -> float:
        return half(one) + half(other) + float(half(int(one)))

    def refused(one: float) -> float:
        return one.is_unknown  # pyright: ignore[reportAttributeAccessIssue]

    seen = Seen()
    event.register("numba:compile", seen)
    try:
        assert numba.njit(both)(3.0, 2.0) == 4.0
        assert gc.isenabled()
        with pytest.raises(TypingError):
            numba.njit(refused)(1.0)
        assert gc.isenabled()
        gc.disable()
        numba.njit(both)(3.0, 2.0)
        assert not gc.isenabled()
    finally:
        gc.enable()
        event.unregister("numba:compile", seen)
    assert len(seen.states) > 5 and not any(seen.states)


ASKED_TWICE = """
from objectmorpher_core import warm_up
from objectmorpher_core.base import kernel_files
assert warm_up.compile_beside()
first = dict(kernel_files.elsewhere)
assert warm_up.compile_beside() and kernel_files.elsewhere == first
print(len(set(first.values())))
"""


def test_large_kernels_are_compiled_beside_by_one_process_each(tmp_path: Path) -> None:
    """An edit asks for it, and the warm-up: all would be compiled as often."""
    own = os.environ | {"PYTHONPATH": PYTHONPATH, "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", ASKED_TWICE], cwd=ROOT, env=own, check=True,
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert int(done.stdout) == (len(warm_up.PARTS) if core_count() > 1 else 0)


def test_what_was_compiled_is_found_again(tmp_path: Path) -> None:
    files = Files(str(tmp_path), "blend", 1)
    for key in (*KEYS, KEYS[0]):
        files.save(key, key)
    assert [Files(str(tmp_path), "blend", 1).load(key) for key in KEYS] == list(KEYS)
    assert len(list(tmp_path.glob("*.nbc"))) == len(KEYS)
    assert Files(str(tmp_path), "blend", 2).load(KEYS[0]) is None  # of other sources


def test_a_kernel_that_names_what_is_gone_is_compiled_anew(tmp_path: Path, monkeypatch) -> None:
    """As after an update that moved or removed a module, or a disk that was full."""
    for gone in ("a module", "a name", "the end"):
        module = ModuleType("gone")
        module.Type = type("Type", (), {"__module__": "gone", "__qualname__": "Type"})  # type: ignore
        monkeypatch.setitem(sys.modules, "gone", module)
        files = Files(str(tmp_path), "blend", 1)
        files.save(module.Type, module.Type)
        files.save("kept", module.Type())
        if gone == "the end":
            for path in tmp_path.iterdir():
                path.write_bytes(path.read_bytes()[:-3])
        elif gone == "a name":
            monkeypatch.delattr(module, "Type")
        else:
            monkeypatch.delitem(sys.modules, "gone")
        found = Files(str(tmp_path), "blend", 1)
        assert found.load("kept") is None, gone
        found.save("kept", 5)
        assert Files(str(tmp_path), "blend", 1).load("kept") == 5
        monkeypatch.undo()


def test_no_kernel_is_kept_otherwise() -> None:
    for package in ("objectmorpher_core", "app"):
        for path in sorted((ROOT / package).rglob("*.py")):
            is_here = path.name == "kernel_files.py"
            lines = path.read_text(encoding="utf-8").splitlines()
            assert is_here or "import numba" not in lines, path


KERNEL = re.compile(
    r"^( *)@numba\.njit\((.*)\)\n\1def (\w+)(?:.*\n)(?:(?:\1[ )].*)?\n)*", re.MULTILINE
)


def test_python_calls_no_kernel_that_has_no_way_in() -> None:
    """It would end the process. Only what names a hidden kernel outside of kernels is parsed."""
    folders = ("objectmorpher_core", "app", "research", "tests", "docs")
    paths = [p for name in folders for p in (ROOT / name).rglob("*.py") if p != Path(__file__)]
    texts = {path: path.read_text(encoding="utf-8") for path in sorted(paths)}
    kernels = {path: KERNEL.findall(text) for path, text in texts.items() if "njit(" in text}
    for path, found in kernels.items():
        assert len(found) == len(re.findall(r"^ *@numba\.njit", texts[path], re.MULTILINE)), path
    hidden = {
        (path.stem, name)
        for path, found in kernels.items() for _, options, name in found if "cache" not in options
    }  # fmt: skip
    assert len(hidden) > 50
    word = re.compile(r"\w+")
    for path, text in texts.items():
        python = KERNEL.sub("", text) if path in kernels else text
        words = set(word.findall(python))
        near = {
            (stem, name) for stem, name in hidden if name in words and stem in {path.stem, *words}
        }
        if not near:
            continue
        tree = ast.parse(python)
        known = {name: (stem, name) for stem, name in near if stem == path.stem}
        modules = {}
        for item in ast.walk(tree):
            if isinstance(item, ast.ImportFrom):
                stem = (item.module or "").rpartition(".")[2]
                known |= {a.asname or a.name: (stem, a.name) for a in item.names}
                modules |= {a.asname or a.name: a.name for a in item.names}
        for item in ast.walk(tree):
            place = ("", "")
            if isinstance(item, ast.Name):
                place = known.get(item.id, place)
            elif isinstance(item, ast.Attribute) and isinstance(item.value, ast.Name):
                place = (modules.get(item.value.id, ""), item.attr)
            assert place not in hidden, f"{path}: {place[1]}"
