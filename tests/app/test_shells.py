"""zsh and tcsh complete what is typed, in a terminal; bash is in test_command_parser.py."""

from __future__ import annotations

import os
import re
import select
import shutil
import sys
import time
from pathlib import Path

import pytest

from objectmorpher import __main__ as program

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="it has no pseudo-terminals")

PATIENCE = 60.0  # s, of a machine that has much else to do
CASES = {
    "mod": "models", "edit --cl": "edit --click", "models li": "models list",
    "edit ph": "edit photo.jpg", "batch --format ti": "batch --format tif",
    "edit -o ph": "edit -o photo.jpg", "completion z": "completion zsh", "warm": "warm-up",
}  # fmt: skip
READY = "it is READY"
# What begins a shell, and the keys by which it then says what stands in its line.
SHELLS = {
    "zsh": (
        ("zsh", "-f", "-i"), "_objectmorpher",
        "fpath=($PWD $fpath); autoload -Uz compinit; compinit -u -D;"
        ' tell() { print -r -- "<$BUFFER>"; BUFFER=; }; zle -N tell; bindkey "^X" tell;'
        " echo it is REA''DY\n",
        "\x18",
    ),
    "tcsh": (
        ("tcsh", "-f", "-i"), "objectmorpher.tcsh",
        "set edit; source objectmorpher.tcsh; alias objectmorpher 'echo \"<objectmorpher \\!*>\"';"
        " echo it is REA''DY\n",
        "\n",
    ),
}  # fmt: skip


class Terminal:
    """A program at a pseudo-terminal."""

    def __init__(self, command: tuple[str, ...], folder: Path) -> None:
        import pty

        own = {"TERM": "vt100", "HOME": str(folder), "PATH": os.environ["PATH"], "LANG": "C"}
        self.process, self._terminal = pty.fork()
        if self.process == 0:
            os.chdir(folder)
            os.execvpe(command[0], command, own)

    def ask(self, keys: str, answer: str) -> str:
        """Types `keys`, and reads until something that matches `answer`, which is returned."""
        os.write(self._terminal, keys.encode())
        said, end = "", time.monotonic() + PATIENCE
        while (found := re.search(answer, said)) is None:
            assert time.monotonic() < end, f"{keys!r}: {said!r}"
            if select.select([self._terminal], [], [], 0.1)[0]:
                said += os.read(self._terminal, 65536).decode(errors="replace")
        return found[0]

    def close(self) -> None:
        os.close(self._terminal)
        os.waitpid(self.process, 0)


@pytest.mark.parametrize("shell", SHELLS)
def test_a_shell_completes_commands_options_choices_and_files(
    shell: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"there is no {shell}")
    command, name, begin, tell = SHELLS[shell]
    assert program.main(["completion", shell]) == 0
    (tmp_path / name).write_text(capsys.readouterr().out)
    (tmp_path / "photo.jpg").touch()
    terminal = Terminal(command, tmp_path)
    try:
        terminal.ask(begin, READY)
        for typed, completed in CASES.items():
            said = terminal.ask(f"objectmorpher {typed}\t{tell}", r"<objectmorpher [^<>]*>")
            assert said.rstrip("> ") == f"<objectmorpher {completed}", typed
    finally:
        terminal.close()
