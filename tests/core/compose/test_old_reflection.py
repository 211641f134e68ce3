"""What the ground mirrors in the photo: found where it is seen, gone where the object goes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from skimage import data

from objectmorpher_core.compose import load
from objectmorpher_core.compose.shadow.old_reflection import without_reflection
from objectmorpher_core.compose.shadow.old_shadow import traceless_plate
from objectmorpher_core.compose.shadow.reflection_fit import find_old_reflection
from objectmorpher_core.document.model import Matte
from objectmorpher_core.pipeline import run_script
from objectmorpher_core.scripting.script import script_from
from objectmorpher_core.segment.matting.matte import build_matte
from tests import shapes
from tests.core.segment.truth_masks import truth, truth_mask
from tests.photos import photo
from tests.reflected import mirrored, photo_with, thing
from tests.shadowed import FOOT, HEIGHT, WIDTH, ground_of, inside, photo_of, thrown
from tests.tree import quick

WHOLE = (0, 0, WIDTH, HEIGHT)


def _matte() -> Matte:
    soft = cv2.GaussianBlur(inside().astype(np.float32), (0, 0), 0.7)
    return Matte(0, 0, soft, thing().astype(np.float32))


def _around() -> np.ndarray:
    return cv2.dilate(inside().astype(np.uint8), np.ones((9, 9))) > 0


@pytest.mark.parametrize(("tilt", "strength"), [(0.0, 0.2), (1.0, 0.4), (-2.0, 0.6)])
@pytest.mark.parametrize("bits", quick([8, 16], 1))
def test_a_reflection_is_found_where_it_is(tilt, strength, bits):
    laid = mirrored(tilt)
    pixels = photo_with(laid, strength)
    if bits == 16:
        pixels = pixels.astype(np.uint16) * np.uint16(257)
    old = find_old_reflection(pixels, _matte())
    assert old is not None
    seen, true = old.covers(WHOLE), (laid[..., 3] > 0.5) & ~_around()
    assert seen[true].mean() > 0.8
    near = cv2.dilate(laid[..., 3], np.ones((13, 13))) > 0.5
    assert not (seen & ~near & ~_around()).any()
    x0, y0, x1, y1 = old.bounds(WIDTH, HEIGHT)
    inner = np.zeros_like(seen)
    inner[y0:y1, x0:x1] = True
    assert not (seen & ~inner).any()


def test_it_ends_where_it_is_no_longer_seen():
    laid = mirrored()
    ends = round(FOOT) + 32
    laid[ends:] = 0
    old = find_old_reflection(photo_with(laid), _matte())
    assert old is not None
    rows = np.flatnonzero(old.covers(WHOLE).any(1))
    assert ends - 12 < rows[-1] < ends + 16


@pytest.mark.parametrize("seed", quick(range(3), 1))
def test_even_ground_mirrors_nothing(seed):
    assert find_old_reflection(photo_with(None, ground=ground_of(seed)), _matte()) is None


def test_a_picture_that_is_no_mirror_image_is_none():
    assert find_old_reflection(photo_with(mirrored(turned=False)), _matte()) is None


def test_what_is_mirrored_elsewhere_is_something_else():
    aside = np.roll(mirrored(), 40, 1)
    assert find_old_reflection(photo_with(aside), _matte()) is None


def test_stripes_that_go_on_below_are_no_reflection():
    """They would be mirrored at any height."""
    stripes = np.where(np.arange(WIDTH) // 6 % 2, 0.3, 0.7)
    pixels = photo_of(None, np.repeat(np.tile(stripes, (HEIGHT, 1))[..., None], 3, 2))
    soft = _matte().alpha[..., None]
    striped = np.rint(soft * 255 * (0.1 + 0.8 * stripes)[None, :, None] + (1 - soft) * pixels)
    assert find_old_reflection(striped.astype(np.uint8), _matte()) is None


def test_a_shadow_is_no_reflection():
    assert find_old_reflection(photo_of(thrown(90.0, 1.2)), _matte()) is None


@pytest.mark.parametrize("name", ["rocket", "coffee", "motorcycle", "seat", "tower"])
def test_none_is_imagined_in_photographs(name):
    pixels, mask = photo(truth(name).photo), truth_mask(name)
    assert find_old_reflection(pixels, build_matte(pixels, mask, 20)) is None


def test_what_fills_or_leaves_the_photo_is_no_error():
    pixels = photo_with(mirrored())

    def solid(left: int, top: int, width: int, height: int, alpha: float = 1) -> Matte:
        colours = np.zeros((height, width, 3), np.float32)
        return Matte(left, top, np.full((height, width), alpha, np.float32), colours)

    for matte in (solid(0, 0, WIDTH, HEIGHT), solid(-40, 150, 80, 90), solid(WIDTH, 0, 9, 9),
                  solid(20, 20, 9, 9, alpha=0), solid(20, 20, 1, 1)):  # fmt: skip
        assert find_old_reflection(pixels, matte) is None
    assert find_old_reflection(pixels, _matte(), np.ones((HEIGHT, WIDTH), bool)) is None


def test_the_background_is_without_it():
    laid, pixels = mirrored(), photo_with(mirrored())
    old = find_old_reflection(pixels, _matte())
    assert old is not None
    plate = traceless_plate(pixels, _around(), (old,), load("telea"))
    x0, y0, x1, y1 = plate.box
    assert plate.painted is not None
    assert not (plate.painted & _around()[y0:y1, x0:x1]).any()
    assert np.array_equal(plate.pixels[~plate.hole], pixels[y0:y1, x0:x1][~plate.hole])
    result = pixels.copy()
    np.copyto(result[y0:y1, x0:x1], plate.pixels, where=plate.hole[..., None])
    assert _error(result, laid) < 0.4 * _error(pixels, laid)


@pytest.mark.slow
def test_a_script_that_moves_a_thing_leaves_no_reflection_behind():
    laid, pixels = mirrored(), photo_with(mirrored())
    script = {"move": [-75, 0], "inpaint": "telea", "gaussians": 800}
    given = shapes.png(pixels), shapes.mask_png(inside())
    gone, kept = (
        run_script(given[0], "a.png", script_from(script | more), given[1])
        for more in ({}, {"shadow": "none"})
    )
    assert _error(gone.composite.pixels, laid) < 0.5 * _error(kept.composite.pixels, laid)
    assert gone.report()["pixels"]["outside_footprint_changed"] == 0
    assert gone.document.objects[0].shadow.strength == 0  # it is not taken for a shadow


@pytest.mark.parametrize(
    ("texture", "tilt", "strength"),
    [("grass", 1.0, 0.3), ("grass", -1.0, 0.6), ("gravel", 0.0, 0.6)],
)
def test_what_is_taken_off_leaves_the_grounds_own_texture(texture, tilt, strength):
    bare = _textured(texture)
    laid, pixels = mirrored(tilt), photo_with(mirrored(tilt), strength, bare)
    old = find_old_reflection(pixels, _matte())
    assert old is not None and old.known is not None
    assert abs(old.known.mirroring.tilt - tilt) < 0.2
    below = old.known.mirroring.below(WHOLE)
    found = old.known.mirroring.share(below)[(laid[..., 3] > 0.5) & (below < 40)]
    assert abs(found.mean() - strength) < 0.15 * strength
    result, is_other = without_reflection(pixels, old, WHOLE)
    true = (laid[..., 3] > 0.5) & ~_around()
    own = photo_with(None, ground=bare).astype(float)
    before, after = (np.abs(p - own)[true].mean() for p in (pixels, result))
    assert after < 0.6 * before
    assert old.lost(WHOLE)[true].mean() < 0.2
    assert np.array_equal(result[~is_other], pixels[~is_other])
    assert not (is_other & ~old.covers(WHOLE)).any()


def test_a_part_of_the_photo_is_taken_off_as_in_the_whole():
    pixels = photo_with(mirrored(1.0), 0.5, _textured("grass"))
    old = find_old_reflection(pixels, _matte())
    assert old is not None
    whole, part = (without_reflection(pixels, old, box)[0] for box in (WHOLE, (60, 90, 200, 170)))
    assert np.abs(whole[90:170, 60:200].astype(int) - part).max() <= 1


@pytest.mark.slow
def test_a_large_photo_is_treated_as_a_small_one():
    pixels = photo_with(mirrored(1.0), 0.5, _textured("grass"))
    zoom = 4
    large = cv2.resize(pixels, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_LINEAR)
    matte = _matte()
    alpha, colour = (
        cv2.resize(part, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_LINEAR)
        for part in (matte.alpha, matte.foreground)
    )
    one = find_old_reflection(pixels, matte)
    other = find_old_reflection(large, Matte(0, 0, alpha, colour))
    assert one is not None and other is not None
    whole = (0, 0, zoom * WIDTH, zoom * HEIGHT)
    own, found = (
        without_reflection(p, old, box)[0].astype(float)
        for p, old, box in ((pixels, one, WHOLE), (large, other, whole))
    )
    found = cv2.resize(found, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    gone = np.abs(own - pixels)[one.covers(WHOLE)].mean()
    assert np.abs(own - found)[one.covers(WHOLE)].mean() < 0.3 * gone


def test_where_the_light_is_clipped_nothing_can_be_taken_off():
    bare = _textured("grass")
    pixels = photo_with(mirrored(), 0.5, bare)
    old = find_old_reflection(pixels, _matte())
    assert old is not None
    spot = np.argwhere(old.covers(WHOLE) & ~_around() & ~old.lost(WHOLE)).mean(0).astype(int)
    lamp = np.s_[spot[0] - 4 : spot[0] + 5, spot[1] - 4 : spot[1] + 5]
    pixels[lamp] = 255
    old = find_old_reflection(pixels, _matte())
    assert old is not None
    assert old.lost(WHOLE)[lamp].all()


def _textured(name: str) -> np.ndarray:
    """(H, W, 3) encoded."""
    texture = getattr(data, name)()[:HEIGHT, :WIDTH] / 255
    return np.repeat(texture[..., None], 3, 2) * [1.0, 0.95, 0.85]


def _error(pixels: np.ndarray, laid: np.ndarray) -> float:
    """Mean difference from the ground where it mirrored the thing."""
    bare, true = photo_with(None).astype(float), (laid[..., 3] > 0.5) & ~_around()
    return float(np.abs(pixels.astype(float) - bare)[true].mean())
