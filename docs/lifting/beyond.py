"""Objects that a photo's frame cuts, continued: by a mirror image, and by patches.

python docs/lifting/beyond.py

Photos are cut through their object, a strip away from where it ends; what was cut off is the truth.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from sheet import PHOTOS, lifted

from objectmorpher_core.base.arrays import RGB, Mask, crop
from objectmorpher_core.document.model import Matte
from objectmorpher_core.lift.beyond_frame import with_beyond
from objectmorpher_core.segment.mask_edit import is_selected
from objectmorpher_core.segment.matting.matte import cut_out

HERE = Path(__file__).resolve()
sys.path += [str(HERE.parents[1] / "compositing"), str(HERE.parents[2])]
from plates import Filled, scored  # noqa: E402

from tests.photos import outlined, photo  # noqa: E402

KEPT = 0.7  # of the object's length, where its photo is cut
LEAST = 12  # px of the strip, and the root of what is compared
TILE = 14 * 16  # px of what DINOv2 compares
MOST = 50.0  # dB
OUTLINED = {
    "astronaut": ("face", "flag", "helmet", "shuttle", "patch", "valve"),
    "flower": ("second_flower",), "china": ("pagoda",),
    "motorcycle": ("motorcycle", "headlight", "seat"),
    "camera": ("cameraman", "tower"), "coins": ("coin", "dim_coin"),
}  # fmt: skip


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


def compared(pixels: RGB, inside: Mask) -> tuple[Filled, Filled] | None:
    """What is cut off at the right, continued mirrored and by patches; None: too little."""
    columns = np.flatnonzero(inside.any(0))
    cut = int(columns[0] + KEPT * np.ptp(columns))
    if not inside[:, cut - 1].any():
        return None
    mirrored = cut_out(pixels[:, :cut], inside[:, :cut])
    height, width = inside.shape
    alpha = crop(mirrored.alpha, mirrored.box, (0, 0, width, height))
    own = inside & (alpha > 0.5)
    own[:, :cut] = False
    rows, columns = np.nonzero(own)
    if len(rows) < LEAST**2 or np.ptp(columns) < LEAST:
        return None
    side = min(max(np.ptp(rows), np.ptp(columns), TILE // 2) + 1, height, width)
    top = int(np.clip(rows.mean() - side / 2, 0, height - side))
    left = int(np.clip(columns.mean() - side / 2, 0, width - side))
    around = (slice(top, top + side), slice(left, left + side))

    def against(matte: Matte) -> Filled:
        colors = crop(matte.foreground, matte.box, (0, 0, width, height))
        levels = np.clip(np.rint(255 * colors), 0, 255).astype(np.uint8)
        return scored(pixels, np.where(own[..., None], levels, pixels), own, around, 0.0)

    return against(mirrored), against(with_beyond(mirrored, (cut, height)))


def table(cases: Iterator[tuple[RGB, Mask]]) -> list[str]:
    """Means over the four sides of each object, and how often patches are better."""
    pairs = [
        pair
        for pixels, inside in cases
        for turns in range(4)
        if (pair := compared(*(np.ascontiguousarray(np.rot90(p, turns)) for p in (pixels, inside))))
    ]
    figures = np.array([[(f.psnr, f.ssim, f.unlike, f.hed) for f in pair] for pair in pairs])
    figures[..., 0] = figures[..., 0].clip(0, MOST)  # of one colour, some are right
    rows = [f"| {len(pairs)} cuts | PSNR | SSIM | unlike | HED |", "|---|---:|---:|---:|---:|"]
    for name, way in zip(("mirrored", "patches"), np.moveaxis(figures, 1, 0), strict=True):
        psnr, ssim, unlike, hed = np.nanmean(way, 0)
        rows.append(f"| {name} | {psnr:.2f} | {ssim:.3f} | {unlike:.3f} | {hed:.3f} |")
    better = (figures[:, 1] - figures[:, 0]) * [1, 1, -1, -1] > 0
    rows.append("| patches are better | " + " | ".join(f"{b:.0%}" for b in better.mean(0)) + " |")
    return rows


if __name__ == "__main__":
    for heading, cases in (("Chosen on", chosen_on()), ("Held out", held_out())):
        print(f"\n{heading}\n", *table(cases), sep="\n", flush=True)
