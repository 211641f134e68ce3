"""What is picked is what is seen."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.document.model import Placement
from objectmorpher_core.raster import tiles
from objectmorpher_core.raster.picking import LEAST_ALPHA, SLACK, pick, seen_points
from tests import shapes

DEPTH = 1e-5  # world units, of a depth of about 3

TURNED = Placement(turn=(35.0, -20.0, 10.0))


@pytest.fixture(scope="module")
def scene() -> shapes.Scene:
    return shapes.scene("star", 2000)


@pytest.fixture(scope="module")
def drawable(scene) -> tiles.Drawable:
    view = scene.camera.windowed(20.0, 10.0, 240, 200, 2.0)
    return tiles.prepare(scene.puppet.posed(None, TURNED), view, scene.camera)


def _pixels(mask: np.ndarray, count: int) -> list[tuple[float, float]]:
    rows, columns = np.nonzero(mask)
    chosen = np.random.default_rng(0).choice(len(rows), min(count, len(rows)), replace=False)
    return [(columns[n] + 0.5, rows[n] + 0.5) for n in chosen]


def test_on_the_object_the_depth_is_that_of_the_picture(scene, drawable):
    picture = tiles.draw(drawable, scene.texture)
    for x, y in _pixels(picture.alpha > 0.5, 40):
        hit = pick(drawable, scene.texture, (x, y))
        assert hit is not None
        assert hit.depth == pytest.approx(float(picture.depth[int(y), int(x)]), abs=DEPTH)
        assert (hit.xy == (x, y)).all()


def test_the_silhouette_is_where_the_picture_ends(scene, drawable):
    """To the pixel: no wider, no narrower."""
    alpha = tiles.draw(drawable, scene.texture).alpha
    for x, y in _pixels((alpha > 0) & (alpha < 0.5 * LEAST_ALPHA), 25):
        assert pick(drawable, scene.texture, (x, y)) is None
    for x, y in _pixels((alpha > 1.5 * LEAST_ALPHA) & (alpha < 0.5), 25):
        assert pick(drawable, scene.texture, (x, y)) is not None


def test_beside_the_object_its_nearest_pixel_within_reach_is_picked(scene, drawable):
    alpha = tiles.draw(drawable, scene.texture).alpha
    rows, columns = np.nonzero(alpha >= LEAST_ALPHA)
    beside = np.array([columns.max() + 3.5, rows[columns.argmax()] + 0.5])
    assert pick(drawable, scene.texture, tuple(beside), 1.0) is None
    hit = pick(drawable, scene.texture, tuple(beside), 6.0)
    assert hit is not None
    gaps = np.hypot(columns + 0.5 - beside[0], rows + 0.5 - beside[1])
    assert np.linalg.norm(hit.xy - beside) == pytest.approx(gaps.min())


def test_the_gaussians_named_are_those_that_are_seen_there(scene, drawable):
    alpha = tiles.draw(drawable, scene.texture).alpha
    splats, away = drawable.splats, []
    for xy in _pixels(alpha > 0.9, 400):
        hit = pick(drawable, scene.texture, xy)
        assert hit is not None and len(hit.gaussians)
        seen = drawable.camera.unproject(hit.xy, hit.depth)
        away.append(np.linalg.norm(splats.means[hit.gaussians[0]] - seen) / splats.rest.spacing)
    # Where a surface is seen edge-on, one pixel lies several spacings along it.
    assert np.median(away) < 0.6
    assert np.quantile(away, 0.99) < 2.5
    assert np.max(away) < 4


def test_behind_a_faint_layer_the_greater_part_is_picked():
    """Two sheets on one ray; the front one hides a tenth."""
    splats, texture, depths = shapes.two_discs(front_opacity=0.3)
    drawable = tiles.prepare(splats, shapes.camera(), shapes.camera())
    picture = tiles.draw(drawable, texture)
    hit = pick(drawable, texture, (80.5, 60.5))
    assert hit is not None and picture.alpha[60, 80] > 0.9
    assert hit.depth == pytest.approx(depths[1], abs=0.02)
    solid, texture, depths = shapes.two_discs(front_opacity=1.0)
    hit = pick(tiles.prepare(solid, shapes.camera(), shapes.camera()), texture, (80.5, 60.5))
    assert hit is not None
    assert hit.depth == pytest.approx(depths[0], abs=0.02)


def test_a_point_is_seen_that_faces_the_camera_and_has_nothing_of_the_object_before_it():
    """On the front disc and close behind it; on the disc behind; beside both; facing away."""
    splats, texture, (front, back) = shapes.two_discs(front_opacity=1.0)
    camera, slack = shapes.camera(), SLACK * splats.rest.lifted.diameter
    depths = np.array([front, front + 0.5 * slack, front + 2 * slack, back, back, front])
    points = np.outer(depths, [0.01, 0.01, 1.0])
    points[4, :2] = 1.2, -0.8
    normals = np.tile([0.0, 0.0, -1.0], (6, 1))
    normals[5] *= -1
    seen = seen_points(splats, texture, camera, points, normals)
    assert seen.tolist() == [True, True, False, False, True, False]


def test_where_nothing_is_drawn_nothing_is_picked(scene):
    away = scene.camera.windowed(-5000.0, 0.0, 40, 30)
    drawable = tiles.prepare(scene.puppet.posed(None, TURNED), away, scene.camera)
    assert pick(drawable, scene.texture, (20.0, 15.0), 8.0) is None


def test_a_cloud_is_picked_where_alpha_reaches_a_half():
    splats, texture = shapes.random_splats(5, "classic", False)
    drawable = tiles.prepare(splats, shapes.camera(), shapes.camera())
    picture = tiles.draw(drawable, texture)
    for x, y in _pixels(picture.alpha > 0.6, 20):
        hit = pick(drawable, texture, (x, y))
        assert hit is not None
        assert hit.depth == pytest.approx(float(picture.depth[int(y), int(x)]), abs=1e-4)
