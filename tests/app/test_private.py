"""What is copied to be sent names neither the user nor what is in the photos."""

from __future__ import annotations

import subprocess
import sys
import traceback
from pathlib import Path

import pytest

from objectmorpher.cli import parser as cli
from objectmorpher.system.logs import CRASHES, NAME
from objectmorpher.system.report import report, without_names
from objectmorpher_core.pictures.image import read_picture
from tests.tree import PYTHONPATH

ROOT = Path(__file__).parents[2]
SECRETS = ("anna", "Anna", "Kowalska", "wedding", "holiday", "clinic")
HOME = Path("/home/anna")


def assert_silent(text: str) -> None:
    assert [secret for secret in SECRETS if secret in text] == []


@pytest.mark.parametrize(("said", "shown"), [
    ("Exporting Anna at the clinic.png took 0.31 s", "Exporting <photo> took 0.31 s"),
    ("the settings /home/anna/.config/a.toml cannot", "the settings ~/.config/a.toml cannot"),
    ("the photo “Anna’s clinic.webp” is", "the photo “<photo>” is"),
    ('No such file: "/mnt/Anna\'s/wedding, 1.omorph"', 'No such file: "<session>"'),
    ("in /media/anna/disk", "in /media/<user>/disk"),
    ("Saving /mnt/holiday 2026/Kowalska wedding.omorph failed", "Saving <session> failed"),
    ("[Errno 2] No such file: 'Anna, wedding.jpeg'", "[Errno 2] No such file: '<photo>'"),
    (r"C:\Users\anna\My wedding\clinic.TIFF is damaged", "<photo> is damaged"),
    ("/home/annabel/x.toml, /home/anna", "/home/annabel/x.toml, ~"),
    ('  File "/home/anna/app/jobs.py", line 3, in run', '  File "~/app/jobs.py", line 3, in run'),
    ("Lifting the object took 1.20 s", "Lifting the object took 1.20 s"),
])  # fmt: skip
def test_names_are_left_out_and_the_rest_stays(said: str, shown: str) -> None:
    assert without_names(said, HOME, "anna") == shown


def test_real_tracebacks_keep_their_lines_and_lose_their_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = tmp_path / "anna"
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("USERPROFILE", str(home))
    monkeypatch.setenv("LOGNAME", "anna")
    album = home / "holiday with Kowalska"
    album.mkdir(parents=True)
    outside = tmp_path / "clinic" / "wedding of Anna.png"
    outside.parent.mkdir()
    outside.write_bytes(b"no photo")
    traces = []
    for act in (
        lambda: (album / "wedding, Anna.jpg").read_bytes(),
        lambda: (tmp_path / "clinic" / "Anna's wedding.omorph").read_bytes(),
        lambda: read_picture(outside.read_bytes()),
        lambda: exec(compile("1 / 0", str(home / "script.py"), "exec")),
    ):
        try:
            act()
        except Exception:
            traces.append(traceback.format_exc())
    folder = home / "settings"
    folder.mkdir()
    (folder / NAME).write_text("\n".join(traces), encoding="utf-8")
    told = report(folder)
    assert len(traces) == 4
    for secret in ("Anna", "wedding", "Kowalska", str(home)):
        assert secret not in told
    assert "FileNotFoundError" in told and "test_private.py" in told and "line " in told
    assert (
        told.count("Traceback (most recent call last)") == len(told.split("Traceback (")) - 1 >= 4
    )


CRASH = """
import os, sys
from pathlib import Path
from objectmorpher.cli import parser as cli
from objectmorpher.system.logs import start_log
start_log(Path(sys.argv[1]))
os.abort()
"""


def test_a_crash_is_in_the_report_with_the_folder_as_home(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = tmp_path / "anna"
    program = home / "holiday" / "run.py"
    program.parent.mkdir(parents=True)
    program.write_text(CRASH, encoding="utf-8")
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("USERPROFILE", str(home))
    monkeypatch.delenv("PYTHONFAULTHANDLER", raising=False)
    monkeypatch.setenv("PYTHONPATH", PYTHONPATH)
    subprocess.run([sys.executable, str(program), str(home / "log")], capture_output=True)
    assert str(home) in (home / "log" / CRASHES).read_text()
    told = report(home / "log")
    assert "Fatal Python error: Aborted" in told and "~/holiday/run.py" in told
    assert str(home) not in told


def test_the_doctor_names_the_log_and_not_the_home(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    home = tmp_path / "anna"
    home.mkdir()
    for name, place in (("HOME", "."), ("USERPROFILE", "."), ("OBJECTMORPHER_CACHE", "models")):
        monkeypatch.setenv(name, str(home / place))
    monkeypatch.setenv("OBJECTMORPHER_SETTINGS", str(home / "settings" / "settings.toml"))
    assert cli.main(["doctor"]) == 0
    said = capsys.readouterr().out
    assert f"the log is ~/settings/{NAME}" in said and str(home) not in said
