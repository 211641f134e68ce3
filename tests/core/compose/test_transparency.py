"""Objects cut out of photos that are transparent around them, moved over clear ground."""

from __future__ import annotations

import io
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose import load
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.order import holes
from objectmorpher_core.compose.plate.plate import plate_cover, plate_of_holes
from objectmorpher_core.compose.plate.repair import fill_patch, margin_of, patch_of, with_patch
from objectmorpher_core.document import edits
from objectmorpher_core.document.bounds import MODES
from objectmorpher_core.document.model import Document, LiftSettings, Photo, Placement, Prompt
from objectmorpher_core.document.settings import Finish, Shadow
from objectmorpher_core.document.transparency import (
    continued,
    on_checker,
    seen,
    seen_plate,
    with_opacity,
)
from objectmorpher_core.lift.refitting import Lifted, background_of, refit
from objectmorpher_core.lift.registration.imported import ImportTarget
from objectmorpher_core.pictures.image import Picture, encode_picture, read_picture
from objectmorpher_core.pipeline import lift_mask, make_plate, replay
from objectmorpher_core.scripting.animation import Clip, frames
from objectmorpher_core.scripting.outputs import Export, output_picture
from objectmorpher_core.session.file import decode_session, encode_session
from tests.core.compose.stacked import stacked
from tests.photos import photo
from tests.tree import quick

SIZE = 240, 160  # px
GROUNDS = np.array([[0, 255, 0], [255, 0, 255]]) / 255
MOVE = 24, -18  # px
KINDS = {  # bits, softness of the edge in px, how opaque it is, whether it is grey
    "8 bits, soft": (8, 1.5, 1.0, False),
    "16 bits, blurred": (16, 3.0, 1.0, False),
    "grey, 16 bits": (16, 1.5, 1.0, True),
    "hard": (8, 0.0, 1.0, False),
    "seen through": (8, 1.5, 0.6, False),
    "grey": (8, 1.5, 1.0, True),
}
kinds = pytest.mark.parametrize("kind", quick(KINDS, 3))
SHAPE = LiftSettings(8000, trust=0)  # what it is does not matter here: no network tells it


def _cut_out(kind: str) -> tuple[Picture, np.ndarray]:
    """The middle of a real photo on clear ground, black beneath, and a hard mask of it."""
    bits, softness, opacity, is_grey = KINDS[kind]
    pixels = cv2.resize(photo("chelsea"), SIZE, interpolation=cv2.INTER_AREA)
    if is_grey:
        pixels = np.repeat(pixels[..., 1:2], 3, axis=2)
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    away = np.hypot((x - 0.45 * SIZE[0]) / (0.2 * SIZE[0]), (y - 0.58 * SIZE[1]) / (0.26 * SIZE[1]))
    mask = away < 1
    alpha = mask.astype(np.float32)
    if softness:
        alpha = cv2.GaussianBlur(alpha, (0, 0), softness)
    levels = np.rint(255 * opacity * alpha).astype(np.uint8)
    pixels = np.where(levels[..., None] > 0, pixels, np.uint8(0))
    if bits == 16:
        pixels, levels = (part.astype(np.uint16) * np.uint16(257) for part in (pixels, levels))
    return Picture(pixels, levels, is_grey=is_grey), mask


def lifted(picture: Picture, mask: np.ndarray) -> Document:
    """Lifted as seen from afar, so that what moves is only moved; with its background."""
    camera = Camera.from_fov(*mask.shape[::-1], 2.0)
    document = Document(Photo(picture, camera, encode_picture(picture, ".png"), "cut.png"))
    document = edits.set_mask(edits.add_object(document), 0, mask, Prompt())
    selection = document.objects[0].selection
    assert selection is not None
    made = lift_mask(picture.pixels, camera, selection, "relief", SHAPE)
    document = edits.set_lifted(document, 0, *made)
    covered = plate_cover(document)
    return edits.set_plate(document, make_plate(continued(picture, covered), covered, "telea"))


@cache
def _scene(kind: str) -> Document:
    return lifted(*_cut_out(kind))


def _moved(document: Document, move: tuple[int, int] = MOVE) -> Document:
    return edits.set_placement(document, 0, Placement(move=move))


def _shifted(image: np.ndarray) -> np.ndarray:
    matrix = np.array([[1, 0, MOVE[0]], [0, 1, MOVE[1]]], np.float32)
    return cv2.warpAffine(image, matrix, SIZE, flags=cv2.INTER_NEAREST)


def _laid(pixels: np.ndarray, alpha: np.ndarray, ground: np.ndarray) -> np.ndarray:
    """(H, W, 3) of 255: straight colours on plain ground."""
    top = np.iinfo(pixels.dtype).max
    share = alpha[..., None] / top
    return 255 * (share * (pixels / top) + (1 - share) * ground)


