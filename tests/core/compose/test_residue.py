"""What an object leaves beside its cut-out: found where the true background is known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from skimage import data

from objectmorpher.canvas.derived import Derived
from objectmorpher_core import compose
from objectmorpher_core.base.arrays import F32, Mask, Pixels, crop
from objectmorpher_core.base.masks import box_of
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.order import holes
from objectmorpher_core.compose.plate import plate as plates
from objectmorpher_core.compose.plate.plate import (
    SEAM,
    build_plate,
    erased_beside,
    hole_margin,
    plate_cover,
    plate_crop,
    plate_of_holes,
)
from objectmorpher_core.compose.plate.repair import Uncovering, refitted_plate
from objectmorpher_core.compose.plate.residue import (
    find_ghosts,
    left_out,
    unlit_strip,
    with_parts,
)
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import (
    Click,
    Document,
    LiftSettings,
    Photo,
    Placement,
    Prompt,
)
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.segment.matting.matte import cut_out
from tests.photos import outlined, photo
from tests.shadow_scenes import scene
from tests.shapes import camera, png
from tests.tree import quick

HEIGHT, WIDTH = 360, 480
MARGIN = hole_margin(WIDTH, HEIGHT)
VISIBLE = 10  # levels by which a ghost differs from the background


@cache
def _scene(name: str, source: str, ground: str) -> tuple[Pixels, Pixels, Mask]:
    """A thing on a background: the photo, the background alone, and what the thing covers."""
    cut = cut_out(photo(source), outlined(name))
    rows, columns = np.flatnonzero((cut.alpha > 0).any(1)), np.flatnonzero((cut.alpha > 0).any(0))
    own = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    scale = min(0.5 * HEIGHT / len(rows), 0.5 * WIDTH / len(columns))
    size = (round(len(columns) * scale), round(len(rows) * scale))
    alpha, colour = (
        cv2.resize(part[own], size, interpolation=cv2.INTER_AREA)
        for part in (cut.alpha, cut.foreground)
    )
    top, left = (HEIGHT - size[1]) // 2, (WIDTH - size[0]) // 2
    there = np.s_[top : top + size[1], left : left + size[0]]
    whole, full = np.zeros((HEIGHT, WIDTH), np.float32), np.zeros((HEIGHT, WIDTH, 3), np.float32)
    whole[there], full[there] = alpha, colour
    behind = background(ground)
    mixed = behind / np.float32(255) * (1 - whole[..., None]) + full * whole[..., None]
    return np.rint(mixed * 255).astype(np.uint8), behind, whole > 0.5


def background(name: str) -> Pixels:
    if name == "wood":
        picture = photo("coffee")[300:, 420:]
    elif name == "brick":
        picture = np.rint(data.brick()[..., None] * np.array([1, 0.7, 0.6])).astype(np.uint8)
    else:
        picture = photo("motorcycle")[300:]
    scale = max(HEIGHT / picture.shape[0], WIDTH / picture.shape[1])
    whole = cv2.resize(picture, None, fx=scale, fy=scale)
    return np.ascontiguousarray(whole[:HEIGHT, :WIDTH], np.uint8)


def _missing(own: Mask, kind: str) -> Mask:
    """A selection of what a thing covers that misses its foot, or its rim at the left."""
    if kind == "foot":
        selection = own.copy()
        selection[np.flatnonzero(own.any(1))[-1] - round(2 * MARGIN) :] = False
        return selection
    return own & np.roll(own, (round(0.6 * MARGIN), round(1.2 * MARGIN)), (0, 1))


def _away(mask: Mask) -> F32:
    px = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
    return np.asarray(px, np.float32)


SCENES = (
    ("cameraman", "camera", "brick"), ("patch", "astronaut", "street"),
    ("valve", "astronaut", "wood"), ("headlight", "motorcycle", "wood"),
)  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "scenes"), quick([("foot", SCENES[:2]), ("foot", SCENES), ("rim", SCENES)], 1)
)
def test_what_a_selection_missed_is_gone_from_the_plate(kind, scenes):
    before, after = 0.0, 0.0
    for name, source, ground in scenes:
        pixels, behind, own = _scene(name, source, ground)
        covered = _away(_missing(own, kind)) < 2
        plate = build_plate(pixels, covered, compose.load("telea"))
        picture = plate_crop(pixels, plate, (0, 0, WIDTH, HEIGHT))
        unlike = np.abs(pixels.astype(int) - behind).max(-1)
        ghost = (unlike > VISIBLE) & (_away(covered) > SEAM * MARGIN)
        assert ghost.sum() > 100, "there is something to be found"
        before += float(unlike[ghost].mean())
        after += float(np.abs(picture.astype(int) - behind).max(-1)[ghost].mean())
    assert after < {"foot": 0.4, "rim": 0.6}[kind] * before


@pytest.mark.parametrize(("name", "source", "ground"), quick(SCENES, 2))
def test_beside_a_good_selection_hardly_anything_is_replaced(name, source, ground):
    pixels, behind, own = _scene(name, source, ground)
    covered = _away(own) < 3
    fringe = (np.abs(pixels.astype(int) - behind).max(-1) > VISIBLE) & ~covered
    plate = build_plate(pixels, covered, compose.load("telea"))
    hole = np.zeros_like(own)
    hole[plate.top : plate.box[3], plate.left : plate.box[2]] = plate.hole
    needless = hole & (_away(covered) > SEAM * MARGIN) & (_away(fringe) > 3)
    assert needless.sum() < 0.06 * covered.sum()


def _strip(own: Mask) -> Mask:
    """Where a thing stands and no light falls: below most of its foot, a fifteenth of it high."""
    rows, columns = np.flatnonzero(own.any(1)), np.flatnonzero(own.any(0))
    strip = np.zeros(own.shape, np.uint8)
    middle, half = int(columns.mean()), (int(0.4 * len(columns)), int(0.07 * len(rows)))
    cv2.ellipse(strip, (middle, int(rows[-1])), half, 0, 0, 360, (1,), -1)
    return (strip > 0) & ~own


@pytest.mark.parametrize(("name", "source", "ground"), [SCENES[1], ("patch", "astronaut", "wood")])
def test_the_strip_without_light_below_a_thing_is_gone_where_it_stood(name, source, ground):
    """It is no source either: the fill is as light as the ground."""
    pixels, behind, own = _scene(name, source, ground)
    dark, strip = pixels.copy(), _strip(own)
    dark[strip] //= 5
    covered = _away(own) < 3
    seen = strip & (_away(covered) > SEAM * MARGIN)
    assert seen.sum() > 0.01 * own.sum()
    plates = [build_plate(p, covered, compose.load("patchmatch")) for p in (pixels, dark)]
    bright, picture = (
        plate_crop(p, plate, (0, 0, WIDTH, HEIGHT)).astype(float)
        for p, plate in zip((pixels, dark), plates, strict=True)
    )
    left = np.abs(picture - behind).mean(-1)[seen].mean()
    assert left < 0.3 * np.abs(dark.astype(float) - behind).mean(-1)[seen].mean()
    assert picture[own].mean() > 0.9 * bright[own].mean()


def test_it_stays_below_a_thing_that_turns_in_its_place():
    pixels, _, own = _scene(*SCENES[1])
    pixels = pixels.copy()
    strip = _strip(own)
    pixels[strip] //= 5
    document = _lifted(pixels, own)
    assert document.plate is not None
    hole = crop(document.plate.hole, document.plate.box, (0, 0, WIDTH, HEIGHT))
    foot = strip & (_away(own) > 2 * MARGIN)
    assert hole[foot].mean() > 0.9, "it is filled in"
    turned = edits.set_placement(document, 0, Placement(turn=(8.0, 0.0, 0.0)))
    assert (composite(turned).pixels[foot] == pixels[foot]).all(-1).mean() > 0.9


@pytest.mark.slow
def test_what_is_dark_on_a_ground_is_no_strip_without_light():
    """On made scenes in which a thing throws no shadow, and on which nothing was chosen."""
    scenes = [made for seed in range(1, 60, 2) if not (made := scene(seed)).has_shadow]
    found = 0
    for made in scenes:
        covered = cv2.dilate(made.mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        strip = unlit_strip(made.photo, covered, box_of(covered))
        found += bool((strip & ~covered).any())
    assert len(scenes) > 10 and found <= 1


@pytest.fixture(scope="module")
def footless() -> Document:
    """A lifted patch whose lower end was left out."""
    pixels, _, own = _scene("patch", "astronaut", "street")
    return _lifted(pixels, _missing(own, "foot"))


def _lifted(pixels: Pixels, mask: Mask) -> Document:
    """A document whose one object is what a mask covers, with a background behind it."""
    view = camera(WIDTH, HEIGHT)
    document = Document(Photo(Picture(pixels), view, png(pixels), "patch.png"))
    document = edits.set_mask(edits.add_object(document), 0, mask, Prompt())
    document = edits.set_lifted(document, 0, *lift_mask(pixels, view, mask, "relief"))
    covered = np.zeros_like(mask)
    matte = document.objects[0].matte
    assert matte is not None
    x0, y0, x1, y1 = matte.box
    covered[y0:y1, x0:x1] = matte.alpha > 0
    return edits.set_plate(document, build_plate(pixels, covered, compose.load("telea")))


def test_what_is_erased_beside_the_outline_is_counted_and_found(footless: Document):
    """A report and the command line say it: nobody sees it there."""
    _, _, own = _scene("patch", "astronaut", "street")
    missed = own & (_away(_missing(own, "foot")) > 0)
    away = edits.set_placement(footless, 0, Placement(move=(0.0, -120.0)))
    (found,) = erased_beside(away, holes(away))
    x, y = found.place
    assert missed[y, x] and found.owner == 0
    assert 0.5 * missed.sum() < found.like_px <= found.px < 1.5 * missed.sum()
    assert erased_beside(footless, holes(footless)) == ()


@pytest.mark.slow
def test_a_ghost_goes_with_what_stands_beside_it(footless: Document):
    pixels, behind, own = _scene("patch", "astronaut", "street")
    ghosts = find_ghosts(footless, SEAM * MARGIN)
    assert ghosts
    foot = own & (_away(_missing(own, "foot")) > 1.5 * MARGIN)
    unlike = np.abs(pixels.astype(int) - behind).max(-1)[foot].mean()

    def left(document: Document) -> float:
        return float(np.abs(composite(document).pixels.astype(int) - behind).max(-1)[foot].mean())

    away = edits.set_placement(footless, 0, Placement(move=(0.0, -120.0)))
    assert left(away) < 0.4 * unlike
    near = edits.set_placement(footless, 0, Placement(move=(0.0, -0.3)))
    assert left(near) > 0.9 * unlike, "what hardly moved leaves its foot where it is"


def test_the_fill_meets_what_stays_beside_an_object(footless: Document):
    """However unlike the photo it is, which lies beyond that: else a line of it would show."""
    plate, photo = footless.plate, footless.photo.pixels
    assert plate is not None
    black = replace(plate, pixels=np.where(plate.hole[..., None], 0, plate.pixels).astype(np.uint8))
    near = edits.set_placement(footless, 0, Placement(move=(0.0, -0.3)))
    near = edits.set_plate(near, black)
    ghosts = find_ghosts(near, SEAM * MARGIN)
    there = max(ghosts, key=lambda ghost: int(ghost.there.sum()))
    found = plate_of_holes(near, holes(near))
    assert found is not None
    stays = crop(there.there, there.box, (0, 0, *found.hole.shape[::-1]))
    seam = found.hole & ~stays & (_away(stays) < 1.5)
    x0, y0, x1, y1 = found.box
    off = np.abs(found.pixels.astype(float) - photo[y0:y1, x0:x1])[seam]
    assert seam.sum() > 20 and off.mean() < 0.35 * photo[y0:y1, x0:x1][seam].mean()


def test_a_drag_computes_the_shade_behind_an_object_once(footless, monkeypatch):
    """The window asks for every frame's background, from which other parts of ghosts are gone."""
    derived, made = Derived(), []
    inner = plates._in_shade
    monkeypatch.setattr(plates, "_in_shade", lambda *a: made.append(1) or inner(*a))
    shown = set()
    for place in (*range(4, 40, 3), *range(40, 4, -3)):
        turned = edits.set_placement(footless, 0, Placement(turn=(place, 0.0, 0.0)))
        plate = derived.plate(turned)
        assert plate is not None
        shown.add(id(plate))
        count = len(made)
        whole = plate_of_holes(turned, holes(turned))
        del made[count:]
        assert whole is not None
        assert np.array_equal(plate.pixels, whole.pixels) and np.array_equal(plate.hole, whole.hole)
    assert len(shown) > 1 and len(made) <= 2


