"""The shadow of what is seen from above: a bowl in the sun, on concrete."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from skimage import data

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose import load
from objectmorpher_core.compose.plate.plate import plate_crop
from objectmorpher_core.compose.shadow.old_shadow import traceless_plate, without_shadow
from objectmorpher_core.compose.shadow.shadow import FINE, LAST_BLURS, FlatShadow, StandingObject
from objectmorpher_core.compose.shadow.shadow_fit import find_old_shadow
from objectmorpher_core.document.model import Matte
from objectmorpher_core.pictures.image import read_picture
from objectmorpher_core.segment.matting.soft_edge import signed_distance

BOWL = Path(__file__).parents[3] / "assets" / "samples" / "bowl.jpg"
WIDTH, HEIGHT = 300, 240
LEFT, TOP = 15, -24  # px, by which the shadow lies beside the disc
BLUR = 0.8  # px, of its edge
DARK = 0.25  # of the light is left


def _disc(left: float = 0, top: float = 0) -> np.ndarray:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.hypot(x - 150 - left, y - 125 - top) < 55


@pytest.fixture(scope="module")
def ground() -> np.ndarray:
    """(h, w, 3) gravel, evenly lit, seen from so far that its stones are small."""
    grey = cv2.resize(data.gravel(), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return np.repeat((150 + (grey.astype(float) - grey.mean()) * 0.5)[..., None], 3, 2)


@pytest.fixture(scope="module")
def matte() -> Matte:
    soft = cv2.GaussianBlur(_disc().astype(np.float32), (0, 0), 0.7)
    return Matte(0, 0, soft, np.full((HEIGHT, WIDTH, 3), 0.5, np.float32))


def test_it_is_found_beside_the_outline_and_taken_off_to_its_edge(ground, matte):
    lit = np.where(_disc()[..., None], (200, 60, 30), ground)
    shade = _disc(LEFT, TOP) & ~_disc()
    photo = np.where(shade[..., None], lit * DARK ** (1 / 2.2), lit).astype(np.uint8)
    old = find_old_shadow(photo, matte)
    assert old is not None and old.shadow.ground == 90
    true = np.degrees(np.arctan2(TOP, LEFT))
    assert abs((old.shadow.direction - true + 180) % 360 - 180) < 20
    result, _ = without_shadow(photo, old, (0, 0, WIDTH, HEIGHT))
    away = cv2.distanceTransform((~_disc()).astype(np.uint8), cv2.DIST_L2, 5)
    inside, beside = shade & (away > 3), ~shade & (away > 3)
    error = np.abs(result.astype(float) - lit).mean(-1)
    before = np.abs(photo.astype(float) - lit).mean(-1)
    assert error[inside].mean() < 0.25 * before[inside].mean()
    assert error[beside].mean() < 2


def _in_the_sun(ground: np.ndarray) -> np.ndarray:
    """(h, w, 3) u8 the disc with its shadow, as a JPEG file has it."""
    lit = np.where(_disc()[..., None], (200, 60, 30), ground)
    shade = cv2.GaussianBlur(_disc(LEFT, TOP).astype(np.float32), (0, 0), BLUR)
    shade[_disc()] = 0
    seen = lit * (1 - shade + shade * DARK)[..., None] ** (1 / 2.2)
    quality = [cv2.IMWRITE_JPEG_QUALITY, 80]
    _, coarse = cv2.imencode(".jpg", seen.astype(np.uint8)[..., ::-1], quality)
    return np.ascontiguousarray(cv2.imdecode(coarse, cv2.IMREAD_COLOR)[..., ::-1])


def test_the_new_shadow_is_as_far_beside_the_outline_and_as_hard(ground, matte):
    old = find_old_shadow(_in_the_sun(ground), matte)
    assert old is not None
    side = np.ptp(np.argwhere(_disc())[:, 0])
    blur = old.shadow.softness * (LAST_BLURS[1] - LAST_BLURS[0]) * side
    assert blur == pytest.approx(BLUR, abs=0.4)
    camera = Camera.from_fov(WIDTH, HEIGHT, 50.0)
    inside = np.argwhere(_disc())[:, ::-1] + 0.5
    points = camera.unproject(inside, np.full(len(inside), 4.0))
    points[:, 2] -= 0.1 * np.random.default_rng(0).random(len(points))  # its relief
    standing = StandingObject(points, np.array([0.0, 0.0, 1.0]), camera)
    flat = FlatShadow.of(old.shadow, standing, FINE)
    assert flat is not None
    shade = flat.shade(old.shadow, standing, None)
    assert shade is not None
    alpha = shade.at((0, 0, WIDTH, HEIGHT))
    found, true = alpha > alpha.max() / 2, _disc(LEFT, TOP)
    assert (found & true).sum() > 0.93 * (found | true).sum()
    assert alpha.max() == pytest.approx(1 - DARK ** (1 / 2.2), abs=0.08)
    between = (alpha > 0.1 * alpha.max()) & (alpha < 0.9 * alpha.max())
    assert between.sum() < 4 * 2 * np.pi * 55  # px: so wide is its edge at most


def test_no_blotches_stay_where_deep_shade_was(ground, matte):
    photo = _in_the_sun(ground)
    old = find_old_shadow(photo, matte)
    assert old is not None
    plate = traceless_plate(photo, _disc(), [old], load("patchmatch"))
    shown = plate_crop(photo, plate, (0, 0, WIDTH, HEIGHT)).astype(float)
    core = cv2.erode((_disc(LEFT, TOP) & ~_disc()).astype(np.uint8), np.ones((13, 13))) > 0
    # The ground is grey: so is what was in the shade, which the file gave a few colours.
    gain = DARK ** (-1 / 2.2)
    coloured = (photo - photo.mean(-1, keepdims=True))[core].std() * gain
    assert (shown - shown.mean(-1, keepdims=True))[core].std() < 0.6 * coloured


def test_ground_of_another_material_is_none(ground, matte):
    """As dark and as large, but another colour."""
    other = np.where(_disc(LEFT, TOP)[..., None], ground * (0.8, 0.45, 0.25), ground)
    photo = np.where(_disc()[..., None], (200, 60, 30), other).astype(np.uint8)
    assert find_old_shadow(photo, matte) is None


def _bowl(step: int) -> tuple[np.ndarray, Matte]:
    """The bowl at every `step`-th px, cut out."""
    picture = read_picture(BOWL.read_bytes()).pixels
    photo = np.ascontiguousarray(picture[::step, ::step])
    height, width = photo.shape[:2]
    red = photo.astype(int)
    is_red = ((red[..., 0] - red[..., 2] > 60) & (red[..., 0] > 90)).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(is_red)
    rim = np.argwhere(labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])))[:, ::-1]
    solid = np.zeros((height, width), np.float32)
    cv2.fillConvexPoly(solid, cv2.convexHull(rim.astype(np.int32)), 1.0)
    soft = cv2.GaussianBlur(solid, (0, 0), 1)
    return photo, Matte(0, 0, soft, photo.astype(np.float32) / 255)


def test_the_bowl_in_the_sun():
    """The concrete in its shadow becomes as light as beside it, and none becomes lighter."""
    photo, matte = _bowl(2)
    height, width = photo.shape[:2]
    old = find_old_shadow(photo, matte)
    assert old is not None
    result, _ = without_shadow(photo, old, (0, 0, width, height))
    shaded, lit = np.s_[60:110, 110:170], np.s_[20:80, 20:50]
    before, after, beside = (p.mean() for p in (photo[shaded], result[shaded], photo[lit]))
    assert before < 0.5 * beside
    assert 0.85 * beside < after < 1.15 * beside
    assert np.abs(result[lit].astype(float) - photo[lit]).mean() < 2


@pytest.mark.slow
def test_no_line_stays_where_the_bowls_shadow_ended():
    """Its edge is as wide and as sharpened as the camera made it."""
    photo, matte = _bowl(1)
    height, width = photo.shape[:2]
    old = find_old_shadow(photo, matte)
    assert old is not None
    covered = matte.alpha > 0.01
    plate = traceless_plate(photo, covered, [old], load("patchmatch"))
    shown = plate_crop(photo, plate, (0, 0, width, height)).mean(-1)
    dark = (cv2.blur(photo, (3, 3)).mean(-1) < 105) & ~covered
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (15, 15))
    closed = cv2.morphologyEx(dark.astype(np.uint8), cv2.MORPH_CLOSE, kernel)
    opened = cv2.morphologyEx(closed, cv2.MORPH_OPEN, kernel)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(opened)
    shade = labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    away, free = -signed_distance(shade), signed_distance(covered) < -13.5
    fine = shown - cv2.GaussianBlur(shown, (0, 0), 8)
    for px in range(-5, 5):
        assert abs(fine[free & (away > px) & (away <= px + 1)].mean()) < 4, f"{px} px from it"
