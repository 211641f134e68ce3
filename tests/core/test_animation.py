"""From the photo to the edit and back, in frames and in files."""

from __future__ import annotations

import io
from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, ImageSequence

from objectmorpher_core.compose.composite import composite
from objectmorpher_core.document import edits
from objectmorpher_core.document.key_edits import (
    add_key,
    at_key,
    count_keys,
    is_at_key,
    remove_key,
    replace_key,
)
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.document.placement import spun
from objectmorpher_core.document.pose import UNHELD, Pose
from objectmorpher_core.document.settings import AS_IN_THE_PHOTO, Refined, Shadow
from objectmorpher_core.document.visitor_edits import departing, with_visitor
from objectmorpher_core.pictures.video import (
    ENDINGS,
    PICTURES,
    VideoError,
    encode_video,
    read_frames,
)
from objectmorpher_core.pipeline import run_script
from objectmorpher_core.scripting.animation import (
    Clip,
    frames,
    share_at,
    shrunk,
    station_at,
)
from objectmorpher_core.scripting.options import script_from
from objectmorpher_core.scripting.outputs import Export
from objectmorpher_core.session.file import decode_session, encode_session
from objectmorpher_core.session.tree import SessionError
from tests import shapes


@cache
def edited() -> Document:
    """An object with one handle dragged, moved and turned."""
    scene = shapes.scene("ellipse")
    document = scene.document()
    point = scene.lifted.control_points[7].astype(np.float64)
    document = edits.add_handle(document, 0, point, point + (0.2, -0.1, 0.0))
    pose = scene.puppet.deformer.solve(document.objects[0].handles).pose
    document = edits.set_pose(document, 0, pose)
    return edits.set_placement(document, 0, Placement(move=(14.0, -6.0), turn=(20.0, 0, 0)))


def difference(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs(one.astype(float) - other).mean())


def test_a_morph_begins_as_the_photo_comes_to_the_edit_and_goes_back():
    document = edited()
    clip = Clip(seconds=1.0, rate=20)
    found = list(frames(document, clip))
    assert len(found) == 20
    photo, edit = document.photo.pixels, composite(document).pixels
    assert np.array_equal(found[0], photo)
    assert np.array_equal(found[10], edit)
    gaps = [difference(a, b) for a, b in zip(found, [*found[1:], found[0]], strict=True)]
    assert max(gaps) < 0.6 * difference(photo, edit)  # no jump, not even from the last to the first
    away = [difference(frame, photo) for frame in found]
    assert away[4] < away[6] < away[9]


def test_the_share_is_still_at_both_ends():
    shares = [share_at(k / 100) for k in range(100)]
    assert shares[0] == shares[14] == 0 and shares[50] == shares[64] == 1
    assert min(shares) == 0 and max(shares) == 1
    assert max(abs(a - b) for a, b in zip(shares, [*shares[1:], shares[0]], strict=True)) < 0.06


@pytest.mark.parametrize("up", [None, (0.0, -0.6, -0.8)])
@pytest.mark.parametrize("motion", ["sway", "turn"])
def test_an_object_turns_without_a_jump(motion, up):
    document = shapes.scene("ellipse").document()
    thing = document.objects[0]
    lifted = replace(shapes.scene("ellipse").lifted, up=up)
    document = document.with_object(0, replace(thing, lifted=lifted))
    found = list(frames(document, Clip(motion, seconds=1.0, rate=24)))
    assert np.array_equal(found[0], document.photo.pixels)
    gaps = [difference(a, b) for a, b in zip(found, [*found[1:], found[0]], strict=True)]
    assert 0 < max(gaps) < 6 * np.median(gaps) + 1


