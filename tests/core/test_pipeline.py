"""The main job from bytes to bytes, without a window or a file."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core import pipeline, segment
from objectmorpher_core.base.progress import Cancelled
from objectmorpher_core.compose import composite as composite_module
from objectmorpher_core.compose.composite import CarriedTexture, object_texture, straight_cutout
from objectmorpher_core.document import edits
from objectmorpher_core.document.edits import EditError
from objectmorpher_core.document.model import Placement
from objectmorpher_core.pictures.image import ImageError, Picture, encode_picture, read_picture
from objectmorpher_core.pipeline import (
    Edited,
    export,
    make_plate,
    open_photo,
    read_photo,
    replay,
    run_script,
    select,
)
from objectmorpher_core.raster import texture as texture_module
from objectmorpher_core.scripting import runner
from objectmorpher_core.scripting.options import EditScript, ScriptError, script_from
from tests import shapes
from tests.tree import quick

pytestmark = pytest.mark.usefixtures("lifted_once")

MASK = shapes.mask("ellipse")
PIXELS = shapes.picture(MASK)
PHOTO, MASK_PNG = shapes.png(PIXELS), shapes.mask_png(MASK)
HANDLE_PX = 1.0  # that a handle may end off its target
QUICK = {"gaussians": 300, "trust": 0, "inpaint": "telea"}


def _run(photo: bytes = PHOTO, mask: bytes = MASK_PNG, **options) -> Edited:
    return run_script(photo, "made.png", script_from(QUICK | options), mask)


# ---- an edit that does nothing --------------------------------------------------------------

KINDS = {
    "u8": Picture(PIXELS),
    "u16": Picture(PIXELS.astype(np.uint16) * 257 + 11),
    "grey": Picture(np.repeat(PIXELS[..., :1], 3, axis=2), is_grey=True),
    "grey 16": Picture(np.repeat(PIXELS[..., :1], 3, 2).astype(np.uint16) * 251, is_grey=True),
    "alpha": Picture(PIXELS, alpha=PIXELS[..., 1]),
    "alpha 16": Picture(PIXELS.astype(np.uint16) * 3, alpha=PIXELS[..., 1].astype(np.uint16)),
}
kinds = pytest.mark.parametrize(
    "kind", quick(["alpha 16", "grey", "u8", "u16", "grey 16", "alpha"], 2)
)


@kinds
def test_a_photo_that_is_not_edited_comes_back_as_it_was(kind):
    picture = KINDS[kind]
    edited = _run(encode_picture(picture, ".png"))
    again = read_picture(encode_picture(edited.picture, ".png"))
    assert again.pixels.dtype == picture.pixels.dtype
    assert np.array_equal(again.pixels, picture.pixels)
    assert again.is_grey == picture.is_grey
    assert (again.alpha is None) == (picture.alpha is None)
    if picture.alpha is not None:
        assert np.array_equal(again.alpha, picture.alpha)
    assert edited.composite.changed == 0


@kinds
def test_outside_the_footprint_an_edit_leaves_every_value(kind):
    picture = KINDS[kind]
    edited = _run(encode_picture(picture, ".png"), move=[15, 5], turn=[10, 0, 0])
    far = ~edited.composite.footprint
    assert far.any()
    assert edited.composite.changed > 0
    assert np.array_equal(edited.picture.pixels[far], picture.pixels[far])
    if picture.alpha is not None:
        assert np.array_equal(edited.picture.alpha[far], picture.alpha[far])


def test_an_edit_of_a_grey_photo_stays_grey():
    edited = _run(encode_picture(KINDS["grey"], ".png"), turn=[40, 20, 0], scale=0.7)
    pixels = edited.picture.pixels.astype(int)
    assert np.abs(np.diff(pixels, axis=2)).max() <= 1


def test_a_placement_that_is_the_identity_is_no_edit():
    edited = _run(move=[0, 0, 0], turn=[0, 0, 0], scale=1)
    assert np.array_equal(edited.picture.pixels, PIXELS)
    assert edited.document.plate is None, "nothing was inpainted for nothing"


def test_the_same_seed_gives_the_same_bytes():
    options = {"handle": [{"at": [100, 62], "to": [120, 40]}], "turn": [10, 5, 0], "seed": 5}
    one, two = _run(**options), _run(**options)
    assert encode_picture(one.picture, ".png") == encode_picture(two.picture, ".png")
    other = _run(**(options | {"seed": 6}))
    assert not np.array_equal(one.picture.pixels, other.picture.pixels)


# ---- handles --------------------------------------------------------------------------------

HANDLES = [
    [{"at": [78, 62], "to": [90, 40]}],
    [{"at": [110, 62], "to": [140, 30], "dz": 0.3}],
    [{"at": [110, 62], "to": [130, 62], "dz": -0.4}, {"at": [45, 62], "to": [40, 70]}],
    [{"at": [45, 62], "to": [45, 62], "dz": 0.5}, {"at": [110, 62], "to": [110, 62]}],
    [{"at": [78, 40], "to": [-30, -50]}, {"at": [78, 85], "to": [78, 100]}],
]


@pytest.mark.parametrize("name", quick(["parts", "frame", "star", "ellipse"], 2))
@pytest.mark.parametrize("handles", HANDLES, ids=range(len(HANDLES)))
def test_a_handle_ends_under_its_target(name, handles):
    inside = shapes.mask(name)
    handles = [h for h in handles if inside[int(h["at"][1]), int(h["at"][0])]]
    if not handles:
        handles = [{"at": [130, 100], "to": [100, 70], "dz": 0.2}]
        if name == "parts":
            handles = [{"at": [45, 55], "to": [60, 50]}, {"at": [115, 65], "to": [115, 90]}]
    edited = _run(shapes.png(shapes.picture(inside)), shapes.mask_png(inside), handle=handles)
    report = edited.report()
    assert len(report["handles"]) == len(handles)
    for told, asked in zip(report["handles"], handles, strict=True):
        assert told["error_px"] <= HANDLE_PX
        assert told["from"] == pytest.approx(asked["at"], abs=0.01)
        assert told["to"] == pytest.approx(asked["to"], abs=0.01)
    assert report["pixels"]["outside_footprint_changed"] == 0


def test_dz_takes_a_handle_away_by_object_diameters():
    edited = _run(handle=[{"at": [110, 62], "to": [110, 62], "dz": 0.5}])
    handle, lifted = edited.document.objects[0].handles[0], edited.puppet.lifted
    before, after = (lifted.world_points(p)[2] for p in (handle.point, handle.target))
    assert (after - before) / (lifted.diameter * lifted.scale) == pytest.approx(0.5, abs=1e-6)


def test_a_pin_stays_where_it_is():
    edited = _run(handle=[{"at": [110, 62], "to": [120, 30]}], pin=[[50, 62], [78, 62]])
    item = edited.document.objects[0]
    for handle in item.handles:
        if handle.is_pin:
            at, now = (
                edited.puppet.picture_of(handle.point, p, Placement()) for p in (None, item.pose)
            )
            assert np.abs(at - now).max() < 1e-3
    assert sum(h.is_pin for h in item.handles) == 2


def test_of_a_large_photo_the_same_is_picked(monkeypatch):
    """There the texture is filled only in the rows about the pixel that is picked."""
    asked = {"handle": [{"at": [110, 62], "to": [120, 30]}], "pin": [[50, 62], [78, 62], [78, 45]]}
    usual = _run(**asked).document.objects[0].handles
    monkeypatch.setattr(composite_module, "LARGE", 1000)
    monkeypatch.setattr(texture_module, "STRIP", 4)
    large = _run(**asked).document.objects[0].handles
    assert len(large) == len(usual) == 4
    for one, other in zip(large, usual, strict=True):
        np.testing.assert_allclose(one.point, other.point, atol=1e-6)


def test_only_what_is_picked_needs_a_texture(monkeypatch):
    """That of 100 megapixels would take 2 GiB beside the fill of the background."""
    made = []

    def counted(*args: object) -> CarriedTexture:
        made.append(args)
        return CarriedTexture(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(runner, "CarriedTexture", counted)
    _run(move=[5, 0])
    assert not made
    _run(pin=[[78, 62]])
    assert len(made) == 1


def test_pins_alone_are_no_edit():
    assert np.array_equal(_run(pin=[[78, 62]]).picture.pixels, PIXELS)


def test_a_handle_that_stays_leaves_the_photo():
    """At most the stray pixels of the matte's edge differ, see test_tiles."""
    edited = _run(handle=[{"at": [78, 62], "to": [78, 62]}, {"at": [50, 62], "to": [50, 62]}])
    assert edited.composite.changed <= 0.02 * MASK.size


