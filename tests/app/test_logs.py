"""The log file, and what happens where there can be none."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
CODE = """
import logging, sys
from pathlib import Path
from app.logs import start_log
start_log(Path(sys.argv[1]))
logging.getLogger("app.jobs").info("Lifted")
logging.getLogger("app.jobs").warning("Odd")
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