@pytest.mark.parametrize("first", ["gone", "never lifted"])
def test_the_first_object_that_is_seen_and_lifted_turns(first):
    document = shapes.scene("ellipse").document()
    thing = document.objects[0]
    gone = replace(thing, is_visible=False, placement=Placement(move=(9.0, 0.0)))
    before = gone if first == "gone" else replace(thing, lifted=None, matte=None)
    document = replace(document, objects=(before, thing))
    found = list(frames(document, Clip("turn", seconds=1.0, rate=8)))
    assert np.array_equal(found[0], composite(document).pixels)
    assert difference(found[2], found[0]) > 1.0
    named = list(frames(document, Clip("turn", seconds=1.0, rate=8, object=1)))
    assert all(np.array_equal(a, b) for a, b in zip(found, named, strict=True))


def test_between_photo_and_edit_a_thing_that_is_spun_stands():
    """Half of a spin about its own upright is a spin by half the angle."""
    scene = shapes.scene("ellipse")
    lifted, document = replace(scene.lifted, up=(0.0, -0.6, -0.8)), scene.document()
    document = document.with_object(0, replace(document.objects[0], lifted=lifted))
    whole, half = (
        edits.set_placement(document, 0, spun(Placement(), degrees, document.objects[0], document))
        for degrees in (40.0, 40.0 * share_at(0.25))
    )
    found = next(islice(frames(whole, Clip("morph", seconds=1.0, rate=8)), 2, None))
    assert difference(found, composite(half, {0: scene.puppet}).pixels) < 0.5
    assert difference(found, document.photo.pixels) > 2.0


@pytest.mark.parametrize("up", [None, (0.0, -0.6, -0.8)])
def test_what_stands_turns_and_sways_where_it_stands(up):
    """As a spin by as many degrees does; it was a turn about its middle, and slid."""
    document = shapes.scene("ellipse").document()
    lifted = replace(shapes.scene("ellipse").lifted, up=up, stands=True)
    document = document.with_object(0, replace(document.objects[0], lifted=lifted))
    found = list(frames(document, Clip("turn", seconds=1.0, rate=6)))
    for k, frame in enumerate(found):
        place = spun(Placement(), 60.0 * k, document.objects[0], document)
        expected = composite(edits.set_placement(document, 0, place)).pixels
        assert difference(frame, expected) < 0.02, k


@pytest.mark.parametrize("up", [None, (0.0, -0.6, -0.8)])
def test_a_film_turns_the_shorter_way_round(up):
    """From 170 degrees to 190, which are stored as -170, by 180; and back by it."""
    document = shapes.scene("ellipse").document()
    lifted = replace(shapes.scene("ellipse").lifted, up=up)
    document = document.with_object(0, replace(document.objects[0], lifted=lifted))

    def turned(degrees: float) -> Document:
        place = spun(Placement(), degrees, document.objects[0], document)
        return edits.set_placement(document, 0, place)

    keyed_twice = document
    for degrees in (170.0, 190.0):
        keyed_twice = add_key(turned(degrees).with_object(0, replace(
            turned(degrees).objects[0], keys=keyed_twice.objects[0].keys
        )))  # fmt: skip
    found = list(frames(keyed_twice, Clip("keys", seconds=1.0, rate=8)))
    behind = composite(turned(180.0)).pixels
    for k in (2, 6):
        assert difference(found[k], behind) < 0.02


def half_turned(has_base: bool) -> Document:
    """Two key poses: as it is, and turned by 170 degrees in the picture, by one handle.

    Both from one pose, or only the second from one, as where another handle was there between.
    """
    scene = shapes.scene("disc")
    deformer, document = scene.puppet.deformer, scene.document()
    middle = deformer.nearest_control_point(scene.lifted.control_points.mean(0))
    first = shapes.handle(scene.lifted, middle, np.array([0.01, 0.0, 0.0]), turn=np.zeros(3))
    begun = deformer.solve((first,), UNHELD).pose
    handles, base = deformer.held((first,), begun, UNHELD.anchors)
    item = document.objects[0]
    if has_base:
        item = replace(item, handles=handles, pose=begun, base=base)
    document = add_key(document.with_object(0, item))
    later = tuple(replace(h, turn=np.radians([0.0, 0.0, 170.0])) for h in handles)
    item = document.objects[0]
    pose = deformer.solve(later, base).pose
    item = replace(item, handles=later, pose=pose, base=base)
    return add_key(document.with_object(0, item))