@kinds
def test_a_cut_out_that_is_moved_is_the_cut_out_elsewhere(kind: str):
    """On green and on magenta, also at its edge; and where it was there is nothing left."""
    picture = _scene(kind).photo.picture
    result = composite(_moved(_scene(kind)))
    assert result.alpha is not None and picture.alpha is not None
    assert result.alpha.dtype == picture.alpha.dtype
    pixels, alpha = _shifted(picture.pixels), _shifted(picture.alpha)
    there = (alpha > 0) | (result.alpha > 0)
    for ground in GROUNDS:
        off = np.abs(_laid(result.pixels, result.alpha, ground) - _laid(pixels, alpha, ground))
        assert off[there].mean() < 3 and np.percentile(off[there], 99) < 20
    left = (picture.alpha > 0) & (alpha == 0) & (cv2.dilate(alpha, np.ones((5, 5))) == 0)
    assert left.sum() > 1000
    assert result.alpha[left].max() == 0


@pytest.mark.parametrize("kind", ["8 bits, soft", "16 bits, blurred"])
def test_no_black_comes_into_a_soft_edge(kind: str):
    document = _scene(kind)
    light = np.full_like(document.photo.pixels, np.iinfo(document.photo.pixels.dtype).max)
    alpha = document.photo.picture.alpha
    assert alpha is not None
    light[alpha == 0] = 0
    picture = replace(document.photo.picture, pixels=light)
    result = composite(_moved(lifted(picture, _cut_out(kind)[1])))
    assert result.alpha is not None
    top = np.iinfo(alpha.dtype).max
    soft = (result.alpha > 0.1 * top) & (result.alpha < 0.9 * top)
    assert soft.sum() > 100
    assert result.pixels[soft].min() > 0.9 * top
    is_recoloured, is_other = (result.pixels != light).any(-1), result.alpha != alpha
    assert (is_other & ~is_recoloured).sum() > 100
    assert result.changed == (is_other | is_recoloured).sum()


@kinds
def test_what_does_not_move_keeps_its_bytes(kind: str):
    document = _scene(kind)
    picture, result = document.photo.picture, composite(document)
    assert np.array_equal(result.pixels, picture.pixels)
    assert np.array_equal(result.alpha, picture.alpha)
    back = composite(_moved(_moved(document), (0, 0)))
    assert np.array_equal(back.pixels, picture.pixels) and np.array_equal(back.alpha, picture.alpha)


