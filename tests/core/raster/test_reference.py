"""The specification itself: texture lookups and the constants' meaning, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import Placement
from objectmorpher_core.raster import reference
from objectmorpher_core.raster.posed import PosedSplats, RestSplats
from objectmorpher_core.raster.reference import ReferenceComposite, Sums
from objectmorpher_core.raster.rules import RULES, SPLATTINGS, coverage, facing_weight, ramp
from objectmorpher_core.raster.texture import TextureLevels, build_levels, sample_texture
from tests import shapes

F32 = 1e-5
LEVEL = 0.5 / 255  # half a grey level

RNG = np.random.default_rng(0)


def _texture(height: int = 40, width: int = 56, left: float = 7, top: float = 3) -> TextureLevels:
    return build_levels(
        RNG.random((height, width, 3)).astype(np.float32),
        RNG.random((height, width)).astype(np.float32), left, top,
    )  # fmt: skip


def test_looking_at_a_pixels_centre_gives_the_pixel():
    texture = _texture()
    rows, columns = np.mgrid[:40, :56]
    look = np.stack([columns.ravel() + 7.5, rows.ravel() + 3.5], 1)
    values = sample_texture(texture, look, np.zeros(len(look)))
    assert np.abs(values - texture.levels[0].reshape(-1, 4)).max() < F32


def test_a_linear_ramp_is_sampled_exactly_between_pixels():
    columns = np.tile(np.linspace(0, 1, 56, dtype=np.float32), (40, 1))
    texture = build_levels(np.dstack([columns] * 3), np.ones((40, 56), np.float32), 0, 0)
    x = RNG.uniform(5, 50, 100)
    values = sample_texture(texture, np.stack([x, np.full(100, 20.0)], 1), np.zeros(100))
    assert np.abs(values[:, 0] - (x - 0.5) / 55).max() < F32


@pytest.mark.parametrize("splatting", ["mip", "classic"])
def test_an_opaque_gaussian_of_a_trained_cloud_lets_a_hundredth_through(splatting):
    splats, texture, _ = shapes.two_discs(front_opacity=1.0)
    lifted = replace(splats.rest.lifted, splatting=splatting)
    lifted = replace(lifted, gaussians=replace(lifted.gaussians, colors=np.eye(2, 3)))
    camera = shapes.camera()
    splats = replace(splats, rest=RestSplats(lifted, camera))
    middle = reference.render(splats, texture, camera, camera).color[60, 80]
    assert np.abs(middle - [0.99, 0.01 * 0.99, 0.0]).max() < F32


def test_outside_the_crop_there_is_no_alpha_but_still_a_colour():
    texture = _texture()
    values = sample_texture(texture, np.array([[-50.0, -50.0], [500.0, 10.0]]), np.zeros(2))
    assert not values[:, 3].any()
    assert np.abs(values[0, :3] - texture.levels[0][0, 0, :3]).max() < F32


def test_coarser_levels_are_means_of_finer_ones():
    texture = _texture()
    for fine, coarse in zip(texture.levels, texture.levels[1:], strict=False):
        assert coarse.shape[0] == (fine.shape[0] + 1) // 2
    block = texture.levels[0][:4, :4].reshape(-1, 4).mean(0)
    assert np.abs(texture.levels[2][0, 0] - block).max() < F32


def test_minification_looks_at_coarser_levels():
    texture = _texture()
    look = np.array([[7 + 28.0, 3 + 20.0]])
    plain = sample_texture(texture, look, np.array([1.0]))
    mixed = sample_texture(texture, look, np.array([1.5]))
    coarse = sample_texture(texture, look, np.array([2.0]))
    assert np.abs(mixed - 0.5 * (plain + coarse)).max() < F32


def test_bicubic_overshoot_is_clipped_to_colours():
    checker = ((np.indices((20, 20)).sum(0) % 2) * np.ones((20, 20))).astype(np.float32)
    texture = build_levels(np.dstack([checker] * 3), checker, 0, 0)
    values = sample_texture(texture, RNG.uniform(2, 18, (500, 2)), np.zeros(500))
    assert values.min() >= 0
    assert values.max() <= 1


def test_levels_of_a_tiny_texture_exist():
    assert len(_texture(3, 2).levels) == 1


@pytest.mark.parametrize("name", ["ellipse", "thin"])
def test_at_rest_the_reference_gives_the_photo_back_too(name):
    scene = shapes.scene(name, 250)
    splats = scene.puppet.posed(None, Placement())
    picture = reference.render(splats, scene.texture, scene.camera, scene.camera)
    colour, alpha = scene.cutout()
    assert np.abs(picture.alpha - alpha).max() <= LEVEL
    assert np.abs(picture.color - colour).max() <= LEVEL


def test_at_rest_every_gaussian_looks_where_it_is():
    scene = shapes.scene("ellipse", 250)
    splats = scene.puppet.posed(None, Placement())
    projected = reference.project(splats, scene.camera, scene.camera)
    is_shown = splats.rest.cosines > 1e-3  # what is turned away looks into an invented picture
    assert np.abs(projected.shift[is_shown]).max() < 1e-4  # px: u0 is stored as float32
    drawn = is_shown & (projected.photo > 0.1)
    assert np.abs(projected.shift_slope[drawn]).max() < 1e-3  # the ridge, of flat ones seen askew


def test_gaussians_behind_the_camera_are_left_out():
    scene = shapes.scene("ellipse", 250)
    splats = scene.puppet.posed(None, shapes.around_the_camera(scene))
    in_front = (splats.means[:, 2] > RULES.near * splats.gap).sum()
    assert len(reference.project(splats, scene.camera, scene.camera).depth) == in_front
    assert 0 < in_front < len(splats)


# ---- the small formulas ---------------------------------------------------------------------


@pytest.mark.parametrize("splatting", ["surface", "solid"])
def test_only_a_solid_has_colours_where_the_photo_has_shown_nothing(splatting):
    scene = shapes.scene("disc", 300)
    lifted = scene.lifted
    blue = np.tile(np.array([0, 0, 1], np.float32), (len(lifted.gaussians), 1))
    unseen = replace(lifted.texture, visibility=np.zeros(len(blue), np.float32))
    gaussians = replace(lifted.gaussians, colors=blue)
    own = replace(lifted, gaussians=gaussians, texture=unseen, splatting=splatting)
    splats = PosedSplats(RestSplats(own, scene.camera), None, np.eye(4))
    drawn = reference.render(splats, scene.texture, scene.camera, scene.camera)
    inside = drawn.alpha > 0.99
    is_blue = np.abs(drawn.color[inside] - [0, 0, 1]).max(1) < 0.02
    assert inside.sum() > 500
    assert is_blue.all() if splatting == "solid" else not is_blue.any()


def test_a_cloud_has_no_normals_but_its_brim_has():
    assert facing_weight(-0.9, 1.0, 1.0, RULES, False) == 1.0
    assert facing_weight(0.9, 1.0, 0.0, RULES, False) == 0.0
    assert facing_weight(0.0, 1.0, 0.0, RULES, False) == 1.0


def test_a_ramp_runs_from_zero_to_one_either_way():
    assert [ramp(v, 0.2, 0.4) for v in (0.1, 0.2, 0.3, 0.4, 9.0)] == pytest.approx(
        [0, 0, 0.5, 1, 1]
    )
    assert [ramp(v, 0.4, 0.2) for v in (0.1, 0.3, 0.5)] == pytest.approx([1, 0.5, 0])


def test_seen_fronts_count_fully_and_backs_not_at_all():
    cosines = np.linspace(0.01, 1, 20)
    assert all(facing_weight(c, 1.0, 1.0, RULES) == 1 for c in cosines)
    assert all(facing_weight(-c, 0.0, 1.0, RULES) == 0 for c in cosines)
    assert facing_weight(-1.0, 1.0, 1.0, RULES) == 0, "a front that was turned away"


def test_the_brim_counts_only_edge_on():
    assert facing_weight(0.0, 1.0, 0.0, RULES) == 1
    assert facing_weight(0.9, 1.0, 0.0, RULES) == 0


def test_coverage_is_one_pixel_wide_at_any_slope():
    for slope in (0.02, 0.5, 3.0):
        level = RULES.surface_level
        assert coverage(level, slope, RULES) == pytest.approx(0.5)
        half = 0.5 * RULES.edge_width * slope
        assert coverage(level + half, slope, RULES) == pytest.approx(1, abs=1e-3)
        assert coverage(level - half, slope, RULES) == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize("own", [0.0, 0.02, 0.5, 1.0])
def test_a_side_behind_a_rim_is_seen_however_little_of_the_photo_it_shows(own):
    """What shows the same point of the photo as a rim is the rim's own surface, under its matte."""
    view = Camera.from_fov(3, 3)
    nothing = build_levels(np.zeros((3, 3, 3), np.float32), np.zeros((3, 3), np.float32), 0, 0)
    composite = ReferenceComposite(nothing, view, view, SPLATTINGS["edged solid"])
    rim, side = Sums(3, 3), Sums(3, 3)
    for layer in (rim, side):
        layer.total += 2.0
        layer.seen += 2.0
        layer.magnified += 2.0
    side.side += 2.0 * (1 - own)
    side.side_shift += 500.0 * (1 - own)  # invented pictures lie beside the photo
    side.unmatted += 2.0
    side.ended += 2.0
    composite.add(rim)
    composite.add(side)
    assert np.abs(composite.alpha - (1 - own)).max() < 1e-6