@pytest.mark.parametrize("has_base", [True, False])
@pytest.mark.parametrize("motion", ["keys", "morph"])
def test_what_a_handle_turns_from_a_pose_does_not_shrink_on_its_way(motion, has_base):
    """Along straight lines it was a tenth as large half-way."""
    document = half_turned(has_base)
    empty = composite(edits.set_visible(document, 0, False)).pixels.astype(int)
    found = list(frames(document, Clip(motion, seconds=1.0, rate=20)))
    areas = [int((np.abs(frame - empty).max(2) > 16).sum()) for frame in found]
    assert min(areas) > 0.9 * max(areas)
    first = composite(at_key(document, 0)).pixels if motion == "keys" else document.photo.pixels
    assert np.array_equal(found[0], first)
    assert np.array_equal(found[10], composite(document).pixels)


def test_nothing_to_be_seen_is_said_in_a_sentence():
    document = shapes.scene("ellipse").document()
    with pytest.raises(ValueError, match="nothing was moved"):
        list(frames(document, Clip()))
    with pytest.raises(ValueError, match="lift an object first"):
        list(frames(document, Clip("turn", object=3)))
    for wrong in ({"motion": "jump"}, {"seconds": 0.0}, {"rate": 0.2}, {"seconds": 9e5}):
        with pytest.raises(ValueError, match="clip"):
            Clip(**wrong)


@pytest.mark.parametrize("times", [2, 3])  # of 160 x 120 px: edges are much of it
def test_the_edit_of_a_smaller_photo_is_the_smaller_edit(times):
    document = edited()
    small = shrunk(document, times)
    width, height = small.photo.size
    whole = composite(document).pixels[: height * times, : width * times]
    expected = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)
    found = composite(small).pixels
    assert found.shape == expected.shape
    moved = difference(expected, small.photo.pixels)
    assert difference(found, expected) < 0.3 * moved
    rest = composite(shrunk(shapes.scene("ellipse").document(), times))
    assert rest.changed == 0


def test_a_photo_does_not_vanish():
    with pytest.raises(ValueError, match="cannot be"):
        shrunk(edited(), 500)


def drifting(count: int = 12) -> list[np.ndarray]:
    base = shapes.picture(shapes.mask("ellipse"))
    return [np.roll(cv2.GaussianBlur(base, (0, 0), 3), 3 * k, 1) for k in range(count)]


@pytest.mark.parametrize("ending", ENDINGS)
def test_every_frame_is_in_the_file_and_looks_as_it_did(ending, tmp_path, capfd):
    sent = drifting()
    data = encode_video(iter(sent), 20.0, ending)
    assert capfd.readouterr().err == ""
    path = tmp_path / f"clip{ending}"
    path.write_bytes(data)
    if ending in (".gif", ".webp"):
        image = Image.open(io.BytesIO(data))
        assert image.n_frames == len(sent) and image.info["loop"] == 0
        found = []
        for k in range(image.n_frames):
            image.seek(k)
            found.append(np.asarray(image.convert("RGB")))
    else:
        reader, found = cv2.VideoCapture(str(path)), []
        assert reader.get(cv2.CAP_PROP_FPS) == pytest.approx(20, rel=0.01)
        while (read := reader.read())[0]:
            found.append(cv2.cvtColor(read[1], cv2.COLOR_BGR2RGB))
        reader.release()
    assert len(found) == len(sent)
    for one, other in zip(found, sent, strict=True):
        assert difference(one, other) < 8


def test_what_is_no_video_is_refused():
    with pytest.raises(VideoError, match=r"cannot be written as \.avi"):
        encode_video(drifting(2), 10, ".avi")
    with pytest.raises(VideoError, match="needs a frame"):
        encode_video([], 10, ".gif")