@pytest.mark.parametrize("options", [
    {"deform": "laplacian"}, {"links": "euclidean"}, {"faithful": True},
    {"nodes": 96, "stiffness": 0.7},
])  # fmt: skip
def test_the_ablations_run_and_give_other_pictures(options):
    handle = [{"at": [110, 62], "to": [90, 20]}, {"at": [45, 62], "to": [45, 62]}]
    plain, ablated = _run(handle=handle), _run(handle=handle, **options)
    if "links" not in options:  # in a convex body both kinds of link are nearly the same
        assert not np.array_equal(plain.picture.pixels, ablated.picture.pixels)
    assert ablated.report()["pixels"]["outside_footprint_changed"] == 0


# ---- placement ------------------------------------------------------------------------------


def _shown(edited: Edited) -> np.ndarray:
    """(H, W) True where the picture shows the object, at least by half."""
    photo = edited.document.photo
    return straight_cutout(edited.composite, photo.pixels.dtype, photo.size)[..., 3] > 127


def _centre(edited: Edited, placement: Placement) -> np.ndarray:
    """Photo px of the object's centre after `placement`."""
    lifted, camera = edited.puppet.lifted, edited.document.photo.camera
    matrix = placement.matrix(lifted, camera)
    return camera.project(matrix[:3, :3] @ lifted.centre + matrix[:3, 3])


