"""The GPU's picture against the tile rasteriser's, which is the reference's (core/raster)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from objectmorpher_core.document import Placement
from objectmorpher_core.raster import tiles
from tests import shapes

moderngl = pytest.importorskip("moderngl")

REST = 2 / 255  # half-float target and 8-bit rounding
MEAN = 0.5 / 255  # mean over the picture when turned; the silhouette differs, see below


@pytest.fixture(scope="module")
def splat_pass() -> Iterator[object]:
    """A SplatPass in a context without a window."""
    from app.render.splat_pass import SplatPass

    try:
        context = moderngl.create_standalone_context(backend="egl")
    except Exception as error:
        pytest.skip(f"no OpenGL without a window here: {error}")
    yield SplatPass(context)
    context.release()


def drawn(splat_pass, scene: shapes.Scene, placement: Placement, camera) -> tuple:
    """The object by the GPU and by the tiles, each (h, w, 4) premultiplied."""
    splats = scene.puppet.posed(None, placement)
    photo_camera = scene.puppet.camera
    front, behind = (
        np.frombuffer(texture.read(), np.float16).reshape(camera.height, camera.width, 4)
        for texture in splat_pass.draw(splats, scene.texture, camera, photo_camera)
    )
    gpu = front.astype(np.float32) + (1 - front[..., 3:].astype(np.float32)) * behind
    cpu = tiles.render(splats, scene.texture, camera, photo_camera)
    return gpu, np.dstack([cpu.color, cpu.alpha])


@pytest.mark.parametrize("zoom", [1.0, 2.0])
def test_at_rest_the_gpu_gives_the_photos_own_pixels_as_the_tiles_do(splat_pass, zoom) -> None:
    scene = shapes.scene("ellipse", 2000)
    width, height = shapes.WIDTH, shapes.HEIGHT
    camera = scene.puppet.camera.windowed(10, 5, int(width * zoom), int(height * zoom), zoom)
    gpu, cpu = drawn(splat_pass, scene, Placement(), camera)
    assert np.abs(gpu - cpu).max() <= REST


@pytest.mark.parametrize("turn", [(20, 0, 0), (-15, 25, 10), (60, 0, 0)])
def test_turned_the_gpu_differs_from_the_tiles_only_along_the_silhouette(splat_pass, turn) -> None:
    scene = shapes.scene("ellipse", 2000)
    gpu, cpu = drawn(splat_pass, scene, Placement(turn=turn), scene.puppet.camera)
    assert np.abs(gpu - cpu).mean() <= MEAN


def test_twice_the_same_picture(splat_pass) -> None:
    scene = shapes.scene("ellipse", 800)
    placement = Placement(turn=(20, 10, 0))
    first, _ = drawn(splat_pass, scene, placement, scene.puppet.camera)
    again, _ = drawn(splat_pass, scene, placement, scene.puppet.camera)
    assert np.abs(first - again).max() <= REST  # the order of additions is the driver's


def test_splats_behind_the_camera_draw_nothing(splat_pass) -> None:
    scene = shapes.scene("ellipse", 800)
    camera = scene.puppet.camera
    splats = scene.puppet.posed(None, Placement())
    from dataclasses import replace

    behind = replace(splats, means=splats.means * [1, 1, -1])
    for texture in splat_pass.draw(behind, scene.texture, camera, camera):
        assert not np.frombuffer(texture.read(), np.float16).any()