def test_what_a_turn_uncovers_lies_in_the_shadow_that_is_left_beside_it():
    _, behind, own = _scene("patch", "astronaut", "wood")
    mask, beside, view = np.zeros_like(own), np.zeros_like(own), camera(WIDTH, HEIGHT)
    mask[120:260, 180:300] = True
    beside[140:260, 300:400] = True
    plate = build_plate(behind, _away(mask) < 3, compose.load("telea"))  # with nothing beside

    def shown(colours: np.ndarray, placement: Placement) -> float:
        """How bright the ground is where a thing was that has `colours` beside it."""
        pixels = np.where(beside[..., None], np.rint(colours), behind).astype(np.uint8)
        pixels = np.where(mask[..., None], np.uint8([40, 90, 200]), pixels)
        document = Document(Photo(Picture(pixels), view, png(pixels), "patch.png"))
        document = edits.set_mask(edits.add_object(document), 0, mask, Prompt())
        flat = LiftSettings(kind="flat")  # so it is narrower when it is turned, with any network
        lifted = lift_mask(pixels, view, mask, "relief", settings=flat)
        document = edits.set_lifted(document, 0, *lifted)
        document = edits.set_plate(document, plate)
        picture = composite(edits.set_placement(document, 0, placement)).pixels
        there = np.s_[160:240, 284:297]
        return float(picture[there].mean() / behind[there].mean())

    turned, away = Placement(turn=(60.0, 0.0, 0.0)), Placement(move=(-200.0, 0.0))
    assert shown(0.25 * behind, turned) < 0.5
    assert shown(0.25 * behind, away) > 0.9
    assert shown(0.02 * behind, turned) > 0.3, "no shadow: so dark it is below a thing only"
    assert shown(np.array([120.0, 0.0, 10.0]), turned) > 0.9, "of another colour: no shadow"


