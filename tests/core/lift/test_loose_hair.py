"""Hair beside a cut-out: it is found, it goes along with its object, and other lines do not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from skimage import data

from objectmorpher_core.base import masks
from objectmorpher_core.base.arrays import F32, Mask, Pixels, crop
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.plate.plate import hole_margin, plate_cover
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Matte, Photo, Placement, Prompt
from objectmorpher_core.lift import loose_hair
from objectmorpher_core.lift.loose_hair import find_loose_hair, with_loose_hair
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.pipeline import lift_mask, make_plate
from tests.core.compose.test_residue import HEIGHT, WIDTH, background
from tests.shapes import camera, png

MARGIN = hole_margin(WIDTH, HEIGHT)
CENTRE, RADIUS, FINE = (240, 190), 80, 4
AWAY = np.hypot(*(np.indices((HEIGHT, WIDTH)) - np.array([[[CENTRE[1]]], [[CENTRE[0]]]])))
DISC = AWAY < RADIUS
MOVED = 70  # px, to the right


def _hairs(seed: int, count: int = 12) -> tuple[F32, Mask]:
    """(h, w) how much hair covers each pixel about the disc; (h, w) True along its middle."""
    rng = np.random.default_rng(seed)
    cover, middle = np.zeros((2 * HEIGHT, 2 * WIDTH), np.uint8), np.zeros((HEIGHT, WIDTH), np.uint8)
    for angle in rng.uniform(0, 2 * np.pi, count):
        steps = np.linspace(0, rng.uniform(20, 45), 20)
        angles = angle + rng.normal(0, 0.012) * steps
        lines = np.stack([240 + (78 + steps) * np.cos(angles), 190 + (78 + steps) * np.sin(angles)])
        cv2.polylines(cover, [np.rint(2 * lines.T).astype(np.int32)], False, 255, 2, cv2.LINE_AA)
        cv2.polylines(middle, [np.rint(lines.T).astype(np.int32)], False, 1)
    small = cv2.resize(cover, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return np.asarray(small / np.float32(255), np.float32), np.asarray((middle > 0) & ~DISC)


def _ground(name: str, rng: np.random.Generator) -> F32:
    """(h, w, 3) levels of a background, out of focus unless it is one of scikit-image's."""
    if name in ("brick", "grass", "gravel"):
        picture = np.repeat(getattr(data, name)()[:HEIGHT, :WIDTH, None], 3, 2)
    elif name in ("wood", "street"):
        picture = background(name)
    elif name == "edge":  # of a table, which ends at the object
        picture = np.full((HEIGHT, WIDTH, 3), 90.0)
        picture[200:] = 170
    elif name == "wire":  # which goes on behind it
        picture = np.full((HEIGHT, WIDTH, 3), 150.0)
        cv2.line(picture, (0, 90), (WIDTH, 260), (60, 60, 60), 2, cv2.LINE_AA)
    else:
        picture = rng.uniform(110, 190, (6, 8, 3))
    picture = cv2.resize(picture.astype(np.float32), (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
    return np.asarray(picture + rng.normal(0, 1.5, picture.shape), np.float32)


def _fur() -> F32:
    """(h, w) how much the disc and its short fur cover."""
    large, rng = np.zeros((FINE * HEIGHT, FINE * WIDTH), np.uint8), np.random.default_rng(5)
    middle = FINE * np.array(CENTRE)
    cv2.circle(large, middle.tolist(), FINE * RADIUS, (255,), -1)
    for angle in rng.uniform(0, 2 * np.pi, 500):
        out = np.array([np.cos(angle), np.sin(angle)])
        ends = FINE * RADIUS - 4, FINE * (RADIUS + rng.uniform(2, 7))
        start, end = (np.rint(middle + out * far).astype(int).tolist() for far in ends)
        cv2.line(large, start, end, (255,), int(rng.integers(3, 8)))
    small = cv2.resize(large, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return np.asarray(small / np.float32(255), np.float32)


def _mixed(ground: F32, *covers: tuple[F32, float]) -> Pixels:
    """The photo of what covers a ground, each by so much and with its own tone."""
    picture = ground
    for cover, tone in covers:
        picture = picture + cover[..., None] * (tone - picture)
    return np.rint(picture.clip(0, 255)).astype(np.uint8)


def _apart(mask: Mask) -> F32:
    return np.asarray(cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5), np.float32)


@pytest.mark.parametrize("tone", [20.0, 240.0])
def test_hair_that_begins_at_the_object_is_found(tone: float):
    found, there, others = 0, 0, []
    for seed in range(4):
        ground = _ground("blurred", np.random.default_rng(seed))
        cover, middle = _hairs(seed)
        pixels = _mixed(ground, (cover, tone), (DISC.astype(np.float32), tone))
        hair = find_loose_hair(pixels, DISC, MARGIN)
        found, there = found + (hair & middle).sum(), there + middle.sum()
        others.append((hair & (_apart(middle) > 6)).mean())
    assert found > 0.85 * there
    assert max(others) < 0.001  # of the photo, where no hair is


@pytest.mark.parametrize(
    "ground", ["blurred", "brick", "grass", "gravel", "wood", "street", "edge", "wire"]
)
def test_the_lines_of_a_background_are_no_hair(ground: str):
    pixels = _mixed(_ground(ground, np.random.default_rng(0)), (DISC.astype(np.float32), 30))
    assert find_loose_hair(pixels, DISC, MARGIN).sum() < 0.005 * DISC.sum()


def test_only_what_ends_in_hair_has_hair_beside_it():
    """What begins at a crisp edge, or at one out of focus, is a cable, a twig or a handle."""
    cover, middle = _hairs(0)
    ground = _ground("blurred", np.random.default_rng(0))
    for blur in (0.7, 3.0):
        alpha = cv2.GaussianBlur(DISC.astype(np.float32), (0, 0), blur)
        pixels = _mixed(ground, (cover, 20), (alpha, 120))
        matte = Matte(0, 0, alpha, np.repeat(alpha[..., None], 3, 2))
        assert with_loose_hair(pixels, matte) is matte
    fur = _fur()
    pixels = _mixed(ground, (cover, 20), (fur, 120))
    hairy = with_loose_hair(pixels, Matte(0, 0, fur, np.repeat(fur[..., None], 3, 2)))
    alpha = crop(hairy.alpha, hairy.box, (0, 0, WIDTH, HEIGHT))
    assert np.array_equal(alpha[fur > 0], fur[fur > 0])
    assert (alpha[middle & (fur <= 0)] > 0.2).mean() > 0.8


def test_between_dark_hairs_a_bright_wall_is_no_bright_hair_and_in_a_tuft_none_is_missing():
    wall, fur = np.full((HEIGHT, WIDTH, 3), 200, np.float32), _fur()
    matte = Matte(0, 0, fur, np.full((*fur.shape, 3), np.float32(60 / 255)))
    brighter, found = [], []
    for seed in range(6):
        cover = _tuft(np.random.default_rng(seed))
        hairy = with_loose_hair(_mixed(wall, (cover, 40), (fur, 60)), matte)
        alpha, tone = (
            crop(part, hairy.box, (0, 0, WIDTH, HEIGHT))
            for part in (hairy.alpha, hairy.foreground.mean(-1))
        )
        redrawn = 200 + alpha * (255 * tone - 200)
        brighter.append(redrawn[fur <= 0].max() - 200)
        there = (fur <= 0) & (cover > 0.5) & (AWAY < RADIUS + 30)
        found.append((redrawn[there] < 120).mean())
    assert np.mean(brighter) < 7  # levels
    assert np.mean(found) > 0.75


def _tuft(rng: np.random.Generator, count: int = 8) -> F32:
    """(h, w) how much of each pixel hairs side by side cover above the disc, and others below."""
    cover = np.zeros((4 * HEIGHT, 4 * WIDTH), np.uint8)
    for angle in rng.normal(-0.9, 0.08, count):
        steps = np.linspace(0, rng.uniform(25, 45), 20)
        angles = angle + 0.004 * steps
        lines = np.stack([240 + (78 + steps) * np.cos(angles), 190 + (78 + steps) * np.sin(angles)])
        cv2.polylines(cover, [np.rint(4 * lines.T).astype(np.int32)], False, 255, 4, cv2.LINE_AA)
    small = cv2.resize(cover, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA) / np.float32(255)
    below = np.indices((HEIGHT, WIDTH))[0] > 240
    return np.asarray(np.maximum(small, _hairs(0)[0] * below), np.float32)


def _furry() -> tuple[np.ndarray, Matte]:
    """A photo (h, w, 3) of fur with loose hairs on a blurred ground, and its cut-out."""
    cover, _ = _hairs(0)
    fur = _fur()
    pixels = _mixed(_ground("blurred", np.random.default_rng(0)), (cover, 20), (fur, 120))
    return pixels, Matte(0, 0, fur, np.repeat(fur[..., None], 3, 2))


def test_in_tiles_as_on_a_large_photo_it_is_the_same(monkeypatch):
    pixels, matte = _furry()
    whole = with_loose_hair(pixels, matte)
    assert whole is not matte
    monkeypatch.setattr(loose_hair, "TILE", 50)
    tiled = with_loose_hair(pixels, matte)
    assert tiled.box == whole.box
    # A window's sums begin elsewhere, and alpha below the faintest is nothing at all.
    assert ((tiled.alpha > 0) != (whole.alpha > 0)).mean() < 1e-4
    both = (tiled.alpha > 0) & (whole.alpha > 0)
    assert np.abs(tiled.alpha - whole.alpha)[both].max() < 1e-3
    assert np.abs(tiled.foreground - whole.foreground)[both].max() < 1e-3


def test_of_a_large_photo_no_more_is_taken_for_hair_than_of_the_smaller_one(monkeypatch):
    """Lines are wider there, so that their px count for less beside an outline's length."""
    pixels, matte = _furry()
    hairy = with_loose_hair(pixels, matte)
    monkeypatch.setattr(masks, "ENOUGH", WIDTH * HEIGHT // 100**2)
    assert with_loose_hair(pixels, matte) is matte is not hairy


@pytest.fixture(scope="module")
def hairy() -> tuple[Document, F32, Mask]:
    """A lifted furry ball with dark long hair, what is behind it, and where its hair is."""
    cover, middle = _hairs(1)
    ground = _ground("blurred", np.random.default_rng(1))
    pixels, view = _mixed(ground, (cover, 20), (_fur(), 120)), camera(WIDTH, HEIGHT)
    document = Document(Photo(Picture(pixels), view, png(pixels), "ball.png"))
    document = edits.set_mask(edits.add_object(document), 0, DISC, Prompt())
    document = edits.set_lifted(document, 0, *lift_mask(pixels, view, DISC, "relief"))
    plate = make_plate(pixels, plate_cover(document), "telea")
    upper = np.indices(middle.shape)[0] < CENTRE[1]  # what is at the foot may be in a shadow
    return edits.set_plate(document, plate), ground, middle & (AWAY > RADIUS + 12) & upper


def test_hair_goes_along_and_leaves_nothing(hairy: tuple[Document, F32, Mask]):
    document, ground, middle = hairy
    pixels = document.photo.pixels
    assert np.array_equal(composite(document).pixels, pixels)
    before = np.abs(pixels - ground).mean(-1)[middle].mean()
    for placement in (Placement(move=(MOVED, 0)), Placement(turn=(20.0, 0.0, 0.0))):
        picture = composite(edits.set_placement(document, 0, placement)).pixels
        away = middle & (np.abs(picture - ground).mean(-1) < 60)  # not below the ball, as it is now
        assert away.sum() > 0.3 * middle.sum()
        assert np.abs(picture - ground).mean(-1)[away].mean() < 0.3 * before
    moved = composite(edits.set_placement(document, 0, Placement(move=(MOVED, 0)))).pixels
    there = np.roll(middle, MOVED, 1)
    darker = cv2.dilate((ground - moved).mean(-1), np.ones((3, 3), np.uint8))  # it is nearer now
    assert darker[there].mean() > 0.6 * (ground - pixels).mean(-1)[middle].mean()
