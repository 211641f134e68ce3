"""The log file, and what happens where there can be none."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.tree import PYTHONPATH

ROOT = Path(__file__).parents[2]
CODE = """
import logging, sys
from pathlib import Path
from objectmorpher.system.logs import start_log
start_log(Path(sys.argv[1]))
logging.getLogger("objectmorpher.worker.jobs").info("Lifted")
logging.getLogger("objectmorpher.worker.jobs").warning("Odd")
"""

FAULT = """
import os, sys, time
from pathlib import Path
from objectmorpher.worker.jobs import Jobs
from objectmorpher.system.logs import start_log

def end(progress=None):
    os.abort()

if __name__ == "__main__":
    start_log(Path(sys.argv[1]))
    if sys.argv[2] == "here":
        end()
    jobs, ends = Jobs(), []
    jobs.start("Ending", end, done=ends.append, failed=ends.append)
    while not ends:
        jobs.poll()
        time.sleep(0.01)
"""


def _run(folder: Path) -> str:
    """What is said on the terminal."""
    command = [sys.executable, "-c", CODE, str(folder)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stderr


def test_the_file_gets_everything_and_the_terminal_warnings(tmp_path: Path) -> None:
    said = _run(tmp_path / "new")
    written = (tmp_path / "new" / "objectmorpher.log").read_text()
    assert "Lifted" in written
    assert "Odd" in written
    assert "Odd" in said
    assert "Lifted" not in said


def test_without_a_place_for_it_the_program_goes_on(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    said = _run(tmp_path / "file")
    assert "There is no log file" in said
    assert "Odd" in said


@pytest.mark.parametrize("where", ["here", "worker"])
def test_a_fault_of_native_code_is_noted(tmp_path: Path, where: str) -> None:
    """What no Python code can catch: the stacks are in a file before the process is gone."""
    program = tmp_path / "program.py"  # in a file: the worker imports what it runs
    program.write_text(FAULT, encoding="utf-8")
    command = [sys.executable, str(program), str(tmp_path), where]
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONFAULTHANDLER"}
    environment["PYTHONPATH"] = PYTHONPATH
    ended = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True)
    assert (ended.returncode != 0) == (where == "here")
    noted = (tmp_path / "objectmorpher-crashes.log").read_text()
    assert "Fatal Python error: Aborted" in noted
    assert ("in work\n" in noted) == (where == "worker")