def test_a_pose_without_handles_comes_about_too():
    document = edited()
    bare = replace(document.objects[0], handles=())
    found = list(frames(document.with_object(0, bare), Clip(seconds=0.5, rate=12)))
    assert np.array_equal(found[0], document.photo.pixels)
    assert difference(found[2], found[0]) > 0


@cache
def keyed() -> list[np.ndarray]:
    """A film through four poses: at rest, dragged, dragged elsewhere, and turned only."""
    script = script_from({
        "mask": "m.png", "gaussians": 300, "trust": 0, "inpaint": "telea",
        "key": [
            {"handle": [{"at": [78, 45], "to": [90, 45]}], "pin": [[78, 80]]},
            {"handle": [{"at": [78, 45], "to": [66, 45]}], "pin": [[78, 80]]},
            {"turn": [25], "scale": 0.8},
        ],
    })  # fmt: skip
    mask = shapes.mask("ellipse")
    photo = shapes.png(shapes.picture(mask))
    edited = run_script(photo, "photo.png", script, shapes.mask_png(mask))
    document = edited.document
    assert count_keys(document) == 4 and is_at_key(document, 0)
    found = list(frames(document, Clip("keys", seconds=1.6, rate=25)))
    for number in range(4):
        shown = composite(at_key(document, number)).pixels
        assert np.array_equal(found[number * 10], shown), "each pose is met exactly"
    return found


def test_a_film_goes_through_its_key_poses_and_back_without_a_jump():
    found = keyed()
    assert len(found) == 40
    gaps = [difference(a, b) for a, b in zip(found, [*found[1:], found[0]], strict=True)]
    for station in range(4):  # it starts and stops slowly
        way = gaps[station * 10 : station * 10 + 10]
        assert max(way[0], way[9]) < 0.7 * max(way[3:7])
        assert max(way) < 0.6 * difference(found[station * 10], found[station * 10 + 10 - 40])
    assert np.array_equal(found[0], shapes.picture(shapes.mask("ellipse")))


def test_between_two_drags_of_one_handle_the_object_passes_its_rest():
    """The handle's way is straight, from one side to the other: half-way it is where it was."""
    found = keyed()
    half = difference(found[15], found[0])
    assert half < 0.35 * min(difference(found[10], found[0]), difference(found[20], found[0]))


def test_the_way_between_key_poses_is_eased():
    assert station_at(0.0, 4) == (0, 0.0)
    assert station_at(0.25, 4) == (1, 0.0)
    station, share = station_at(0.375, 4)
    assert station == 1 and share == pytest.approx(0.5)
    shares = [station_at(k / 200, 2)[1] for k in range(100)]
    steps = np.diff(shares)
    assert (steps > 0).all() and steps[0] < 0.1 * steps.max()


def test_a_film_without_key_poses_is_refused_in_a_sentence():
    with pytest.raises(ValueError, match="needs at least two"):
        list(frames(edited(), Clip("keys")))


