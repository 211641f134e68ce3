"""What is said of a mistyped command line: one sentence with what was meant."""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import subprocess
import sys

import pytest

from objectmorpher import __main__ as program
from tests.tree import PYTHONPATH

SAID = {
    "edti photo.jpg": "no command and no file edti, did you mean edit?",
    "wibble photo.jpg": "no file wibble: edit, batch, select",
    "models": "models needs one of list, get, path, verify, add, remove",
    "bench": "bench needs one of deform, render, pipeline",
    "evaluate": "evaluate needs one of metrics, truth, paper",
    "completion fish": "there is no 'fish' here: bash, zsh, tcsh",
    "edit a.png -o b.png --turn 1,2,3,4": "'1,2,3,4' is not 1 to 3 numbers with commas",
    "edit a.png -o b.png --click 873 475": "'873' is not 2 numbers with commas, as in X,Y\n",
    "edit a.png -o b.png --key scale=a": "--key: 'a' is not a number\n",
    "edit a.png -o b.png --scale 120%": "--scale: '120%' is not a number\n",
    "serve --port any": "--port: 'any' is not a whole number\n",
    "edit - -o -": "- is no file name",
    "edit a.png -o b.png --report -": "- is no file name",
    "edit a.png --farther 1": "no option --farther\n",
    "edit a.png --drag 1": "no option --drag, did you mean --handle?\n",
    "edit a.png --output b.png": "no option --output, did you mean --out?\n",
    "edit a.png --front-msk b.png": "did you mean --front-mask?\n",
    "models lst": "there is no 'lst' here, did you mean list?: list, get",
    "edit photo.jpg --clik 1,2": "edit has no option --clik, did you mean --click?",
    "edit photo.jpg -o a.png more.jpg": "edit cannot do anything with more.jpg",
    "evaluate metrics a b --sed 4": "evaluate metrics has no option --sed, did you mean --seed?",
    "--theem dark": "objectmorpher has no option --theem, did you mean --theme?",
    f"edit a.png -o b.png --pin={'1' * 5000},2,3": "1111...",
    "info": "info needs SESSION",
    "batch a.json --format bmp": "there is no 'bmp' here: png, jpg, tif, webp",
}


@pytest.mark.parametrize("typed", SAID)
def test_a_mistyped_command_line_is_told_with_what_was_meant(typed, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        program.main(typed.split())
    told = capsys.readouterr().err
    assert ended.value.code == 2
    assert len(told) < 300
    assert SAID[typed] in told and told.startswith("objectmorpher: ") and told.count("\n") == 1


def _run(command: str, **more: str) -> str:
    """What a command prints on a terminal of its own, 80 characters wide."""
    environment = os.environ | {"PYTHONPATH": PYTHONPATH, "COLUMNS": "80", "TERM": "xterm"} | more
    import pty

    main, terminal = pty.openpty()
    with subprocess.Popen(shlex.split(command), stdout=terminal, env=environment) as process:
        os.close(terminal)
        said = b""
        with contextlib.suppress(OSError):  # how Linux says that nobody holds the other end
            while data := os.read(main, 65536):
                said += data
    os.close(main)
    assert process.returncode == 0
    return said.decode().replace("\r\n", "\n")


@pytest.mark.skipif(sys.platform == "win32", reason="it has no pseudo-terminals")
def test_the_help_is_in_colour_on_a_terminal_that_has_it_and_says_the_same():
    command = f"{sys.executable} -m objectmorpher edit --help"
    shown, plain = _run(command), _run(command, NO_COLOR="1")
    assert "\033[" in shown and "\033[" not in plain
    assert re.sub(r"\033\[\d*m", "", shown) == plain
    assert "\033[" not in _run(command, TERM="dumb")


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
def test_bash_completes_commands_options_choices_and_files(capsys, tmp_path):
    assert program.main(["completion", "bash"]) == 0
    (tmp_path / "complete.sh").write_text(capsys.readouterr().out)
    (tmp_path / "photo.jpg").touch()
    cases = {"e": "edit", "edit --cl": "--click", "models li": "list", "edit ph": "photo.jpg",
             "batch --format ti": "tif", "edit -o ph": "photo.jpg", "warm": "warm-up"}  # fmt: skip
    for typed, expected in cases.items():
        words = ["objectmorpher", *typed.split()]
        line = " ".join(map(shlex.quote, words))
        script = (
            f"source complete.sh; COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; "
            f'_shtab_objectmorpher; echo "${{COMPREPLY[*]}}"'
        )
        done = subprocess.run(
            ["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        assert expected in done.stdout.split(), (typed, done.stdout, done.stderr)
