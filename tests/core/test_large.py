"""What is looked at in place of a picture of many megapixels, and how much memory parts take."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable

import cv2
import numpy as np

from objectmorpher_core.base import masks
from objectmorpher_core.base.masks import ENOUGH, reduced, reduced_mask, reduction
from objectmorpher_core.compose.light.lighting import object_texture
from objectmorpher_core.compose.plate import plate as plates
from objectmorpher_core.compose.plate.completion import shrunk
from objectmorpher_core.compose.plate.plate import build_plate
from objectmorpher_core.document.model import Matte
from tests import shapes
from tests.tree import over

F32_ROUNDING = 1e-6


def _padded(image: np.ndarray, times: int, pads: masks.Pads) -> np.ndarray:
    (above, below), (left, right) = pads
    height, width = above + len(image) + below, left + image.shape[1] + right
    more = (above, below + -height % times), (left, right + -width % times)
    return np.pad(image, [*more, (0, 0)][: image.ndim], mode="edge")


@over("n", range(60))
def test_a_reduced_picture_is_the_means_of_its_blocks(n, monkeypatch):
    monkeypatch.setattr(masks, "STRIP", (3, 128)[n % 2])
    chance = np.random.default_rng(n)
    height, width = (int(side) for side in chance.integers(1, 40, 2))
    times, channels = 2 ** (n % 3), ((), (3,))[n // 3 % 2]
    (a, b), (c, d) = chance.integers(0, 20, (2, 2)).tolist()
    image = chance.random((height, width, *channels)).astype(np.float32)
    found = reduced(image, times, ((a, b), (c, d)))
    whole = _padded(image, times, ((a, b), (c, d)))
    blocks = whole.reshape(len(whole) // times, times, whole.shape[1] // times, times, *channels)
    np.testing.assert_allclose(found, blocks.mean((1, 3)), atol=F32_ROUNDING)


def test_a_reduced_mask_is_where_half_of_each_block_is():
    mask = np.zeros((4, 6), bool)
    mask[:2, :2] = True  # all of the first block
    mask[0, 2:4] = True  # half of the second
    mask[2, 0] = True  # a quarter of the fourth
    assert reduced_mask(mask, 2).tolist() == [[True, True, False], [False, False, False]]


SIZES = [(10, 10), (2000, 4000), (2000, 4001), (4000, 6000), (10_000, 10_000), (9, 10**8)]


@over("shape", SIZES)
def test_only_what_is_large_is_reduced(shape):
    times, size = reduction(shape), shape[0] * shape[1]
    assert (times == 1) == (size <= 2 * ENOUGH)
    assert times == 1 or ENOUGH / 4 < size / times**2 <= ENOUGH


# ---- memory -------------------------------------------------------------------------------------


def _peak(work: Callable[[], object]) -> float:
    """Bytes that NumPy has at once, beyond what there was; the result is a part of it."""
    tracemalloc.start()
    try:
        kept = work()
        assert kept is not None
        return float(tracemalloc.get_traced_memory()[1])
    finally:
        tracemalloc.stop()


def _matte(side: int) -> Matte:
    alpha = np.zeros((side, side), np.float32)
    cv2.circle(alpha, (side // 2, side // 2), side // 3, 1.0, -1)
    return Matte(0, 0, alpha, np.full((side, side, 3), 0.5, np.float32))


def test_a_texture_with_invented_sides_takes_hardly_more_memory_than_itself():
    lifted = shapes.scene().lifted
    assert lifted.sides is not None
    matte = _matte(1500)
    size = object_texture(matte, lifted).texels.nbytes
    assert _peak(lambda: object_texture(matte, lifted)) < 1.35 * size  # all at once it was 2.3


def test_what_a_fill_is_looked_for_in_is_made_a_channel_at_a_time():
    chance = np.random.default_rng(0)
    for dtype in (np.uint8, np.uint16):
        photo = chance.integers(0, np.iinfo(dtype).max, (1500, 1500, 3)).astype(dtype)
        known = np.ones(photo.shape[:2], np.float32)
        unit = np.iinfo(dtype).max / 255
        small = shrunk(photo, known, (300, 300), unit)[0]
        peak = _peak(
            lambda photo=photo, known=known, unit=unit: shrunk(photo, known, (300, 300), unit)
        )
        assert peak / known.size < 13  # bytes a pixel; three channels of floats are 12 more
        whole = photo.astype(np.float32) / np.float32(unit)
        assert np.array_equal(small, shrunk(whole, known, (300, 300))[0])


class _Grey:
    """Fills a hole with grey."""

    name, is_random = "grey", False

    def missing(self) -> str | None:
        return None

    def inpaint(self, rgb, hole, progress, seed=0):
        return np.where(hole[..., None], np.uint8(128), rgb)


def test_joining_a_large_fill_needs_a_third_of_the_memory_and_gives_the_same(monkeypatch):
    side = 1400
    smooth = cv2.resize(
        np.random.default_rng(1).integers(0, 255, (6, 6, 3)).astype(np.uint8), (side, side)
    )
    fill = np.full_like(smooth, 128)
    away = cv2.distanceTransform((_matte(side).alpha <= 0).astype(np.uint8), cv2.DIST_L2, 5)
    margin = plates.hole_margin(side, side)
    weight = plates.fill_weight(away.copy(), margin)
    ring = (away < margin) & (weight <= 0)
    asked = smooth, fill, weight, ring, margin
    whole, peak = plates._joined(*asked), _peak(lambda: plates._joined(*asked))
    monkeypatch.setattr(plates, "LARGE", 10_000)
    small = _peak(lambda: plates._joined(*asked))
    assert small / ring.size < 0.62 * peak / ring.size
    apart = np.abs(plates._joined(*asked).astype(int) - whole)
    assert apart.max() <= 1 and (apart > 0).mean() < 1e-3  # sums in another order


def test_a_plate_is_the_same_where_its_residue_is_looked_for_in_the_photos_own_levels(monkeypatch):
    scene = shapes.scene("ellipse")
    plate = build_plate(scene.pixels, scene.mask, _Grey())
    from objectmorpher_core.compose.plate import residue

    monkeypatch.setattr(residue, "LARGE", 1000)
    other = build_plate(scene.pixels, scene.mask, _Grey())
    assert plate.box == other.box
    assert np.array_equal(plate.hole, other.hole)
    assert np.array_equal(plate.pixels, other.pixels)