def test_a_move_moves_the_centres_picture_by_exactly_that():
    edited = _run(move=[-13.5, 8.25, 0.3], turn=[20, 10, 5])
    placement = edited.document.objects[0].placement
    shift = _centre(edited, placement) - _centre(edited, Placement())
    assert np.abs(shift - [-13.5, 8.25]).max() < 1e-6


def test_the_picture_of_a_moved_object_moves_with_it():
    middles = []
    for move in ([0, 0.001], [20, -10]):
        rows, columns = np.nonzero(_shown(_run(move=move, trust=0.0)))
        middles.append(np.array([columns.mean(), rows.mean()]))
    # perspective, of a body as deep as its silhouette says
    assert np.abs(middles[1] - middles[0] - [20, -10]).max() < 1.0


def test_a_positive_yaw_takes_what_faces_the_camera_to_the_left():
    edited = _run(turn=[15, 0, 0], trust=0.0)
    item = edited.document.objects[0]
    texture = object_texture(item.matte, item.lifted)
    picked = edited.puppet.pick((78.0, 62.0), None, Placement(), texture)
    placed = edited.puppet.picture_of(picked.rest, None, edited.document.objects[0].placement)
    assert placed[0] < 78 - 2


@pytest.mark.parametrize("scale", [0.5, 1.5])
def test_scale_scales_the_objects_picture(scale):
    shown = _shown(_run(scale=scale))
    width = np.flatnonzero(shown.any(0))
    assert width[-1] - width[0] + 1 == pytest.approx(90 * scale, rel=0.06)  # perspective
    foot = np.flatnonzero(MASK.any(1))[-1]
    assert np.flatnonzero(shown.any(1))[-1] == pytest.approx(foot, abs=2), "it stands on the ground"


def test_a_deeper_object_is_smaller():
    assert 0.2 * MASK.sum() < _shown(_run(move=[0, 0, 1.0])).sum() < 0.7 * MASK.sum()


# ---- opening, choosing, stages --------------------------------------------------------------


def test_the_field_of_view_is_50_degrees_unless_the_user_says_so():
    assert open_photo(PHOTO, "a.png").photo.camera == shapes.camera()
    wide = open_photo(PHOTO, "a.png", fov=90.0).photo.camera
    assert wide.focal == pytest.approx(80.0)
    with pytest.raises(ImageError, match="field of view of 180"):
        open_photo(PHOTO, "a.png", fov=180.0)


def test_the_document_keeps_the_very_bytes_of_the_photo():
    assert open_photo(PHOTO, "a.png").photo.source is PHOTO


def test_a_mask_wins_over_clicks():
    script = EditScript(click=((3.0, 3.0),))
    document = select(open_photo(PHOTO, "a.png"), script, MASK_PNG)
    assert np.array_equal(document.objects[0].mask, MASK)
    assert document.objects[0].prompt.is_empty, "they did not choose it"
    assert dict(document.backends)["segment"] == "mask"


def test_no_choice_is_an_error():
    with pytest.raises(ScriptError, match="no object is chosen"):
        select(open_photo(PHOTO, "a.png"), EditScript())


@pytest.mark.parametrize(("inside", "error"), [
    (np.zeros_like(MASK), "nothing is selected"),
    (np.ones_like(MASK), "covers the whole photo"),
])  # fmt: skip
def test_empty_and_full_masks_are_refused(inside, error):
    with pytest.raises(EditError, match=error):
        _run(mask=shapes.mask_png(inside))


@pytest.mark.parametrize(("options", "sentence"), [
    ({"handle": [{"at": [5, 5], "to": [9, 9]}]}, "handle 5,5 misses the object"),
    ({"handle": [{"at": [500, 5], "to": [9, 9]}]}, "handle 500,5 is outside the photo of 160"),
    ({"pin": [[5, 5]]}, "pin 5,5 misses the object"),
    ({"handle": [{"at": [78, 62], "to": [9, 9], "dz": -50}]}, "behind the camera"),
    ({"splats": "x.pdf"}, "x.pdf has none of the endings"),
    ({"refine": "dream"}, "no refiner 'dream'"),
    ({"inpaint": "magic"}, "'magic'"), ({"lift": "magic"}, "'magic'"),
    ({"move": [0, 0, -80]}, "behind the camera"),
    ({"scale": -2}, "a scale of -2 is not above 0"),
    ({"handle": [{"at": [78, 62], "to": [9, 9]}, {"at": [78, 62], "to": [90, 90]}]},
     "to different places"),
])  # fmt: skip
def test_impossible_wishes_are_refused_in_one_sentence(options, sentence):
    if "inpaint" in options:
        options = options | {"move": [3, 3]}  # only then a plate is made
    with pytest.raises(ValueError, match=sentence) as caught:
        _run(**options)
    assert "\n" not in str(caught.value)


