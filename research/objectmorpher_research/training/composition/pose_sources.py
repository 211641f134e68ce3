"""Sources of the pose of an object that was lifted out of B and stands in A.

A source tells a motion, the world of A from the world of B (`camera.py`: each is its camera's own
frame); the registration improves it. A source that tells none has every turn searched. `own` only
carries B's pose over to A's mask as a start; details that both pictures show (`matched`) tell more.
`cupid` asks CUPID about both pictures. Any other name is a worker's (docs/workers.md): a command
that runs, for instance, pi^3, in its own environment.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from objectmorpher_core.base.arrays import F32, F64, frozen
from objectmorpher_core.base.masks import box_of
from objectmorpher_core.base.progress import Progress
from objectmorpher_core.document.model import LiftedObject
from objectmorpher_core.lift import LiftError, LiftSubject
from objectmorpher_core.lift.registration.sketch import Matches, alike
from objectmorpher_core.lift.registration.view import towards
from objectmorpher_core.lift.workers.external import (
    WRONG,
    check_similarity,
    read_told,
    run_worker,
    write_job,
)
from objectmorpher_core.lift.workers.file import LiftWorker, read_worker, worker_names

from . import TrainingError

if TYPE_CHECKING:
    from objectmorpher_core.lift.trellis.lifter import CupidLifter

ANSWER = "pose.json"


@dataclass(frozen=True, eq=False)
class Two:
    """An object in two pictures."""

    b: LiftSubject
    a: LiftSubject
    lifted: LiftedObject  # out of `b`


class PoseSource(Protocol):
    """Tells a motion."""

    name: str

    def missing(self) -> str | None:
        """Why it cannot run here, as one sentence; None where it can."""
        ...

    def motion(self, two: Two, progress: Progress, seed: int = 0) -> F64 | None:
        """Return the (4, 4) similarity from the world of B to that of A; None where it is unknown.

        Raises LiftError.
        """
        ...


def load(name: str) -> PoseSource:
    """The source called `name`. Raises TrainingError where it is unknown or cannot run."""
    source: PoseSource
    if name == "own":
        source = OwnPoses()
    elif name == "cupid":
        source = CupidPoses()
    elif name in worker_names():
        try:
            source = WorkerPoses(read_worker(name))
        except LiftError as error:
            raise TrainingError(str(error)) from error
    else:
        known = ", ".join(("own", "cupid", *worker_names()))
        raise TrainingError(f"there is no source of poses {name!r}; known are {known}")
    if (sentence := source.missing()) is not None:
        raise TrainingError(sentence)
    return source


class OwnPoses:
    """No pose is known beforehand: the registration looks for it."""

    name = "own"

    def missing(self) -> None:
        """See `PoseSource`."""

    def motion(self, two: Two, progress: Progress, seed: int = 0) -> None:
        """See `PoseSource`."""


class CupidPoses:
    """CUPID makes the object of each picture, and with it the pose in each."""

    name = "cupid"

    def missing(self) -> str | None:
        """See `PoseSource`."""
        return self._lifter().missing()

    def motion(self, two: Two, progress: Progress, seed: int = 0) -> F64 | None:
        """See `PoseSource`."""
        lifter = self._lifter()
        b, a = (lifter.stance(subject, progress, seed) for subject in (two.b, two.a))
        return None if b is None or a is None else a @ np.linalg.inv(b)

    def _lifter(self) -> CupidLifter:
        from objectmorpher_core.lift.trellis.lifter import CupidLifter

        return CupidLifter()


class WorkerPoses:
    """A command in an environment of its own.

    It gets a folder with `b/` and `a/`, each as a lifting worker gets it, and leaves `pose.json`:
    `a_from_b`, 4 x 4 rows, and `depth_b`, how far the object's middle is from B's camera in the
    units of that matrix. Cameras are OpenCV's: x right, y down, z forward.
    """

    def __init__(self, worker: LiftWorker) -> None:
        self._worker, self.name = worker, worker.name

    def missing(self) -> str | None:
        """See `PoseSource`."""
        return self._worker.missing()

    def motion(self, two: Two, progress: Progress, seed: int = 0) -> F64:
        """See `PoseSource`."""
        with tempfile.TemporaryDirectory(prefix="objectmorpher-", ignore_cleanup_errors=True) as at:
            folder = Path(at)
            for name, subject in (("b", two.b), ("a", two.a)):
                (folder / name).mkdir()
                write_job(folder / name, subject, len(two.lifted.gaussians), seed)
            run_worker(self._worker, folder, progress)
            matrix, depth = self._read(folder / ANSWER)
        matrix[:3, 3] *= float(two.lifted.centre[2]) / depth  # into the units of our world
        return matrix

    def _read(self, at: Path) -> tuple[F64, float]:
        try:
            told = read_told(at)
            matrix, depth = np.array(told["a_from_b"], np.float64), float(told["depth_b"])
            check_similarity(matrix, "a_from_b", size=1.0)
            if not 0 < depth < np.inf:
                raise ValueError("depth_b is no distance")
        except WRONG as error:
            raise LiftError(f"the pose of the worker {self.name} is of no use: {error}") from error
        return matrix, depth


def matched(two: Two, depth: F32) -> Matches:
    """Points of the object that both pictures show; `depth` (h, w) is that of it in B, world."""
    b, a = two.b, two.a
    at, seen = alike((b.pixels, b.mask), (a.pixels, a.mask))
    height, width = depth.shape
    column, row = np.clip(at.astype(int), 0, [width - 1, height - 1]).T
    found = np.isfinite(depth[row, column])
    world = b.camera.unproject(at[found], depth[row, column][found])
    points = frozen(two.lifted.object_points(world), np.float64)
    return Matches(points, frozen(seen[found], np.float64), float(np.sqrt(a.mask.sum())))


def carried(two: Two) -> F64:
    """(4, 4) the motion that leaves the object turned to the camera as it is in B, at A's mask."""
    b, a = two.b, two.a
    centre = two.lifted.centre
    size_b, size_a = (np.sqrt(float(s.mask.sum())) / s.camera.focal for s in (b, a))
    depth = centre[2] * size_b / size_a
    target = a.camera.unproject(_middle(a), depth)
    motion = np.eye(4)
    motion[:3, :3] = towards(_ray(target)) @ towards(_ray(centre)).T
    motion[:3, 3] = target - motion[:3, :3] @ centre
    return motion


def _middle(subject: LiftSubject) -> F64:
    """(2,) px of the box around the mask."""
    return np.array(box_of(subject.mask)).reshape(2, 2).mean(0)


def _ray(point: F64) -> F64:
    return point / point[2]
