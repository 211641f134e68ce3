"""No text of the window overlaps another one or is cut off, in any tool and panel."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest

from hands import PATIENCE, ROOT
from tests.tree import PYTHONPATH

SIZES = ("1440x900x1", "900x600x1", "2880x1800x2")
TOO_SMALL = "500x320x2"  # less than the window allows: the last line has no room for its sentence


def looked_at(environment: dict[str, str], *sizes: str) -> dict[str, dict[str, dict[str, Any]]]:
    """How many letters there are and what is wrong with them, by size and the window's state."""
    command = [sys.executable, "tests/app/find_bad_texts.py", *sizes]
    said = subprocess.run(
        command, cwd=ROOT, env=environment | {"PYTHONPATH": PYTHONPATH}, capture_output=True,
        text=True, timeout=len(sizes) * PATIENCE,
    )  # fmt: skip
    assert said.returncode == 0, said.stderr[-2000:]
    rows = [json.loads(line) for line in said.stdout.splitlines()]
    return {size: {r["state"]: r for r in rows if r["size"] == size} for size in sizes}


@pytest.mark.window
@pytest.mark.slow
def test_texts_neither_overlap_nor_are_cut_off(window_environment: dict[str, str]) -> None:
    by_size = looked_at(window_environment, *SIZES, TOO_SMALL)
    for size in SIZES:
        found = by_size[size]
        assert len(found) > 10 and all(row["letters"] > 80 for row in found.values())
        assert {state: row["bad"] for state, row in found.items() if row["bad"]} == {}, size
    assert any(row["bad"] for row in by_size[TOO_SMALL].values())
