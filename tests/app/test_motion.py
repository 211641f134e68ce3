"""Reduced motion: what the user and the system say."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from hands import PATIENCE, ROOT
from objectmorpher.editor.settings import AUTO, read_settings
from objectmorpher.system.desktop import FULL, REDUCED, MotionPreference
from tests.tree import PYTHONPATH


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads GNOME's setting")
@pytest.mark.parametrize(("answer", "is_reduced"), [("false", True), ("true", False), ("", False)])
def test_the_system_is_asked_and_the_user_overrules_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: str, is_reduced: bool
) -> None:
    asked = tmp_path / "gsettings"
    asked.write_text(f"#!/bin/sh\n[ $3 = enable-animations ] && echo {answer}\n")
    asked.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    motion = MotionPreference()
    motion.ask_system()
    assert motion.is_reduced(AUTO) is is_reduced
    assert motion.is_reduced(REDUCED)
    assert not motion.is_reduced(FULL)


def test_a_system_that_does_not_tell_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    motion = MotionPreference()
    motion.ask_system()
    assert not motion.is_reduced(AUTO) or not sys.platform.startswith("linux")


def test_the_settings_keep_what_was_chosen_under_its_earlier_name(tmp_path: Path) -> None:
    file = tmp_path / "settings.toml"
    file.write_text("is_motion_reduced = true\n")
    assert read_settings(file).motion == REDUCED
    file.write_text('is_motion_reduced = true\nmotion = "full"\n')
    assert read_settings(file).motion == FULL


def moving(environment: dict[str, str], motion: str) -> dict[str, int]:
    """How many pictures of the real window differ after each action."""
    program = str(Path(__file__).parent / "shoot_motion.py")
    result = subprocess.run(
        [sys.executable, program, motion], env={**environment, "PYTHONPATH": PYTHONPATH},
        capture_output=True, text=True, timeout=PATIENCE, cwd=ROOT,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout.splitlines()[-1])


@pytest.mark.slow
@pytest.mark.window
def test_with_reduced_motion_every_action_is_there_at_once(
    without_networks: dict[str, str],
) -> None:
    assert moving(without_networks, FULL)["show_popup"] > 0  # or this test could not fail
    still = moving(without_networks, REDUCED)
    assert still == dict.fromkeys(still, 0)
