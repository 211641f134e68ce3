"""The relief: a closed body over a silhouette, registered to the photo."""

from __future__ import annotations

from dataclasses import fields

import cv2
import numpy as np
import pytest
from scipy.spatial import cKDTree

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.progress import Cancelled
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.document.model import LiftedObject, LiftSettings
from objectmorpher_core.lift import BACKENDS, LiftError, load
from objectmorpher_core.lift.relief.body import BACK, FRONT, ReliefBody
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.lift.relief.thickness import FULLNESS, RIM_SLOPE
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.segment.matting.matte import signed_distance
from tests import shapes
from tests.core.lift.standing_things import Box, View
from tests.tree import quick

PIXEL = 1e-3  # px: u0 and means are float32
COUNT = 3000  # Gaussians of each mask: one lift for all that is seen of it

masks = pytest.mark.parametrize("name", quick(shapes.MASKS, 4))


def _lift(inside: np.ndarray, count: int = 800, seed: int = 0, trust: float = 0.0) -> LiftedObject:
    """By its silhouette alone, unless there is `trust` in the shape network."""
    height, width = inside.shape
    camera, settings = Camera.from_fov(width, height), LiftSettings(count, trust=trust)
    return lift_mask(shapes.picture(inside), camera, inside, "relief", settings, seed=seed)[1]


def _heights(scene: shapes.Scene) -> np.ndarray:
    """(N,) px in front of the middle sheet."""
    lifted = scene.lifted
    assert lifted.middle is not None
    world = lifted.world_points(lifted.gaussians.means.astype(np.float64))
    unit = 1 / ReliefSilhouette.of(scene.mask).extent  # world units per px: the object is 1 wide
    return (lifted.middle[:, 0] - world[:, 2]) / unit


@masks
def test_every_gaussian_is_seen_in_the_photo_where_its_texture_says(name):
    scene = shapes.scene(name, COUNT)
    world = scene.lifted.world_points(scene.lifted.gaussians.means.astype(np.float64))
    assert np.abs(scene.camera.project(world) - scene.lifted.texture.u0).max() < PIXEL


@masks
def test_the_object_frame_is_centred_and_one_unit_large(name):
    lifted = shapes.scene(name, COUNT).lifted
    low, high = lifted.gaussians.means.min(0), lifted.gaussians.means.max(0)
    assert np.abs(low + high).max() < 1e-5
    assert (high - low).max() == pytest.approx(1, abs=1e-5)
    linear = lifted.world_from_object[:3, :3]
    assert np.abs(linear - lifted.scale * np.eye(3)).max() < 1e-9, "a similarity without turn"


@masks
def test_it_has_a_front_a_back_and_a_brim(name):
    scene = shapes.scene(name, COUNT)
    texture = scene.lifted.texture
    body = texture.solidity > 0.5
    front, back = body & (texture.visibility > 0.5), body & (texture.visibility < 0.5)
    assert front.sum() > 0.25 * body.sum()
    assert back.sum() > 0.25 * body.sum()
    assert (~body).any()
    outside = cv2.distanceTransform((~scene.mask).astype(np.uint8), cv2.DIST_L2, 5)
    column, row = np.floor(texture.u0[~body]).astype(int).T
    is_in = (column >= 0) & (column < 160) & (row >= 0) & (row < 120)
    assert (outside[row[is_in], column[is_in]] >= 0.5).mean() > 0.9, "the brim is around it"


@masks
def test_the_front_faces_the_camera_and_the_back_does_not(name):
    scene = shapes.scene(name, COUNT)
    lifted, texture = scene.lifted, scene.lifted.texture
    world = lifted.world_points(lifted.gaussians.means.astype(np.float64))
    cosine = -(lifted.gaussians.normals * world).sum(1) / np.linalg.norm(world, axis=1)
    body = texture.solidity > 0.5
    rounding = 1e-3  # a front that is seen just edge-on, through a float32 quaternion
    assert cosine[body & (texture.visibility > 0.5)].min() > -rounding
    assert cosine[body & (texture.visibility < 0.5)].max() < 0.2  # perspective sees round the rim


@masks
def test_front_and_back_are_mirror_images_about_the_middle_sheet(name):
    scene = shapes.scene(name, COUNT)
    height = _heights(scene)
    body = scene.lifted.texture.solidity > 0.5
    front, back = height[body & (height > 0)], -height[body & (height < 0)]
    assert np.quantile(front, 0.9) == pytest.approx(np.quantile(back, 0.9), rel=0.15)


@masks
def test_there_are_no_spikes_at_the_rim(name):
    """Nowhere is the body thicker than the silhouette's width there allows."""
    scene = shapes.scene(name, COUNT)
    height, u0 = np.abs(_heights(scene)), scene.lifted.texture.u0
    column, row = np.floor(u0).astype(int).T
    is_in = (column >= 0) & (column < 160) & (row >= 0) & (row < 120)
    distance = signed_distance(scene.mask)  # px to the edge; the frame is no edge
    near = is_in.copy()
    near[is_in] = distance[row[is_in], column[is_in]] < 4
    widest = signed_distance(scene.mask).max()
    # the slope at the rim, one grid cell of slack
    steepest = 1.1 * FULLNESS * RIM_SLOPE
    allowed = np.minimum(distance[row[near], column[near]] + 1.5, widest)
    assert (height[near] <= steepest * np.maximum(allowed, 0) + 1).all()
    assert height.max() <= 1.1 * widest + 1


