"""A lifted object whose mask is refined: nothing moves that the change does not concern."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest
from scipy.spatial import KDTree

from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.plate.plate import hole_margin, plate_cover
from objectmorpher_core.deform.puppet import Puppet, puppet_of
from objectmorpher_core.document import edits
from objectmorpher_core.document.edits import EditError
from objectmorpher_core.document.key_edits import add_key
from objectmorpher_core.document.model import Document, LiftSettings, Placement, Prompt
from objectmorpher_core.document.pose import Base
from objectmorpher_core.lift.refitting import Lifted, background_of, refit
from objectmorpher_core.lift.registration.imported import ImportTarget
from objectmorpher_core.pictures.image import Picture, encode_picture
from objectmorpher_core.pipeline import lift_mask, make_plate, open_photo
from objectmorpher_core.segment.mask_edit import grow
from objectmorpher_core.segment.matting.matte import REACH, band_width
from objectmorpher_core.session.file import decode_session, encode_session
from tests.photos import outlined, photo
from tests.tree import quick

STEP = 2  # every second pixel of the photos
SETTINGS = LiftSettings(count=4000)
SUBJECTS = {"coffee": "coffee", "chelsea": "cat", "astronaut": "astronaut"}


@dataclass(frozen=True, eq=False)
class Posed:
    """A lifted object that was bent and placed."""

    document: Document
    puppet: Puppet
    pixels: np.ndarray


def _posed(name: str) -> Posed:
    pixels = np.ascontiguousarray(photo(name)[::STEP, ::STEP])
    mask = outlined(SUBJECTS[name])[::STEP, ::STEP]
    document = open_photo(encode_picture(Picture(pixels), "png"), f"{name}.png")
    document = edits.set_mask(edits.add_object(document), 0, mask, Prompt())
    camera = document.photo.camera
    matte, lifted = lift_mask(pixels, camera, mask, "relief", SETTINGS)
    document = edits.set_lifted(document, 0, matte, lifted, SETTINGS)
    plate = make_plate(pixels, plate_cover(document), "telea")
    points = lifted.control_points.astype(np.float64)
    low, high = points[points[:, 1].argmax()], points[points[:, 1].argmin()]
    document = edits.add_handle(edits.set_plate(document, plate), 0, low, is_pin=True)
    document = edits.add_handle(document, 0, high, high + [0.12, 0.02, 0.0])
    puppet = puppet_of(document.objects[0], camera)
    pose = puppet.deformer.solve(document.objects[0].handles, document.objects[0].footing).pose
    document = edits.set_pose(document, 0, pose)
    document = edits.set_placement(document, 0, Placement((9, -4), 0.1, (12, 5, 4), 1.04))
    return Posed(document, puppet, composite(document, {0: puppet}).pixels)


@pytest.fixture(scope="module", params=quick(SUBJECTS, 1))
def posed(request) -> Posed:
    return _posed(request.param)


def _changed(mask: np.ndarray, seed: int) -> np.ndarray:
    """A disc on the outline, added or taken away."""
    random = np.random.default_rng(seed)
    rim = np.argwhere(mask & ~cv2.erode(mask.view(np.uint8), np.ones((3, 3))).astype(bool))
    row, column = rim[random.integers(len(rim))]
    y, x = np.mgrid[: mask.shape[0], : mask.shape[1]]
    disc = np.hypot(y - row, x - column) < 0.05 * np.hypot(*np.ptp(rim, axis=0))
    return mask | disc if seed % 2 else mask & ~disc


def _refitted(document: Document, mask: np.ndarray) -> Document:
    changed = edits.change_mask(document, 0, mask)
    item, photo = changed.objects[0], changed.photo
    was = Lifted(item.shaped, item.matte, item.lifted, item.shape)
    scene = ImportTarget(photo.pixels, photo.camera, item.selection)
    answer = refit(was, scene, background_of(changed, 0, "telea"))
    return edits.refit(changed, 0, answer.matte, answer.lifted, answer.plate)


def _footprint(before: Posed, after: Document, puppet: Puppet) -> np.ndarray:
    """(H, W) where the change may be seen: in the photo, and where it went from there."""
    one, two = before.document.objects[0], after.objects[0]
    height, width = one.mask.shape
    changed = one.mask != two.mask
    reach = (REACH + 3) * band_width(width, height) + hole_margin(width, height)
    away = cv2.distanceTransform((~changed).astype(np.uint8), cv2.DIST_L2, 5)
    seen = away < reach
    for item, own in ((one, before.puppet), (two, puppet)):
        u0 = item.lifted.texture.u0
        column, row = np.floor(u0).astype(int).T
        near = away[row.clip(0, height - 1), column.clip(0, width - 1)] < reach
        xy = after.photo.camera.project(own.posed(item.pose, item.placement).means[near])
        for x, y in np.rint(xy).astype(int):
            cv2.circle(seen.view(np.uint8), (int(x), int(y)), 8, 1, -1)
    return seen


@pytest.mark.parametrize("seed", quick(range(3), 1))
def test_a_refined_mask_changes_nothing_but_what_it_concerns(posed, seed):
    camera, old = posed.document.photo.camera, posed.document.objects[0]
    base = Base(old.pose, old.handles, np.arange(5))  # which names control points, too
    document = add_key(posed.document.with_object(0, replace(old, base=base)))
    after = _refitted(document, _changed(old.mask, seed))
    item = after.objects[0]
    puppet = puppet_of(item, camera)
    gaps, same = KDTree(item.lifted.gaussians.means).query(old.lifted.gaussians.means)
    assert (gaps == 0).mean() > 0.85
    places = [p.posed(o.pose, o.placement).means for p, o in ((posed.puppet, old), (puppet, item))]
    xy = [camera.project(m) for m in (places[0][gaps == 0], places[1][same[gaps == 0]])]
    moved = np.hypot(*(xy[0] - xy[1]).T)
    assert np.quantile(moved, 0.99) < 0.1
    footprint = _footprint(posed, after, puppet)
    far = ~_at(footprint, xy[0])
    assert moved[far].max() < 1.0
    for handle in item.handles:
        ends = [p.picture_of(handle.point, o.pose, o.placement)
                for p, o in ((posed.puppet, old), (puppet, item))]  # fmt: skip
        assert np.hypot(*(ends[0] - ends[1])) < 1.0
    kept = {tuple(h.point) for h in item.handles}
    assert kept <= {tuple(h.point) for h in old.handles}
    picture = composite(after, {0: puppet}).pixels
    difference = np.abs(picture.astype(int) - posed.pixels).max(2)
    assert difference[~footprint].mean() < 1.0
    assert difference[footprint].max() > 8  # the change is seen
    assert item.shaped is None
    assert np.array_equal(item.keys[0].pose.points, item.pose.points)
    assert item.keys[0].placement == item.placement
    again = decode_session(encode_session(after))
    assert np.array_equal(composite(again).pixels, picture)


def _at(mask: np.ndarray, xy: np.ndarray) -> np.ndarray:
    column, row = np.floor(xy).astype(int).T
    return mask[row.clip(0, mask.shape[0] - 1), column.clip(0, mask.shape[1] - 1)]


def test_until_it_is_refitted_everything_stays_and_a_session_says_so(posed):
    document = posed.document
    mask = grow(document.objects[0].mask, 2)
    changed = edits.change_mask(document, 0, mask)
    item, old = changed.objects[0], document.objects[0]
    assert item.lifted is old.lifted and item.pose is old.pose and changed.plate is document.plate
    assert np.array_equal(item.shaped, old.mask)
    assert np.array_equal(composite(changed, {0: posed.puppet}).pixels, posed.pixels)
    twice = edits.change_mask(changed, 0, grow(mask, 2))
    assert twice.objects[0].shaped is item.shaped
    again = decode_session(encode_session(changed)).objects[0]
    assert np.array_equal(again.shaped, old.mask) and again.pose is not None


def test_another_thing_is_a_new_selection(posed):
    document = posed.document
    elsewhere = ~grow(document.objects[0].mask, 4)
    item = edits.change_mask(document, 0, elsewhere).objects[0]
    assert item.lifted is None and item.pose is None and item.placement.is_identity
    assert edits.set_mask(document, 0, None, Prompt()).objects[0].lifted is None
    with pytest.raises(EditError, match="nothing"):
        edits.change_mask(document, 0, np.zeros_like(elsewhere))


def test_a_shape_from_elsewhere_stays_and_takes_the_new_cutout(posed):
    document = posed.document
    old = document.objects[0]
    alien = replace(old.lifted, middle=None, splatting="solid", backend="imported")
    document = document.with_object(0, replace(old, lifted=alien))
    after = _refitted(replace(document, plate=posed.document.plate), _changed(old.mask, 0))
    item = after.objects[0]
    body, new = alien.body, item.lifted.body
    assert np.array_equal(body.means, new.means) and item.lifted.backend == "imported"
    assert np.array_equal(alien.control_points, item.lifted.control_points)
    assert np.allclose(item.pose.points, old.pose.points)
    removed = old.mask & ~item.mask
    column, row = np.argwhere(removed)[:, ::-1].T - np.array([[item.matte.left], [item.matte.top]])
    assert item.matte.alpha[row, column].mean() < 0.35


def test_copies_stay_copies(posed):
    document = edits.duplicate(posed.document, 0)
    after = _refitted(document, _changed(document.objects[0].mask, 1))
    one, two = after.objects
    assert one.mask is two.mask and one.lifted is two.lifted and one.matte is two.matte
    assert two.shaped is None
