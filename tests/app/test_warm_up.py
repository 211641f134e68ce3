"""After the warm-up nobody waits for a compiler."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.tree import PYTHONPATH

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_after_the_warm_up_neither_an_import_nor_a_lift_compiles_anything(tmp_path: Path) -> None:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    environment |= {"PYTHONPATH": PYTHONPATH}

    def run(*command: str) -> set[str]:
        """The kernels on the disk afterwards: a file for each mixture of types."""
        subprocess.run([sys.executable, *command], cwd=ROOT, check=True, env=environment)
        return {file.name for file in (tmp_path / "kernels").rglob("*.nbc")}

    compiled = run("-m", "objectmorpher.system.warm_up")
    assert len(compiled) > 50
    assert run("tests/app/first_jobs.py", str(tmp_path)) - compiled == set()