def test_the_same_seed_gives_the_same_object_and_another_seed_another():
    inside = shapes.mask("ellipse")
    one, two, other = _lift(inside, seed=3), _lift(inside, seed=3), _lift(inside, seed=4)
    for name in (f.name for f in fields(Gaussians)):
        assert np.array_equal(getattr(one.gaussians, name), getattr(two.gaussians, name))
    assert np.array_equal(one.control_points, two.control_points)
    assert not np.array_equal(one.gaussians.means[:50], other.gaussians.means[:50])


@pytest.mark.parametrize("count", quick([1000, 300, 4000], 1))
def test_about_as_many_gaussians_as_asked(count):
    got = (_lift(shapes.mask("disc", 320, 240), count).texture.solidity > 0.5).sum()
    assert 0.6 * count <= got <= 1.4 * count


def test_the_gaussians_are_evenly_spread():
    scene = shapes.scene("disc", 1000)
    texture, means = scene.lifted.texture, scene.lifted.gaussians.means
    front = means[(texture.visibility > 0.5) & (texture.solidity > 0.5)]
    gaps = cKDTree(front).query(front, k=2)[0][:, 1]
    assert gaps.min() > 0.5 * scene.lifted.spacing
    assert gaps.max() < 2.0 * scene.lifted.spacing


def test_control_points_lie_on_the_body_and_not_on_the_brim():
    scene = shapes.scene("ellipse")
    means, body = scene.lifted.gaussians.means, scene.lifted.texture.solidity > 0.5
    assert cKDTree(means[body]).query(scene.lifted.control_points)[0].max() < 1e-6


def test_a_hole_of_the_mask_stays_a_hole():
    scene = shapes.scene("ring", 2000)
    u0, body = scene.lifted.texture.u0, scene.lifted.texture.solidity > 0.5
    assert np.hypot(u0[body, 0] - 80, u0[body, 1] - 60).min() > 18


def test_parts_of_the_mask_become_parts_of_the_object():
    scene = shapes.scene("parts", 2000)
    body = scene.lifted.texture.solidity > 0.5
    x = scene.lifted.texture.u0[body, 0]
    assert not ((x > 72) & (x < 92)).any()
    assert scene.puppet.deformer.graph.component_count == 2


def test_an_object_that_fills_one_row_less_than_the_photo_lifts():
    inside = np.ones((60, 80), bool)
    inside[0] = False
    lifted = _lift(inside, 400, trust=1.0)
    assert np.isfinite(lifted.gaussians.means).all()


@pytest.mark.parametrize("side", quick([5, 7, 12], 1))
def test_a_tiny_object_lifts(side):
    inside = np.zeros((120, 160), bool)
    inside[50 : 50 + side, 60 : 60 + side] = True
    lifted = _lift(inside, 2000, trust=1.0)
    assert len(lifted.control_points) >= 4
    assert (lifted.gaussians.scales > 0).all()


def test_too_small_an_object_is_refused():
    inside = np.zeros((120, 160), bool)
    inside[50:54, 60:66] = True
    with pytest.raises(LiftError, match="only 24 pixels, too small to lift"):
        _lift(inside)


def test_cancelling_ends_the_lift():
    def stop(fraction: float, note: str) -> None:
        raise Cancelled

    inside = shapes.mask("disc")
    with pytest.raises(Cancelled):
        lift_mask(
            shapes.picture(inside), shapes.camera(), inside, "relief", LiftSettings(300), stop
        )


def test_progress_runs_from_nothing_towards_one():
    told: list[float] = []
    inside = shapes.mask("disc")
    lift_mask(
        shapes.picture(inside), shapes.camera(), inside, "relief", LiftSettings(300),
        lambda fraction, note: told.append(fraction),
    )  # fmt: skip
    assert told == sorted(told)
    assert told[0] >= 0
    assert told[-1] <= 1


def test_an_unknown_lifter_is_refused_by_name():
    with pytest.raises(LiftError, match="no lifter 'magic'; known are relief"):
        load("magic")
    assert load("auto").name in BACKENDS


@masks
def test_the_brim_lies_in_the_middle_sheet(name):
    scene = shapes.scene(name, COUNT)
    brim = scene.lifted.texture.solidity < 0.5
    assert np.abs(_heights(scene)[brim]).max() < 1e-3  # px


@masks
def test_the_middle_sheet_changes_as_it_says(name):
    """Depth and slope of neighbours agree: they are of one sheet."""
    lifted = shapes.scene(name, COUNT).lifted
    assert lifted.middle is not None
    middle, u0 = lifted.middle.astype(np.float64), lifted.texture.u0.astype(np.float64)
    pairs = cKDTree(u0).query_pairs(4.0, output_type="ndarray")
    a, b = pairs.T
    step = ((u0[b] - u0[a]) * 0.5 * (middle[a, 1:] + middle[b, 1:])).sum(1)
    gap = np.abs(middle[b, 0] - middle[a, 0] - step)
    assert gap.max() < 0.02 * np.ptp(middle[:, 0]) + 1e-4


