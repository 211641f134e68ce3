"""The edited photo: nothing outside the footprint, and every pixel accounted for."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from objectmorpher_core.base.progress import Cancelled
from objectmorpher_core.compose import composite as composite_module
from objectmorpher_core.compose.composite import Composite, composite, straight_cutout
from objectmorpher_core.compose.layers import layers
from objectmorpher_core.compose.light.lighting import texture_source
from objectmorpher_core.compose.plate.plate import hole_margin
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Origin, Placement, Pose
from objectmorpher_core.raster import texture as texture_module
from objectmorpher_core.raster import tiles
from objectmorpher_core.raster.texture import TextureRows, TextureSource
from tests import shapes
from tests.tree import quick

MOVES = {
    "moved": Placement(move=(18.0, -7.0)),
    "turned": Placement(turn=(25.0, 10.0, -15.0)),
    "scaled": Placement(scale=0.6),
    "away": Placement(depth=1.5),
    "out of the photo": Placement(move=(900.0, 0.0)),
    "half out of the photo": Placement(move=(70.0, 40.0)),
    "large": Placement(scale=6.0),
    "a hair": Placement(move=(0.4, 0.0)),
    "a little": Placement(move=(1.5, 2.5)),
    "rolled": Placement(turn=(0.0, 0.0, 90.0)),
    "turned far": Placement(turn=(60.0, 0.0, 20.0), scale=1.3),
}
ROOT = Path(__file__).parents[3]
masks = pytest.mark.parametrize("name", ["ellipse", "thin", "frame", "parts", "ring"])
moves = pytest.mark.parametrize("move", MOVES)


def _placed(document: Document, placement: Placement) -> Document:
    return edits.set_placement(document, 0, placement)


def _solved(scene: shapes.Scene, move: tuple[float, float, float]) -> Document:
    """The document after one handle was dragged by `move`, object units."""
    document = scene.document()
    point = scene.lifted.control_points[7].astype(np.float64)
    document = edits.add_handle(document, 0, point, point + move)
    solution = scene.puppet.deformer.solve(document.objects[0].handles)
    return edits.set_pose(document, 0, solution.pose)


@masks
def test_with_nothing_moved_the_photo_comes_back(name):
    scene = shapes.scene(name)
    result = composite(scene.document())
    assert np.array_equal(result.pixels, scene.pixels)
    assert result.changed == 0
    assert not result.footprint.any()
    assert sum(vars(result.shares).values()) == 0


@moves
@masks
def test_outside_the_footprint_nothing_changes(name, move):
    scene = shapes.scene(name)
    result = composite(_placed(scene.document(), MOVES[move]), {0: scene.puppet})
    different = (result.pixels != scene.pixels).any(-1)
    assert not (different & ~result.footprint).any()
    assert result.outside_footprint_changed == 0
    assert result.changed == different.sum()


@moves
def test_the_shares_sum_to_one(move):
    scene = shapes.scene("ellipse")
    result = composite(_placed(scene.document(), MOVES[move]), {0: scene.puppet})
    shares = vars(result.shares)
    assert sum(shares.values()) == pytest.approx(1, abs=1e-6)
    assert min(shares.values()) >= 0
    assert shares["from_refiner"] == 0


def test_an_object_that_only_moved_is_made_of_the_photo():
    scene = shapes.scene("ellipse")
    document = _placed(scene.document(), MOVES["moved"])
    result = composite(document, {0: scene.puppet})
    assert result.shares.from_lifter < 0.01
    assert result.shares.from_inpainter > 0.05, "what it uncovered"


def test_a_turned_object_shows_what_the_lifter_made_up():
    scene = shapes.scene("ellipse")
    back = composite(
        _placed(scene.document(), Placement(turn=(180.0, 0.0, 0.0))), {0: scene.puppet}
    )
    assert back.shares.from_lifter > 0.5


def test_moved_and_moved_back_is_the_photo():
    scene = shapes.scene("ellipse")
    document = _placed(_placed(scene.document(), MOVES["turned"]), Placement())
    assert np.array_equal(composite(document, {0: scene.puppet}).pixels, scene.pixels)


@masks
def test_a_pose_that_is_the_rest_changes_next_to_nothing(name):
    """A handle dragged to where it was: rendered, and still the photo's own pixels."""
    scene = shapes.scene(name)
    document = edits.set_pose(scene.document(), 0, scene.puppet.deformer.rest())
    result = composite(document, {0: scene.puppet})
    # A stray pixel of the edge (test_tiles) disturbs its surroundings by the hole's margin.
    assert result.changed <= 0.02 * scene.mask.size
    inside = scene.mask & ~(result.pixels != scene.pixels).any(-1)
    assert inside.sum() >= 0.98 * scene.mask.sum()