def test_key_poses_are_kept_changed_and_saved():
    rest = shapes.scene("ellipse").document()
    document = add_key(edits.set_placement(add_key(rest), 0, Placement(turn=(20.0, 0.0, 0.0))))
    posed = edited().objects[0]
    document = document.with_object(0, replace(posed, keys=document.objects[0].keys))
    document = add_key(document)
    assert count_keys(document) == 3 and is_at_key(document, 2)
    assert at_key(document, 0).objects[0].pose is None
    assert at_key(document, 1).objects[0].placement.turn == (20.0, 0.0, 0.0)
    for key in range(3):
        shown = at_key(document, key)
        assert [is_at_key(shown, other) for other in range(3)] == [key == k for k in range(3)]

    opened = decode_session(encode_session(document))
    for one, other in zip(opened.objects[0].keys, document.objects[0].keys, strict=True):
        assert one.placement == other.placement
        assert (one.pose is None) == (other.pose is None)
        if one.pose is not None and other.pose is not None:
            assert np.array_equal(one.pose.points, other.pose.points)
    assert np.array_equal(composite(at_key(opened, 2)).pixels, composite(document).pixels)
    assert [is_at_key(opened, key) for key in range(3)] == [False, False, True]

    at_rest = at_key(document, 0)
    assert is_at_key(at_rest, 0) and not is_at_key(at_rest, 2)
    changed = replace_key(at_rest, 2)
    assert is_at_key(changed, 2) and count_keys(changed) == 3
    assert count_keys(remove_key(changed, 1)) == 2
    further = edits.add_object(document)
    assert count_keys(further) == 3, "what is not lifted has none"
    for _ in range(9):
        document = add_key(document)
    with pytest.raises(edits.EditError, match="at most 12"):
        add_key(document)


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_what_was_frozen_later_stays_where_a_key_pose_has_it(share):
    """Of the side where the handle is: also when that is dragged on from there."""
    document = add_key(edited())
    item, points = document.objects[0], shapes.scene("ellipse").lifted.control_points
    gaps = np.linalg.norm(points - points[7], axis=1)
    frozen = np.argsort(gaps)[1 : round(share * len(points))]
    there = at_key(edits.freeze(edits.set_pose(document, 0, None), 0, frozen), 0)
    handle = there.objects[0].handles[0]
    pulled = edits.move_handle(there, 0, 0, handle.target + (0.05, 0.0, 0.0)).objects[0]
    deformer = shapes.scene("ellipse").puppet.deformer.with_rig(pulled.rig)
    found = deformer.solve(pulled.handles, pulled.footing).pose.points[frozen]
    assert np.abs(found - item.pose.points[frozen]).max() < 1e-9
    at_rest = replace(item.keys[0], handles=(), pose=None)
    resting = at_key(there.with_object(0, replace(there.objects[0], keys=(at_rest,))), 0)
    assert resting.objects[0].rig.shifts is None


def test_a_session_with_key_poses_of_another_object_is_refused():
    document = add_key(edited())
    item = document.objects[0]
    pose = item.keys[0].pose
    short = Pose(pose.points[:-1], pose.rotations[:-1])
    broken = replace(item, keys=(replace(item.keys[0], pose=short),))
    with pytest.raises(SessionError, match="pose"):
        decode_session(encode_session(document.with_object(0, broken)))


def test_a_folder_of_frames_holds_the_film(tmp_path):
    document = edited()
    clip = Clip("sway", seconds=0.4, rate=10)
    files = Export(document, clip=clip).files("video", tmp_path)
    assert [path.name for path in files] == [f"made-{n:04d}.png" for n in range(4)]
    for data, frame in zip(files.values(), frames(document, clip), strict=True):
        assert np.array_equal(np.asarray(Image.open(io.BytesIO(data))), frame)


@pytest.mark.parametrize("change", ["removed", "half seen", "multiplied", "visitor", "moved, too"])
def test_a_morph_begins_as_the_photo_whatever_the_edit_changes(change):
    """Also where an object goes away, comes from another photo, or only looks otherwise."""
    document = shapes.scene("ellipse").document()
    if change == "removed":
        document = edits.set_visible(document, 0, False)
    elif change == "visitor":
        item = replace(departing(document, 0, None), placement=Placement(move=(40.0, 10.0)))
        item = replace(item, mask=np.zeros_like(item.mask))
        document = with_visitor(replace(document, objects=(), plate=None), item)
    else:
        look = {"blend_mode": "multiply"} if change == "multiplied" else {"opacity": 0.5}
        document = edits.set_finish(document, 0, replace(AS_IN_THE_PHOTO, **look))
        if change == "moved, too":
            document = edits.set_placement(document, 0, Placement(move=(14.0, -6.0)))
    found = list(frames(document, Clip(seconds=1.0, rate=20)))
    photo, edit = document.photo.pixels, composite(document).pixels
    assert difference(photo, edit) > 1
    assert np.array_equal(found[0], photo)
    assert np.array_equal(found[10], edit)
    gaps = [difference(a, b) for a, b in zip(found, [*found[1:], found[0]], strict=True)]
    assert max(gaps) < 0.6 * difference(photo, edit)


