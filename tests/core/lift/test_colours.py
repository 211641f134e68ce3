"""Colours of what the photo did not show: mirrored, or grown from the rim."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from objectmorpher_core.base.arrays import F32, F64, Mask
from objectmorpher_core.document.model import LiftSettings, Matte
from objectmorpher_core.lift.relief.canvas import ReliefCanvas
from objectmorpher_core.lift.relief.colours import Colouring, colouring, fill_in, grown
from objectmorpher_core.lift.relief.mirror import MirrorAxis
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.pipeline import lift_mask
from tests import shapes

SIDE = 200  # px
SPACING = 4.0  # px
MIDDLE = np.array([[100.0, 100.0]])
AXIS = MirrorAxis((1.0, 0.0), 100.0, 1.0, 1.0)


def _away() -> F64:
    """(h, w) px from the middle."""
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5 - SIDE / 2
    return np.hypot(x, y)


def _green() -> F32:
    """(h, w, 3) a green texture with a red spot in the middle."""
    rng = np.random.default_rng(0)
    noise = cv2.GaussianBlur(rng.normal(size=(SIDE, SIDE, 1)), (0, 0), 2)[..., None]
    rgb = np.array([0.2, 0.6, 0.3]) + 0.6 * noise
    return np.where(_away()[..., None] < 35, [0.9, 0.1, 0.1], rgb).astype(np.float32)


def _coloured(rgb: F32, is_mirrored: bool, hidden: Mask | None = None, axis=None) -> Colouring:
    inside = _away() < 80
    shown = inside if hidden is None else inside & ~hidden
    matte = Matte(0, 0, shown.astype(np.float32), rgb)
    return colouring(
        ReliefCanvas.of(matte, hidden), ReliefSilhouette.of(inside), SPACING, is_mirrored, axis
    )


def _at(colours: Colouring, xy: F64, is_back: bool) -> F32:
    return colours.sample(xy, np.full(len(xy), is_back))


def _circle(radius: float) -> F64:
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    return 100 + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def test_a_mirrored_back_shows_what_the_front_shows():
    colours = _coloured(_green(), True)
    xy = np.concatenate([MIDDLE, _circle(50)])
    assert np.array_equal(_at(colours, xy, True), _at(colours, xy, False))
    assert _at(colours, MIDDLE, True)[0] == pytest.approx([0.9, 0.1, 0.1], abs=0.02)


def test_a_back_grown_from_the_rim_has_none_of_a_red_spot_in_the_middle():
    colours = _coloured(_green(), False)
    xy = np.concatenate([MIDDLE, _circle(10), _circle(25)])
    back = _at(colours, xy, True)
    assert (back[:, 0] < 0.4).all()
    assert (back[:, 1] > 0.4).all()
    assert _at(colours, MIDDLE, False)[0] == pytest.approx([0.9, 0.1, 0.1], abs=0.02)


def test_a_grown_back_meets_the_front_at_the_outline():
    colours = _coloured(_green(), False)
    xy = _circle(79)
    assert np.abs(_at(colours, xy, True) - _at(colours, xy, False)).max() < 0.02


def test_a_grown_back_has_the_rims_texture_and_not_only_its_mean():
    back = _coloured(_green(), False).back
    front = _coloured(_green(), True).front
    scale = back.shape[0] / SIDE
    y, x = np.mgrid[: back.shape[0], : back.shape[1]] / scale - 100
    away = np.hypot(x, y)
    assert back[away < 40].std(0).mean() > 0.4 * front[(away > 62) & (away < 78)].std(0).mean()


def test_the_front_is_the_photo_blurred_as_the_gaussians_are_far_apart():
    rgb = _green()
    front = _at(_coloured(rgb, True), _circle(60), False)
    expected = cv2.GaussianBlur(rgb, (0, 0), 1.2 * SPACING)
    column, row = np.floor(_circle(60)).astype(int).T
    assert np.abs(front - expected[row, column]).max() < 0.06


@pytest.mark.parametrize("axis", [None, AXIS])
def test_hidden_parts_have_the_mirrored_colour_where_the_object_is_symmetric(axis):
    """Green on the left, and on the right where nobody sees it; blue on the right beside."""
    x = np.arange(SIDE) + 0.5
    rgb = np.empty((SIDE, SIDE, 3), np.float32)
    rgb[:] = [0.2, 0.2, 0.8]
    rgb[:, (x > 40) & (x < 70)] = [0.2, 0.8, 0.2]
    hidden = np.zeros((SIDE, SIDE), bool)
    hidden[:, 125:165] = True  # in which the mirror image of the green stripe lies
    got = _at(_coloured(rgb, True, hidden, axis), np.array([[145.0, 100.0]]), False)[0]
    assert got == pytest.approx([0.2, 0.8, 0.2] if axis else [0.2, 0.2, 0.8], abs=0.05)


def test_the_size_of_the_photo_does_not_change_the_colours():
    inside = _away() < 80
    small = _coloured(_green(), True)
    large = cv2.resize(_green(), (3 * SIDE, 3 * SIDE))
    mask = cv2.resize(inside.astype(np.uint8), (3 * SIDE, 3 * SIDE)) > 0
    matte = Matte(0, 0, mask.astype(np.float32), np.asarray(large, np.float32))
    other = colouring(ReliefCanvas.of(matte), ReliefSilhouette.of(mask), 3 * SPACING, True, None)
    xy = _circle(50)
    assert np.abs(_at(small, xy, False) - _at(other, 3 * xy, False)).max() < 0.03


def test_filling_in_keeps_what_is_known_and_stays_between():
    rng = np.random.default_rng(1)
    rgb = rng.uniform(0.2, 0.7, (61, 83, 3)).astype(np.float32)
    known = rng.random((61, 83)) < 0.05
    filled = fill_in(rgb, known)
    assert np.array_equal(filled[known], rgb[known])
    assert (filled >= rgb[known].min(0) - 1e-5).all()
    assert (filled <= rgb[known].max(0) + 1e-5).all()


def test_filling_in_from_nothing_changes_nothing():
    rgb = np.random.default_rng(1).random((9, 9, 3)).astype(np.float32)
    assert np.array_equal(fill_in(rgb, np.zeros((9, 9), bool)), rgb)


def test_growing_copies_pixels_of_the_source_and_nothing_else():
    rgb = _green()
    source, hole = _away() > 60, _away() < 55
    whole = grown(rgb, source, hole)
    assert np.array_equal(whole[~hole], rgb[~hole])
    known = {p.tobytes() for p in rgb[source]}
    assert all(p.tobytes() in known for p in whole[hole])


def test_growing_goes_on_with_stripes():
    x = np.arange(SIDE)
    stripes = np.where((x // 8) % 2, 0.8, 0.2)[None, :, None]
    rgb = np.broadcast_to(stripes, (SIDE, SIDE, 3)).astype(np.float32).copy()
    hole = np.zeros((SIDE, SIDE), bool)
    hole[80:120, 80:120] = True
    rgb[hole] = 0.5
    whole = grown(rgb, ~hole, hole)
    assert (np.abs(whole - stripes)[hole] < 0.1).mean() > 0.8


def test_growing_twice_is_the_same():
    source, hole = _away() > 60, _away() < 55
    assert np.array_equal(grown(_green(), source, hole), grown(_green(), source, hole))


@pytest.mark.parametrize("nothing", ["source", "hole"])
def test_growing_from_nothing_or_into_nothing_changes_nothing(nothing):
    some, none = _away() < 20, np.zeros((SIDE, SIDE), bool)
    source, hole = (none, some) if nothing == "source" else (some, none)
    assert np.array_equal(grown(_green(), source, hole), _green())


def test_a_lifted_object_is_red_behind_only_when_its_back_is_mirrored():
    """The whole way: a disc with a red spot, seen from behind."""
    inside = shapes.mask("disc", 320, 240)
    pixels = shapes.picture(inside)
    y, x = np.mgrid[:240, :320] + 0.5
    pixels[np.hypot(x - 160, y - 120) < 22] = [240, 10, 10]
    reds = {}
    for back in ("mirrored", "continued"):
        settings = LiftSettings(3000, back=back)
        lifted = lift_mask(pixels, shapes.camera(320, 240), inside, "relief", settings)[1]
        behind = lifted.texture.visibility < 0.5
        middle = np.hypot(*(lifted.texture.u0 - [160, 120]).T) < 12
        reds[back] = float(lifted.gaussians.colors[behind & middle, 0].mean())
        greens = lifted.gaussians.colors[behind & middle, 1].mean()
        assert (greens < 0.2) == (back == "mirrored")
    assert reds["mirrored"] > 0.9
    assert reds["continued"] < 0.85
