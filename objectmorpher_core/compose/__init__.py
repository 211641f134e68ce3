"""Putting the edited picture together (paper 3.3): the plate behind the object, then the object.

An inpainter a file; `load()` imports the chosen one. What lies outside the hole is never touched.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from ..base import backends
from ..base.arrays import Mask, Pixels
from ..base.progress import Progress
from ..document.settings import Hint


class InpaintError(ValueError):
    """The hole cannot be filled; one sentence."""


class Inpainter(Protocol):
    """Invents what the photo shows where an object was."""

    name: str
    is_random: bool  # whether another seed gives another fill

    def missing(self) -> str | None:
        """Why this backend cannot run here, as a sentence for the user; None where it can."""
        ...

    def inpaint(self, rgb: Pixels, hole: Mask, progress: Progress, seed: int = 0) -> Pixels:
        """`rgb` (h, w, 3) u8 or u16 with its `hole` (h, w) filled, the same values elsewhere.

        What the hole hides does not matter, but to `klein`, which is shown what is to go. The same
        arguments give the same bytes. Raises InpaintError where the hole is everything.
        """
        ...


@runtime_checkable
class TakesHints(Protocol):
    """An inpainter that heeds what the user says about where to take what from."""

    def inpaint_from(
        self, rgb: Pixels, hole: Mask, hints: tuple[Hint, ...], progress: Progress, seed: int = 0
    ) -> Pixels:
        """Fill like `Inpainter.inpaint`; the hints are in px of `rgb`, some perhaps outside."""
        ...


@runtime_checkable
class LooksFar(Protocol):
    """An inpainter that can use more of the photo than what is copied from."""

    context: int  # px around a hole


@runtime_checkable
class MayBeSlow(Protocol):
    """An inpainter that "auto" does not take on every machine."""

    def is_slow(self) -> bool:
        """Whether a fill takes minutes here; asked only where it can run."""
        ...


REFINERS: tuple[str, ...] = (
    "none",
    "harmonise",
)  # what is done to a moved object so that it fits in

BACKENDS = {  # best first; the last one is always there
    "pixelhacker": "objectmorpher_core.compose.plate.inpaint_latent:pixelhacker",
    "moebius": "objectmorpher_core.compose.plate.inpaint_latent:moebius",
    "klein": "objectmorpher_core.compose.plate.inpaint_klein:KleinInpainter",
    "lama": "objectmorpher_core.compose.plate.inpaint_onnx:lama",
    "migan": "objectmorpher_core.compose.plate.inpaint_onnx:migan",
    "patchmatch": "objectmorpher_core.compose.plate.inpaint_patchmatch:PatchMatchInpainter",
    "telea": "objectmorpher_core.compose.plate.inpaint_telea:TeleaInpainter",
}


def load(name: str = "auto", has_hints: bool = False) -> Inpainter:
    """The inpainter called `name`; "auto" is the first that can run here, and heeds any hints.

    Raises InpaintError for an unknown name, or one that cannot run here.
    """
    if name == "auto":
        created = (backends.create(BACKENDS, each) for each in BACKENDS)
        return next(found for found in created if _suits(found, has_hints))
    found = backends.known(BACKENDS, name, "inpainter", InpaintError)
    return backends.able(found, InpaintError)


def missing(name: str) -> str | None:
    """Why the inpainter called `name` cannot run here; None where it can, as "auto" always can."""
    return None if name == "auto" else backends.create(BACKENDS, name).missing()


def is_random(name: str = "auto") -> bool:
    """Whether another seed gives another fill."""
    return load(name).is_random


def _suits(inpainter: Inpainter, has_hints: bool) -> bool:
    """Whether "auto" may take it."""
    if inpainter.missing() is not None or (has_hints and not isinstance(inpainter, TakesHints)):
        return False
    return not (isinstance(inpainter, MayBeSlow) and inpainter.is_slow())