def test_what_comes_from_another_photo_is_faded_in_where_it_is():
    """It neither slides nor grows: its way here began in no place of this photo."""
    document = shapes.scene("ellipse").document()
    place = Placement((40.0, 10.0), 0.3, (20.0, 0.0, 0.0), 0.8)
    item = replace(departing(document, 0, None), placement=place)
    item = replace(item, mask=np.zeros_like(item.mask))
    document = with_visitor(replace(document, objects=(), plate=None), item)
    found = list(frames(document, Clip(seconds=1.0, rate=20)))
    photo = document.photo.pixels
    there = (composite(document).pixels != photo).any(2)
    shown = [(frame != photo).any(2) for frame in found]
    assert there.any() and shown[5].sum() > 0.5 * there.sum()
    assert not any((seen & ~there).any() for seen in shown)


def test_shadows_and_repairs_fade_in_with_a_morph():
    """The ground beside the object, lightened in the plate, does not change in one picture."""
    document = shapes.scene("ellipse").document()
    plate = document.plate
    assert plate is not None
    ground = np.zeros_like(plate.hole)
    ground[100:118, 10:150] = True
    pixels = np.where(ground[..., None], 255, plate.pixels).astype(np.uint8)
    plate = replace(plate, pixels=pixels, hole=plate.hole | ground, painted=ground)
    document = edits.set_plate(document, plate)
    document = edits.set_placement(document, 0, Placement(move=(14.0, -6.0)))
    document = edits.set_shadow(document, 0, Shadow(strength=0.8))
    found = [f[102:116, 20:140] for f in frames(document, Clip(seconds=2.0, rate=20))]
    photo, edit = (
        document.photo.pixels[102:116, 20:140],
        composite(document).pixels[102:116, 20:140],
    )
    assert np.array_equal(found[0], photo) and np.array_equal(found[20], edit)
    whole = difference(photo, edit)
    gaps = [difference(a, b) for a, b in zip(found, [*found[1:], found[0]], strict=True)]
    assert whole > 30 and max(gaps) < 0.25 * whole


def refined(document: Document) -> Document:
    """Refined to half as dark, everywhere in a box around the edit."""
    pixels = composite(document).pixels[20:90, 30:130] // 2
    made = Refined(30, 20, pixels, np.full(pixels.shape[:2], 255, np.uint8), "made")
    return edits.set_refined(document, made)


def test_a_refinement_is_seen_only_while_the_edit_is_still():
    """It was made for that picture: over any other one it would show the object twice."""
    plain = edited()
    document = refined(plain)
    found, expected = (list(frames(d, Clip(seconds=2.0, rate=20))) for d in (document, plain))
    for k in (*range(21), *range(26, 40)):
        assert np.array_equal(found[k], expected[k]), k
    assert np.array_equal(found[23], composite(document).pixels)
    darker = [difference(found[k], expected[k]) for k in (20, 21, 23)]
    assert darker[0] < darker[1] <= darker[2]
    first = [next(frames(d, Clip("sway", seconds=1.0, rate=20))) for d in (document, plain)]
    assert np.array_equal(*first)


@pytest.mark.parametrize("times", [2, 3])
def test_a_smaller_photo_is_refined_and_blurred_as_the_whole_one(times):
    moved = edits.set_placement(shapes.scene("ellipse").document(), 0, Placement(move=(14.0, -6.0)))
    blurred = edits.set_finish(moved, 0, replace(AS_IN_THE_PHOTO, blur=9.0))
    for document in (refined(edited()), blurred):
        small = shrunk(document, times)
        width, height = small.photo.size
        whole = composite(document).pixels[: height * times, : width * times]
        expected = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)
        assert difference(composite(small).pixels, expected) < 0.3 * difference(
            expected, small.photo.pixels
        )
    assert small.objects[0].finish.blur == 9.0 / times


