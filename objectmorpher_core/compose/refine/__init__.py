"""Learned refiners: a network makes the coarse composite look as if it had been photographed.

A refiner a file, imported when it is chosen. None of them is trusted: `refinement` checks that what
comes back lies where the coarse composite lay, and shows it inside the edit's footprint only.
"""

from __future__ import annotations

from typing import Protocol

from ...base import backends
from ...base.arrays import F32, RGB
from ...base.progress import Progress


class RefineError(ValueError):
    """The edit cannot be refined; one sentence."""


class Refiner(Protocol):
    """Corrects light, colour and seams of a coarse composite."""

    name: str

    def missing(self) -> str | None:
        """Return what has to be installed first, as one sentence; None when it can run."""
        ...

    def refine(
        self, original: RGB, coarse: RGB, object_alpha: F32, progress: Progress, seed: int = 0
    ) -> RGB:
        """The picture that `coarse` (h, w, 3) u8 is meant to be, of the same size.

        `original` (h, w, 3) u8 is what the photo showed there, `object_alpha` (h, w) in [0, 1]
        where the edit is seen. The object's outline is to stay; light, colour and seam may change.
        The same seed gives the same bytes on one device. Raises RefineError or ModelError.
        """
        ...


BACKENDS = {  # imported when chosen
    "qwen": "objectmorpher_core.compose.refine.qwen:QwenRefiner",
    "klein": "objectmorpher_core.compose.refine.klein:KleinRefiner",
}


def load(name: str) -> Refiner:
    """The refiner called `name`; "auto" is the first that can run here.

    Raises RefineError where it is unknown or cannot run.
    """
    if name == "auto":
        lacking = dict(backends.absent(BACKENDS))
        if len(lacking) == len(BACKENDS):
            told = "; ".join(f"{each}: {reason}" for each, reason in lacking.items())
            raise RefineError(f"no refiner can run here: {told}")
        name = next(each for each in BACKENDS if each not in lacking)
    found = backends.known(BACKENDS, name, "refiner", RefineError)
    return backends.able(found, RefineError)


def missing(name: str) -> str | None:
    """Why the refiner called `name` cannot run here; None where it can."""
    return backends.create(BACKENDS, name).missing()
