"""Drafts: nearly the exact picture, from a fraction of its pixels and Gaussians."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.deform.resampling import thinned
from objectmorpher_core.document.model import Placement
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.raster import tiles
from objectmorpher_core.raster.sharpening import sharpen
from tests import shapes
from tests.tree import over

LEVEL = 1 / 255
SOFT = 12 * LEVEL  # bilinear is softer than the exact picture's filter
# At half the photo's size the thing is 60 px wide and a quarter draft of it 15: its outline, which
# is drawn as an edge where it has turned into view, is a whole px of the draft wide (15.4 levels).
SMALL = 16 * LEVEL


def _draft(scene: shapes.Scene, placement: Placement, factor: int, zoom: float) -> np.ndarray:
    """(h, w, 4) in [0, 1] of the view that shows the whole photo `zoom` times as large."""
    width, height = round(zoom * shapes.WIDTH), round(zoom * shapes.HEIGHT)
    coarse = -(-width // factor), -(-height // factor)
    camera = scene.camera.windowed(0.0, 0.0, *coarse, zoom / factor)
    splats = scene.puppet.posed(None, placement)
    picture = tiles.render(splats, scene.texture, camera, scene.camera)
    rgba, _ = sharpen(picture, scene.texture, factor, (0, 0, width, height), (0.0, 0.0), zoom)
    return rgba / 255


def _exact(scene: shapes.Scene, placement: Placement, zoom: float) -> np.ndarray:
    width, height = round(zoom * shapes.WIDTH), round(zoom * shapes.HEIGHT)
    camera = scene.camera.windowed(0.0, 0.0, width, height, zoom)
    splats = scene.puppet.posed(None, placement)
    picture = tiles.render(splats, scene.texture, camera, scene.camera)
    return np.dstack([picture.color, picture.alpha])


@over("zoom", [0.5, 1.0, 3.0])
@over("factor", [2, 4])
@over("name", ["at rest", "turned", "large"])
def test_a_draft_is_nearly_the_exact_picture(name: str, factor: int, zoom: float) -> None:
    scene, placement = shapes.scene("ellipse", 1500), shapes.PLACEMENTS[name]
    draft, exact = _draft(scene, placement, factor, zoom), _exact(scene, placement, zoom)
    difference = np.abs(draft - exact)[exact[..., 3] > 0]
    assert difference.mean() < (SMALL if zoom < 1 else SOFT)
    assert np.abs(draft[..., 3] - exact[..., 3]).mean() < 0.04  # at the edge


def test_at_rest_a_pixel_is_that_of_the_photo() -> None:
    """At its own scale bilinear look-ups are at the pixels' centres."""
    scene = shapes.scene("ellipse", 1500)
    draft = _draft(scene, Placement(), 4, 1.0)
    alpha = scene.texture.levels[0][..., 3]
    top, left = int(scene.texture.top), int(scene.texture.left)
    inside = np.zeros((top + alpha.shape[0], left + alpha.shape[1]), bool)  # invented sides, too
    inside[top:, left:] = alpha > 0.999
    inside = inside[: draft.shape[0], : draft.shape[1]] & scene.mask
    inside = cv2.erode(inside.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    photo = scene.document().photo.pixels / 255
    assert inside.sum() > 500
    np.testing.assert_allclose(draft[inside, :3], photo[inside], atol=1.5 * LEVEL)


def test_of_nothing_there_is_nothing() -> None:
    scene = shapes.scene("ellipse", 1500)
    gone = Placement(move=(4000.0, 0.0))
    assert not _draft(scene, gone, 4, 1.0).any()


def test_a_part_of_the_view_is_that_part_of_the_whole() -> None:
    scene, zoom, factor = shapes.scene("ellipse", 1500), 2.0, 4
    whole = _draft(scene, shapes.PLACEMENTS["turned"], factor, zoom)
    camera = scene.camera.windowed(
        0.0, 0.0, 2 * shapes.WIDTH // factor, 2 * shapes.HEIGHT // factor, zoom / factor
    )
    splats = scene.puppet.posed(None, shapes.PLACEMENTS["turned"])
    drawable = tiles.prepare(splats, camera, scene.camera)
    box = drawable.box()
    assert box is not None
    picture = tiles.draw(drawable, scene.texture, box)
    x0, y0, x1, y1 = (factor * v for v in box)
    part, _ = sharpen(picture, scene.texture, factor, (x0, y0, x1, y1), (0.0, 0.0), zoom)
    np.testing.assert_allclose(part / 255, whole[y0:y1, x0:x1], atol=2 * LEVEL)


@pytest.mark.parametrize("name", ["ellipse", "thin", "star"])
def test_fewer_gaussians_cover_the_same(name: str) -> None:
    scene = shapes.scene(name, 6000)
    fewer = thinned(scene.lifted, 600)
    assert fewer is not None
    lifted, chosen = fewer
    is_solid = scene.lifted.texture.solidity > 0.5
    kept = is_solid[chosen].sum()
    assert 300 < kept < 1000
    assert (~is_solid).sum() == (~is_solid[chosen]).sum()  # the soft edge is whole
    gain = np.sqrt(is_solid.sum() / kept)  # along the surface, so that their areas sum to as much
    times = lifted.gaussians.scales / scene.lifted.gaussians.scales[chosen]
    wider = np.where(is_solid[chosen, None], [gain, gain, 1.0], 1.0)
    assert np.abs(times - wider).max() < 1e-5 * gain
    assert lifted.spacing == pytest.approx(gain * scene.lifted.spacing) and gain > 2
    pictures = []
    for each in (scene.lifted, lifted):
        splats = Puppet(each, DeformSettings(), scene.camera).posed(None, Placement())
        pictures.append(tiles.render(splats, scene.texture, scene.camera, scene.camera))
    assert np.abs(pictures[0].alpha - pictures[1].alpha).mean() < 0.02
    assert np.abs(pictures[0].color - pictures[1].color).mean() < 0.02


def test_a_small_object_is_not_thinned() -> None:
    assert thinned(shapes.scene("ellipse", 800).lifted, 10_000) is None
