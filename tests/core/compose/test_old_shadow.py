"""The shadow in the photo: found where there is one, lifted off the ground, thrown again."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from skimage import data

from objectmorpher_core.compose import load
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.shadow.old_shadow import OldShadow, traceless_plate, without_shadow
from objectmorpher_core.compose.shadow.shadow import DARKEST
from objectmorpher_core.compose.shadow.shadow_fit import find_old_shadow
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Matte, Placement
from objectmorpher_core.pipeline import run_script
from objectmorpher_core.scripting.options import script_from
from objectmorpher_core.segment.matting.matte import build_matte
from tests import shapes
from tests.shadow_scenes import scene
from tests.shadowed import (
    DARK,
    FOOT,
    HEIGHT,
    MIDDLE,
    RADII,
    WIDTH,
    ground_of,
    inside,
    photo_of,
    thrown,
)
from tests.tree import quick

WAYS = [(35.0, 0.8), (150.0, 0.8), (-20.0, 1.1)]  # degrees and lengths of shadows


def _matte() -> Matte:
    soft = cv2.GaussianBlur(inside().astype(np.float32), (0, 0), 0.7)
    return Matte(0, 0, soft, np.full((HEIGHT, WIDTH, 3), 0.5, np.float32))


_known: dict[bytes, OldShadow | None] = {}  # by the photo: several tests begin with the same


def _found(pixels: np.ndarray) -> OldShadow:
    if (key := pixels.tobytes()) not in _known:
        _known[key] = find_old_shadow(pixels, _matte())
    old = _known[key]
    assert old is not None
    return old


@pytest.mark.parametrize(("direction", "length"), quick(WAYS[::-1], 2))
def test_a_shadow_is_found_with_its_direction_and_length(direction, length):
    shadow = _found(photo_of(thrown(direction, length))).shadow
    assert abs((shadow.direction - direction + 180) % 360 - 180) < 25
    assert length / 1.5 < shadow.length < length * 1.5
    assert 0.4 < shadow.strength < 0.85


@pytest.mark.parametrize("direction", quick([35.0, 150.0], 1))
@pytest.mark.parametrize("taken", quick([0.2, 0.3, 0.4], 2))
@pytest.mark.parametrize("touching", quick([0.9, 0.6], 1))
def test_a_dark_contact_does_not_darken_the_whole_shadow(direction, taken, touching):
    """A faint shadow of a thing beneath which it is nearly black stays as faint."""
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    foot, half = MIDDLE[0], RADII[0]
    contact = np.exp(-(((x - foot) / half) ** 4) - ((y - FOOT) / 5) ** 2)
    dark = 1 - (1 - taken * thrown(direction, 0.8)) * (1 - touching * contact)
    shadow = _found(photo_of(dark, dark=1.0)).shadow
    assert DARKEST * shadow.strength == pytest.approx(taken, abs=0.08)
    assert shadow.contact > 0.4


def test_what_is_known_of_the_ground_is_used():
    """Seen from higher up, the same picture is that of a shadow that goes less towards the side."""
    pixels = photo_of(thrown(35.0, 0.8))
    usual, steep = _found(pixels), find_old_shadow(pixels, _matte(), None, 60.0)
    assert steep is not None
    assert usual.shadow.ground == 30.0 and steep.shadow.ground is None
    down = [
        np.sin(np.radians(s.direction)) * s.length * np.sin(np.radians(g))
        for s, g in ((usual.shadow, 30.0), (steep.shadow, 60.0))
    ]
    assert down[0] == pytest.approx(down[1], rel=0.5)


@pytest.mark.parametrize(("direction", "length"), quick(WAYS, 1))
@pytest.mark.parametrize("bits", quick([16, 8], 1))
def test_it_is_lifted_off_the_ground_that_stays_as_it_is(direction, length, bits):
    shade = thrown(direction, length)
    dark, lit = photo_of(shade), photo_of(None)
    scale = 1 if bits == 8 else 257
    kind = np.uint8 if bits == 8 else np.uint16
    dark, lit = dark.astype(kind) * kind(scale), lit.astype(kind) * kind(scale)
    box = (0, 0, WIDTH, HEIGHT)
    result, is_changed = without_shadow(dark, _found(dark), box)
    ground = cv2.dilate(inside().astype(np.uint8), np.ones((9, 9))) == 0
    true = (shade > 0.3) & ground
    before, after = (np.abs(p.astype(float) - lit)[true].mean() / scale for p in (dark, result))
    assert after < 0.4 * before
    assert np.array_equal(result[~is_changed], dark[~is_changed])
    far = (shade < 0.004) & ground & (cv2.blur(shade, (41, 41)) < 0.004)
    assert is_changed[far].mean() < 0.02
    # Its grain stays where it was: the ground is lit, not invented.
    fine = [p.astype(float) - cv2.GaussianBlur(p.astype(float), (0, 0), 2) for p in (lit, result)]
    assert np.corrcoef(fine[0][true].ravel(), fine[1][true].ravel())[0, 1] > 0.8


@pytest.mark.parametrize("seed", quick(range(4), 1))
def test_an_even_ground_has_no_shadow(seed):
    assert find_old_shadow(photo_of(None, ground_of(seed)), _matte()) is None


def test_another_colour_is_no_shadow():
    """A blue cloth that lies where a shadow would."""
    shade, ground = thrown(35.0, 0.8)[..., None], ground_of()
    cloth = ground * np.array([0.25, 0.5, 1.3])
    assert find_old_shadow(photo_of(None, ground + shade * (cloth - ground)), _matte()) is None


def test_on_a_ground_of_many_things_nothing_is_told():
    rng = np.random.default_rng(1)
    patches = rng.uniform(0.02, 1, (10, 13, 3)).repeat(20, 0).repeat(20, 1)
    assert find_old_shadow(photo_of(thrown(35.0, 0.8), patches), _matte()) is None


def test_what_fills_or_leaves_the_photo_is_no_error():
    pixels = photo_of(thrown(35.0, 0.8))

    def solid(left: int, top: int, width: int, height: int, alpha: float = 1) -> Matte:
        colours = np.zeros((height, width, 3), np.float32)
        return Matte(left, top, np.full((height, width), alpha, np.float32), colours)

    assert find_old_shadow(pixels, solid(0, 0, WIDTH, HEIGHT)) is None
    find_old_shadow(pixels, solid(-40, 150, 80, 90))
    assert find_old_shadow(pixels, solid(20, 20, 9, 9, alpha=0)) is None


def test_what_the_photo_cuts_off_below_stands_on_no_ground_that_one_sees():
    pixels, whole = photo_of(thrown(35.0, 0.8)), _matte()
    for rows in (125, 60):  # its foot is at 132
        matte = Matte(0, 0, whole.alpha[:rows], whole.foreground[:rows])
        assert find_old_shadow(pixels[:rows], matte) is None


@pytest.mark.parametrize("taken", [DARK, 0.9])
def test_the_background_is_without_it(taken):
    """Also where the shadow is so dark that the ground has to be invented."""
    shade = thrown(35.0, 0.8)
    dark, lit = photo_of(shade, dark=taken), photo_of(None)
    covered = cv2.dilate(inside().astype(np.uint8), np.ones((5, 5))) > 0
    plate = traceless_plate(dark, covered, (_found(dark),), load("telea"))
    x0, y0, x1, y1 = plate.box
    assert plate.painted is not None
    assert not (plate.painted & covered[y0:y1, x0:x1]).any()
    assert np.array_equal(plate.pixels[~plate.hole], dark[y0:y1, x0:x1][~plate.hole])
    whole = dark.copy()
    np.copyto(whole[y0:y1, x0:x1], plate.pixels, where=plate.hole[..., None])
    error = np.abs(whole.astype(float) - lit).mean(-1)
    assert error[(shade > 0.3) & ~covered].mean() < 0.4 * np.abs(dark.astype(float) - lit).mean(-1)[
        (shade > 0.3) & ~covered
    ].mean()  # fmt: skip


@pytest.mark.slow
def test_a_script_that_moves_a_thing_takes_its_shadow_along():
    dark = photo_of(thrown(35.0, 0.8))
    script = {"move": [-70, 0], "inpaint": "telea", "gaussians": 800}
    photo, mask = shapes.png(dark), shapes.mask_png(inside())
    with_it = run_script(photo, "a.png", script_from(script), mask)
    without = run_script(photo, "a.png", script_from(script | {"shadow": "none"}), mask)
    assert with_it.document.objects[0].shadow.strength > 0.4
    assert without.document.objects[0].shadow.strength == 0
    old = (thrown(35.0, 0.8) > 0.3) & ~cv2.dilate(inside().astype(np.uint8), np.ones((9, 9))) > 0
    lit = photo_of(None).astype(float)
    error = [np.abs(e.composite.pixels.astype(float) - lit)[old].mean() for e in (with_it, without)]
    assert error[0] < 0.5 * error[1]
    told, silent = with_it.report(), without.report()
    assert told["pixels"]["outside_footprint_changed"] == 0
    assert told["pixels"]["shadow"] > 300 > silent["pixels"]["shadow"]
    assert any("goes along" in n and "shadow none" in n for n in told["notes"])
    assert not silent["notes"]
    said = run_script(photo, "a.png", script_from(script | {"seen_from": 45}), mask)
    own = said.document.objects[0]
    assert own.shadow.strength > 0.4 and own.grounded_shadow.ground == 45
    turned = run_script(
        photo, "a.png", script_from({**script, "move": [0, 0], "turn": [9, 0, 0]}), mask
    )
    assert turned.document.objects[0].shadow.strength == 0  # it stands where it stood


def test_put_back_the_photo_is_there_again():
    dark = photo_of(thrown(35.0, 0.8))
    script = script_from({"move": [-70, 0], "inpaint": "telea", "gaussians": 800})
    moved = run_script(shapes.png(dark), "a.png", script, shapes.mask_png(inside())).document
    back = edits.set_placement(moved, 0, Placement())
    assert np.array_equal(composite(back).pixels, dark)
    still = replace(moved.objects[0], placement=Placement(), pose=None)
    assert np.array_equal(composite(moved.with_object(0, still)).pixels, dark)


def test_the_cup_on_the_table():
    """scikit-image's coffee: the saucer's shadow lies below it, and the table gets even there."""
    photo = data.coffee()
    x, y = np.meshgrid(np.arange(600), np.arange(400))
    saucer = ((x - 277) / 201) ** 2 + ((y - 214) / 177) ** 2 < 1
    foreground = photo.astype(np.float32) / 255
    matte = Matte(0, 0, cv2.GaussianBlur(saucer.astype(np.float32), (0, 0), 1.0), foreground)
    old = find_old_shadow(photo, matte)
    assert old is not None
    assert 45 < old.shadow.direction < 135  # towards the viewer
    result, _ = without_shadow(photo, old, (0, 0, 600, 400))
    lit, shaded = np.s_[330:390, 500:560], np.s_[372:398, 130:180]
    means = [p[where].mean() for p in (photo, result) for where in (lit, shaded)]
    assert means[1] < 0.4 * means[0]
    assert 0.55 * means[2] < means[3] < means[2]


SHADOWLESS, SHADED = (0, 2, 4, 11, 12, 14, 16, 17), (1, 5, 13)  # seeds of scenes


@pytest.mark.slow
def test_what_is_dark_beside_a_thing_without_a_shadow_is_none():
    """Neighbours, walls, edges of another material and busy grounds, photographed and drawn."""
    found = {}
    for seed in (*SHADOWLESS, *SHADED):
        made = scene(seed)
        assert made.has_shadow == (seed in SHADED)
        found[seed] = find_old_shadow(made.photo, build_matte(made.photo, made.mask, 20))
    assert all(found[seed] is None for seed in SHADOWLESS)
    assert any(found[seed] is not None for seed in SHADED)


def test_no_shadow_is_taken_off_another_material():
    """A red book that lies in the shadow keeps its light."""
    shade, book = thrown(35.0, 0.8), np.zeros((HEIGHT, WIDTH), bool)
    book[150:165, 165:190] = True
    ground = np.where(book[..., None], (0.6, 0.1, 0.1), ground_of())
    dark = photo_of(shade, ground)
    missing = _found(dark).missing((0, 0, WIDTH, HEIGHT))
    inner = cv2.erode(book.astype(np.uint8), np.ones((5, 5))) > 0
    assert missing[inner].max() < 0.1 < 0.3 < missing[(shade > 0.7) & ~book].mean()