def test_what_a_deformation_leaves_in_place_keeps_its_very_pixels():
    """One arm of the star is lifted; the others' control points do not move at all."""
    scene = shapes.scene("star", 2000)
    deformer = scene.puppet.deformer
    points = deformer.points.copy()
    points[points[:, 0] > 0.2] += [0.0, -0.15, 0.0]
    pose = Pose(points, deformer.rest().rotations)
    result = composite(edits.set_pose(scene.document(), 0, pose), {0: scene.puppet})
    moved = np.linalg.norm(
        deformer.skin_gaussians(pose).points - scene.lifted.gaussians.means, axis=1
    )
    left = scene.lifted.texture.u0[moved > 1e-9, 0].min() - 2 * hole_margin(160, 120)
    still = scene.mask & (np.arange(160) < left)
    assert still.sum() > 300
    changed = (result.pixels != scene.pixels).any(-1)
    assert not (changed & still).any()
    assert changed.any()


@masks
def test_a_hidden_object_shows_the_plate(name):
    scene = shapes.scene(name)
    document = edits.set_visible(scene.document(), 0, False)
    result = composite(document)
    assert (result.pixels[scene.mask] == 128).all()
    assert result.shares.from_lifter == 0
    assert result.shares.from_inpainter > 0.5
    assert result.outside_footprint_changed == 0


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_the_depth_of_the_photo_is_kept(dtype):
    scene = shapes.scene("ellipse")
    document = scene.document()
    if dtype == np.uint16:
        deep = scene.pixels.astype(np.uint16) * 257 + 3
        photo = replace(document.photo, picture=replace(document.photo.picture, pixels=deep))
        plate = replace(document.plate, pixels=document.plate.pixels.astype(np.uint16) * 257)
        document = replace(document, photo=photo, plate=plate)
    result = composite(_placed(document, MOVES["moved"]), {0: scene.puppet})
    assert result.pixels.dtype == dtype
    far = ~result.footprint
    assert np.array_equal(result.pixels[far], document.photo.pixels[far])


def test_the_object_lies_where_it_was_moved_to():
    """Of all shifts by whole pixels the one of its front explains the picture best; the front
    is nearer than the centre, so it moves a little farther in the picture."""
    scene = shapes.scene("disc")
    placement = Placement(move=(11.0, -6.0))
    result = composite(_placed(scene.document(), placement), {0: scene.puppet})
    rows, columns = np.nonzero(cv2.erode(scene.mask.astype(np.uint8), np.ones((41, 41))))
    own = scene.pixels[rows, columns].astype(int)
    shifts = [(x, y) for x in range(7, 16) for y in range(-10, -2)]
    errors = [np.abs(result.pixels[rows + y, columns + x] - own).mean() for x, y in shifts]
    picked = scene.puppet.pick((80.0, 60.0), None, Placement(), scene.texture)
    expected = scene.puppet.picture_of(picked.rest, None, placement) - [80, 60]
    assert np.abs(shifts[int(np.argmin(errors))] - expected).max() <= 1.0


