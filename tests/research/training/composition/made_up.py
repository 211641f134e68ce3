"""Triplets and pipelines that are small enough for a test, and the conditions' size with them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from objectmorpher_core.base.progress import Progress
from objectmorpher_research.training.composition import shards
from objectmorpher_research.training.composition.pictures import PictureSource
from objectmorpher_research.training.composition.sources import SourcePair
from objectmorpher_research.training.composition.train_lora import TrainingFolders
from objectmorpher_research.training.composition.triplet import Rejected, Triplet, TripletPlan

SIDE = 64  # px
REJECTED = 3  # every so manyth pair


def small_conditions() -> None:
    """Qwen's pipeline looks at pictures of a megapixel; here at small ones."""
    from diffusers.pipelines.qwenimage import pipeline_qwenimage_edit_plus as plus

    plus.VAE_IMAGE_SIZE, plus.CONDITION_IMAGE_SIZE = SIDE * SIDE, 56 * 56


def triplet(seed: int, side: int = SIDE) -> Triplet:
    """A disc in other light, over a soft background."""
    rng = np.random.default_rng(seed)
    ground = cv2.resize(rng.integers(60, 200, (4, 4, 3)).astype(np.uint8), (side, side))
    y, x = np.mgrid[:side, :side]
    inside = np.hypot(x - rng.uniform(24, 40), y - rng.uniform(24, 40)) < 14
    color = rng.integers(60, 200, 3)
    b = np.where(inside[..., None], color, ground[::-1])
    coarse = np.where(inside[..., None], color, ground)
    a = np.where(inside[..., None], color * 0.6 + 20, ground)
    alpha = inside.astype(np.uint8) * 255
    return Triplet(*(p.astype(np.uint8) for p in (b, coarse, a)), alpha, {"seed": seed})


def pairs(count: int) -> tuple[SourcePair, ...]:
    nothing = PictureSource("nowhere.png")
    return tuple(SourcePair(f"made-{k:03d}", nothing, nothing, str(k)) for k in range(count))


def make(pair: SourcePair, how: TripletPlan, progress: Progress) -> Triplet:
    """Instead of lifting."""
    seed = int(pair.item)
    if seed % REJECTED == REJECTED - 1:
        raise Rejected("every third is rejected", {"iou": 0.5})
    return triplet(seed)


def write_triplets(out: Path, count: int = 9, size: int = 4) -> Path:
    """A folder of shards."""
    parts, how = shards.shards_of(pairs(count), size), TripletPlan()
    shards.begin(out, parts, how)
    for part in parts:
        shards.write_shard(out, part, how, make=make)
    shards.finish(out, parts)
    return out


def places(at: Path, weights: Path, name: str = "out") -> TrainingFolders:
    """Folders of a training of the triplets in `at`."""
    out = at / name
    out.mkdir(exist_ok=True)
    return TrainingFolders(at / "triplets", out, weights, at / "latents")
