"""Putting the edited picture together (paper 3.3): the plate behind the object, then the object.

An inpainter a file; `load()` imports the chosen one. What lies outside the hole is never touched.
"""

from __future__ import annotations

from importlib import import_module
from typing import Protocol, runtime_checkable

from ..arrays import Mask, Pixels
from ..hint import Hint
from ..progress import Progress


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

        The same arguments give the same bytes. Raises InpaintError where the hole is everything.
        """
        ...


@runtime_checkable
class TakesHints(Protocol):
    """An inpainter that heeds what the user says about where to take what from."""

    def inpaint_from(
        self, rgb: Pixels, hole: Mask, hints: tuple[Hint, ...], progress: Progress, seed: int = 0
    ) -> Pixels:
        """As `Inpainter.inpaint`; the hints are in px of `rgb`, some perhaps outside."""
        ...


REFINERS: tuple[str, ...] = (
    "none",
    "harmonise",
)  # what is done to a moved object so that it fits in

BACKENDS = {  # best first; the last one is always there
    "patchmatch": "objectmorpher_core.compose.inpaint_patchmatch:PatchMatchInpainter",
    "telea": "objectmorpher_core.compose.inpaint_telea:TeleaInpainter",
}


def load(name: str = "auto") -> Inpainter:
    """The inpainter called `name`; "auto" is the first that can run here.

    Raises InpaintError for an unknown name, or one that cannot run here.
    """
    if name == "auto":
        return next(found for found in map(_create, BACKENDS) if found.missing() is None)
    if name not in BACKENDS:
        raise InpaintError(f"there is no inpainter {name!r}; known are {', '.join(BACKENDS)}")
    inpainter = _create(name)
    if (sentence := inpainter.missing()) is not None:
        raise InpaintError(sentence)
    return inpainter


def missing(name: str) -> str | None:
    """Why the inpainter called `name` cannot run here; None where it can, as "auto" always can."""
    return None if name == "auto" else _create(name).missing()


def is_random(name: str = "auto") -> bool:
    """Whether another seed gives another fill."""
    return load(name).is_random


def _create(name: str) -> Inpainter:
    module, _, kind = BACKENDS[name].partition(":")
    return getattr(import_module(module), kind)()
