"""The wheel is installed by pipx and by uv, and edits a photo."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_pipx_and_uv_install_what_edits(tmp_path) -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "packaging" / "check_tools.py", "--compiled", tmp_path],
        capture_output=True, text=True,
    )  # fmt: skip
    if "Could not find a version" in done.stderr or "No matching distribution" in done.stderr:
        pytest.skip("there is no package index with pipx and uv")
    assert done.returncode == 0, done.stderr[-3000:]
    assert [line.split(":")[0] for line in done.stdout.splitlines()] == ["pipx", "uv"]
