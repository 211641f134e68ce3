"""A thing on a paved ground that is in focus where the thing stands: photos for tests."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import skimage.data

from objectmorpher_core.compose.light.lighting import Lighting, Lit
from objectmorpher_core.deform.puppet import puppet_of
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from tests import shapes

WIDTH, HEIGHT = 480, 360  # px
HORIZON, FOOT = 90.0, 285.0  # rows
MIDDLE, SIDES = 240.0, (70, 90)  # px, of the thing
TEXELS = 24  # of a photographed ground, along a slab
GRADES = 24  # blurs of which the photo is made
RATIO = 1.8  # of depths: where it is far


def row_at(ratio: float) -> float:
    """Where the ground is so many times as far away as the thing."""
    return HORIZON + (FOOT - HORIZON) / ratio


def blur_at(row: np.ndarray | float, far: float) -> np.ndarray:
    """Px, standard deviation: 0 where the thing stands, `far` at RATIO times its depth."""
    near = 1 - (np.asarray(row) - HORIZON) / (FOOT - HORIZON)  # as inverse depths are apart
    return np.minimum(far * np.abs(near) / (1 - 1 / RATIO), 1.4 * far)


def _ground(name: str) -> np.ndarray:
    """(H, W) sharp: slabs of one size on the ground, of many greys, or a photographed ground."""
    factor = 4
    x, y = np.meshgrid(np.arange(WIDTH * factor) + 0.5, np.arange(HEIGHT * factor) + 0.5)
    x, y = x / factor, y / factor
    away = 1 / np.maximum(y - HORIZON, 2.0)
    if name == "slabs":
        texels, fine = np.random.default_rng(0).uniform(0.2, 0.8, (97, 89)), 1
    else:
        texels, fine = getattr(skimage.data, name)().T / 255.0, TEXELS
    across = np.floor((x - WIDTH / 2) * away * 5 * fine).astype(int) % texels.shape[0]
    along = np.floor(1000 * away * fine).astype(int) % texels.shape[1]
    sharp = np.where(y > HORIZON + 4, texels[across, along], 0.8)
    size = (WIDTH, HEIGHT)
    return np.asarray(cv2.resize(sharp.astype(np.float32), size, interpolation=cv2.INTER_AREA))


@cache
def scene(far: float, name: str = "slabs") -> Document:
    """The thing lifted; `far`: see `blur_at`. `name`: the ground, "slabs" or scikit-image's."""
    ground, rows = _ground(name), np.arange(HEIGHT) + 0.5
    blurs = blur_at(rows, far)
    grades = np.linspace(0, max(float(blurs.max()), 1e-6), GRADES)
    pile = np.array([ground if g < 0.1 else cv2.GaussianBlur(ground, (0, 0), g) for g in grades])
    at = np.clip(np.searchsorted(grades, blurs), 1, GRADES - 1)
    share = ((blurs - grades[at - 1]) / (grades[at] - grades[at - 1]))[:, None]
    whole = np.arange(HEIGHT)
    picture = (1 - share) * pile[at - 1, whole] + share * pile[at, whole]
    width, height = SIDES
    top, left = int(FOOT) - height, int(MIDDLE) - width // 2
    inside = np.zeros((HEIGHT, WIDTH), bool)
    inside[top : int(FOOT), left : left + width] = True
    checks = (np.indices((HEIGHT, WIDTH)) // 9).sum(0) % 2
    picture = np.where(inside, 0.25 + 0.5 * checks, picture)
    noise = np.random.default_rng(1).normal(0, 0.006, (HEIGHT, WIDTH, 3))
    rgb = picture[..., None] * np.array([1.0, 0.95, 0.9]) + noise
    pixels = np.rint(255 * rgb.clip(0, 1)).astype(np.uint8)
    document = shapes.lifted_scene(pixels, inside, 3000).document()
    document = edits.set_horizon(document, HORIZON)
    return edits.set_share(document, 0, "defocus", 1.0)


def farther(document: Document, ratio: float) -> Document:
    """The thing on the same ground, so many times as far away."""
    item = document.objects[0]
    assert item.lifted is not None
    camera, centre = document.photo.camera, item.lifted.centre
    middle = float(camera.project(centre)[1])
    depth = (ratio - 1) * centre[2] / (item.lifted.diameter * item.lifted.scale)
    move = row_at(ratio) - middle - (FOOT - middle) / ratio
    return edits.set_placement(document, 0, Placement(move=(60.0, move), depth=float(depth)))


def look(document: Document) -> Lit:
    """What is done to the thing."""
    item = document.objects[0]
    puppet = puppet_of(item, document.photo.camera)
    now = puppet.posed(item.pose, item.placement)
    return Lighting(document).of(
        item, now, lambda: puppet.posed(None, Placement()), document.horizon
    )
