"""Lifting: a mask of the photo becomes 3D Gaussians, registered to the photo (paper 3.1)."""

from __future__ import annotations

from importlib import import_module
from typing import Protocol

from ..arrays import Mask, Pixels
from ..camera import Camera
from ..document import LiftedObject, Matte
from ..progress import Progress

GAUSSIANS = 16_000  # default count; the detail is in the photo, they only follow the shape


class LiftError(ValueError):
    """The object cannot be lifted; one sentence."""


class Lifter(Protocol):
    """Makes an object's 3D shape from its picture."""

    name: str

    def missing(self) -> str | None:
        """What has to be installed first, as one sentence; None when it can run."""
        ...

    def lift(
        self,
        pixels: Pixels,
        mask: Mask,
        matte: Matte,
        camera: Camera,
        count: int,
        progress: Progress,
        seed: int = 0,
    ) -> LiftedObject:
        """About `count` Gaussians of the object under `mask` (H, W), with its control points."""
        ...  # fmt: skip


BACKENDS = {"relief": "objectmorpher_core.lift.relief:ReliefLifter"}  # imported when chosen


def load(name: str = "auto") -> Lifter:
    """The lifter called `name`; `auto` takes the best that can run here.

    Raises LiftError for an unknown name or one whose models are missing.
    """
    if name == "auto":
        name = "relief"
    if name not in BACKENDS:
        known = ", ".join(BACKENDS)
        raise LiftError(f"the lifter {name!r} is not installed; installed: {known}")
    module, attribute = BACKENDS[name].split(":")
    lifter = getattr(import_module(module), attribute)()
    if (sentence := lifter.missing()) is not None:
        raise LiftError(sentence)
    return lifter
