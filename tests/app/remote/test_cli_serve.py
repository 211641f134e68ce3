"""`objectmorpher serve` on the command line: what it refuses, and how it begins and ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from objectmorpher.cli.parser import main
from objectmorpher.server.address import Address, Server, read_token
from objectmorpher.server.client import hello

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--stages", "lift,polish"), "no stage 'polish'"),
        (("--replicas", "3,1"), "smaller first"),
        (("--replicas", "0"), "1 to 256"),
        (("--replicas", "many"), "MIN or MIN,MAX"),
        (("--port", "99999"), "objectmorpher: --port is a number from 0 to 65535, not 99999\n"),
        (("--max-body", "0"), "numbers above zero"),
        (("--cpus", "nan"), "numbers above zero"),
        (("--gpus", "-1"), "number of GPUs"),
        (("--store", "-5"), "number of MB"),
    ],
)
def test_what_makes_no_sense_is_refused_with_a_sentence(
    options: tuple[str, ...], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["serve", "--alone", *options]) == 1
    told = capsys.readouterr().err
    assert sentence in told
    assert told.count("\n") == 1


def test_a_token_that_is_too_short_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("OBJECTMORPHER_TOKEN", "secret")
    assert main(["serve", "--alone", "--port", "0"]) == 1
    assert "16 to 512" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform == "win32", reason="there SIGTERM ends a process at once")
def test_it_makes_a_token_serves_this_computer_only_and_ends_when_asked(tmp_path: Path) -> None:
    path = tmp_path / "token"
    environment = {k: v for k, v in os.environ.items() if k != "OBJECTMORPHER_TOKEN"}
    process = subprocess.Popen(
        [sys.executable, "-m", "objectmorpher", "serve", "--alone", "--port", "0",
         "--stages", "inpaint",
         "--token-file", str(path)],
        cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        first, second = process.stdout.readline(), process.stdout.readline()
        assert first.startswith("serving on http://127.0.0.1:")
        token = read_token(path)
        assert second == f"token: {token}, kept in {path}\n"
        assert path.stat().st_mode & 0o077 == 0
        told = hello(Server(Address("127.0.0.1", int(first.rpartition(":")[2])), token))
        assert told["functions"] == ["fill_variants", "inpaint", "repair", "take_shadow"]
    finally:
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=20)
    assert process.returncode == 0, errors
    assert token not in errors
