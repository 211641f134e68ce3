"""The ways to make a cut-out that are compared; all get a photo and a rough mask, no more."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

import first_version
import numpy as np

from objectmorpher_core.base.arrays import F32, Pixels, Selection, crop, unit_pixels
from objectmorpher_core.segment.mask_edit import FULL, is_selected
from objectmorpher_core.segment.matting.matte import REACH, band_width, cut_out, signed_distance

Method = Callable[[Pixels, Selection], tuple[F32, F32]]  # alpha (H, W), foreground (H, W, 3)
NARROW = 1.5  # x band: half-width of a usual trimap


def hard_mask(pixels: Pixels, selection: Selection) -> tuple[F32, F32]:
    """The photo inside, nothing outside."""
    return is_selected(selection).astype(np.float32), unit_pixels(pixels)


def ours(pixels: Pixels, selection: Selection) -> tuple[F32, F32]:
    """What the editor does."""
    height, width = selection.shape
    matte = cut_out(pixels, selection)
    box = (0, 0, width, height)
    return crop(matte.alpha, matte.box, box), crop(matte.foreground, matte.box, box)


def _pymatting(share: float) -> Method:
    def cut_out(pixels: Pixels, selection: Selection) -> tuple[F32, F32]:
        import pymatting

        rgb = unit_pixels(pixels).astype(np.float64)
        if selection.dtype == np.bool_:
            reach = share * band_width(selection.shape[1], selection.shape[0])
            distance = signed_distance(selection)
            trimap = np.where(distance > reach, 1.0, np.where(distance < -reach, 0.0, 0.5))
            alpha = pymatting.estimate_alpha_cf(rgb, trimap)
        else:
            alpha = selection / FULL
        foreground = pymatting.estimate_foreground_ml(rgb, alpha)
        return alpha.astype(np.float32), np.asarray(foreground, np.float32)

    return cut_out


def methods() -> dict[str, Method]:
    """By their names on the page."""
    found: dict[str, Method] = {"hard mask": hard_mask, "first version": first_version.cut_out}
    if find_spec("pymatting") is not None:
        found["pymatting, narrow"] = _pymatting(NARROW)
        found["pymatting, wide"] = _pymatting(REACH)
    return found | {"ours": ours}