def test_the_light_stays_while_a_script_turns_an_object():
    """`--refine harmonise` is what Harmonise does in the window; none and auto are without."""
    plain, auto, lit = (
        _run(turn=[35, 0, 0], refine=name) for name in ("none", "auto", "harmonise")
    )
    assert np.array_equal(plain.picture.pixels, auto.picture.pixels)
    assert not np.array_equal(plain.picture.pixels, lit.picture.pixels)
    again = edits.harmonised(plain.document, 0)
    assert np.array_equal(export(again).pixels, lit.picture.pixels)
    assert lit.report()["backends"]["refine"] == "harmonise"
    assert lit.report()["pixels"]["outside_footprint_changed"] == 0


def test_a_target_outside_the_photo_is_allowed():
    report = _run(handle=[{"at": [110, 62], "to": [400, 62]}]).report()
    assert report["handles"][0]["error_px"] <= HANDLE_PX


def test_a_small_photo_is_segmented_by_a_click():
    reading = read_photo(PIXELS, segment.load("grabcut"))
    found = reading.segment(pipeline.prompt_of(EditScript(click=((78, 62),))))
    mask = found.mask
    assert found.backend == "grabcut" and found.confidence is None
    overlap = (mask & MASK).sum() / (mask | MASK).sum()
    assert overlap > 0.8


def test_a_plate_is_the_photo_outside_its_hole():
    plate = make_plate(PIXELS, MASK, "telea")
    x0, y0, x1, y1 = plate.box
    assert plate.hole[MASK[y0:y1, x0:x1]].all()
    outside = ~plate.hole
    assert np.array_equal(plate.pixels[outside], PIXELS[y0:y1, x0:x1][outside])
    assert plate.pixels.dtype == PIXELS.dtype


def test_a_plate_is_made_only_where_it_is_seen():
    assert _run().document.plate is None
    script = script_from(QUICK)
    asked = run_script(PHOTO, "a.png", script, MASK_PNG, needs_plate=True)
    assert asked.document.plate is not None
    assert np.array_equal(asked.picture.pixels, PIXELS)


def test_replaying_the_document_gives_the_same_picture():
    edited = _run(handle=[{"at": [100, 62], "to": [120, 40]}], turn=[10, 5, 0])
    again = replay(edited.document)
    assert np.array_equal(again.picture.pixels, edited.picture.pixels)
    assert np.array_equal(export(edited.document).pixels, edited.picture.pixels)
    assert again.report()["handles"] == edited.report()["handles"]


def test_a_session_without_an_object_cannot_be_replayed():
    with pytest.raises(ScriptError, match="no lifted object"):
        replay(open_photo(PHOTO, "a.png"))


def test_progress_rises_from_the_first_stage_to_the_last():
    told: list[float] = []
    run_script(PHOTO, "a.png", script_from(QUICK | {"move": [5, 5]}), MASK_PNG,
               lambda fraction, note: told.append(fraction))  # fmt: skip
    assert told == sorted(told)
    assert told[-1] == 1.0


@pytest.mark.parametrize("stage", ["Cutting out", "Inflating", "Filling", "Drawing"])
def test_every_stage_can_be_cancelled(stage):
    def stop(fraction: float, note: str) -> None:
        if note.startswith(stage):
            raise Cancelled

    with pytest.raises(Cancelled):
        run_script(PHOTO, "a.png", script_from(QUICK | {"move": [5, 5]}), MASK_PNG, stop)


def test_what_is_guesswork_is_said_of_what_is_seen():
    """However far: what has left the photo is not seen at all."""
    (note,) = _run(turn=[120, 0, 0]).notes
    assert "is turned so far that it is guesswork" in note
    (note,) = _run(move=[3000, 0]).notes
    assert "beside the photo" in note


@pytest.mark.parametrize("turn", [8, 30, 60, 120])
def test_what_is_said_of_a_turn_is_what_its_sign_says(turn):
    edited = _run(turn=[turn, 0, 0])
    told = {"fine": None, "look closely": "look closely:", "guesswork": "it is guesswork:"}
    words = told[edited.report()["trust"]["sign"]]
    assert len(edited.notes) == (words is not None)
    assert words is None or words in edited.notes[0]
