"""A body from what is seen of it, where the truth about it is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.progress import silent
from objectmorpher_core.document.model import LiftSettings
from objectmorpher_core.lift import LiftSubject
from objectmorpher_core.lift.crop import SIDE, Crop, rays
from objectmorpher_core.lift.relief.body import BACK, FRONT, ReliefBody, lacking, leaning
from objectmorpher_core.lift.relief.fusion import fused
from objectmorpher_core.lift.relief.lifter import ReliefLifter
from objectmorpher_core.lift.relief.shape_look import SeenShape
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.segment.matting.matte import build_matte
from objectmorpher_research.training import shape_eval
from objectmorpher_research.training.shape_eval import Surfaces, score, surfaces_of, true_surfaces
from objectmorpher_research.training.shapes.sample import Sample, make_sample
from tests import shapes
from tests.tree import quick

KINDS = ("boxes", "lathe", "superquadrics", "creatures", "rings", "figures")
SURE, UNSURE = 1e-3, 10.0  # crop units, expected error


def camera_of(sample: Sample) -> Camera:
    return shape_eval.camera_of(sample.tangents, SIDE)


def truth(sample: Sample, error: float = SURE) -> SeenShape:
    even = np.full(sample.mask.shape, error, np.float32)
    crop = Crop(0, 0, SIDE, sample.tangents)
    return SeenShape(
        crop, sample.mask, sample.front, sample.thickness, sample.depth, sample.normal,
        sample.edge.astype(np.float32), even, even,
    )  # fmt: skip


def body_of(sample: Sample, **settings) -> ReliefBody:
    return ReliefBody.of(
        ReliefSilhouette.of(sample.mask), camera_of(sample), LiftSettings(**settings)
    )


def surfaces(body: ReliefBody, sample: Sample) -> Surfaces:
    """In crop units."""
    found = surfaces_of(body, sample.mask)
    return Surfaces(found.front / SIDE, found.thickness / SIDE)


def along_axis(sample: Sample) -> Surfaces:
    """In crop units."""
    true = true_surfaces(sample.front, sample.depth, sample.tangents)
    return Surfaces(true.front / SIDE, true.thickness / SIDE)


@pytest.mark.parametrize("kind", quick(KINDS, 3))
def test_the_truth_comes_through(kind):
    sample = make_sample(7, families=(kind,))
    body = body_of(sample)
    found = fused(body, truth(sample), camera_of(sample), 1.0, 1.0)
    before, after = (score(surfaces(b, sample), along_axis(sample), sample.mask)
                     for b in (body, found))  # fmt: skip
    assert after.front < 0.35 * before.front
    # What is behind is settled: nobody has seen it, and its waves would be the turned outline's.
    assert after.thickness < 0.7 * before.thickness


@pytest.mark.parametrize("kind", quick(KINDS, 1))
def test_without_trust_or_sureness_the_silhouette_tells(kind):
    sample = make_sample(7, families=(kind,))
    body = body_of(sample)
    assert fused(body, truth(sample), camera_of(sample), 1.0, 0.0) is body
    doubted = fused(body, truth(sample, UNSURE), camera_of(sample), 1.0, 1.0)
    own, theirs = surfaces(doubted, sample), surfaces(body, sample)
    off = (own.front - theirs.front)[sample.mask]
    assert np.std(off) < 0.01
    assert np.abs(own.thickness - theirs.thickness)[sample.mask].mean() < 0.01


def test_more_trust_is_nearer_to_what_is_seen():
    sample = make_sample(7, families=("boxes",))
    body, true = body_of(sample), along_axis(sample)
    errors = []
    for trust in (0.0, 0.3, 0.7, 1.0):
        found = fused(body, truth(sample), camera_of(sample), 1.0, trust)
        errors.append(score(surfaces(found, sample), true, sample.mask).front)
    assert errors == sorted(errors, reverse=True)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_it_is_a_body_nowhere_less_than_nothing_thick(kind):
    sample = make_sample(11, families=(kind,))
    noise = np.random.default_rng(0).normal(0, 0.05, sample.front.shape).astype(np.float32)
    seen = replace(truth(sample), front=sample.front + noise)
    found = surfaces(fused(body_of(sample), seen, camera_of(sample), 1.0, 1.0), sample)
    assert (found.thickness[sample.mask] >= 0).all()


def test_a_ball_closes_at_its_outline_and_a_slab_ends_there():
    """What a pixel is too wide to tell: the ball's front turns away, the slab's stops."""
    tangents = np.array([0, 0, 0.4], np.float32)
    camera = Camera(SIDE / 0.4, SIDE / 2, SIDE / 2, SIDE, SIDE)
    at = (np.arange(SIDE) + 0.5) / SIDE - 0.5
    across = np.hypot(*np.meshgrid(at, at)) / 0.4
    mask = across < 1
    half = np.where(mask, 0.4 * np.sqrt(np.maximum(1 - across**2, 0)), 0).astype(np.float32)
    x, y = np.meshgrid(at / 0.4, at / 0.4)
    out = np.stack([x, y, -np.sqrt(np.maximum(1 - across**2, 0))], -1).astype(np.float32)
    facing = np.broadcast_to(np.array([0, 0, -1], np.float32), out.shape)
    even, sure = np.full(mask.shape, 0.3, np.float32), np.full(mask.shape, SURE, np.float32)
    none, crop = np.zeros(mask.shape, np.float32), Crop(0, 0, SIDE, tangents)
    ball = SeenShape(crop, mask, half, 2 * half, 2 * half, out, none, sure, sure)
    slab = SeenShape(crop, mask, none, even, even, facing, none, sure, sure)
    outline = ReliefSilhouette.of(mask)
    body = ReliefBody.of(outline, camera, LiftSettings())
    rims = []
    for seen in (ball, slab):
        found = fused(body, seen, camera, 1.0, 1.0)
        middles, _ = found.silhouette.contour
        rims.append(np.median(found.height(middles, FRONT) - found.height(middles, BACK)) / SIDE)
    assert rims[0] < 0.1 and rims[1] > 0.2


def test_what_is_hardly_seen_to_lean_leans_more():
    """A ball whose front leans as a network that is not sure sees it."""
    y, x = np.mgrid[:200, :200] + 0.5
    outline = ReliefSilhouette.of((x - 100) ** 2 + (y - 100) ** 2 < 70**2)
    camera = Camera.from_fov(200, 200)
    body = ReliefBody.of(outline, camera, LiftSettings())
    tangents = (outline.photo_xy(outline.cells) - 100) / camera.focal

    def lean(height: np.ndarray) -> np.ndarray:
        own, depth = tangents[outline.inside], np.log(camera.focal - height[outline.inside])
        return np.linalg.lstsq(own, depth - depth.mean(), rcond=None)[0]

    before = lean(body.middle)
    for seen, missing in (((0.4, 0.0), (0.48, 0.0)), ((0.1, -0.3), (0.0, -0.36))):
        front = camera.focal * (1 - np.exp(tangents @ np.array(seen)))
        for share in (0.5, 1.0):
            lacks = lacking(body, front, camera, share)
            after = lean(leaning(replace(body, lacks=lacks), camera).middle)
            np.testing.assert_allclose(after - before, share * np.array(missing), atol=0.01)


def test_twice_the_thickness_is_twice_the_thickness():
    sample = make_sample(7, families=("lathe",))
    once, twice = (
        surfaces(fused(body_of(sample, thickness=t), truth(sample), camera_of(sample), t, 1.0),
                 sample).thickness[sample.mask]
        for t in (1.0, 2.0)
    )  # fmt: skip
    assert np.abs(twice - 2 * once).max() < 0.02 * once.max()


def test_the_lifter_takes_what_is_seen_and_the_photo_stays_the_photo():
    sample = make_sample(7, families=("boxes",))
    camera = camera_of(sample)
    matte = build_matte(sample.rgb, sample.mask, 12)
    subject = LiftSubject(sample.rgb, camera, sample.mask, matte)
    lifter = ReliefLifter(lambda *_: None, see=lambda *_: truth(sample))
    lifted = lifter.lift(subject, LiftSettings(3000), silent)
    at = camera.project(lifted.world_points(lifted.gaussians.means))
    assert np.abs(at - lifted.texture.u0).max() < 0.02
    plain = lifter.lift(subject, LiftSettings(3000, trust=0.0), silent)
    assert not np.allclose(lifted.gaussians.means[:500], plain.gaussians.means[:500], atol=1e-3)


def test_a_crop_knows_where_its_pixels_look():
    inside = shapes.mask("ellipse", 160, 120)
    camera = shapes.camera(160, 120)
    crop = Crop.around(inside, camera)
    pixels = np.array([[3, 200], [111, 111], [220, 17]])  # column, row
    xy = (pixels + 0.5) * crop.side / SIDE + [crop.left, crop.top]
    assert np.allclose(crop.grid_xy(xy), pixels)
    there = camera.unproject(xy, np.ones(len(xy)))
    there /= np.linalg.norm(there, axis=1, keepdims=True)
    assert np.allclose(rays(crop.tangents)[pixels[:, 1], pixels[:, 0]], there, atol=1e-6)
    rows, columns = np.nonzero(crop.seen_mask(inside))
    assert abs(columns.mean() - 111.5) < 3 and abs(rows.mean() - 111.5) < 3
    wide = max(np.ptp(rows), np.ptp(columns)) + 1
    assert 0.75 < wide / SIDE < 0.9


def test_beyond_the_frame_a_crop_is_black():
    inside = np.zeros((60, 80), bool)
    inside[:, :30] = True
    crop = Crop.around(inside, shapes.camera(80, 60))
    seen = crop.seen(np.full((60, 80, 3), 200, np.uint8))
    assert crop.left < 0 and crop.top < 0
    assert (seen[:, 0] == 0).all() and (seen[0] == 0).all()
    assert (seen[SIDE // 2, SIDE // 2] == 200).all()
    assert not crop.seen_mask(inside)[0].any()
