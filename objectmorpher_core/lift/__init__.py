"""Lifting: a mask of the photo becomes 3D Gaussians, registered to the photo (paper 3.1)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ..base import backends
from ..base.arrays import Mask, Pixels
from ..base.camera import Camera
from ..base.masks import reduced, reduced_mask, reduction
from ..base.progress import Progress
from ..document.model import LiftedObject, LiftSettings, Matte
from ..document.sides import FurtherView


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


# The lift of what fills tens of megapixels, from a smaller picture of it.
#
# A shape is found on grids of a few hundred cells, and the photo carries the detail: the smaller
# picture gives the same shape in a fraction of the time and memory. What is in px of the photo is
# brought back to its size.


def lift_subject(
    lifter: Lifter,
    subject: LiftSubject,
    settings: LiftSettings,
    progress: Progress,
    seed: int = 0,
) -> LiftedObject:
    """Lift as the `lifter` does, of what is large in a smaller picture. Raises LiftError."""
    times = reduction(subject.matte.alpha.shape)
    if times == 1:
        return lifter.lift(subject, settings, progress, seed)
    small = _reduced(subject, times)
    lifted = lifter.lift(small, _reduced_settings(settings, times), progress, seed)
    return _enlarged(lifted, times, small.matte, subject.matte)


def _reduced(subject: LiftSubject, times: int) -> LiftSubject:
    matte, (height, width) = subject.matte, subject.mask.shape
    (left, x), (top, y) = divmod(matte.left, times), divmod(matte.top, times)
    alpha, foreground = (
        reduced(part, times, ((y, 0), (x, 0))) for part in (matte.alpha, matte.foreground)
    )
    pixels, mask = reduced(subject.pixels, times), reduced_mask(subject.mask, times)
    camera = subject.camera.windowed(0, 0, -(-width // times), -(-height // times), 1 / times)
    return LiftSubject(pixels, camera, mask, Matte(left, top, alpha, foreground))


def _reduced_settings(settings: LiftSettings, times: int) -> LiftSettings:
    hidden, horizon = settings.hidden, settings.horizon
    return replace(
        settings,
        hidden=None if hidden is None else reduced_mask(hidden, times),
        horizon=None if horizon is None else horizon / times,
        views=tuple(_with_matches(view, 1 / times) for view in settings.views),
    )


def _with_matches(view: FurtherView, zoom: float) -> FurtherView:
    """The view with what it has in common with the first photo, where that is `zoom`ed."""
    zooms = np.array([zoom, zoom, 1, 1], np.float32)
    return replace(view, matches=view.matches * zooms)


def _enlarged(lifted: LiftedObject, times: int, small: Matte, matte: Matte) -> LiftedObject:
    """What was lifted from the `small` matte, on the photo of the `matte`."""
    texture, middle, sides = lifted.texture, lifted.middle, lifted.sides
    if middle is not None:
        middle = middle / np.array([1, times, times], np.float32)
    if sides is not None:  # its pictures keep their own size, beside the matte of the photo
        beside, below = sides.left - small.left, sides.top - small.box[3]
        sides = sides.placed(matte.left + beside, matte.box[3] + below)
    texture = replace(texture, u0=texture.u0 * np.float32(times))
    return replace(lifted, texture=texture, middle=middle, sides=sides)