def test_a_part_that_was_left_out_can_be_added(footless: Document):
    _, _, own = _scene("patch", "astronaut", "street")
    mask = footless.objects[0].mask
    assert mask is not None
    parts = left_out(footless, find_ghosts(footless, SEAM * MARGIN), MARGIN)
    assert parts
    grown = with_parts(mask, footless, parts, MARGIN)

    missed = own & ~mask
    assert (grown | ~mask).all()
    assert (grown & missed).sum() > 0.6 * missed.sum()
    assert (grown ^ own).sum() < 0.6 * (mask ^ own).sum()
    assert cv2.connectedComponents(grown.astype(np.uint8))[0] == 2, "it is joined to the object"


def test_what_was_taken_out_of_a_selection_is_never_residue(footless: Document):
    """Erased, or right-clicked, it stays in the photo, is not offered, and cannot be found anew."""
    pixels, photo = footless.photo.pixels, footless.photo
    item, plate = footless.objects[0], footless.plate
    assert item.mask is not None and plate is not None
    part = left_out(footless, find_ghosts(footless, SEAM * MARGIN), MARGIN)[0]
    x0, y0, x1, y1 = (n + (plate.left, plate.top)[i % 2] for i, n in enumerate(part.box))
    foot = crop(part.there, (x0, y0, x1, y1), (0, 0, WIDTH, HEIGHT))
    y, x = np.argwhere(foot)[0]
    away = Placement(move=(0.0, -120.0))

    wide = edits.set_mask(edits.add_object(Document(photo)), 0, item.mask | foot, Prompt())
    erased = edits.change_mask(wide, 0, item.mask).objects[0]
    click = Click(float(x), float(y), is_foreground=False)
    clicked = replace(item, prompt=Prompt((Click(240.0, 180.0), click)))
    for own in (replace(item, found=erased.found), clicked):
        document = edits.set_plate(replace(footless, objects=(own,)), plate)
        left = document.plate
        assert left is not None
        assert not (crop(left.hole, left.box, (0, 0, WIDTH, HEIGHT)) & foot).any()
        moved = composite(edits.set_placement(document, 0, away)).pixels
        np.testing.assert_array_equal(moved[foot], pixels[foot])
    gone = composite(edits.set_placement(footless, 0, away)).pixels
    assert (gone[foot] != pixels[foot]).any(-1).mean() > 0.8, "else it goes with its object"


