"""Old shadows found and lifted, against grounds that are known without them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import worlds
from worlds import GROUNDS, SIDE, SUNS

from objectmorpher_core.base.arrays import F64, Pixels
from objectmorpher_core.compose.shadow.old_shadow import without_shadow
from objectmorpher_core.compose.shadow.shadow_fit import find_old_shadow
from objectmorpher_core.segment.matting.matte import build_matte

DARK = 0.1  # of the light, from which the ground counts as shaded
AROUND = 9  # px about the solid, that the inpainter fills in any case
MARGIN = 20  # px of the matte


@dataclass(frozen=True, eq=False)
class Shaded:
    """One case; errors are mean differences of encoded levels from the ground in full light."""

    name: str
    sun: str
    ground: str
    is_found: bool
    is_imagined: bool  # found where there is none
    before: float  # in the shadow
    after: float
    beside: float  # outside of it
    pictures: tuple[Pixels, Pixels, Pixels]  # the photo, without the shadow, as it truly is


def measured(name: str, number: int, meshes: Path) -> list[Shaded]:
    """A solid under all suns, each on another ground."""
    stood, cases = worlds.stand(name, meshes), []
    for k, sun in enumerate(SUNS):
        ground = GROUNDS[(number + k) % len(GROUNDS)]
        made = worlds.photo(stood, sun, ground)
        old = find_old_shadow(made.photo, build_matte(made.photo, made.mask, MARGIN))
        bare = build_matte(made.shadowless, made.mask, MARGIN)
        is_imagined = find_old_shadow(made.shadowless, bare) is not None
        lifted = made.photo
        if old is not None:
            lifted, _ = without_shadow(made.photo, old, (0, 0, SIDE, SIDE))
            lifted = np.where(made.mask[..., None], made.photo, lifted)
        cover = cv2.dilate(made.mask.astype(np.uint8), np.ones((AROUND, AROUND))) > 0
        shaded = (made.dark > DARK) & ~cover
        lit = (made.dark < 0.01) & ~cover
        before, after, beside = (
            _error(p, made.empty, where)
            for p, where in ((made.photo, shaded), (lifted, shaded), (lifted, lit))
        )
        pictures = (made.photo, lifted, made.shadowless)
        cases.append(
            Shaded(name, sun.name, ground, old is not None, is_imagined, before, after, beside,
                   pictures)
        )  # fmt: skip
    return cases


def _error(pixels: Pixels, true: Pixels, where: F64) -> float:
    return float(np.abs(pixels.astype(float) - true)[where].mean()) if where.any() else 0.0
