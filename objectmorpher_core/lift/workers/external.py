"""Lifting by a program in an environment of its own: the worker protocol (docs/workers.md).

The worker gets a fresh folder: `image.png` (the photo, RGBA, alpha is the soft cut-out), `mask.png`
(0 or 255), both of the photo's size, and `camera.json`. It leaves `object.ply` (or another file of
3D Gaussians, or a mesh) there, and, where it knows, `object.json`: how it was seen. What it leaves
is registered to the photo as an imported file is; the folder is removed.

Its command runs in a process group of its own, of which nothing stays behind. What it prints on
stdout in lines of JSON is its progress, {"progress": 0.5, "note": "Sampling"}, or why it fails,
{"error": "one sentence"}. Every other line, a library's, is ignored.
"""

from __future__ import annotations

import json
import logging
import math
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import numpy as np
from PIL import Image

from ...base.arrays import F64
from ...base.camera import Camera
from ...base.limits import WORKER_FILE
from ...base.limits import WORKER_GAUSSIANS as MOST
from ...base.progress import Progress, part
from ...base.quoting import reason, shown
from ...document.gaussians import Gaussians
from ...document.model import LiftedObject, LiftSettings
from ...pictures.image import to_u8
from ...splat_files import FORMATS, MESH_ENDINGS, SplatFileError, read, read_object
from ...splat_files.splats.ply import read_header
from .. import LiftError, LiftSubject
from ..registration.imported import lift_imported
from ..registration.placement import Hints, Proposal, Registrar, register
from ..registration.view import Target
from ..trellis.camera import pose_in
from .file import LiftWorker, read_worker

# The small JSON files that workers leave, and the poses in them (docs/workers.md).

VERSION = 1  # of the protocol
TOLERANCE = 1e-3  # of a turn's rows, in its size
# What reading a file raises that says something else than it should.
WRONG = (OSError, ValueError, LookupError, TypeError, RecursionError, OverflowError)


def read_told(at: Path) -> Any:
    """Read a JSON file of our version. Raises one of WRONG."""
    if at.is_symlink() or at.stat().st_size > WORKER_FILE:
        raise ValueError("it is no small file")
    told = json.loads(at.read_text(encoding="utf-8"))
    if told["version"] != VERSION:
        raise ValueError(f"version {shown(told['version'])} is not known")
    return told


def check_similarity(matrix: F64, name: str, size: float | None = None) -> None:
    """Raises ValueError unless it is a (4, 4) of a turn, a `size` (None: any) and a place."""
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ValueError(f"{name} is no 4 x 4 of numbers")
    linear = matrix[:3, :3]
    volume = np.linalg.det(linear)
    squared = np.cbrt(volume) ** 2 if size is None else size**2
    is_turn = volume > 0 and np.allclose(linear @ linear.T / squared, np.eye(3), atol=TOLERANCE)
    if not is_turn or not np.allclose(matrix[3], [0, 0, 0, 1]):
        known = "size" if size is None else f"size of {size:g}"
        raise ValueError(f"{name} is no turn, {known} and place")


POLL = 0.05  # s between two looks at the process
LINE = 1 << 14  # characters of a line that are read
TOLD = 300  # characters of a sentence that is passed on


class _Heard:
    """What a worker has said so far; written by the threads that read its pipes."""

    def __init__(self) -> None:
        self.fraction, self.note, self.error, self.last = 0.0, "", "", ""

    def out(self, line: str) -> None:
        """A line of stdout."""
        try:
            told = json.loads(line)
        except (ValueError, RecursionError):
            return
        if not isinstance(told, dict):
            return
        fraction = told.get("progress")
        if isinstance(fraction, int | float) and 0 <= fraction <= 1:
            self.fraction = max(self.fraction, float(fraction))
            self.note = str(told.get("note", ""))[:TOLD]
        if "error" in told:
            self.error = " ".join(str(told["error"]).split())[:TOLD]

    def err(self, line: str) -> None:
        """Take a line of stderr; the last one says most."""
        self.last = " ".join(line.split())[:TOLD] or self.last


def run_worker(worker: LiftWorker, folder: Path, progress: Progress) -> None:
    """Runs `worker` on the job in `folder`, which is its working directory, too.

    Raises LiftError: one sentence; Cancelled passes. The whole group has ended in every case.
    """
    heard = _Heard()
    process = _started(worker, folder)
    readers = [
        threading.Thread(target=_read, args=pair, daemon=True)
        for pair in ((process.stdout, heard.out), (process.stderr, heard.err))
    ]
    for reader in readers:
        reader.start()
    end = time.monotonic() + worker.timeout
    try:
        while not _has_ended(process):
            progress(heard.fraction, heard.note or f"{worker.name} is at work")
            if time.monotonic() > end:
                raise LiftError(f"the worker {worker.name} took more than {worker.timeout:g} s")
            time.sleep(POLL)
    finally:
        _end_group(process)
        code = process.wait()
        for reader in readers:
            reader.join(1.0)
    if code != 0:
        reason = heard.error or heard.last or "it said nothing"
        how = f"was ended by signal {-code}" if code < 0 else f"failed ({code})"
        raise LiftError(f"the worker {worker.name} {how}: {reason}")


