"""Whatever goes wrong while something is written, the old file or the new one is there, whole."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
# Operations of each at which a fault comes; `make faults` does all. Seven scenarios write a file by
# the same nine, and have every fault at each of these together.
MOST = "8"


def run(*options: str) -> list[dict[str, Any]]:
    """What `python -m tests.faults` found, a dict for each scenario."""
    command = [sys.executable, "-m", "tests.faults", *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    found = [json.loads(line) for line in done.stdout.splitlines()]
    if found and "missing" in found[0]:
        pytest.skip(found[0]["missing"])
    assert found, done.stderr
    return found


def assert_none_lost(found: list[dict[str, Any]], least: int) -> None:
    for result in found:
        assert result["wrong"] == [], result["name"]
        assert sum(result["runs"].values()) >= least, result["name"]


def test_power_cuts_leave_the_old_step_or_the_new_one() -> None:
    found = run("--power", "--scenarios", "session,autosave,settings")
    assert len(found) == 3
    assert_none_lost(found, 15)
    assert any(result["ends"].get("new") for result in found)


@pytest.mark.slow
def test_a_writer_that_takes_no_care_is_found_out() -> None:
    """A file that is opened and written over: what the product must not do."""
    (found,) = run("--quick", "--scenarios", "careless")
    assert found["wrong"]


@pytest.mark.slow
def test_where_the_power_fails_it_is_found_out_and_a_journal_without_names_on_the_disk() -> None:
    found = run("--power", "--scenarios", "careless,careless order")
    assert [bool(result["wrong"]) for result in found] == [True, True]


@pytest.mark.slow
def test_every_fault_at_the_operations_of_all_that_is_written() -> None:
    assert_none_lost(run("--most", MOST), 20)  # the token: 7 operations, one of them a write


@pytest.mark.slow
def test_power_cuts_of_all_that_is_written() -> None:
    assert_none_lost(run("--power", "--states", "64"), 10)
