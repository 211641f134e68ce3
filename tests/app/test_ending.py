"""A command's own process ends at once when everything is written, and as it should."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests import photos, shapes

ROOT = Path(__file__).parents[2]
PIXELS, _, MASK = photos.small_cup(6, 26.0, 18.0)
CODE = """
import atexit, sys
atexit.register(print, "at the end")
atexit.register(print, "before", file=sys.stderr)
from objectmorpher.__main__ import run
run()
"""
EDIT = ("--mask", "mask.png", "--gaussians", "300", "--trust", "0", "--inpaint", "telea")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "cup.png").write_bytes(shapes.png(PIXELS))
    (tmp_path / "mask.png").write_bytes(shapes.mask_png(MASK))
    return tmp_path


def ended(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The command as a process of its own, which writes to pipes."""
    path = os.pathsep.join(map(str, (ROOT, ROOT / "app")))
    known = {name: v for name, v in os.environ.items() if name != "PYTHONUNBUFFERED"}
    return subprocess.run(
        [sys.executable, "-c", CODE, *arguments], cwd=folder, capture_output=True, text=True,
        env=known | {"PYTHONPATH": path}, check=False,
    )  # fmt: skip


def test_all_is_written_printed_and_put_away(folder: Path) -> None:
    done = ended(folder, "edit", "cup.png", *EDIT, "--move", "5,0", "-o", "out.png")
    assert done.returncode == 0
    first, last = done.stdout.splitlines()
    assert first.startswith("wrote out.png in ")
    assert last == "at the end"
    assert done.stderr.splitlines()[-1] == "before"
    assert (folder / "out.png").stat().st_size > 0


def test_a_failure_has_its_exit_code_and_its_sentence(folder: Path) -> None:
    done = ended(folder, "edit", "none.png", *EDIT, "-o", "out.png")
    assert (done.returncode, done.stdout) == (1, "at the end\n")
    assert done.stderr == "objectmorpher: none.png does not exist\nbefore\n"