@pytest.mark.parametrize("ending", ENDINGS)
def test_an_odd_size_stays_where_the_format_has_it(ending: str, tmp_path: Path):
    sent = [frame[:101, :151] for frame in drifting(3)]
    path = tmp_path / f"clip{ending}"
    path.write_bytes(encode_video(iter(sent), 20.0, ending))
    if ending in PICTURES:
        with Image.open(path) as image:
            assert image.size == (151, 101)
        return
    height, width = read_frames(path, (0,))[0].shape[:2]
    assert (width, height) == (150, 100)


@pytest.mark.parametrize("ending", PICTURES)
@pytest.mark.parametrize("rate", [12.0, 24.0, 25.0, 30.0])
def test_a_clip_lasts_as_long_as_its_frames(ending: str, rate: float):
    sent = drifting(24)
    with Image.open(io.BytesIO(encode_video(iter(sent), rate, ending))) as image:
        lasting = 0
        for frame in ImageSequence.Iterator(image):
            frame.load()
            lasting += frame.info["duration"]
    assert lasting == pytest.approx(1000 * len(sent) / rate, abs=5)


def test_a_gif_has_colours_that_its_first_frame_lacks():
    grey = np.full((60, 80, 3), 128, np.uint8)
    red = grey.copy()
    red[20:40, 30:60] = (200, 60, 40)
    data = encode_video(iter([grey, red, grey]), 10.0, ".gif", [red])
    with Image.open(io.BytesIO(data)) as image:
        for frame, before in zip(ImageSequence.Iterator(image), (grey, red, grey), strict=True):
            assert difference(np.asarray(frame.convert("RGB")), before) < 2


@pytest.mark.parametrize("ending", PICTURES)
def test_what_the_photo_does_not_show_is_in_no_frame(ending: str):
    sent, clear = drifting(4), np.s_[:30, :40]
    alpha = np.full(sent[0].shape[:2], 255, np.uint8)
    alpha[clear] = 0
    data = encode_video((np.dstack([frame, alpha]) for frame in sent), 20.0, ending)
    with Image.open(io.BytesIO(data)) as image:
        assert image.n_frames == len(sent)
        for frame, before in zip(ImageSequence.Iterator(image), sent, strict=True):
            found = np.asarray(frame.convert("RGBA"))
            assert np.array_equal(found[..., 3], alpha)
            there = alpha > 0
            assert np.abs(found[there][:, :3].astype(int) - before[there]).mean() < 8


def test_the_alpha_of_a_clip_at_rest_is_the_photos_as_small_as_its_frames():
    document = edited()
    height, width = document.photo.pixels.shape[:2]
    alpha = np.zeros((height, width), np.uint8)
    alpha[: height // 2] = 255
    photo = replace(document.photo, picture=replace(document.photo.picture, alpha=alpha))
    document = replace(document, photo=photo)
    clip = Clip(seconds=0.2, longest=(max(width, height) + 1) // 2)
    small = next(frames(document, clip))
    assert small.shape == (height // 2, width // 2, 4)
    assert set(np.unique(small[..., 3])) == {0, 255}
    assert next(frames(edited(), clip)).shape[2] == 3


@pytest.mark.parametrize(
    ("size", "ending"),
    [((1, 1), ".mp4"), ((64, 1), ".webm"), ((1, 64), ".mp4"), ((20000, 12), ".webp")],
)
def test_a_size_that_a_format_does_not_have_is_said(size, ending):
    width, height = size
    sent = [np.full((height, width, 3), 90, np.uint8)] * 2
    with pytest.raises(VideoError, match=rf"of {width} x {height} px .* {ending}, .* \d+ to \d+"):
        encode_video(iter(sent), 10.0, ending)
    assert encode_video(iter(sent), 10.0, ".gif")
