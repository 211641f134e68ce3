"""The shadow of what is seen from above: a bowl in the sun, on concrete."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from skimage import data

from objectmorpher_core.compose.shadow.old_shadow import without_shadow
from objectmorpher_core.compose.shadow.shadow_fit import find_old_shadow
from objectmorpher_core.document.model import Matte
from objectmorpher_core.pictures.image import read_picture

BOWL = Path(__file__).parents[3] / "assets" / "samples" / "bowl.jpg"
WIDTH, HEIGHT = 300, 240
LEFT, TOP = 15, -24  # px, by which the shadow lies beside the disc
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


def test_ground_of_another_material_is_none(ground, matte):
    """As dark and as large, but another colour."""
    other = np.where(_disc(LEFT, TOP)[..., None], ground * (0.8, 0.45, 0.25), ground)
    photo = np.where(_disc()[..., None], (200, 60, 30), other).astype(np.uint8)
    assert find_old_shadow(photo, matte) is None


def test_the_bowl_in_the_sun():
    """The concrete in its shadow becomes as light as beside it, and none becomes lighter."""
    picture = read_picture(BOWL.read_bytes()).pixels
    photo = np.ascontiguousarray(picture[::2, ::2])
    height, width = photo.shape[:2]
    red = photo.astype(int)
    is_red = ((red[..., 0] - red[..., 2] > 60) & (red[..., 0] > 90)).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(is_red)
    rim = np.argwhere(labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])))[:, ::-1]
    solid = np.zeros((height, width), np.float32)
    cv2.fillConvexPoly(solid, cv2.convexHull(rim.astype(np.int32)), 1.0)
    matte = Matte(0, 0, cv2.GaussianBlur(solid, (0, 0), 1), photo.astype(np.float32) / 255)
    old = find_old_shadow(photo, matte)
    assert old is not None
    result, _ = without_shadow(photo, old, (0, 0, width, height))
    shaded, lit = np.s_[60:110, 110:170], np.s_[20:80, 20:50]
    before, after, beside = (p.mean() for p in (photo[shaded], result[shaded], photo[lit]))
    assert before < 0.5 * beside
    assert 0.85 * beside < after < 1.15 * beside
    assert np.abs(result[lit].astype(float) - photo[lit]).mean() < 2
