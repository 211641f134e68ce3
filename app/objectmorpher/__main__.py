"""Arguments, construction, loop: `objectmorpher` and `python -m objectmorpher`."""

from __future__ import annotations

import argparse
import atexit
import gc
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from .cli.options import WindowOptions

# One BLAS thread: the solver's matrices are small, and a second thread costs more than it helps.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

SAMPLE_EDIT = ("--click", "280,150", "--turn", "18,0,0")  # what the first run does headless
HEADLESS_OUT = Path("objectmorpher-edited.png")
# Most objects are the modules' own, and stay; to look for garbage among them takes .1 s each time.
GARBAGE = 50_000, 20, 20  # new objects, and how often younger ones are looked through before older
FINAL = ("edit", "select", "replay")  # commands that have written everything when they return


def run() -> NoReturn:
    """Runs the program as a process of its own, and ends it."""
    gc.set_threshold(*GARBAGE)
    code = main()
    if sys.argv[1:2] and sys.argv[1] in FINAL:
        _leave(code)
    sys.exit(code)


def _leave(code: int) -> None:
    """Ends the process without taking apart what it holds: that takes a third of a second.

    Comes back where what was printed cannot be handed over, which the interpreter then reports.
    """
    atexit._run_exitfuncs()
    try:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
    except (OSError, ValueError):
        return
    os._exit(code)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the program; returns its exit code."""
    from .cli import parser as cli

    _forgive_characters()
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    if arguments and (
        arguments[0] in cli.COMMANDS or arguments[0] in ("-h", "--help", "--version")
    ):
        is_question = {"-h", "--help", "--version"} & set(arguments)
        return cli.main(arguments) if is_question else _run_command(arguments)
    options = cli.parse_window(arguments)
    if (wrong := cli.idle_in_window(options, has_display())) is not None:
        print(f"{cli.PROGRAM}: {wrong}", file=sys.stderr)
        return cli.FAILED
    if not has_display():
        return _edit_headless(options)
    return _run_window(cli.window_options(options))


def _run_command(arguments: Sequence[str]) -> int:
    """Run a command: apart, where an installer's copy has PyTorch in an environment, or here."""
    from objectmorpher_core.base import torch_environment

    from .cli import parser as cli

    torch_environment.join()
    if torch_environment.apart() is not None:
        from .worker.apart import run_command

        if (code := run_command(arguments)) is not None:
            return code
    _start_log()
    return cli.main(arguments)


def _start_log() -> None:
    """Imported late: the words of `--help` need none of it."""
    from .system.logs import log_path, start_command_log

    start_command_log(log_path().parent)


def _forgive_characters() -> None:
    """What a terminal or a pipe has no character for is a question mark there, and no error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")


def _run_window(options: WindowOptions) -> int:
    """The driver takes as long to make a window as the imports of what is drawn in it."""
    from .cli.terminal import PROGRAM
    from .gui.window.glfw_window import WindowError, open_window

    imports = Thread(target=import_module, args=("objectmorpher.gui.window.window",), daemon=True)
    imports.start()
    try:
        handle = open_window(options)
    except WindowError as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return 1
    imports.join()

    from objectmorpher_core.base import torch_environment

    from .editor.settings import settings_path
    from .gui.window.window import run_window
    from .system.logs import start_log
    from .system.warm_up import start_compiling

    torch_environment.join()
    start_log(settings_path().parent)
    compiling = start_compiling() if options.frames is None else None
    try:
        return run_window(options, handle)
    finally:
        if compiling is not None:
            compiling.kill()


def has_display() -> bool:
    """Whether a window can be opened here at all."""
    if sys.platform.startswith("linux"):
        return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return True


def _edit_headless(options: argparse.Namespace) -> int:
    """Without a screen: the sample edit, or a turn of the photo's subject, into a file."""
    from .cli import parser as cli
    from .system.resources import resource

    photo: Path | None = next(iter(options.files), None)
    choice = SAMPLE_EDIT if photo is None else ("--subject", *SAMPLE_EDIT[2:])
    photo = photo or resource(cli.SAMPLE)
    if photo.suffix.lower() == ".omorph":
        arguments = ["replay", str(photo), "-o", str(HEADLESS_OUT)]
    else:
        arguments = ["edit", str(photo), *choice, "-o", str(HEADLESS_OUT)]
        arguments += [] if options.fov is None else [f"--fov={options.fov:g}"]
        arguments += [f"--seed={options.seed}"] if options.seed else []
    print(f"There is no display, so this edit runs without a window:\n  {' '.join(arguments)}")
    code = cli.main(arguments)
    if code == 0:
        print(f"The edited photo is {HEADLESS_OUT.resolve()}")
    return code


if __name__ == "__main__":
    run()