def test_the_nearer_of_two_objects_covers_the_farther():
    near, far = shapes.scene("disc"), shapes.scene("ellipse")
    document = near.document()
    item = replace(far.document().objects[0], name="far", placement=Placement(depth=0.8))
    document = replace(document, objects=(document.objects[0], item))
    document = edits.set_placement(document, 0, Placement(move=(0.0, 1.0)))
    pixels = [
        composite(replace(document, objects=order)).pixels
        for order in (document.objects, document.objects[::-1])
    ]
    assert np.array_equal(pixels[0], pixels[1]), "the order of the list does not matter"


def test_the_cut_out_is_the_object_on_nothing():
    scene = shapes.scene("ellipse")
    document = _placed(scene.document(), MOVES["moved"])
    result = composite(document, {0: scene.puppet})
    cutout = straight_cutout(result, np.dtype(np.uint8), (160, 120))
    assert cutout.shape == (120, 160, 4)
    shifted = np.zeros_like(scene.mask)
    rows, columns = np.nonzero(scene.mask)
    shifted[rows - 7, columns + 18] = True
    agree = (cutout[..., 3] > 127) == shifted
    assert agree.mean() > 0.98  # perspective changes the outline by a pixel or so
    assert not cutout[~result.footprint].any()


def test_puppets_of_the_caller_give_the_same_picture():
    scene = shapes.scene("star")
    document = _solved(scene, (0.1, 0.1, 0.0))
    assert np.array_equal(composite(document).pixels, composite(document, {0: scene.puppet}).pixels)


def test_an_object_behind_the_frame_or_nowhere_changes_only_its_hole():
    scene = shapes.scene("ellipse")
    result = composite(_placed(scene.document(), MOVES["out of the photo"]), {0: scene.puppet})
    assert result.shares.from_inpainter > 0.5
    assert (result.pixels[scene.mask] == 128).mean() > 0.99


# ---- an object of another photo -------------------------------------------------------------


def _with_guest(placement: Placement | None = None, **more) -> Document:
    """A photo of 40 x 30 px without objects, and in it one of a photo of 160 x 120 px."""
    item = shapes.scene("frame").document().objects[0]
    small = shapes.scene("ellipse").document()
    picture = replace(small.photo.picture, pixels=small.photo.pixels[:30, :40])
    photo = replace(small.photo, picture=picture, camera=shapes.camera(40, 30))
    assert item.lifted is not None
    lifted = replace(item.lifted, origin=Origin("other", shapes.camera()))
    nowhere = np.zeros((30, 40), bool)
    guest = replace(item, lifted=lifted, mask=nowhere, placement=placement or Placement(), **more)
    return replace(small, photo=photo, objects=(guest,), plate=None)


@pytest.mark.parametrize(
    "document",
    [_with_guest(is_visible=False), _with_guest(Placement(move=(5000.0, 0.0)))],
    ids=["hidden", "out of the photo"],
)
def test_a_guest_that_is_not_seen_leaves_the_photo(document):
    result, pile = layers(document)
    assert np.array_equal(result.pixels, document.photo.pixels)
    assert result.changed == 0 and not result.footprint.any()
    assert sum(vars(result.shares).values()) == 0
    assert [layer.name for layer in pile] == ["Photo"]
    assert not straight_cutout(result, np.dtype(np.uint8), (40, 30)).any()


def test_a_guest_is_neither_blurred_nor_not_by_what_stands_where_it_was_elsewhere():
    document = _with_guest(Placement(move=(-20.0, -10.0), depth=1.0))
    plain = composite(document)
    assert plain.changed > 0
    asked = composite(edits.set_share(document, 0, "defocus", 1.0))
    assert np.array_equal(asked.pixels, plain.pixels)


# ---- strip by strip -------------------------------------------------------------------------


@cache
def _wide(name: str = "star") -> shapes.Scene:
    """A scene that is many strips high where strips are made narrow."""
    inside = shapes.mask(name, 640, 480)
    return shapes.lifted_scene(shapes.picture(inside), inside, 2000)


def _bent(scene: shapes.Scene) -> Document:
    """One end of the object is lifted, the other stays in place."""
    deformer = scene.puppet.deformer
    points = deformer.points.copy()
    points[:, 1] -= 0.6 * np.maximum(points[:, 0], 0) ** 2
    return edits.set_pose(scene.document(), 0, Pose(points, deformer.rest().rotations))


