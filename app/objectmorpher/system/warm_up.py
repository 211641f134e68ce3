"""Compiles what the editor uses, so that nobody waits for it later.

A checkout does it beforehand, on several cores: `python -m objectmorpher.system.warm_up`. An
installer's copy does it when it has been started for the first time, in a process of its own with
the lowest priority, while the window is used already: what is asked for before it is ready is
compiled there and then.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from pathlib import Path
from threading import Thread

from objectmorpher_core.base import installation

log = logging.getLogger(__name__)

COMMAND = "warm-up"  # the subcommand
MARK = "compiled.txt"  # in the kernels' folder: the build that all were compiled for


def warm_up() -> None:
    """A minute or two the first time after an installation, seconds afterwards.

    The largest kernels of a checkout are compiled by processes beside this one.
    """
    from objectmorpher_core import warm_up as core

    core.compile_beside()
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


# Opens DINOv2, and has it look at the photo, while the rest of the program is being imported.
#
# Importing takes two seconds of one core; networks leave the interpreter to others and use all
# that is left: together they take hardly more than one of them.

LAST_IMPORTED = "objectmorpher_core.pipeline"  # when it is there nothing is left to be imported

BETTER = ("sam2", "sam3", "sam", "sam-onnx")  # which "auto" may take in its place


def open_early(photo: Path | None, segmenter: str | None, is_seen: bool = False) -> Thread | None:
    """The thread that opens it for `segmenter` of a `photo`; None where that would gain nothing.

    `is_seen`: the photo will be encoded, and may be at once. Without the weights, or the photo,
    there is nothing to wait for at the end of the program.
    """
    wants_it = segmenter in (None, "auto", "dino")
    if LAST_IMPORTED in sys.modules or not wants_it or photo is None or not photo.is_file():
        return None
    # Imported before the thread begins: two threads never import modules of ours at a time.
    from objectmorpher_core import models
    from objectmorpher_core.pictures import image  # noqa: F401
    from objectmorpher_core.segment import dino_tokens, salience  # noqa: F401

    if models.path(dino_tokens.WEIGHT) is None:
        return None
    others = segmenter != "dino" and any(map(models.installed, BETTER))
    seen = photo if is_seen and not others else None
    # not a daemon: it ends before the interpreter
    opening = Thread(target=_open, args=(seen,), name="network")
    opening.start()
    return opening


def _open(photo: Path | None) -> None:
    from objectmorpher_core.pictures.image import read_picture, to_u8
    from objectmorpher_core.segment import dino_tokens, salience

    try:
        if photo is None:
            dino_tokens.shared()
            return
        rgb = to_u8(read_picture(photo.read_bytes()).pixels)
        begun = dino_tokens.expect_tokens(rgb), salience.expect_salience(rgb)
        for compute in begun:
            compute()
    except Exception as error:  # whoever needs the network opens it again, and reports it
        log.debug("DINOv2 did not begin early: %s", error)


if __name__ == "__main__":
    warm_up()
