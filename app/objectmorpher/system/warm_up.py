"""Compiles what the editor uses, so that nobody waits for it later.

A checkout does it beforehand: `python -m objectmorpher.system.warm_up`. An installer's copy does it
when it has been started for the first time, in a process of its own with the lowest priority, while
the window is used already: what is asked for before it is ready is compiled there and then.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from pathlib import Path

from objectmorpher_core.base import installation

log = logging.getLogger(__name__)

COMMAND = "warm-up"  # the subcommand
MARK = "compiled.txt"  # in the kernels' folder: the build that all were compiled for


def warm_up() -> None:
    """A minute or two the first time after an installation, seconds afterwards."""
    from objectmorpher_core import warm_up as core

    from ..canvas.shape import build_shape, rehearse
    from ..render import flattening
    from ..render.splat_pass import near_to_far

    document = core.warm_up()
    camera, thing = document.photo.camera, document.objects[0]
    shape = build_shape(camera, thing)
    rehearse(shape, camera)
    near_to_far(shape.puppet.posed(thing.pose, thing.placement))
    flattening.rehearse()


def needs_compiling(folder: Path, build: str) -> bool:
    """Return whether the folder is not known to hold all kernels of this build."""
    try:
        return (folder / MARK).read_text(encoding="ascii").strip() != build
    except (OSError, ValueError):
        return True


def mark_compiled(folder: Path, build: str) -> None:
    """Note that all kernels of this build lie in the folder. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MARK).write_text(build + "\n", encoding="ascii")


def start_compiling() -> subprocess.Popen[bytes] | None:
    """The process, which is the caller's to end; None where there is nothing to do."""
    if not installation.is_frozen():
        return None
    try:
        build = installation.written_build(installation.inside())
        if not needs_compiling(installation.kernel_folder(), build):
            return None
        log.info("Compiling the kernels in the background, once")
        return subprocess.Popen(
            [sys.executable, COMMAND], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL, creationflags=_flags(),
        )  # fmt: skip
    except OSError as error:
        log.warning("The kernels are not compiled beforehand: %s", error)
        return None


def compile_kernels() -> None:
    """`objectmorpher warm-up`: now and in this process; seconds where they lie there already."""
    if sys.platform != "win32":
        os.nice(19)
    warm_up()
    if installation.is_frozen():
        build = installation.written_build(installation.inside())
        mark_compiled(installation.kernel_folder(), build)


def _flags() -> int:
    """On Windows: no window of its own, and the lowest priority."""
    if sys.platform != "win32":
        return 0
    return subprocess.CREATE_NO_WINDOW | subprocess.IDLE_PRIORITY_CLASS


if __name__ == "__main__":
    warm_up()