def test_colours_under_clear_ground_stay_beside_the_edit():
    """Black, grey and white, a third each."""
    picture, mask = _cut_out("8 bits, soft")
    assert picture.alpha is not None
    hidden = np.repeat(np.array([0, 90, 255], np.uint8), SIZE[0] // 3)[:, None]
    pixels = np.where(picture.alpha[..., None] > 0, picture.pixels, hidden)
    picture = replace(picture, pixels=pixels)
    result = composite(_moved(lifted(picture, mask)))
    assert result.alpha is not None
    far = ~result.footprint | ((result.alpha == 0) & (picture.alpha == 0))
    assert far.any() and np.array_equal(result.pixels[far], pixels[far])
    assert np.array_equal(result.alpha[~result.footprint], picture.alpha[~result.footprint])
    assert result.outside_footprint_changed == 0


@cache
def _beside_clear_ground() -> Document:
    """The same on opaque ground that ends beside it; magenta is what nobody sees."""
    _, mask = _cut_out("hard")
    is_clear = np.broadcast_to(np.arange(SIZE[0]) >= 175, mask.shape)
    pixels = cv2.resize(photo("chelsea"), SIZE, interpolation=cv2.INTER_AREA)
    pixels = np.where(is_clear[..., None], np.uint8([255, 0, 255]), pixels)
    return lifted(Picture(pixels, np.where(is_clear, 0, 255).astype(np.uint8)), mask)


def _magenta(document: Document) -> int:
    """How much of the picture is of the colour that nobody is to see."""
    picture = composite(document)
    assert picture.alpha is not None
    red, green, blue = np.moveaxis(picture.pixels.astype(int), -1, 0)
    return int(((red > green + 40) & (blue > green + 60) & (picture.alpha > 0)).sum())


def test_a_repair_copies_nothing_from_under_clear_ground():
    document = _moved(_beside_clear_ground(), (-40, 0))
    coverage = np.zeros(SIZE[::-1], np.float32)
    coverage[80:110, 160:175] = 1
    patch = patch_of(document, coverage, (160, 80, 175, 110))
    patch = fill_patch(patch, margin_of(document), load("telea"))
    repaired = edits.set_plate(document, with_patch(document, patch, "telea"))
    assert repaired.plate is not None and repaired.plate.painted is not None
    assert _magenta(repaired) == _magenta(document) == 0


def test_a_refined_mask_is_filled_behind_with_nothing_from_under_clear_ground():
    document = _moved(_beside_clear_ground(), (-40, 0))
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    grown = document.objects[0].mask | ((np.abs(x - 164) < 10) & (np.abs(y - 93) < 14))
    changed = edits.change_mask(document, 0, grown)
    item, opened = changed.objects[0], changed.photo
    was = Lifted(item.shaped, item.matte, item.lifted, item.shape)
    scene = ImportTarget(opened.pixels, opened.camera, item.selection)
    answer = refit(was, scene, background_of(changed, 0, "telea"))
    refitted = edits.refit(changed, 0, answer.matte, answer.lifted, answer.plate)
    assert (refitted.plate.hole.sum() > document.plate.hole.sum()) and _magenta(refitted) == 0


def test_behind_an_object_the_alpha_around_it_goes_on():
    """Half of the ground is opaque, half is clear: so is what is filled in."""
    pixels = cv2.resize(photo("coffee"), SIZE, interpolation=cv2.INTER_AREA)
    _, mask = _cut_out("hard")
    alpha = np.where((np.arange(SIZE[0]) < 0.45 * SIZE[0]) | mask, 255, 0).astype(np.uint8)
    result = composite(_moved(lifted(Picture(pixels, alpha), mask), (400, 0)))
    assert result.alpha is not None
    rows = np.flatnonzero(mask.any(1))
    middle = result.alpha[rows[0] : rows[-1]]
    assert set(np.unique(middle)) <= {0, 255}
    assert (middle[:, : round(0.3 * SIZE[0])] == 255).all()
    assert (middle[:, round(0.6 * SIZE[0]) :] == 0).all()
    filled = result.pixels[mask & (result.alpha > 0)]
    assert filled.mean() > 10, "in the colours of what is seen"


def test_over_other_things_an_object_lies_as_glass_does():
    document = _scene("seen through")
    alpha = document.photo.picture.alpha
    assert alpha is not None
    opaque = alpha.copy()
    opaque[:60, 140:] = 255
    pixels = document.photo.pixels.copy()
    pixels[:60, 140:] = (0, 0, 200)
    picture = replace(document.photo.picture, pixels=pixels, alpha=opaque)
    moved = composite(_moved(lifted(picture, _cut_out("seen through")[1]), (60, -55)))
    assert moved.alpha is not None
    assert (moved.alpha[5:50, 150:230] == 255).all(), "no hole in what lies below"
    changed = (moved.pixels[5:50, 150:230] != pixels[5:50, 150:230]).any(-1)
    assert changed.sum() > 300
    assert moved.pixels[5:50, 150:230][changed][:, 2].mean() > 60, "which shows through"


def test_a_shadow_falls_on_clear_ground_as_translucent_black():
    document = _moved(_scene("8 bits, soft"))
    plain, shaded = composite(document), composite(edits.set_shadow(document, 0, Shadow(0.8)))
    assert plain.alpha is not None and shaded.alpha is not None
    is_shadow = (shaded.alpha > 20) & (plain.alpha == 0)
    assert is_shadow.sum() > 200
    assert shaded.alpha[is_shadow].max() < 255
    assert shaded.pixels[is_shadow].max() < 60
    assert (shaded.alpha >= plain.alpha).all()


def test_an_opaque_alpha_channel_changes_nothing():
    _, mask = _cut_out("hard")
    pixels = cv2.resize(photo("chelsea"), SIZE, interpolation=cv2.INTER_AREA)
    with_alpha, without = (
        composite(_moved(lifted(Picture(pixels, alpha), mask)))
        for alpha in (np.full(mask.shape, 255, np.uint8), None)
    )
    assert without.alpha is None
    assert (with_alpha.alpha == 255).all()
    assert np.abs(with_alpha.pixels.astype(int) - without.pixels).max() <= 1
    assert with_alpha.changed == pytest.approx(without.changed, abs=20)


def test_a_cut_out_is_limited_once():
    document = _scene("seen through")
    item = document.objects[0]
    assert item.matte is not None
    again = with_opacity(item.matte, document.photo.picture, item.mask)
    assert again is item.matte


@pytest.mark.parametrize("kind", ["8 bits, soft", "grey, 16 bits"])
def test_every_way_out_gives_the_same(kind: str, tmp_path: Path):
    document = _moved(_scene(kind))
    opened = decode_session(encode_session(document))
    edited, again = replay(document), replay(opened)
    for ending in (".png", ".tif", ".webp", ".jxl", ".avif"):
        path = tmp_path / f"made{ending}"
        one, two = (Export(e.document, e).encode("photo", path) for e in (edited, again))
        assert one == two
        found = read_picture(one)
        assert found.alpha is not None and edited.picture.alpha is not None
        if ending in (".png", ".tif"):
            assert np.array_equal(found.alpha, edited.picture.alpha)
            assert np.array_equal(found.pixels, edited.picture.pixels)
    plate = output_picture("plate", edited)
    assert plate.alpha is not None and plate.alpha.max() == 0


@pytest.mark.parametrize("ending", [".psd", ".ora"])
def test_layers_look_like_the_picture(ending: str, tmp_path: Path):
    """The pile, under its mask, on green and on magenta."""
    document = edits.set_shadow(_moved(_scene("8 bits, soft")), 0, Shadow(0.5))
    result = composite(document)
    assert result.alpha is not None
    merged, pile = Export(document).layers(lambda *_: None)
    assert np.array_equal(merged.alpha, result.alpha)
    picture = stacked(pile)
    for ground in GROUNDS:
        off = _laid(picture.round().astype(np.uint8), result.alpha, ground)
        assert np.abs(off - _laid(result.pixels, result.alpha, ground)).max() <= 3
    assert Export(document).encode("layers", tmp_path / f"made{ending}")


@cache
def _half_clear() -> Document:
    """The same on ground of which a third is opaque, a third half transparent, a third clear."""
    _, mask = _cut_out("hard")
    ground = np.repeat(np.array([255, 128, 0], np.uint8), SIZE[0] // 3)
    alpha = np.where(mask, 255, ground).astype(np.uint8)
    pixels = cv2.resize(photo("coffee"), SIZE, interpolation=cv2.INTER_AREA)
    return lifted(Picture(pixels, alpha), mask)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("move", [(-40, -10), (20, -18), (95, 0)])
def test_mixed_layers_look_like_the_picture_over_ground_that_is_not_opaque(mode, move):
    """Over nothing an object has its own colours, in whatever way it is mixed; so in the pile."""
    document = edits.set_finish(_moved(_half_clear(), move), 0, Finish(blend_mode=mode))
    merged, pile = Export(document).layers(lambda *_: None)
    assert merged.alpha is not None
    off = np.abs(stacked(pile) - merged.pixels).max(-1) * (merged.alpha / 255)
    assert off.max() <= 3
    assert mode in {layer.mode for layer in pile}


def test_in_a_film_the_alpha_moves_too(tmp_path: Path):
    document, clip = _moved(_scene("8 bits, soft")), Clip(seconds=1.0, rate=6)
    found, before, after = list(frames(document, clip)), document.photo.picture, composite(document)
    assert np.array_equal(found[0], np.dstack([before.pixels, before.alpha]))
    made = np.dstack([after.pixels, after.alpha])
    assert any(np.array_equal(frame, made) for frame in found), "it comes to the edit"
    small = next(frames(document, replace(clip, longest=SIZE[0] // 2)))
    assert small.shape == (SIZE[1] // 2, SIZE[0] // 2, 4)
    soft = (small[..., 3] > 60) & (small[..., 3] < 200)
    inner = small[small[..., 3] == 255][:, :3].mean()
    assert small[soft][:, :3].mean() > 0.7 * inner, "no black comes into its edge"
    data = Export(document, clip=clip).encode("video", tmp_path / "made.webp")
    with Image.open(io.BytesIO(data)) as image:
        assert image.n_frames == len(found)


def test_on_the_canvas_clear_ground_is_a_checker():
    picture, _ = _cut_out("8 bits, soft")
    assert picture.alpha is not None
    shown = on_checker(picture.pixels, picture.alpha, SIZE)
    clear, solid = picture.alpha == 0, picture.alpha == 255
    assert np.array_equal(shown[solid], picture.pixels[solid])
    assert len(np.unique(shown[clear], axis=0)) == 2
    part = on_checker(picture.pixels[30:, 50:], picture.alpha[30:, 50:], SIZE, 50, 30)
    assert np.array_equal(part, shown[30:, 50:]), "a part of it lies on the same squares"


@kinds
def test_the_canvas_shows_what_the_file_holds(kind: str):
    """The background of the view, and an object over it, on the checker's squares."""
    document = _moved(_scene(kind))
    photo, gone = document.photo, holes(document)
    plate = seen_plate(photo, plate_of_holes(document, gone), gone)
    assert plate is not None
    x0, y0, x1, y1 = plate.box
    canvas = seen(photo).copy()
    canvas[y0:y1, x0:x1] = plate.pixels
    top = np.iinfo(canvas.dtype).max
    alone = output_picture("object", replay(document))
    share = alone.alpha[..., None] / top
    canvas = share * alone.pixels + (1 - share) * canvas
    result = composite(document)
    off = np.abs(canvas - on_checker(result.pixels, result.alpha, SIZE)).max(-1)
    assert off.mean() < 0.005 * top and np.percentile(off, 99) < 0.03 * top
