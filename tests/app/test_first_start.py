"""Kernels of an installed copy: found again wherever it lies, compiled anew after an update."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from objectmorpher.system.warm_up import mark_compiled, needs_compiling, start_compiling
from objectmorpher_core.base import installation
from tests.tree import PYTHONPATH

# A copy as an installer's: a small kernel of its own, under the settings that such a copy has.
KERNEL = """
import numba

@numba.njit(cache=True)
def twice(x):
    return {times} * x
"""
START = """
import sys
from pathlib import Path
from objectmorpher_core.base import installation
folder = Path(sys.argv[1])
installation.prepare(folder)
sys.path.insert(0, str(folder))
from app_kernels.twice import twice
print(twice(21), sum(twice.stats.cache_hits.values()))
"""
ROOT = Path(__file__).parents[2]


def copy_at(folder: Path, times: int) -> Path:
    """An installed copy in a folder."""
    package = folder / "app_kernels"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("", encoding="utf-8")
    (package / "twice.py").write_text(KERNEL.format(times=times), encoding="utf-8")
    (folder / installation.BUILD).write_text(f"{times}\n", encoding="ascii")
    return folder


def run(folder: Path, kernels: Path) -> tuple[int, int]:
    """What its kernel computes, and how many kernels came from the disk."""
    done = subprocess.run(
        [sys.executable, "-c", START, folder], capture_output=True, text=True, check=True,
        env=os.environ | {installation.KERNELS: str(kernels), "PYTHONPATH": PYTHONPATH},
    )  # fmt: skip
    value, hits = done.stdout.split()
    return int(value), int(hits)


def test_a_kernel_is_compiled_once_whatever_folder_the_program_is_in(tmp_path) -> None:
    kernels = tmp_path / "kernels"
    assert run(copy_at(tmp_path / "mounted-1", 2), kernels) == (42, 0)
    assert run(copy_at(tmp_path / "mounted-2", 2), kernels) == (42, 1)


def test_a_kernel_of_an_older_build_is_not_used(tmp_path) -> None:
    kernels = tmp_path / "kernels"
    run(copy_at(tmp_path / "old", 2), kernels)
    assert run(copy_at(tmp_path / "new", 3), kernels) == (63, 0)
    assert run(tmp_path / "new", kernels) == (63, 1)


def test_without_a_folder_for_them_kernels_are_compiled_every_time(tmp_path) -> None:
    nowhere = tmp_path / "file"
    nowhere.write_text("no folder", encoding="utf-8")
    copy = copy_at(tmp_path / "copy", 2)
    assert run(copy, nowhere / "kernels") == (42, 0)
    assert run(copy, nowhere / "kernels") == (42, 0)


def test_a_build_is_marked_and_another_is_not(tmp_path) -> None:
    assert needs_compiling(tmp_path / "kernels", "a")
    mark_compiled(tmp_path / "kernels", "a")
    assert not needs_compiling(tmp_path / "kernels", "a")
    assert needs_compiling(tmp_path / "kernels", "b")


def test_a_checkout_compiles_nothing_by_itself() -> None:
    assert not installation.is_frozen()
    assert start_compiling() is None


@pytest.mark.parametrize("change", ["content", "name"])
def test_the_name_of_a_build_is_of_all_its_sources(tmp_path, change: str) -> None:
    for package in ("objectmorpher", "objectmorpher_core"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "one.py").write_text("a = 1\n", encoding="utf-8")
    before = installation.build_name(tmp_path)
    assert installation.build_name(tmp_path) == before
    at = tmp_path / "objectmorpher_core" / "one.py"
    if change == "content":
        at.write_text("a = 2\n", encoding="utf-8")
    else:
        at.rename(at.with_name("two.py"))
    assert installation.build_name(tmp_path) != before


def test_what_an_installed_copy_is_told_to_do_is_possible(monkeypatch) -> None:
    monkeypatch.delenv("APPIMAGE", raising=False)
    assert installation.extra("models") == "objectmorpher models setup"
    monkeypatch.setenv("APPIMAGE", "/opt/ObjectMorpher.AppImage")
    assert installation.extra("models") == "/opt/ObjectMorpher.AppImage models setup"
    assert installation.extra("research").startswith("pip ")
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    assert installation.extra("research").startswith("pipx ")
