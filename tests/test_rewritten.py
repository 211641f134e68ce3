"""The tests' bytecode that is made beforehand is what pytest would make."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests import rewritten

TEST = "def test_sum():\n    found = 1 + 1\n    assert found == {}\n"


def _run(folder: Path) -> str:
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-q", str(folder)]
    own = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    return subprocess.run(command, cwd=folder, env=own, capture_output=True, text=True).stdout


def test_pytest_takes_what_was_rewritten_and_says_what_differs(tmp_path: Path) -> None:
    tests = [tmp_path / "conftest.py", tmp_path / "test_right.py", tmp_path / "test_wrong.py"]
    tests[0].write_text("")
    tests[1].write_text(TEST.format(2))
    tests[2].write_text(TEST.format(3))
    (tmp_path / "scenes.py").write_text("")
    rewritten.main(tmp_path)
    assert not rewritten.is_kept(tmp_path / "scenes.py")
    made = [rewritten.kept_in(test).stat().st_ino for test in tests]
    assert "assert 2 == 3" in _run(tmp_path)
    assert [rewritten.kept_in(test).stat().st_ino for test in tests] == made


def test_what_changed_afterwards_is_rewritten_again(tmp_path: Path) -> None:
    test = tmp_path / "test_it.py"
    test.write_text(TEST.format(2))
    rewritten.main(tmp_path)
    assert rewritten.is_kept(test)
    test.write_text(TEST.format(4))
    assert not rewritten.is_kept(test)
    rewritten.main(tmp_path)
    assert rewritten.is_kept(test)