def _edited(edit: str) -> Document:
    scene = _wide()
    if edit == "bent":
        return _bent(scene)
    if edit == "hidden":
        return edits.set_visible(scene.document(), 0, False)
    if edit == "16 bits":
        document = _placed(scene.document(), MOVES["turned"])
        picture = replace(document.photo.picture, pixels=scene.pixels.astype(np.uint16) * 257)
        plate = replace(document.plate, pixels=document.plate.pixels.astype(np.uint16) * 257)
        return replace(document, photo=replace(document.photo, picture=picture), plate=plate)
    return _placed(scene.document(), MOVES[edit])


EDITS = (
    "moved",
    "turned",
    "a hair",
    "a little",
    "half out of the photo",
    "bent",
    "hidden",
    "16 bits",
)


@cache
def _whole(edit: str) -> Composite:
    return composite(_edited(edit), {0: _wide().puppet}, rows=10**6)


def _assert_same(result: Composite, whole: Composite) -> None:
    assert result.changed == whole.changed > 0
    assert result.outside_footprint_changed == 0
    assert np.array_equal(result.pixels, whole.pixels)
    assert np.array_equal(result.footprint, whole.footprint)
    for name, share in vars(whole.shares).items():
        assert getattr(result.shares, name) == pytest.approx(share, abs=1e-6)


@pytest.mark.parametrize("rows", quick([1, None, 64, 257], 2))
@pytest.mark.parametrize("edit", EDITS)
def test_the_picture_is_the_same_however_many_rows_are_blended_at_a_time(edit, rows, monkeypatch):
    whole = _whole(edit)
    if rows == 1:
        monkeypatch.setattr(composite_module, "PIECE", 3)  # fewer rows than a pixel looks around
    result = composite(_edited(edit), {0: _wide().puppet}, rows=rows)
    _assert_same(result, whole)


@pytest.mark.parametrize("height", quick([64, 1, 257], 1))
@pytest.mark.parametrize("edit", EDITS)
def test_low_strips_show_what_a_high_one_shows(edit, height, monkeypatch):
    """But for a last bit, which may depend on what part of the view the rasteriser draws."""
    whole, few = _whole(edit), 10  # px, of 300,000
    before = straight_cutout(whole, np.dtype(np.uint8), (640, 480)).astype(int)
    monkeypatch.setattr(composite_module, "STRIP", 640 * height)
    result = composite(_edited(edit), {0: _wide().puppet})
    level = np.iinfo(whole.pixels.dtype).max / 255
    apart = np.abs(result.pixels.astype(np.float64) - whole.pixels).max(-1)
    assert (apart > 1.01 * level).sum() <= few
    assert (result.footprint != whole.footprint).sum() <= few
    for name, share in vars(whole.shares).items():
        assert getattr(result.shares, name) == pytest.approx(share, abs=1e-4)
    cutout = straight_cutout(whole, np.dtype(np.uint8), (640, 480)).astype(int)
    is_seen = before[..., 3] > 64  # straight colours of what is hardly there mean little
    assert (np.abs(cutout - before)[is_seen].max(-1, initial=0) > 1).sum() <= few


@pytest.mark.parametrize("edit", quick([*EDITS, "rolled", "turned far"], 3))
def test_a_texture_that_is_there_only_by_rows_gives_the_same_picture(edit, monkeypatch):
    monkeypatch.setattr(composite_module, "STRIP", 640 * 32)
    whole = composite(_edited(edit), {0: _wide().puppet})
    monkeypatch.setattr(composite_module, "LARGE", 1000)
    monkeypatch.setattr(texture_module, "STRIP", 8)
    result = composite(_edited(edit), {0: _wide().puppet})
    _assert_same(result, whole)
    assert vars(result.shares) == vars(whole.shares)


