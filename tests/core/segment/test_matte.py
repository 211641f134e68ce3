"""The soft cut-out: certain where it is certain, true to the photo, stable at the frame."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from objectmorpher_core.pixels import unit_pixels
from objectmorpher_core.segment.mask_edit import feather
from objectmorpher_core.segment.matte import band_width, build_matte, signed_distance
from tests import shapes

LEVEL = 1 / 255
BAND = band_width(shapes.WIDTH, shapes.HEIGHT)

masks = pytest.mark.parametrize("name", shapes.MASKS)


def _matte(name: str):
    inside = shapes.mask(name)
    return shapes.picture(inside), inside, build_matte(shapes.picture(inside), inside, 16)


def _on_photo(image: np.ndarray, box: tuple[int, int, int, int]) -> np.ndarray:
    """The part of a crop that lies inside the photo, pasted at its place."""
    pad = 400
    whole = np.zeros((120 + 2 * pad, 160 + 2 * pad, *image.shape[2:]), image.dtype)
    x0, y0, x1, y1 = box
    whole[y0 + pad : y1 + pad, x0 + pad : x1 + pad] = image
    return whole[pad : pad + 120, pad : pad + 160]


def _blend(soft: np.ndarray, body: tuple, ground: tuple) -> np.ndarray:
    """(H, W, 3) u8 of two plain colours mixed by `soft` (H, W)."""
    mixed = soft[..., None] * np.array(body) + (1 - soft[..., None]) * np.array(ground)
    return np.rint(mixed).astype(np.uint8)


@masks
def test_alpha_is_one_inside_and_nothing_outside_the_band(name):
    _, inside, matte = _matte(name)
    alpha, distance = _on_photo(matte.alpha, matte.box), signed_distance(inside)
    assert (alpha[distance > 1.5 * BAND] == 1).all()
    assert (alpha[distance < -1.5 * BAND] == 0).all()
    assert alpha.min() >= 0
    assert alpha.max() <= 1


@masks
def test_where_alpha_is_one_the_colour_is_the_photos(name):
    pixels, _, matte = _matte(name)
    alpha = _on_photo(matte.alpha, matte.box)
    colour = _on_photo(matte.foreground, matte.box)
    assert np.abs(colour - unit_pixels(pixels))[alpha == 1].max() < 1e-6


def test_a_blurred_edge_between_two_colours_gives_its_blur_back():
    inside = shapes.mask("disc")
    soft = cv2.GaussianBlur(inside.astype(np.float64), (0, 0), 1.0)
    matte = build_matte(_blend(soft, (220, 60, 40), (30, 90, 160)), inside, 16)
    error = np.abs(_on_photo(matte.alpha, matte.box) - soft)
    assert error.mean() < 0.01
    assert error.max() < 0.35  # the estimate ends at the band, a blur does not


def test_the_objects_colour_is_freed_of_the_background():
    inside = shapes.mask("disc")
    soft = cv2.GaussianBlur(inside.astype(np.float64), (0, 0), 1.0)
    body = (220, 60, 40)
    matte = build_matte(_blend(soft, body, (30, 90, 160)), inside, 16)
    touched = matte.alpha > 0.1
    assert np.abs(matte.foreground[touched] - np.array(body) / 255).max() < 0.12


def test_a_mixed_pixel_over_its_background_is_the_photo():
    """a F + (1 - a) B = photo, on average over the soft pixels."""
    inside = shapes.mask("disc")
    soft = cv2.GaussianBlur(inside.astype(np.float64), (0, 0), 1.0)
    ground = (30, 90, 160)
    photo = _blend(soft, (220, 60, 40), ground)
    matte = build_matte(photo, inside, 16)
    alpha = _on_photo(matte.alpha, matte.box)[..., None]
    again = alpha * _on_photo(matte.foreground, matte.box) + (1 - alpha) * np.array(ground) / 255
    mixed = (alpha[..., 0] > 0.05) & (alpha[..., 0] < 0.95)
    assert np.abs(again - unit_pixels(photo))[mixed].mean() < 6 * LEVEL


def test_where_the_colours_do_not_differ_the_mask_decides():
    inside = shapes.mask("disc")
    matte = build_matte(np.full((120, 160, 3), 128, np.uint8), inside, 16)
    alpha = _on_photo(matte.alpha, matte.box)
    assert abs(float(alpha.sum()) - inside.sum()) < 0.05 * inside.sum()
    assert (alpha[inside] >= 0.3).all()


def test_a_thin_limb_keeps_its_core():
    _, inside, matte = _matte("thin")
    alpha = _on_photo(matte.alpha, matte.box)
    ridge = signed_distance(inside) >= 2
    assert (alpha[ridge] > 0.9).all()


def test_at_the_photos_frame_the_object_is_whole():
    _, inside, matte = _matte("frame")
    alpha = _on_photo(matte.alpha, matte.box)
    frame = np.zeros_like(inside)
    frame[-1], frame[:, -1] = True, True
    deep = signed_distance(inside) > 2 * BAND
    assert (alpha[frame & deep] == 1).all()


def test_the_crop_is_the_object_with_its_margin():
    inside = np.zeros((120, 160), bool)
    inside[50:70, 60:100] = True
    matte = build_matte(shapes.picture(inside), inside, 10)
    assert matte.box == (50, 40, 110, 80)


def test_sixteen_bits_give_the_same_matte_as_eight():
    pixels, inside, matte = _matte("ellipse")
    deep = build_matte(pixels.astype(np.uint16) * 257, inside, 16)
    assert np.abs(deep.alpha - matte.alpha).max() < 1e-4
    assert np.abs(deep.foreground - matte.foreground).max() < 1e-4


@masks
def test_colours_continue_beyond_the_object(name):
    _, _, matte = _matte(name)
    assert np.isfinite(matte.foreground).all()
    assert matte.foreground.max() <= 1
    beyond = matte.alpha == 0
    body = np.array([190, 120, 60]) / 255
    # the made object's mean colour, not the ground's (70, 105, 135)
    assert np.abs(matte.foreground[beyond].mean(0) - body).max() < 0.12


def test_the_signed_distance_is_zero_between_inside_and_outside():
    inside = np.zeros((20, 30), bool)
    inside[:, 10:] = True
    distance = signed_distance(inside)
    assert np.allclose(distance[10, 8:12], [-1.5, -0.5, 0.5, 1.5])
    assert distance[0, 29] > 10, "the photo's frame is no edge"


def test_the_band_grows_with_the_photo():
    assert band_width(6000, 4000) > 10 * band_width(320, 240)


def test_a_mask_of_another_size_or_nothing_is_refused():
    pixels = shapes.picture(shapes.mask("disc"))
    with pytest.raises(ValueError, match=r"mask is \(120, 161\), photo is \(120, 160\)"):
        build_matte(pixels, np.ones((120, 161), bool), 5)
    with pytest.raises(ValueError, match="the mask is empty"):
        build_matte(pixels, np.zeros((120, 160), bool), 5)


def _with_soft_top(inside: np.ndarray) -> np.ndarray:
    """`inside` as coverage, drawn 10 px soft in the upper half."""
    coverage = feather(inside, 10)
    middle = inside.shape[0] // 2
    coverage[middle:] = inside[middle:] * np.uint8(255)
    return coverage


def test_a_drawn_soft_edge_is_the_cut_outs_alpha():
    inside = shapes.mask("disc")
    coverage = _with_soft_top(inside)
    matte = build_matte(shapes.picture(inside), coverage, 16)
    alpha = _on_photo(matte.alpha, matte.box)
    soft = (coverage > 0) & (coverage < 255)
    assert soft.sum() > 500
    np.testing.assert_array_equal(np.rint(alpha[soft] * 255), coverage[soft])


def test_where_nothing_was_drawn_soft_the_photo_decides():
    inside = shapes.mask("disc")
    coverage = _with_soft_top(inside)
    drawn = build_matte(shapes.picture(inside), coverage, 30)
    found = build_matte(shapes.picture(inside), inside, 30)
    far = np.zeros_like(inside)
    far[inside.shape[0] // 2 + round(3 * BAND) + 10 :] = True
    both = [_on_photo(matte.alpha, matte.box) for matte in (drawn, found)]
    assert np.abs(both[0] - both[1])[far].max() < 0.02
    hard = build_matte(shapes.picture(inside), inside * np.uint8(255), 30)
    np.testing.assert_array_equal(hard.alpha, found.alpha)
    np.testing.assert_array_equal(hard.foreground, found.foreground)


def test_inside_a_drawn_edge_colours_are_the_photos_and_outside_the_objects():
    inside = shapes.mask("disc")
    pixels = shapes.picture(inside)
    matte = build_matte(pixels, feather(inside, 10), 16)
    alpha, colour = (_on_photo(image, matte.box) for image in (matte.alpha, matte.foreground))
    within = signed_distance(inside) > 3
    assert np.abs(colour - unit_pixels(pixels))[within & (alpha > 0.7)].max() < 0.1
    body = np.array([190, 120, 60]) / 255
    beyond = (signed_distance(inside) < -4) & (alpha > 0)
    assert np.abs(colour[beyond].mean(0) - body).max() < 0.15


def test_the_crop_holds_all_of_a_soft_edge():
    inside = np.zeros((120, 160), bool)
    inside[50:70, 60:100] = True
    matte = build_matte(shapes.picture(inside), feather(inside, 15), 2)
    assert matte.alpha[0].max() == 0
    assert matte.alpha[:, 0].max() == 0
