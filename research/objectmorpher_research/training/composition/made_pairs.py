"""Pairs of made-up objects, for trying everything without a data set."""

from __future__ import annotations

from pathlib import Path

from objectmorpher_core.files import write_all
from objectmorpher_core.image import Picture, encode_mask, encode_picture
from objectmorpher_core.progress import Progress, silent

from ..shapes.views import make_views
from .sources import MASK

TURNS = (12.0, 35.0)  # degrees between the two views
FAMILIES = ("busts", "boxes", "lathe", "creatures", "figures", "superquadrics")


def write_made_pairs(
    folder: Path, count: int, side: int = 512, seed: int = 0, progress: Progress = silent
) -> None:
    """`count` pairs of pictures of `side` px with their masks, those that are not there yet."""
    folder.mkdir(parents=True, exist_ok=True)
    for k in range(count):
        progress(k / count, f"object {k + 1} of {count}")
        name = f"made-{seed}-{k:05d}"
        if (folder / f"{name}-a{MASK}.png").exists():
            continue
        views = make_views(seed * 1_000_000 + k, (0.0, turn_of(k)), side, FAMILIES)
        outputs: dict[Path, bytes] = {}
        for letter, view in zip("ba", views, strict=True):
            at = folder / f"{name}-{letter}.png"
            outputs[at] = encode_picture(Picture(view.rgb), ".png")
            outputs[at.with_name(at.stem + MASK + ".png")] = encode_mask(view.mask)
        write_all(outputs)


def turn_of(k: int) -> float:
    """Degrees by which the camera of pair `k` goes around its object."""
    low, high = TURNS
    return low + (high - low) * (0.5 + 0.5 * (-1) ** k * (k * 0.618 % 1))
