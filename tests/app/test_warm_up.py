"""After the warm-up nobody waits for a compiler."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.tree import PYTHONPATH

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_after_the_warm_up_neither_an_import_nor_a_lift_compiles_anything(
    compiled: None, tmp_path: Path
) -> None:
    """It would compile each kernel that it asks for and the warm-up did not."""
    done = subprocess.run(
        [sys.executable, "tests/app/first_jobs.py", tmp_path], cwd=ROOT, check=True,
        env=os.environ | {"PYTHONPATH": PYTHONPATH}, stdout=subprocess.PIPE,
    )  # fmt: skip
    told = json.loads(done.stdout)
    assert told["warm"] > 50
    assert told["others"] == []
    assert told["twins"] == [], "compiled twice, which takes seconds"
