"""Objects that a photo's frame cuts, continued: by a mirror image, and by patches.

python docs/lifting/beyond.py

Photos are cut through their object, a strip away from where it ends; what was cut off is the truth.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from sheet import PHOTOS, lifted
from skimage.metrics import structural_similarity

from objectmorpher_core import models
from objectmorpher_core.base.arrays import F32, RGB, Mask
from objectmorpher_core.document.model import Matte
from objectmorpher_core.lift.beyond_frame import with_beyond
from objectmorpher_core.segment import dino_tokens
from objectmorpher_core.segment.mask_edit import is_selected
from objectmorpher_core.segment.matting.matte import cut_out
from objectmorpher_research.evaluation.measures.hed_vgg import WEIGHT, read_hed_vgg

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from tests.photos import outlined, photo

KEPT = 0.7  # of the object's length, where its photo is cut
LEAST = 12  # px of the strip, and the root of what is compared
TILE = 14 * 16  # px of what DINOv2 and HED-VGG compare
OUTLINED = {
    "astronaut": ("face", "flag", "helmet", "shuttle", "patch", "valve"),
    "flower": ("second_flower",), "china": ("pagoda",),
    "motorcycle": ("motorcycle", "headlight", "seat"),
    "camera": ("cameraman", "tower"), "coins": ("coin", "dim_coin"),
}  # fmt: skip


@dataclass(frozen=True)
class Beyond:
    """How far a continuation is from what was cut off."""

    psnr: float  # dB
    ssim: float
    unlike: float  # 1 - cosine of DINOv2's tokens
    hed: float  # HED-VGG


def chosen_on() -> Iterator[tuple[RGB, Mask]]:
    """The photos on which the continuation's numbers were chosen, and what is chosen in them."""
    for name in PHOTOS:
        document = lifted(name)
        mask = document.objects[0].mask
        assert mask is not None, "it was lifted"
        yield np.asarray(document.photo.pixels, np.uint8), is_selected(mask)


def held_out() -> Iterator[tuple[RGB, Mask]]:
    """Things that were outlined by hand."""
    for source, names in OUTLINED.items():
        for name in names:
            yield photo(source), outlined(name)


def compared(pixels: RGB, inside: Mask) -> tuple[Beyond, Beyond] | None:
    """What is cut off at the right, continued mirrored and by patches; None: too little."""
    columns = np.flatnonzero(inside.any(0))
    cut = int(columns[0] + KEPT * np.ptp(columns))
    if not inside[:, cut - 1].any():
        return None
    mirrored = cut_out(pixels[:, :cut], inside[:, :cut])
    first = cut - mirrored.left
    x0, y0, x1, y1 = mirrored.box
    x1, y1, top = min(x1, pixels.shape[1]), min(y1, len(pixels)), max(y0, 0)
    window = slice(top - y0, y1 - y0), slice(max(-x0, 0), x1 - x0)
    truth, there = pixels[top:y1, max(x0, 0) : x1], inside[top:y1, max(x0, 0) : x1]
    own = there & (mirrored.alpha[window] > 0.5)
    own[:, : first - window[1].start] = False
    if x1 - cut < LEAST or own.sum() < LEAST**2:
        return None
    made = with_beyond(mirrored, (cut, len(pixels)))

    def against(matte: Matte) -> Beyond:
        return _scored(truth, matte.foreground[window], own)

    return against(mirrored), against(made)


def _scored(truth: RGB, colors: F32, own: Mask) -> Beyond:
    error = float(((255.0 * colors - truth)[own] ** 2).mean())
    levels = np.clip(np.rint(255 * colors), 0, 255).astype(np.uint8)
    shown = np.where(own[..., None], levels, truth)
    _, alike = structural_similarity(truth, shown, channel_axis=2, full=True)
    rows, columns = np.nonzero(own)
    side = min(max(np.ptp(rows), np.ptp(columns), TILE // 2) + 1, *own.shape)
    top = int(np.clip(rows.mean() - side / 2, 0, len(own) - side))
    left = int(np.clip(columns.mean() - side / 2, 0, own.shape[1] - side))
    window = slice(top, top + side), slice(left, left + side)
    pair = [cv2.resize(np.ascontiguousarray(p[window]), (TILE, TILE)) for p in (truth, shown)]
    tokens = [dino_tokens.shared().tokens(picture) for picture in pair]
    one, other = (t / np.linalg.norm(t, axis=-1, keepdims=True) for t in tokens)
    share = cv2.resize(own[window].astype(np.float32), (16, 16), interpolation=cv2.INTER_AREA)
    where = share > min(0.2, 0.5 * float(share.max()))
    there = cv2.resize(own[window].astype(np.uint8), (TILE, TILE)).astype(np.float64)
    (seen,) = read_hed_vgg(models.fetch(WEIGHT))(*pair, [there])
    return Beyond(
        10 * float(np.log10(255**2 / max(error, 0.01))),
        float(alike[own].mean()), float(1 - (one * other).sum(-1)[where].mean()), seen,
    )  # fmt: skip


def table(cases: Iterator[tuple[RGB, Mask]]) -> list[str]:
    """Means over the four sides of each object, and how often patches are better."""
    pairs = [
        pair
        for pixels, inside in cases
        for turns in range(4)
        if (pair := compared(*(np.ascontiguousarray(np.rot90(p, turns)) for p in (pixels, inside))))
    ]
    figures = np.array([[list(vars(b).values()) for b in pair] for pair in pairs])
    rows = [f"| {len(pairs)} cuts | PSNR | SSIM | unlike | HED |", "|---|---:|---:|---:|---:|"]
    for name, way in zip(("mirrored", "patches"), np.moveaxis(figures, 1, 0), strict=True):
        psnr, ssim, unlike, hed = way.mean(0)
        rows.append(f"| {name} | {psnr:.2f} | {ssim:.3f} | {unlike:.3f} | {hed:.3f} |")
    better = (figures[:, 1] - figures[:, 0]) * [1, 1, -1, -1] > 0
    rows.append("| patches are better | " + " | ".join(f"{b:.0%}" for b in better.mean(0)) + " |")
    return rows


if __name__ == "__main__":
    for heading, cases in (("Chosen on", chosen_on()), ("Held out", held_out())):
        print(f"\n{heading}\n", *table(cases), sep="\n", flush=True)
