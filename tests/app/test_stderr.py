"""What stands on stderr when something fails: our one sentence, whatever libraries print."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from objectmorpher.cli import parser as cli
from objectmorpher.system.logs import NAME
from tests.tree import PYTHONPATH

ROOT = Path(__file__).parents[2]


def without_strips(path: Path) -> Path:
    """A TIFF file whose directory says that its picture has no strips."""
    Image.fromarray(np.zeros((20, 30, 3), np.uint8)).save(path, compression="tiff_lzw")
    data = bytearray(path.read_bytes())
    order = "little"
    at = int.from_bytes(data[4:8], order)
    for k in range(int.from_bytes(data[at : at + 2], order)):
        entry = at + 2 + 12 * k
        if int.from_bytes(data[entry : entry + 2], order) in (273, 279):
            data[entry + 4 : entry + 8] = bytes(4)
    path.write_bytes(data)
    return path


def test_a_tiff_without_strips_is_one_sentence_and_the_rest_is_in_the_log(tmp_path: Path) -> None:
    photo = without_strips(tmp_path / "none.tif")
    environment = os.environ | {"XDG_CONFIG_HOME": str(tmp_path), "HOME": str(tmp_path),
                                "PYTHONPATH": PYTHONPATH}  # fmt: skip
    command = [sys.executable, "-m", "objectmorpher", "select", str(photo), "--box", "1,1,9,9"]
    done = subprocess.run([*command, "-o", str(tmp_path / "m.png")], env=environment,
                          capture_output=True, text=True, cwd=tmp_path)  # fmt: skip
    assert done.returncode == cli.FAILED
    assert done.stderr.startswith("objectmorpher: the image cannot be read")
    assert done.stderr.count("\n") == 1
    (log,) = tmp_path.rglob(NAME)
    assert "TIFF" in log.read_text(encoding="utf-8")


def test_a_fault_of_ours_is_a_sentence_that_names_the_log(monkeypatch, capsys, caplog) -> None:
    class Fault(Exception):
        pass

    def fail(options: object) -> None:
        raise Fault("of ours")

    monkeypatch.setattr("objectmorpher.cli.commands.run_info", fail)
    assert cli.main(["info", "x.omorph"]) == cli.FAILED
    told = capsys.readouterr().err
    assert cli.UNFORESEEN in told and "(Fault: of ours)" in told and NAME in told
    assert told.count("\n") == 1
    assert "Traceback" in caplog.text


@pytest.mark.skipif(sys.platform == "win32", reason="C's stderr is not Python's there")
def test_output_of_native_code_while_a_picture_is_read_is_logged(capfd, caplog) -> None:
    from objectmorpher_core.base.library_output import logged_output

    caplog.set_level("INFO")
    with logged_output("a picture"), logged_output("another"):
        os.write(2, b"libtiff says this\n")
    os.write(2, b"said afterwards\n")
    assert capfd.readouterr().err == "said afterwards\n"
    assert "About a picture: libtiff says this" in caplog.text
