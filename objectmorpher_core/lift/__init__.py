"""Lifting: a mask of the photo becomes 3D Gaussians, registered to the photo (paper 3.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from ..base import backends
from ..base.arrays import Mask, Pixels
from ..base.camera import Camera
from ..base.progress import Progress
from ..document.model import LiftedObject, LiftSettings, Matte


class LiftError(ValueError):
    """The object cannot be lifted; one sentence."""


@dataclass(frozen=True, eq=False)
class LiftSubject:
    """The object that is to be lifted, as the photo shows it."""

    pixels: Pixels  # (H, W, 3) the photo
    camera: Camera
    mask: Mask  # (H, W)
    matte: Matte


class Lifter(Protocol):
    """Makes an object's 3D shape from its picture."""

    name: str

    def missing(self) -> str | None:
        """Return what has to be installed first, as one sentence; None when it can run."""
        ...

    def lift(
        self, subject: LiftSubject, settings: LiftSettings, progress: Progress, seed: int = 0
    ) -> LiftedObject:
        """About `settings.count` Gaussians of the subject, with its control points.

        Raises LiftError: one sentence.
        """
        ...


BACKENDS = {  # imported when chosen
    "relief": "objectmorpher_core.lift.relief.lifter:ReliefLifter",
    "trellis": "objectmorpher_core.lift.trellis.lifter:TrellisLifter",
    "cupid": "objectmorpher_core.lift.trellis.lifter:CupidLifter",
    "triposplat": "objectmorpher_core.lift.trellis.lifter:TripoSplatLifter",
}


def load(name: str = "auto") -> Lifter:
    """The lifter called `name`; `auto` takes the best that can run here.

    Raises LiftError for an unknown name or one whose models are missing.
    """
    return backends.able(_lifter("relief" if name == "auto" else name), LiftError)


def _lifter(name: str) -> Lifter:
    from .workers.file import worker_names

    workers = () if name in BACKENDS else worker_names()
    if name not in workers:
        return backends.known(BACKENDS, name, "lifter", LiftError, workers)
    from .workers.external import load_worker

    return load_worker(name)