def _box() -> np.ndarray:
    view = View(Camera.from_fov(320, 240), 15.0)
    return view.hull(Box(view.ahead, angle=30.0).points)


def test_a_box_has_walls_and_a_back_of_its_own():
    lifted = _lift(_box(), 2000)
    texture, gaussians = lifted.texture, lifted.gaussians
    body = texture.solidity > 0.5
    unseen = body & (texture.visibility < 0.5)
    world = lifted.world_points(gaussians.means.astype(np.float64))
    cosine = (gaussians.normals * world).sum(1) / np.linalg.norm(world, axis=1)
    is_wall = unseen & (np.abs(cosine) < 0.2)
    assert 0.05 * body.sum() < is_wall.sum() < 0.5 * body.sum()
    assert (unseen & (cosine > 0.5)).sum() > 0.2 * body.sum()


@pytest.mark.parametrize("name", quick([name for name in shapes.MASKS if name != "frame"], 3))
def test_what_is_round_has_hardly_any_walls(name):
    texture = shapes.scene(name, COUNT).lifted.texture
    outline = ReliefSilhouette.of(shapes.mask(name))
    body = ReliefBody.of(outline, shapes.camera(), LiftSettings())
    middles, _ = outline.contour
    size = shapes.mask(name).shape[::-1]
    middles = middles[((middles > 0) & (middles < size)).all(1)]  # not where the frame cuts it
    walls = body.sample(middles, FRONT)[0] - body.sample(middles, BACK)[0]
    assert walls.mean() < 0.12 * outline.extent
    assert texture.visibility[texture.solidity > 0.5].mean() > 0.35


def test_a_profile_is_mirrored_and_a_face_goes_on():
    """What is wide and stands is seen from the side; what is alike left and right, from before."""
    mask = np.zeros((240, 320), bool)
    mask[100:160, 60:260] = True
    mask[150:210, 80:110] = mask[150:210, 200:230] = True  # legs
    mask[60:120, 220:290] = True  # a head
    assert _lift(mask).splatting == "edged surface"
    assert _lift(shapes.mask("disc", 320, 240)).splatting == "edged solid"


@pytest.mark.parametrize(
    ("back", "splatting"), [("mirrored", "edged surface"), ("continued", "edged solid")]
)
def test_the_user_says_what_the_back_is(back, splatting):
    inside = shapes.mask("ellipse")
    settings = LiftSettings(800, back=back, trust=0)
    lifted = lift_mask(shapes.picture(inside), shapes.camera(), inside, "relief", settings)[1]
    assert lifted.splatting == splatting


def test_what_is_hidden_belongs_to_the_shape_and_carries_no_photo():
    inside = shapes.mask("ellipse", 320, 240)
    hidden = np.zeros_like(inside)
    hidden[:, 150:175] = True
    hidden &= inside
    settings = LiftSettings(2000, hidden=hidden, trust=0)
    camera = shapes.camera(320, 240)
    lifted = lift_mask(shapes.picture(inside), camera, inside & ~hidden, "relief", settings)[1]
    x, y = np.floor(lifted.texture.u0).astype(int).T
    body = lifted.texture.solidity > 0.5
    there = hidden[np.clip(y, 0, 239), np.clip(x, 0, 319)]
    assert (there & body).sum() > 100
    assert not lifted.texture.visibility[there].any()
    assert (there & ~body).sum() == 0, "no edge of the photo is there"
    whole = _lift(inside, 2000)
    assert np.ptp(lifted.texture.u0, axis=0) == pytest.approx(
        np.ptp(whole.texture.u0, axis=0), rel=0.05
    )


def test_painted_nearness_brings_a_part_nearer():
    inside = shapes.mask("ellipse", 320, 240)
    near = np.zeros((24, 32), np.float32)
    near[:, 20:] = 0.3
    camera = shapes.camera(320, 240)
    lifted = lift_mask(
        shapes.picture(inside), camera, inside, "relief", LiftSettings(2000, nearness=near, trust=0)
    )[1]
    assert lifted.middle is not None
    x, z = lifted.texture.u0[:, 0], lifted.middle[:, 0]
    assert np.median(z[x < 150]) - np.median(z[x > 220]) == pytest.approx(0.3, abs=0.05)


def test_the_shape_is_the_same_far_from_and_near_the_start_of_a_huge_photo():
    """Where the object is in the photo does not matter, but for the perspective."""
    small = shapes.mask("star")
    large = np.zeros((700, 900), bool)
    large[290:410, 370:530] = small
    near, far = ReliefSilhouette.of(small), ReliefSilhouette.of(large)
    assert np.array_equal(near.inside, far.inside)
    assert (far.left - near.left, far.top - near.top) == (370, 290)