def _started(worker: LiftWorker, folder: Path) -> subprocess.Popen[str]:
    own: dict[str, Any] = (
        {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}  # type: ignore[attr-defined]
        if sys.platform == "win32"
        else {"start_new_session": True}
    )
    try:
        return subprocess.Popen(
            [*worker.command, str(folder)], cwd=folder, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8",
            errors="replace", env=os.environ | {"PYTHONUNBUFFERED": "1"}, **own,
        )  # fmt: skip
    except (OSError, ValueError) as error:
        raise LiftError(f"the worker {worker.name} cannot be started: {error}") from error


def _read(pipe: IO[str], take: Callable[[str], None]) -> None:
    with pipe:
        while line := pipe.readline(LINE):
            take(line)


def _has_ended(process: subprocess.Popen[str]) -> bool:
    """On POSIX without reaping it: its number, which is its group's, stays taken until then."""
    wait = getattr(os, "waitid", None)  # macOS has it since Python 3.13
    if sys.platform == "win32" or wait is None:
        return process.poll() is not None
    flags = os.WEXITED | os.WNOHANG | os.WNOWAIT
    return wait(os.P_PID, process.pid, flags) is not None


def _end_group(process: subprocess.Popen[str]) -> None:
    """Kills the process and all that it started; also what outlives it."""
    if sys.platform == "win32":
        subprocess.run(["taskkill", "/F", "/T", "/PID", str(process.pid)], capture_output=True)
        return
    # On macOS there is no right to kill a group of which only a zombie is left.
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


log = logging.getLogger(__name__)
OBJECT, SEEN = "object", "object.json"  # what a worker leaves
LOST = 0.01  # share of Gaussians with values that are no numbers, from which the file is refused
ELSEWHERE = 0.3  # IoU below which the worker's camera shows the object elsewhere
SAME = 1e-6  # relative difference of cameras that are one
POINTS = 2_000  # by which a pose is carried from the worker's camera to the photo's
UP = (0.0, -1.0, 0.0)  # of the object frame: y is down


class ExternalLifter:
    """A worker as a lifter."""

    def __init__(self, worker: LiftWorker) -> None:
        self.worker, self.name = worker, worker.name

    def missing(self) -> str | None:
        """See `Lifter`."""
        return self.worker.missing()

    def lift(
        self, subject: LiftSubject, settings: LiftSettings, progress: Progress, seed: int = 0
    ) -> LiftedObject:
        """See `Lifter`. Raises LiftError; Cancelled passes, and the worker has ended then."""
        with tempfile.TemporaryDirectory(prefix="objectmorpher-", ignore_cleanup_errors=True) as at:
            folder = Path(at)
            write_job(folder, subject, settings.count, seed)
            run_worker(self.worker, folder, part(progress, 0.0, 0.7))
            progress(0.7, "Reading the object")
            made, seen = read_answer(folder, self.name, settings.count)
        target = Target(subject.pixels, subject.mask, subject.camera)
        best = self._placed(made, seen, target, part(progress, 0.7, 0.9), seed)
        log.info("%s: registered with an IoU of %.3f", self.name, best.iou)
        rest = part(progress, 0.9, 1.0)
        lifted = lift_imported(made, best, subject.matte, None, rest, seed)
        return replace(lifted, backend=self.name)

    def _placed(
        self,
        made: Gaussians,
        seen: WorkerView | None,
        target: Target,
        progress: Progress,
        seed: int,
    ) -> Proposal:
        if seen is None:
            return register(made, target, Hints(up=UP), progress, seed).best
        progress(0.0, "Fitting the object")
        start = seen.pose_for(target.camera, made.means.astype(np.float64), self.name)
        registrar = Registrar(made, target, seed)
        best = registrar.improved(registrar.rated(start))
        if best.iou < ELSEWHERE:
            raise LiftError(
                f"the worker {self.name} says that the object is seen elsewhere: its outline and"
                f" the selection agree by {best.iou:.0%}"
            )
        return best


