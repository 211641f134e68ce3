"""Holes in photos whose background is known, filled in by us and by others."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from skimage import data
from skimage.metrics import structural_similarity
from sklearn.datasets import load_sample_image

from objectmorpher_core import models
from objectmorpher_core.base.arrays import Mask, Pixels
from objectmorpher_core.base.progress import silent
from objectmorpher_core.compose import load
from objectmorpher_core.segment import dino_tokens
from objectmorpher_research.evaluation.measures.hed_vgg import WEIGHT, HedVgg, read_hed_vgg

SAMPLES = Path(__file__).resolve().parents[2] / "assets" / "samples"
PATCH = 7  # px, of plain PatchMatch: the authors' usual
SEED = 0
BLUR = 2.0  # px, standard deviation
TILE = 14 * 16  # px of the crop that DINOv2 compares


def _file(name: str) -> Pixels:
    picture = cv2.imread(str(next(SAMPLES.glob(f"{name}.*"))))
    assert picture is not None, name
    return np.ascontiguousarray(picture[..., ::-1])


def _grey(picture: Pixels) -> Pixels:
    return np.repeat(picture[..., None], 3, 2)


def _smaller(picture: Pixels) -> Pixels:
    scale = LONGEST / max(picture.shape[:2])
    size = round(picture.shape[1] * scale), round(picture.shape[0] * scale)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


# name -> photo, and the middle and radii of the hole, as shares of its sides: all background
HOLES: dict[str, tuple[Callable[[], Pixels], tuple[float, float], tuple[float, float]]] = {
    "table": (data.coffee, (0.87, 0.6), (0.09, 0.2)),
    "launch tower": (lambda: _file("rocket"), (0.36, 0.55), (0.07, 0.2)),
    "flag and wall": (data.astronaut, (0.2, 0.2), (0.12, 0.15)),
    "garage": (lambda: data.stereo_motorcycle()[0], (0.55, 0.2), (0.1, 0.14)),
    "leaves": (lambda: _file("flower"), (0.8, 0.3), (0.1, 0.18)),
    "floor": (lambda: data.stereo_motorcycle()[0], (0.18, 0.85), (0.12, 0.1)),
    "bricks": (lambda: _grey(data.brick()), (0.5, 0.5), (0.14, 0.18)),
    "gravel": (lambda: _grey(data.gravel()), (0.5, 0.5), (0.14, 0.18)),
}
# Likewise, in photos that none of the above are of.
OTHER_HOLES: dict[str, tuple[Callable[[], Pixels], tuple[float, float], tuple[float, float]]] = {
    "pavement": (lambda: load_sample_image("china.jpg"), (0.5, 0.93), (0.12, 0.06)),
    "sky and trees": (lambda: load_sample_image("china.jpg"), (0.15, 0.3), (0.1, 0.14)),
    "roof": (lambda: load_sample_image("china.jpg"), (0.5, 0.45), (0.07, 0.09)),
    "fur": (data.chelsea, (0.15, 0.75), (0.1, 0.15)),
    "lawn": (lambda: _grey(data.camera()), (0.8, 0.8), (0.12, 0.1)),
    "tower": (lambda: _grey(data.camera()), (0.85, 0.55), (0.08, 0.12)),
    "grass": (lambda: _grey(data.grass()), (0.5, 0.5), (0.14, 0.18)),
    "tissue": (data.immunohistochemistry, (0.5, 0.5), (0.14, 0.16)),
    "retina": (lambda: _smaller(data.retina()), (0.5, 0.35), (0.1, 0.1)),
    "moon": (lambda: _grey(data.moon()), (0.35, 0.6), (0.12, 0.14)),
}
OTHER_WAYS = ("ours", "PatchMatch")
LONGEST = 1000  # px of a photo
Filler = Callable[[Pixels, Mask], Pixels]


def _plain(pixels: Pixels, hole: Mask) -> Pixels:
    from patchmatch import inpaint, set_random_seed

    set_random_seed(SEED)
    return inpaint(pixels, hole, patch_size=PATCH)


def _opencv(how: int) -> Filler:
    def fill(pixels: Pixels, hole: Mask) -> Pixels:
        return np.asarray(cv2.inpaint(pixels, hole.astype(np.uint8), 5, how), np.uint8)

    return fill


WAYS: dict[str, Filler] = {
    "ours": lambda pixels, hole: load("patchmatch").inpaint(pixels, hole, silent, SEED),
    "PatchMatch": _plain,
    "Telea": _opencv(cv2.INPAINT_TELEA),
    "Navier-Stokes": _opencv(cv2.INPAINT_NS),
}


@dataclass(frozen=True, eq=False)
class Filled:
    """One fill of one hole."""

    psnr: float  # dB, in the hole
    blurred: float  # dB, the same of the fill without what is finer than BLUR
    ssim: float  # in the hole
    unlike: float  # 1 - cosine of DINOv2's tokens, those that the hole touches
    hed: float  # HED-VGG perceptual, in the hole
    seconds: float  # of all processors
    picture: Pixels  # around the hole


def measured(name: str) -> tuple[Pixels, Pixels, dict[str, Filled]]:
    """What was there, with the hole, and the fills of each way, compiled and loaded before."""
    make, middle, radii = {**HOLES, **OTHER_HOLES}[name]
    ways = WAYS if name in HOLES else {way: WAYS[way] for way in OTHER_WAYS}
    photo = make()
    height, width = photo.shape[:2]
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    hole = ((x - middle[0]) / radii[0]) ** 2 + ((y - middle[1]) / radii[1]) ** 2 < 1
    column, row = int(middle[0] * width), int(middle[1] * height)
    side = min(TILE, height, width)
    left = int(np.clip(column - side // 2, 0, width - side))
    top = int(np.clip(row - side // 2, 0, height - side))
    around = (slice(top, top + side), slice(left, left + side))
    WAYS["ours"](photo[around].copy(), _middle(hole[around]))
    cut = photo.copy()
    cut[hole] = 255
    found = {}
    for way, fill in ways.items():
        begun = time.process_time()
        filled = fill(photo * ~hole[..., None], hole)
        found[way] = scored(photo, filled, hole, around, time.process_time() - begun)
    return photo[around], cut[around], found


def _middle(hole: Mask) -> Mask:
    """A small hole in the middle of a picture (h, w)."""
    small = np.zeros_like(hole)
    height, width = hole.shape
    small[height // 2 : height // 2 + 20, width // 2 : width // 2 + 20] = True
    return small


def scored(
    photo: Pixels, filled: Pixels, hole: Mask, around: tuple[slice, slice], seconds: float
) -> Filled:
    """How far a fill of a `hole` (h, w) is from the photo; networks see what is `around` it."""
    psnr, blurred = (
        10 * np.log10(255**2 / max(((p.astype(float) - photo)[hole] ** 2).mean(), 1e-9))
        for p in (filled, cv2.GaussianBlur(filled, (0, 0), BLUR))
    )
    _, alike = structural_similarity(photo, filled, channel_axis=2, full=True)
    tokens = [
        dino_tokens.shared().tokens(cv2.resize(p[around], (TILE, TILE))) for p in (photo, filled)
    ]
    one, other = (t / np.linalg.norm(t, axis=-1, keepdims=True) for t in tokens)
    share = cv2.resize(hole[around].astype(np.float32), (16, 16), interpolation=cv2.INTER_AREA)
    unlike = 1 - (one * other).sum(-1)[share > 0.2].mean()
    before, after = (np.ascontiguousarray(p[around]) for p in (photo, filled))
    (seen,) = _hed_vgg()(before, after, [hole[around].astype(np.float64)])
    ssim = float(alike[hole].mean())
    return Filled(psnr, blurred, ssim, float(unlike), seen, seconds, filled[around])


@cache
def _hed_vgg() -> HedVgg:
    return read_hed_vgg(models.fetch(WEIGHT))
