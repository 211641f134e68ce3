"""The real case: the motorcycle of the Middlebury 2014 stereo pair, seen from the other camera.

(Scharstein et al. 2014, as scikit-image carries it.) The right camera stands beside the left one:
what it sees is the left photo with the motorcycle moved sideways, nearer parts farther. There is no
true background, so only what the motorcycle covers is compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F64, RGB, Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.masks import largest_piece

from ..error import EvaluationError
from .cases import RIGID_POINTS, TruthCase, TruthGuidance, inner_pixels, spread_out
from .motions import Rigid

NAME, CATEGORY = "64-view-motorcycle", "view"
FOCAL, OFFSET = 994.978, 31.086  # px, of the pair's calibration: disparity + OFFSET = FOCAL B / z
GROUND = (330, 110)  # px: below that row and left of that column there is only floor
ABOVE_GROUND = 2.5  # px of disparity
NEAREST_WALL = 34.0  # px of disparity of what is behind the motorcycle


@dataclass(frozen=True, eq=False)
class StereoPair:
    """Two photos of the motorcycle."""

    left: RGB  # (h, w, 3)
    right: RGB
    disparity: F64  # (h, w) px, of the left one; 0 where it is not known
    mask: Mask  # (h, w) of the motorcycle in the left one
    right_mask: Mask


def read_pair() -> StereoPair:
    """The pair that comes with scikit-image. Raises EvaluationError."""
    try:
        from skimage import data

        left, right, disparity = data.stereo_motorcycle()
    except (ImportError, OSError) as error:
        raise EvaluationError(f"scikit-image's stereo pair is not here: {error}") from error
    disparity = np.where(np.isfinite(disparity), disparity, 0).astype(np.float64)
    mask = _motorcycle(disparity)
    left, right = (np.asarray(pixels, np.uint8) for pixels in (left, right))
    return StereoPair(left, right, disparity, mask, _seen_from_right(mask, disparity))


def stereo_case() -> TruthCase:
    """Return the right camera's view with the left one's middle. Raises EvaluationError."""
    pair = read_pair()
    mask, disparity = pair.mask, pair.disparity
    height, width = mask.shape
    step = np.array([[1.0, 0.0, -OFFSET], [0.0, 1.0, 0.0]])
    size = (width, height)
    truth = cv2.warpAffine(
        pair.right, step, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    shown = cv2.warpAffine(pair.right_mask.astype(np.float64), step, size, flags=cv2.INTER_LINEAR)
    camera = Camera(FOCAL, width / 2, height / 2, width, height)
    known = mask & (disparity > 0)
    guidance = _guidance(known, disparity)
    region = (shown > 0.99).astype(np.float64)
    return TruthCase(
        NAME, CATEGORY, pair.left, mask, camera, guidance,
        np.asarray(truth, np.uint8), None, np.asarray(shown, np.float64), region, has_outside=False,
    )  # fmt: skip


def _guidance(known: Mask, disparity: F64) -> TruthGuidance:
    """Points that go sideways by their disparity; none changes its distance."""
    xy = inner_pixels(known)
    chosen = xy[spread_out(xy, RIGID_POINTS)]
    column, row = chosen.astype(int).T
    to = chosen - np.column_stack([disparity[row, column] + OFFSET, 0 * chosen[:, 0]])
    return TruthGuidance(chosen, to, np.zeros(len(chosen)), Rigid())


def _motorcycle(disparity: F64) -> Mask:
    """(H, W) what rises above the plane of the floor, before the wall."""
    x, y = np.meshgrid(*(np.arange(n) for n in disparity.shape[::-1]))
    floor = (y > GROUND[0]) & (x < GROUND[1]) & (disparity > 0)
    slope, start = np.polyfit(y[floor], disparity[floor], 1)
    found = disparity > np.maximum(slope * y + start + ABOVE_GROUND, NEAREST_WALL)
    return _closed(largest_piece(found))


def _seen_from_right(mask: Mask, disparity: F64) -> Mask:
    """(H, W) where the right photo shows what the mask holds."""
    rows, columns = np.nonzero(mask & (disparity > 0))
    there = np.rint(columns - disparity[rows, columns]).astype(int)
    seen = np.zeros(mask.shape, bool)
    seen[rows[there >= 0], there[there >= 0]] = True
    return _closed(seen)


def _closed(mask: Mask) -> Mask:
    return cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3))) > 0