@pytest.mark.parametrize("size", [(9, 12), (12, 9), (7, 13)])
def test_an_odd_last_row_or_column_counts_twice(size):
    height, width = size
    texels = RNG.random((height, width, 4)).astype(np.float32)
    coarse = build_levels(texels[..., :3], texels[..., 3], 0, 0).levels[1]
    more = np.pad(texels, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    blocks = more.reshape(more.shape[0] // 2, 2, more.shape[1] // 2, 2, 4)
    np.testing.assert_allclose(coarse, blocks.mean((1, 3)), atol=F32)


@pytest.mark.parametrize("splatting", SPLATTINGS)
def test_a_gaussians_box_ends_where_its_alpha_does(splatting):
    """Alpha reaches the least that counts on each side of the box, and is less beyond."""
    splats, _ = shapes.random_splats(0, splatting)
    kind = SPLATTINGS[splatting]
    p = reference.project(splats, shapes.camera(), shapes.camera())
    seen = p.weight * (1 - kind.tail) > kind.least * 1.01 + 1e-9
    assert seen.sum() > 20
    inverse = np.linalg.inv(p.conic[:, [0, 1, 1, 2]].reshape(-1, 2, 2))
    for axis in range(2):  # farthest along it of all places with the same alpha
        q = p.extent[:, axis] ** 2 / inverse[:, axis, axis]
        alpha = p.weight * (np.exp(-q / 2) - kind.tail)
        np.testing.assert_allclose(alpha[seen], kind.least, atol=F32)