@pytest.mark.parametrize("stays", ["what is beside it", "all but its top"])
def test_residue_leaves_the_plate_with_the_thing_that_left_it(stays: str):
    """Where that is taken out of the selection later, as if it had never been in it."""
    pixels, _, own = _scene("patch", "astronaut", "street")
    thing, beside = _missing(own, "foot"), np.zeros_like(own)
    rows, columns = np.flatnonzero(thing.any(1)), np.flatnonzero(thing.any(0))
    beside[rows[0] : rows[0] + 60, columns[-1] - 10 : columns[-1] + 80] = True
    before = thing | beside
    after = before.copy()
    if stays == "what is beside it":
        after[thing & ~beside] = False
    else:
        after[: rows[0] + 20] = False
    inpainter = compose.load("telea")
    was, fresh = (build_plate(pixels, covered, inpainter) for covered in (before, after))
    plate = refitted_plate(Uncovering(pixels, was, before, after), inpainter)
    whole = (0, 0, WIDTH, HEIGHT)
    hole, new, old = (crop(each.hole, each.box, whole) for each in (plate, fresh, was))
    foot = own & old & (_away(before) > SEAM * MARGIN)
    assert foot.sum() > 100, "there is something to be found"
    shown, shown_before = (plate_crop(pixels, each, whole) for each in (plate, was))
    np.testing.assert_array_equal(shown[~hole], pixels[~hole])
    if stays == "what is beside it":
        is_beside_it = _away(before & ~after) <= _away(after)
        assert not (hole & ~new & (_away(after) > SEAM * MARGIN) & is_beside_it).any()
        assert not (hole & foot).any()
    else:
        assert hole[foot].all()
        np.testing.assert_array_equal(shown[foot], shown_before[foot])


def test_what_is_only_selected_changes_no_pixel_of_the_edit(footless: Document):
    """As `replay` draws it: also where it touches what was moved, and what that has left."""
    foot = np.zeros_like(footless.objects[0].mask)
    foot[230:300, 100:400] = True
    for placement in (Placement(move=(0.0, -120.0)), Placement(turn=(40.0, 0.0, 0.0))):
        moved = edits.set_placement(footless, 0, placement)
        selected = edits.set_mask(edits.add_object(moved), 1, foot, Prompt())
        assert selected.plate is moved.plate and (foot & ~moved.objects[0].mask).any()
        np.testing.assert_array_equal(composite(selected).pixels, composite(moved).pixels)
        again = edits.remove_object(selected, 1)
        assert again.plate is moved.plate
        assert (plate_cover(selected) == plate_cover(moved)).all()