class WorkerView:
    """A worker's report of the view of its object."""

    def __init__(self, world_from_object: F64, camera: Camera) -> None:
        self.world_from_object, self.camera = world_from_object, camera

    def pose_for(self, camera: Camera, points: F64, name: str) -> F64:
        """(4, 4) world from object with which the photo's camera sees `points` (N, 3) so.

        Raises LiftError where no camera in front of the object does.
        """
        matrix = self.world_from_object
        world = points @ matrix[:3, :3].T + matrix[:3, 3]
        if (world[:, 2] <= 0).any():
            raise LiftError(f"the worker {name} says that the object is behind the camera")
        own = np.array([self.camera.focal, self.camera.cx, self.camera.cy])
        wanted = np.array([camera.focal, camera.cx, camera.cy])
        if (np.abs(own - wanted) <= SAME * wanted).all():
            return matrix
        some = slice(None, None, len(points) // POINTS + 1)
        found = pose_in(camera, points[some], self.camera.project(world[some]))
        if found is None:
            raise LiftError(f"the worker {name} says a camera that the photo cannot have")
        return found


def write_job(folder: Path, subject: LiftSubject, count: int, seed: int) -> None:
    """Write the worker's input."""
    rgb = to_u8(subject.pixels)
    alpha = np.zeros(subject.mask.shape, np.uint8)
    matte, (height, width) = subject.matte, subject.mask.shape
    x0, y0, x1, y1 = matte.box
    left, top, right, bottom = max(x0, 0), max(y0, 0), min(x1, width), min(y1, height)
    own = matte.alpha[top - y0 : bottom - y0, left - x0 : right - x0]
    alpha[top:bottom, left:right] = np.rint(255 * own.clip(0, 1))
    Image.fromarray(np.dstack([rgb, alpha]), "RGBA").save(folder / "image.png", compress_level=1)
    Image.fromarray(subject.mask.astype(np.uint8) * 255, "L").save(folder / "mask.png")
    c = subject.camera
    told = {
        "version": VERSION, "width": c.width, "height": c.height, "focal": c.focal, "cx": c.cx,
        "cy": c.cy, "seed": seed, "count": count,
    }  # fmt: skip
    (folder / "camera.json").write_text(json.dumps(told), encoding="utf-8")


def read_answer(folder: Path, name: str, count: int) -> tuple[Gaussians, WorkerView | None]:
    """The Gaussians that a worker left, and how it says they are seen. Raises LiftError."""
    at = _object_file(folder, name)
    seen = _seen(folder / SEEN, name)
    try:
        declared = _declared(at)
        if declared is not None and declared > MOST:
            raise SplatFileError(f"{at.name}: {declared:,} Gaussians are more than {MOST:,}")
        made = read(at, count)
        if declared is not None and len(made) < (1 - LOST) * declared:
            lost = f"{declared - len(made):,} of {declared:,} Gaussians"
            raise SplatFileError(f"{at.name}: {lost} have values that are not numbers")
        if seen is None:  # a pose refers to the frame of the file; without one any frame will do
            made = read_object(at, count)
    except (SplatFileError, OSError) as error:
        raise LiftError(f"what the worker {name} made cannot be used: {reason(error)}") from error
    if len(made) > MOST:
        raise LiftError(f"the worker {name} made {len(made):,} Gaussians, more than {MOST:,}")
    return made, seen


def _object_file(folder: Path, name: str) -> Path:
    for ending in (*FORMATS, *MESH_ENDINGS):
        at = folder / f"{OBJECT}{ending}"
        if at.is_symlink():
            raise LiftError(f"the worker {name} left a link, not a file: {at.name}")
        if at.is_file():
            return at
    raise LiftError(f"the worker {name} ended without leaving {OBJECT}.ply or another object")


def _declared(at: Path) -> int | None:
    """How many vertices a .ply says it has; of other files nothing."""
    if at.suffix != ".ply":
        return None
    with at.open("rb") as file:
        header = read_header(file)
    vertex = header.element("vertex")
    return None if vertex is None or header.element("chunk") is not None else vertex.count


def _seen(at: Path, name: str) -> WorkerView | None:
    """What object.json says. Raises LiftError."""
    if not at.exists():
        return None
    try:
        told = read_told(at)
        matrix = np.array(told["world_from_object"], np.float64)
        focal, cx, cy = (float(told[key]) for key in ("focal", "cx", "cy"))
        camera = Camera(focal, cx, cy, int(told["width"]), int(told["height"]))
        check_similarity(matrix, "world_from_object")
        if not (math.isfinite(camera.cx + camera.cy) and 0 < camera.focal < math.inf):
            raise ValueError("the camera is none")
    except WRONG as error:
        raise LiftError(f"the camera of the worker {name} is of no use: {reason(error)}") from error
    return WorkerView(matrix, camera)


def load_worker(name: str) -> ExternalLifter:
    """The worker called `name` as a lifter. Raises LiftError."""
    return ExternalLifter(read_worker(name))
