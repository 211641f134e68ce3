"""Clicks, a box or "the subject" -> the mask of one object (paper 3.1).

A backend a file; `load()` imports the chosen one. `encode` is costly and runs once per photo,
`segment` is cheap and runs at every click.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from ..base import backends
from ..base.arrays import RGB, Mask
from ..base.progress import Progress
from ..document.model import Prompt
from .selection import SelectionError

__all__ = [
    "BACKENDS",
    "UNSURE",
    "Found",
    "Quick",
    "Segmenter",
    "SelectionError",
    "is_known",
    "load",
]

# Confidence below which the status line says how to help: on the things of the click tests 7 of 8
# answers that are bad, and 12 of 58 that are good.
UNSURE = 0.7


@dataclass(frozen=True, eq=False)
class Found:
    """A segmenter's answer to a prompt."""

    mask: Mask  # (H, W)
    backend: str  # the segmenter's name
    confidence: float | None  # the overlap (IoU) with what is meant that is to be expected
    is_final: bool = True  # otherwise found at a glance: a closer look may tell better


class Segmenter(Protocol):
    """Finds the object that a prompt means."""

    name: str

    def missing(self) -> str | None:
        """Why this backend cannot run here, as a sentence for the user; None where it can."""
        ...

    def encode(self, rgb: RGB, progress: Progress) -> Any:
        """Encode a photo (H, W, 3) for later prompts, as a picklable value, or None."""
        ...

    def segment(
        self, rgb: RGB, prompt: Prompt, embedding: Any, progress: Progress, seed: int = 0
    ) -> Mask:
        """(H, W) bool, the object. An `embedding` of None is computed here.

        The same arguments give the same mask. Raises SelectionError: one sentence.
        """
        ...

    def confidence(self, rgb: RGB, prompt: Prompt, embedding: Any) -> float | None:
        """Return the expected overlap (IoU) of `segment`'s answer with the thing that is meant.

        In [0, 1]; None where the backend cannot tell. Cheap after `segment` of the same.
        """
        ...


@runtime_checkable
class Quick(Protocol):
    """A segmenter that answers at a glance where its whole answer takes longer than a moment."""

    def glance(self, rgb: RGB, prompt: Prompt, embedding: Any, progress: Progress) -> Found:
        """Segment like `segment`, in a fraction of a second; not final where it can do better."""
        ...


BACKENDS = {
    "dino": "objectmorpher_core.segment.dino_walk:DinoWalk",
    "subject": "objectmorpher_core.segment.subject:SubjectSegmenter",
    "grabcut": "objectmorpher_core.segment.grabcut:GrabCut",
    "sam2": "objectmorpher_core.segment.sam.segmenter:sam2",
    "sam": "objectmorpher_core.segment.sam.segmenter:sam",
    "sam3": "objectmorpher_core.segment.sam.segmenter:sam3",
    "sam-onnx": "objectmorpher_core.segment.sam.segmenter:sam_onnx",
}


def is_known(name: str) -> bool:
    """Whether `load` takes that name."""
    from ..models import hub_models

    ids = (model.id for model in hub_models() if model.stage == "segment")
    return name in ("auto", *BACKENDS, *ids)


def load(name: str = "auto") -> Segmenter:
    """The backend called `name`; "auto" is the best one for clicks that can run here.

    `name` may be a SAM's own id, as "sam2.1-tiny"; "sam2" is the best of SAM 2.1 that is here.
    """
    if name == "auto":
        from .sam.segmenter import best

        found = best()
        if found is not None:
            return found
        dino = load("dino")
        return dino if dino.missing() is None else load("grabcut")
    if name not in BACKENDS and is_known(name):
        from ..models import hub_model
        from .sam.segmenter import Sam

        return Sam(hub_model(name).family, name)
    return backends.known(BACKENDS, name, "segmenter", SelectionError)
