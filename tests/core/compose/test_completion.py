"""Filling by example: what goes on, from where it is taken, and by how much patches vote."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
import skimage.data

from objectmorpher_core.base.arrays import frozen
from objectmorpher_core.base.progress import silent
from objectmorpher_core.compose import load
from objectmorpher_core.compose.plate.completion import complete, smooth
from objectmorpher_core.compose.plate.patch_detail import with_detail
from objectmorpher_core.compose.plate.patch_search import patch_cost, vote
from objectmorpher_core.compose.plate.plate import build_plate, plate_cover, plate_picture
from objectmorpher_core.compose.plate.sources import (
    SUBJECT_COST,
    Guide,
    PatchTone,
    beside_hole,
    strange,
    unlikely,
)
from objectmorpher_core.compose.plate.structure_lines import draw_lines, find_lines
from objectmorpher_core.document.settings import Hint
from objectmorpher_core.segment.salience import SubjectNet
from tests import focussed
from tests.tree import over, quick

SIZE = 160  # px
LEAST_BESIDE = 0.22  # x the roughness beside, mean of three draws, which differ by 0.1; was 0.11
# and 0.17 with roughness in one band only
Y, X = np.mgrid[:SIZE, :SIZE]
HOLE = np.hypot(X - 80, Y - 80) < 26
without_weights = pytest.mark.usefixtures("without_weights")
needs_network = pytest.mark.skipif(SubjectNet().missing() is not None, reason="needs U^2-Net-p")


def noisy(levels: np.ndarray, seed: int = 0) -> np.ndarray:
    """(h, w, 3) u8 of grey levels (h, w) with some grain."""
    grain = np.random.default_rng(seed).normal(0, 3, (*levels.shape, 3))
    return np.clip(levels[..., None] + grain, 0, 255).astype(np.uint8)


def filled(picture: np.ndarray, hole: np.ndarray = HOLE, hints: tuple[Hint, ...] = ()):
    emptied = np.where(hole[..., None], np.uint8(0), picture)
    return load("patchmatch").inpaint_from(emptied, hole, hints, silent, 1)


@without_weights
@pytest.mark.parametrize("angle", quick([25, 0, 70, 90], 1))
def test_an_edge_that_enters_on_two_sides_goes_on_straight(angle):
    turn = np.radians(angle)
    beside = (X - 84) * np.sin(turn) - (Y - 77) * np.cos(turn)
    picture = noisy(np.where(beside > 0, 170.0, 80.0))
    found = filled(picture).astype(float).mean(-1)
    off_edge = HOLE & (np.abs(beside) > 2.5)
    wrong = (np.abs(found - np.where(beside > 0, 170, 80)) > 45)[off_edge]
    assert wrong.mean() < 0.02


def test_lines_are_found_where_they_are_and_nowhere_else():
    beside = (X - 84) * 0.5 - (Y - 77) * np.sqrt(0.75)
    edge = noisy(np.where(beside > 0, 170.0, 80.0)).astype(np.float32)
    known = (~HOLE).astype(np.float32)
    lines = find_lines(smooth(edge, known), HOLE)
    assert len(lines) == 1
    wanted, offered = draw_lines(lines, (1.0, 1.0), HOLE)
    assert (wanted[..., 0] > 0)[HOLE & (np.abs(beside) < 2)].mean() > 0.9
    assert not wanted[~HOLE].any() and not offered[HOLE].any()
    there = wanted[..., 0] > 0
    gap = np.abs(np.abs(wanted[there, 1]) - np.abs(beside[there]))
    assert np.median(gap) < 1.5  # px
    plain = noisy(np.full((SIZE, SIZE), 90.0)).astype(np.float32)
    assert not find_lines(smooth(plain, known), HOLE)


@pytest.mark.parametrize("radius", [26, 60])
def test_the_first_guess_is_a_mean_of_what_is_around_deep_in_a_hole_too(radius):
    hole = np.hypot(X - 80, Y - 80) < radius
    sides = np.where(X < 80, 90.0, 170.0)[..., None].repeat(3, 2).astype(np.float32)
    guess = smooth(sides * ~hole[..., None], (~hole).astype(np.float32))
    assert guess.min() > 90 - 0.1 and guess.max() < 170 + 0.1
    steps = np.abs(np.diff(guess[80, 80 - radius + 2 : 80 + radius - 2, 0]))
    assert steps.max() < 40  # no rim around the middle


@without_weights
def test_what_repeats_goes_on():
    tiles = noisy(60.0 + 120 * ((X // 10 + Y // 10) % 2))
    error = np.abs(filled(tiles).astype(float) - tiles)[HOLE]
    assert np.median(error) < 10 and error.mean() < 20


@without_weights
def test_a_hint_says_from_where():
    """Left dark, right bright, the hole in the dark: bright where the user wants it so."""
    picture = noisy(np.where(X > 120, 200.0, 60.0))
    hint = Hint((140.0, 80.0), (80.0, 80.0), 12.0)
    plain, hinted = (filled(picture, hints=h).astype(float).mean(-1) for h in ((), (hint,)))
    disc = np.hypot(X - 80, Y - 80) < 6  # within the soft seam of the two
    assert plain[disc].mean() < 80 and hinted[disc].mean() > 160
    rim = HOLE & (np.hypot(X - 80, Y - 80) > 22)
    assert hinted[rim].mean() < 90, "elsewhere nothing was said"
    assert np.array_equal(hinted[~HOLE], picture.astype(float).mean(-1)[~HOLE])


@without_weights
def test_a_hint_may_lead_to_the_far_end_of_the_photo():
    large = noisy(np.where(np.mgrid[:120, :600][1] > 540, 200.0, 60.0))
    hole = np.zeros((120, 600), bool)
    hole[45:75, 40:70] = True
    hint = Hint((570.0, 60.0), (55.0, 60.0), 14.0)
    plate = build_plate(large, hole, load("patchmatch"), hints=(hint,))
    assert plate.pixels[60 - plate.top, 55 - plate.left].mean() > 150


def test_telea_goes_without_hints():
    picture = noisy(np.full((SIZE, SIZE), 90.0))
    hint = Hint((140.0, 80.0), (80.0, 80.0), 12.0)
    plates = [build_plate(picture, HOLE, load("telea"), hints=h) for h in ((), (hint,))]
    assert np.array_equal(plates[0].pixels, plates[1].pixels)


@without_weights
def test_no_other_object_is_copied():
    """Everything that a plate covers is a hole: a magenta thing beside does not come again."""
    picture = noisy(60.0 + 40 * np.sin(X / 9.0))
    other = np.hypot(X - 125, Y - 80) < 14
    picture[other] = (255, 0, 255)
    plate = build_plate(picture, HOLE | other, load("patchmatch"))
    invented = plate.pixels[plate.hole].astype(int)
    assert (invented[:, 0] - invented[:, 1]).max() < 60


def test_a_colour_that_is_not_around_the_hole_is_unlikely():
    levels = noisy(60.0 + 100 * (X > 80)).astype(np.float32)
    red = np.hypot(X - 140, Y - 20) < 12
    levels[red] = (220, 20, 30)
    around = (cv2.dilate(HOLE.astype(np.uint8), np.ones((15, 15))) > 0) & ~HOLE
    share = strange(levels.astype(np.uint8), around)
    assert share.shape == HOLE.shape and share.min() >= 0
    inner = np.hypot(X - 140, Y - 20) < 6
    assert share[inner].min() > 0.5 and share[~red & (X > 82)].mean() < 0.1


@needs_network
@over("shape", [(1, 2), (40, 1)])
def test_the_network_looks_at_tiny_pictures_too(shape):
    hole = np.zeros(shape, bool)
    hole[-1, -1] = True
    cost = unlikely(np.full((*shape, 3), 90, np.float32), hole)
    assert cost.shape == shape and np.isfinite(cost).all()


@needs_network
def test_a_face_beside_the_hole_is_unlikelier_than_the_wall(astronaut):
    small = cv2.resize(astronaut, (256, 256), interpolation=cv2.INTER_AREA).astype(np.float32)
    y, x = np.mgrid[:256, :256]
    hole = np.hypot(x - 185, y - 50) < 18  # in the wall, between her and the shuttle
    cost = unlikely(small, hole)
    face, wall = cost[45:70, 100:122].mean(), cost[20:60, 155:165].mean()
    assert face > wall + 0.3 * SUBJECT_COST


@needs_network
def test_a_meadow_is_likely_behind_a_hole_in_it():
    grass = np.repeat(skimage.data.grass()[:256, :256, None], 3, 2).astype(np.float32)
    y, x = np.mgrid[:256, :256]
    hole = np.hypot(x - 128, 0.8 * (y - 128)) < 60
    cost = unlikely(smooth(grass, (~hole).astype(np.float32)), hole)
    around = cv2.dilate(hole.astype(np.uint8), np.ones((17, 17))) > 0
    assert cost[around & ~hole].mean() < 0.05 * SUBJECT_COST


def test_the_smooth_guess_in_a_hole_is_no_subject():
    blob = np.exp(-0.5 * (np.hypot(X - 80, Y - 80) / 26) ** 2).astype(np.float32)  # over its edge
    beside = np.exp(-0.5 * (np.hypot(X - 20, Y - 30) / 8) ** 2).astype(np.float32)
    left = beside_hole(np.maximum(blob, beside), HOLE)
    assert np.array_equal(left[beside > 0.5], beside[beside > 0.5])
    assert left[blob > 0.5].max() == 0
    assert np.array_equal(beside_hole(blob, HOLE & (X > 100)), blob), "the hole is a part of it"


def test_votes_are_the_mean_of_what_the_patches_say():
    random = np.random.default_rng(4)
    side, radius, channels = 7, 1, 2
    hole = random.random((side, side)) < 0.4
    layers = random.random((2, side + 2, side + 2, channels)).astype(np.float32)
    sources = np.dstack(
        [random.integers(-1, 2, (side, side)), *random.integers(0, side, (2, side, side))]
    ).astype(np.int32)
    shares = random.random((side, side)).astype(np.float32)
    voted = random.random((side, side, channels)).astype(np.float32)
    expected = voted.copy()
    for row, column in np.argwhere(hole):
        said, weights = [], []
        for i, j in np.argwhere(sources[..., 0] >= 0):
            if max(abs(i - row), abs(j - column)) <= radius:
                k, v, u = sources[i, j]
                said.append(layers[k, v + row - i + radius, u + column - j + radius])
                weights.append(shares[i, j])
        if said:
            expected[row, column] = np.average(said, 0, weights)
    vote(frozen(layers), frozen(sources), frozen(shares), frozen(hole), voted, 0, len(hole))
    np.testing.assert_allclose(voted, expected, atol=1e-5)


def test_a_patch_costs_nothing_where_it_is_from():
    random = np.random.default_rng(5)
    layers = frozen(random.random((1, 20, 20, 5)), np.float32)
    weight = frozen(np.ones_like(layers[0]))
    rows = [values.reshape(*values.shape[:-2], -1) for values in (layers[0], weight, layers)]
    assert patch_cost(*rows, (3, 4, 5), (0, 3, 4), 7, 1e9) == 0
    gap = layers[0, 3:10, 4:11] - layers[0, 8:15, 9:16]
    cost = patch_cost(*rows, (3, 4, 5), (0, 8, 9), 7, 1e9)
    np.testing.assert_allclose(cost, (gap**2).sum(), rtol=1e-5)


def noise(picture: np.ndarray, where: np.ndarray) -> float:
    """Standard deviation of what is finer than 2 px, in levels."""
    grey = picture.astype(np.float32).mean(2)
    return float((grey - cv2.GaussianBlur(grey, (0, 0), 2))[where].std())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gravel", "grass", "brick"])
def test_a_texture_goes_on_as_rough_as_it_is(name):
    grey = getattr(skimage.data, name)()[90:390, 100:400]
    picture = np.repeat(grey[..., None], 3, 2)
    y, x = np.indices(grey.shape)
    away = np.hypot(y - 150, x - 150)
    emptied = np.where(away[..., None] < 60, np.uint8(0), picture)
    results = [load("patchmatch").inpaint(emptied, away < 60, silent, seed) for seed in (0, 1)]
    rough = np.mean([noise(result, away < 56) for result in results])  # a draw spreads by 0.05
    assert 0.8 < rough / noise(picture, (away > 64) & (away < 94)) < 1.2


@pytest.mark.parametrize("name", quick(["gravel", "grass"], 1))
def test_ground_that_grows_blurred_farther_off_is_no_blob(name):
    """Smooth ground far off looks like the mean of sharp ground, and must not take its place."""
    document = focussed.scene(3.0, name)
    picture, hole = document.photo.pixels, plate_cover(document)
    plates = [build_plate(picture, hole, load("patchmatch"), seed=seed) for seed in range(3)]
    results = [plate_picture(replace(document, plate=plate)) for plate in plates]
    rows, columns = (np.flatnonzero(hole.any(axis)) for axis in (1, 0))
    inside = np.zeros_like(hole)
    inside[rows[0] + 8 : rows[-1] - 8, columns[0] + 6 : columns[-1] - 6] = True
    beside = np.roll(inside, 80, 1) | np.roll(inside, -80, 1)
    rough = np.mean([noise(result, inside) for result in results])
    assert rough > LEAST_BESIDE * noise(picture, beside)


def _slant(picture: np.ndarray, where: np.ndarray) -> float:
    """In [-1, 1] which diagonal steps lie on, of a picture (h, w, 3): the structure tensor's."""
    grey = cv2.GaussianBlur(picture.astype(np.float32).mean(-1), (0, 0), 1)
    down, right = np.gradient(grey)
    return float(2 * (right * down)[where].sum() / (right**2 + down**2)[where].sum())


