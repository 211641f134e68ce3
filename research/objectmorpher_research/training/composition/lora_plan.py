"""The plan of a training (paper 4.1): the same plan of the same triplets gives the same losses."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from typing import Any

from objectmorpher_core.models.plans import QUANTISER, has_quantiser

from . import TrainingError
from .triplet_folder import Stored

NUMBERS = ("auto", "bfloat16", "float32")
BASES = ("whole", "nf4")  # of the frozen network: as it is, or in four bits (QLoRA)


@dataclass(frozen=True)
class LoraPlan:
    """A plan with the paper's figures as defaults; those that it does not give are marked."""

    model: str = "qwen"  # of edit_models.BACKENDS
    side: int = 1024  # px: pictures have about the square of it
    rank: int = 16
    rate: float = 1e-4  # of A; AdamW's
    ratio: float = 3.0  # LoRA+: of B's rate to A's
    decay: float = 0.01  # AdamW's own; the paper names none
    batch: int = 4  # triplets of a step, on all processes together; not told
    warm_up: int = 0  # steps in which the rates rise; not told
    steepest: float = 1.0  # length of a gradient that is not shortened; not told
    mean: float = 0.0  # of the moving mean of weights, as 0.999; 0: none
    held_out: int = 4  # triplets that are not trained on, but looked at; even: whole pairs
    number: str = "bfloat16"
    seed: int = 0
    base: str = "whole"  # of BASES

    def check(self) -> None:
        """Raises TrainingError."""
        if self.side < 32 or self.side % 32:
            raise TrainingError(f"a size of {self.side} px is no multiple of 32")
        for name in ("rank", "batch"):
            if getattr(self, name) < 1:
                raise TrainingError(f"a {name} of {getattr(self, name)} is none")
        if not (self.rate > 0 and self.ratio > 0 and self.steepest > 0):
            raise TrainingError("rate, ratio and the longest gradient are above 0")
        if not (0 <= self.mean < 1 and self.decay >= 0 and self.warm_up >= 0 and self.seed >= 0):
            raise TrainingError("decay, warm-up and seed are not negative, the mean is below 1")
        if self.base not in BASES:
            raise TrainingError(f"the base is one of {', '.join(BASES)}, not {self.base!r}")
        if self.base == "nf4" and not has_quantiser():
            raise TrainingError(f"a base in four bits needs {QUANTISER}: `pip install {QUANTISER}`")
        if self.held_out < 0:
            raise TrainingError("the number of triplets held out is not negative")

    def facts(self, triplets: tuple[Stored, ...], weights: str) -> dict[str, Any]:
        """Plain values that a training keeps while it goes on; `triplets`: it is trained on."""
        of = hashlib.sha256("".join(t.content for t in triplets).encode()).hexdigest()
        return {**asdict(self), "triplets": of, "weights": weights}


def parted(
    triplets: tuple[Stored, ...], plan: LoraPlan
) -> tuple[tuple[Stored, ...], tuple[Stored, ...]]:
    """Split triplets for training from those held out, by content, stable when some are added.

    A pair's two directions stand together, and what shows a photograph of those held out, as the
    next frame of a video does, is in neither part. Raises TrainingError where none is left.
    """

    def place(one: Stored) -> tuple[str, str]:
        pair = hashlib.sha256(b"".join(sorted(one.photographed))).hexdigest()
        return pair, one.content

    aside = set(sorted(triplets, key=place)[: plan.held_out])
    seen = frozenset().union(*(one.photographed for one in aside))
    left = tuple(t for t in triplets if not seen & t.photographed)
    if not left:
        raise TrainingError(
            f"{len(triplets)} triplets are too few to hold {plan.held_out} of them out,"
            " and what shows a photograph of theirs"
        )
    return left, tuple(t for t in triplets if t in aside)
