"""No fringe: what stood before black is put before white, and the other way about."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest

from objectmorpher_core.compose.composite import composite, straight_cutout
from objectmorpher_core.compose.plate.plate import plate_cover
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Photo, Placement
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.pipeline import make_plate
from tests import shapes
from tests.tree import over, quick

WIDTH, HEIGHT = 320, 160  # px
MIDDLE, RADIUS = (80.0, 78.0), 45.0  # px, of a disc in the left half
ACROSS = 158.0  # px to the same place in the right half
KINDS = {"white": (0, 250), "black": (255, 5)}  # its background's level, and its own
# Levels by which a pixel, and the mean, may be off. Measured: at most 5 and 0.15, 7 and 0.60; what
# remains is alpha below `soft_edge.TAIL`, which counts as none, and its like at the other end.
LEVELS = {0.6: (6, 0.2), 2.0: (8, 0.7)}
PLACES = {
    "moved": Placement(move=(ACROSS, 0.0)),
    "by a part of a pixel": Placement(move=(ACROSS + 0.4, 0.3)),
    "enlarged": Placement(move=(ACROSS, 0.0), scale=1.23),
    "made smaller": Placement(move=(ACROSS, 0.0), scale=0.6),
    "rolled": Placement(move=(ACROSS, 0.0), turn=(0.0, 0.0, 33.0)),
}


@cache
def _moved(kind: str, blur: float) -> tuple[Document, Puppet]:
    """A disc on a ground as far from it as can be; the photo's other half is as bright as it."""
    ground, level = KINDS[kind]
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    away = np.hypot(x - MIDDLE[0], y - MIDDLE[1])
    share = np.clip(RADIUS - away + 0.5, 0, 1)
    share = cv2.GaussianBlur(share, (0, 0), blur)
    left = ground + share * (level - ground)
    right = np.clip((x - WIDTH / 2) / 12, 0, 1)  # a ramp between the halves
    grey = left + right * (level - left)
    pixels = np.repeat(np.rint(grey).astype(np.uint8)[..., None], 3, axis=2)
    scene = shapes.lifted_scene(pixels, away < RADIUS, 1500)
    document = Document(Photo(Picture(pixels), scene.camera, shapes.png(pixels), "a.png"))
    document = edits.add_object(document)
    item = document.objects[0].with_mask(away < RADIUS, document.objects[0].prompt)
    document = document.with_object(0, item.with_lifted(scene.matte, scene.lifted))
    plate = make_plate(pixels, plate_cover(document), "telea")
    return edits.set_plate(document, plate), scene.puppet


@pytest.mark.parametrize("place", quick(PLACES, 3))
@over("blur", [0.6, 2.0])
@over("kind", KINDS)
def test_on_its_own_colour_its_edge_is_not_seen(kind, place, blur):
    document, puppet = _moved(kind, blur)
    level = KINDS[kind][1]
    result = composite(edits.set_placement(document, 0, PLACES[place]), {0: puppet}).pixels
    there = result[:, WIDTH // 2 + 16 :].astype(int)
    most, mean = LEVELS[blur]
    assert np.abs(there - level).max() <= most
    assert np.abs(there - level).mean() <= mean


@pytest.mark.parametrize("blur", [0.6, 2.0])
@pytest.mark.parametrize("kind", KINDS)
def test_beside_where_it_was_its_edge_falls_without_a_ring(kind, blur):
    """Moved by a few px before the same ground: the profile is the photo's, moved."""
    document, puppet = _moved(kind, blur)
    ground, level = KINDS[kind]
    moved = edits.set_placement(document, 0, Placement(move=(6.0, 3.0)))
    result = composite(moved, {0: puppet}).pixels[..., 0].astype(float)
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    away = np.hypot(x - MIDDLE[0] - 6, y - MIDDLE[1] - 3)
    share = (result - ground) / (level - ground)
    near = away < RADIUS + 14
    profile = [share[near & (np.floor(away) == r)].mean() for r in range(int(RADIUS) + 13)]
    assert max(np.diff(profile)) < 0.03  # it only falls
    assert min(profile[: int(RADIUS - 4 * blur - 1)]) > 0.98
    assert max(profile[int(RADIUS + 4 * blur + 2) :]) < 0.02
    photo = document.photo.pixels[..., 0].astype(float)
    before = np.hypot(x - MIDDLE[0], y - MIDDLE[1])
    was = (photo - ground) / (level - ground)
    expected = [was[np.floor(before) == r].mean() for r in range(int(RADIUS) + 13)]
    assert np.abs(np.array(profile) - expected).max() < 0.025  # measured: 0.020


@pytest.mark.parametrize("kind", KINDS)
def test_the_cutouts_colours_are_its_own_to_the_edge(kind):
    """Straight alpha: wherever anything of it is seen, it has its own colour."""
    document, puppet = _moved(kind, 2.0)
    moved = edits.set_placement(document, 0, PLACES["made smaller"])
    result = composite(moved, {0: puppet})
    cutout = straight_cutout(result, np.dtype(np.uint8), (WIDTH, HEIGHT))
    seen = cutout[..., 3] > 12
    assert (cutout[seen][:, 3] < 240).any()  # it has a soft edge
    assert np.abs(cutout[seen][:, :3].astype(int) - KINDS[kind][1]).max() <= LEVELS[2.0][0]
