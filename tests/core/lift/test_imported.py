"""An object from elsewhere becomes a lifted one: registered, textured with the photo."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from objectmorpher_core.compose.composite import composite, object_texture
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.document.model import (
    Document,
    EditObject,
    LiftedObject,
    Matte,
    Photo,
    Placement,
)
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.registration.imported import lift_imported
from objectmorpher_core.lift.registration.placement import Proposal, Registrar
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.pipeline import export
from objectmorpher_core.raster.reference import Picture3D
from objectmorpher_core.segment.matting.matte import build_matte
from tests import shapes
from tests.core.lift import registered
from tests.core.lift.registered import Scene

PIXEL = 2e-3  # px: u0 and means are float32
LEVEL = 1 / 255
MARGIN = 16  # px of the matte around the mask


def _true_pose(gaussians: Gaussians, scene: Scene) -> Proposal:
    return Registrar(gaussians, scene.target).rated(scene.world_from_object)


@cache
def _bracket() -> tuple[Scene, Matte, LiftedObject]:
    gaussians, scene = registered.known_bracket()
    matte = build_matte(scene.pixels, scene.mask, MARGIN)
    return scene, matte, lift_imported(gaussians, _true_pose(gaussians, scene), matte)


def _drawn(scene: Scene, matte: Matte, lifted: LiftedObject, placement: Placement) -> Picture3D:
    puppet = Puppet(lifted, DeformSettings(), scene.camera)
    return puppet.draw(None, placement, object_texture(matte, lifted), scene.camera)


def _in_photo(values: np.ndarray, matte: Matte, scene: Scene) -> np.ndarray:
    whole = np.zeros((*scene.mask.shape, *values.shape[2:]), np.float32)
    x0, y0, x1, y1 = matte.box
    whole[y0:y1, x0:x1] = values
    return whole


def _depths(scene: Scene, lifted: LiftedObject) -> np.ndarray:
    """(N,) how far each Gaussian is behind what a ray through it meets first, object units."""
    own = scene.world_from_object
    world = lifted.world_points(lifted.gaussians.means.astype(np.float64))
    start, ways = -own[:3, 3] @ own[:3, :3], world @ own[:3, :3]
    return 1.0 - registered.bracket().cast(start, ways)  # in units of the way, about 2.4


def test_its_frame_is_centred_and_its_largest_extent_is_1():
    _, _, lifted = _bracket()
    body = lifted.body.means
    low, high = body.min(0), body.max(0)
    assert np.abs(low + high).max() < 1e-5
    assert (high - low).max() == pytest.approx(1, abs=1e-5)
    linear = lifted.world_from_object[:3, :3] / lifted.scale
    assert np.abs(linear @ linear.T - np.eye(3)).max() < 1e-9, "a similarity"
    assert lifted.splatting == "solid"
    assert 256 < len(lifted.control_points) <= 512


def test_every_gaussian_looks_at_the_pixel_where_it_is():
    scene, _, lifted = _bracket()
    world = lifted.world_points(lifted.gaussians.means.astype(np.float64))
    assert np.abs(scene.camera.project(world) - lifted.texture.u0).max() < PIXEL


def test_the_world_stays_where_the_registration_has_put_it():
    gaussians, scene = registered.known_bracket()
    _, _, lifted = _bracket()
    own = scene.world_from_object
    ratio = lifted.world_from_object[2, 3] / own[2, 3]  # the world's unit is the document's own
    before = (gaussians.means @ own[:3, :3].T + own[:3, 3]).astype(np.float64)
    after = lifted.world_points(lifted.gaussians.means[: len(gaussians)].astype(np.float64))
    ratio = np.linalg.norm(after) / np.linalg.norm(before)
    assert np.abs(after - ratio * before).max() < 1e-5


def test_what_is_in_front_is_seen_and_what_is_hidden_is_not():
    scene, _, lifted = _bracket()
    is_body = lifted.texture.solidity > 0.5
    behind, seen = _depths(scene, lifted)[is_body], lifted.texture.visibility[is_body]
    thick = 3 * lifted.spacing / 2.4
    hidden = np.isfinite(behind) & (behind > 2 * thick)
    normals = lifted.gaussians.normals[is_body] @ lifted.world_from_object[:3, :3].T
    world = lifted.world_points(lifted.gaussians.means[is_body].astype(np.float64))
    cosine = -(normals * world).sum(1) / np.linalg.norm(normals, axis=1)
    cosine /= np.linalg.norm(world, axis=1)
    front = np.isfinite(behind) & (np.abs(behind) < 0.3 * thick) & (cosine > 0.3)
    assert hidden.sum() > 500 and seen[hidden].max() < 0.2 and seen[hidden].mean() < 1e-3
    assert front.sum() > 500 and np.median(seen[front]) == 1.0
    assert (seen[front] > 0.5).mean() > 0.93, "but for those beside what hides them"
    assert seen[cosine < -0.06].max() == 0, "a back is never seen"


def test_at_rest_it_is_the_photo():
    scene, matte, lifted = _bracket()
    drawn = _drawn(scene, matte, lifted, Placement())
    alpha = _in_photo(matte.alpha, matte, scene)
    own = _in_photo(matte.foreground, matte, scene) * alpha[..., None]
    assert np.abs(drawn.alpha - alpha).mean() / alpha.mean() < 0.01
    inside = cv2.erode(scene.mask.astype(np.uint8), np.ones((3, 3))) > 0
    error = np.abs(drawn.color - own).max(2)[inside]
    assert np.median(error) < 0.1 * LEVEL
    assert (error < 2 * LEVEL).mean() > 0.96, "but for seams where a part hides another"
    assert drawn.from_photo[inside].mean() > 0.97


def test_nothing_of_it_is_left_behind_or_brought_along_when_it_moves():
    scene, matte, lifted = _bracket()
    drawn = _drawn(scene, matte, lifted, Placement(move=(10.0, 5.0)))
    was = _drawn(scene, matte, lifted, Placement())
    assert drawn.alpha.sum() == pytest.approx(was.alpha.sum(), rel=0.04)
    there = cv2.dilate(np.roll(scene.mask, (5, 10), (0, 1)).astype(np.uint8), np.ones((9, 9)))
    assert drawn.alpha[there == 0].max() == 0, "but for its perspective it is only shifted"


def test_no_pixel_of_the_background_is_carried():
    """The background is made of a colour that the object has nowhere."""
    gaussians, scene = registered.known_bracket()
    signal = np.array([0, 255, 0], np.uint8)
    pixels = scene.pixels.copy()
    red = np.array([200, 40, 60], np.uint8)
    pixels[scene.mask], pixels[~scene.mask] = red, signal
    plain = replace(gaussians, colors=np.full((len(gaussians), 3), [0.9, 0.2, 0.3], np.float32))
    matte = build_matte(pixels, scene.mask, MARGIN)
    # A registration that misses by four pixels: parts of the object stand before the background.
    wrong = scene.world_from_object.copy()
    wrong[:2, 3] += 4.0 * wrong[2, 3] / scene.camera.focal
    lifted = lift_imported(plain, Registrar(plain, scene.target).rated(wrong), matte)
    for turn in (0.0, 15.0, -40.0, 100.0, 180.0):
        drawn = _drawn(scene, matte, lifted, Placement(turn=(turn, 0.0, 0.0)))
        seen = drawn.color[drawn.alpha > 0.2] / drawn.alpha[drawn.alpha > 0.2][:, None]
        greener = seen[:, 1] - seen[:, 0]
        assert greener.max() < -0.1, "the object is red"
        assert np.quantile(seen[:, 1], 0.99) < 0.3


def test_what_the_object_does_not_cover_of_the_cut_out_comes_along():
    gaussians, scene = registered.known_bracket()
    small = scene.world_from_object.copy()
    small[:3, :3] *= 0.93  # the mask is larger than the object, all around
    matte = build_matte(scene.pixels, scene.mask, MARGIN)
    lifted = lift_imported(gaussians, Registrar(gaussians, scene.target).rated(small), matte)
    brim = lifted.texture.solidity < 0.5
    assert brim.any()
    alpha = _in_photo(matte.alpha, matte, scene)
    drawn = _drawn(scene, matte, lifted, Placement())
    assert np.minimum(drawn.alpha, alpha).sum() > 0.98 * alpha.sum()


def test_what_reaches_beyond_the_cut_out_is_cut_off_at_rest():
    gaussians, scene = registered.known_bracket()
    large = scene.world_from_object.copy()
    large[:3, :3] *= 1.03
    matte = build_matte(scene.pixels, scene.mask, MARGIN)
    lifted = lift_imported(gaussians, Registrar(gaussians, scene.target).rated(large), matte)
    drawn = _drawn(scene, matte, lifted, Placement())
    alpha = _in_photo(matte.alpha, matte, scene)
    assert drawn.alpha[alpha == 0].sum() < 0.01 * alpha.sum()


def test_unseen_colours_are_brought_into_the_light_of_the_photo():
    """The photo is darker and warmer than the object: by 0.9, 0.85, 0.75."""
    gaussians, (_, _, lifted) = registered.known_bracket()[0], _bracket()
    unseen = lifted.texture.visibility[: len(gaussians)] == 0
    before = gaussians.colors[unseen].astype(np.float64)
    after = lifted.gaussians.colors[: len(gaussians)][unseen]
    gains = (before * after).sum(0) / (before * before).sum(0)
    assert np.abs(gains - [0.9, 0.85, 0.75]).max() < 0.05
    wanted = before * [0.9, 0.85, 0.75]
    assert np.abs(after - wanted).mean() < 0.4 * np.abs(before - wanted).mean()


def test_a_cloud_is_drawn_as_a_cloud_and_carries_the_photo_too():
    gaussians, scene = registered.known_bracket()
    sizes = np.repeat(0.8 * gaussians.scales[:, :1], 3, 1)
    cloud = replace(gaussians, scales=sizes, opacities=np.full(len(gaussians), 0.8, np.float32))
    matte = build_matte(scene.pixels, scene.mask, MARGIN)
    lifted = lift_imported(cloud, _true_pose(cloud, scene), matte)
    assert lifted.splatting == "classic"
    drawn = _drawn(scene, matte, lifted, Placement())
    inside = cv2.erode(scene.mask.astype(np.uint8), np.ones((5, 5))) > 0
    own = _in_photo(matte.foreground, matte, scene)
    straight = drawn.color[inside] / np.maximum(drawn.alpha[inside], 0.1)[:, None]
    # It is translucent: a little of what is behind shines through.
    assert np.median(np.abs(straight - own[inside])) < 8 * LEVEL
    assert drawn.from_photo[inside].mean() > 0.8
    named = lift_imported(cloud, _true_pose(cloud, scene), matte, "mip")
    assert named.splatting == "mip"


def test_in_a_document_nothing_changes_until_it_is_moved():
    scene, matte, lifted = _bracket()
    data = shapes.png(scene.pixels)
    photo = Photo(Picture(scene.pixels), scene.camera, data, "made.png")
    item = EditObject("Object 1", mask=scene.mask).with_lifted(matte, lifted)
    document = Document(photo, (item,), plate=shapes.grey_plate(scene.mask))
    assert np.array_equal(export(document).pixels, scene.pixels)
    moved = replace(item, placement=Placement(turn=(25.0, 0.0, 0.0)))
    result = composite(replace(document, objects=(moved,)))
    assert result.outside_footprint_changed == 0
    assert result.shares.from_photo > 0.3 and result.shares.from_lifter > 0.02


def test_a_mesh_that_is_inside_out_is_turned_out():
    gaussians, scene = registered.known_bracket()
    w, x, y, z = gaussians.quats.T
    turned = np.stack([-x, w, z, -y], 1)  # by 180 degrees about their own x axis
    inside_out = replace(gaussians, quats=turned)
    assert np.abs(inside_out.normals + gaussians.normals).max() < 1e-5
    _, matte, lifted = _bracket()
    other = lift_imported(inside_out, _true_pose(inside_out, scene), matte)
    count = len(gaussians)
    assert np.abs(other.gaussians.normals[:count] - lifted.gaussians.normals[:count]).max() < 1e-4


def test_an_object_that_is_too_little_is_refused_in_one_sentence():
    gaussians, scene = registered.known_bracket()
    _, matte, _ = _bracket()
    pose = _true_pose(gaussians, scene)
    with pytest.raises(LiftError, match="too few"):
        lift_imported(gaussians.select(np.arange(5)), pose, matte)
    near = pose.world_from_object.copy()
    near[2, 3] = 0.1
    with pytest.raises(LiftError, match="behind the camera"):
        lift_imported(gaussians, replace(pose, world_from_object=near), matte)