def test_the_grain_of_a_table_goes_on_along_itself(coffee):
    """Its mirror image has the same steps to the side and down, and made a herringbone (0.13)."""
    y, x = np.mgrid[: coffee.shape[0], : coffee.shape[1]]
    hole = np.hypot((x - 285) / 225, (y - 225) / 215) < 1
    inner = np.hypot((x - 275) / 145, (y - 155) / 115) < 1
    assert _slant(filled(coffee, hole), inner) > 0.35


def test_a_tone_that_is_wanted_decides_between_textures():
    """Beside the hole is lit gravel alone; its right half is to be as dark as gravel far off."""
    grey = skimage.data.gravel()[100:196, 100:260].astype(np.float32)
    grey[:, 112:] *= 0.35
    y, x = np.indices(grey.shape)
    hole = (np.abs(y - 48) < 16) & (np.abs(x - 48) < 16)
    wanted = cv2.GaussianBlur(grey, (0, 0), 4)
    wanted[hole & (x > 48)] *= 0.35
    known, picture = (~hole).astype(np.float32), np.repeat(grey[..., None], 3, 2)
    tone = PatchTone(np.repeat(wanted[..., None], 3, 2), np.ones_like(grey))
    means = []
    for kept in (None, tone):
        guide = Guide(np.zeros_like(grey), tone=kept)
        colors = complete(picture * known[..., None], known, guide, 0, silent).colors
        means.append([colors[hole & side].mean() for side in (x < 44, x > 52)])
    lit, dark = grey[~hole & (x < 112)].mean(), grey[:, 116:].mean()
    assert min(means[0]) > 0.8 * lit and means[1][0] > 0.8 * lit
    assert means[1][1] < 0.5 * (lit + dark)


@pytest.mark.parametrize("zoom", [1, 2, 4, 8])
def test_what_is_copied_from_the_mirror_image_is_what_it_shows(zoom, coffee):
    """Of a picture that is its own mirror image, a hole comes back as it was."""
    half = cv2.resize(coffee[:64, :96], (96, 128))
    picture = np.concatenate([half, half[:, ::-1]], axis=1)
    hole = np.zeros(picture.shape[:2], bool)
    hole[40:88, 16:64] = True
    size = picture.shape[1] // zoom, picture.shape[0] // zoom
    small = cv2.resize(picture.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    rows, columns = np.mgrid[: size[1], : size[0]]
    sources = np.dstack([np.ones_like(rows), rows, columns]).astype(np.int32)
    filled = with_detail(picture, hole, small, sources)
    off = np.abs(filled.astype(int) - picture)
    assert off[hole].max() <= 1
    assert off[~hole].max() == 0