def test_of_a_texture_by_rows_only_what_is_looked_at_takes_memory(monkeypatch):
    monkeypatch.setattr(texture_module, "STRIP", 8)
    scene = _wide()
    rows = TextureRows(texture_source(scene.matte, scene.lifted))
    shown = tiles.prepare(scene.puppet.posed(None, Placement()), scene.camera, scene.camera)
    box = 0, 200, 640, 232
    low, high = shown.rows_looked_at(box)
    assert low.min() < 200 and high.max() > 232
    seen = rows.looked_at(low, high).levels[0].any((1, 2))
    kept = rows.looked_at(np.array([214.0]), np.array([218.0])).levels[0].any((1, 2))
    assert 0 < kept.sum() < seen.sum() < 0.6 * len(seen)  # a Gaussian is a few rows high
    whole = scene.texture.levels[0]
    first = 200 - int(scene.texture.top)
    part = rows.looked_at(low, high).levels[0][first : first + 32]
    assert np.array_equal(part, whole[first : first + 32])


@pytest.mark.parametrize("height", [300, 384, 401])
def test_what_is_given_back_of_a_texture_is_no_row_of_its_halved_copies(height):
    """Whatever its height, of which the last strip is a part only."""
    rng = np.random.default_rng(height)
    colours, alpha = (rng.random(shape, np.float32) for shape in ((height, 512, 3), (height, 512)))
    top = float(rng.integers(-200, 200))
    source = TextureSource(lambda a, b: (colours[a:b], alpha[a:b]), (height, 512), 0.0, top)
    rows = TextureRows(source)
    rows.looked_at(top + np.array([height - 2.0]), top + np.array([height - 1.0]))
    seen = rows.looked_at(top + np.array([20.0]), top + np.array([30.0]))
    full, *halved = source.levels().levels
    for own, whole in zip(seen.levels[1:], halved, strict=True):
        np.testing.assert_array_equal(own, whole)
    np.testing.assert_array_equal(seen.levels[0][14:36], full[14:36])


def test_a_texture_is_there_by_rows_from_its_area_on(monkeypatch):
    scene = _wide()
    shown = tiles.prepare(scene.puppet.posed(None, Placement()), scene.camera, scene.camera)
    height, width = texture_source(scene.matte, scene.lifted).shape
    for most, is_by_rows in ((height * width - 1, True), (height * width, False)):
        monkeypatch.setattr(composite_module, "LARGE", most)
        carried = composite_module.CarriedTexture(scene.matte, scene.lifted, shown)
        assert isinstance(carried._texture, TextureRows) == is_by_rows


def test_every_strip_tells_how_far_it_is(monkeypatch):
    monkeypatch.setattr(composite_module, "STRIP", 640 * 32)
    told: list[float] = []
    composite(_edited("moved"), {0: _wide().puppet}, lambda share, note: told.append(share))
    assert len(told) > 5
    assert told == sorted(told)
    assert told[0] >= 0 and told[-1] <= 1


def test_between_strips_it_can_be_cancelled(monkeypatch):
    monkeypatch.setattr(composite_module, "STRIP", 640 * 32)

    def stop(share: float, note: str) -> None:
        if share > 0.4:
            raise Cancelled

    with pytest.raises(Cancelled):
        composite(_edited("moved"), {0: _wide().puppet}, stop)


def _cost_of_export(width: int, height: int, factor: int) -> dict[str, float]:
    """See `tests.large`, in a process of its own."""
    command = [sys.executable, "-m", "tests.large", str(width), str(height), str(factor)]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout)


@pytest.mark.slow
@pytest.mark.parametrize(("size", "most_mb"), [((600, 400, 10), 2000), ((600, 417, 20), 6000)])
def test_a_large_photo_is_exported_in_bounded_memory(size, most_mb):
    """24 and 100 megapixels. An object on a quarter of the photo takes 16 bytes a pixel of its
    box in the document, and as the texture that is drawn once or twice as much again."""
    cost = _cost_of_export(*size)
    assert cost["peak_mb"] < most_mb
    assert cost["changed"] > 0.2 * cost["footprint"]
    assert cost["outside"] == 0
    assert cost["misread"] == 0
