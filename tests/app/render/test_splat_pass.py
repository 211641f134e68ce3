"""The GPU's picture is the one that `raster/reference.py` defines."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_core.document.model import Placement
from objectmorpher_core.raster import reference
from objectmorpher_core.raster.posed import RestSplats
from tests import shapes
from tests.app.render.pictures import bent, pixels_of, premultiplied, rendered, specified
from tests.tree import quick

pytest_plugins = ["tests.app.render.gpu"]  # the fixtures

ROOT = Path(__file__).parents[3]

# Premultiplied colour and alpha. Measured 2026-11: 0.13 / 255 at rest, which is the half-float
# target's rounding; 0.7 / 255 elsewhere, what lies behind an alpha of 0.999.
REST = 2 / 255
PIXEL = 3 / 255
NUDGE = 1e-4  # degrees, by which the specification's own picture may jump in
TIES = 2  # pixels

ZOOMS = {
    "1x": (0, 0, 160, 120, 1.0),
    "2x": (50.3, 40.7, 200, 150, 2.0),
    "0.5x": (-40, -30, 90, 70, 0.5),
}
PLACEMENTS = {name: p for name, p in shapes.PLACEMENTS.items() if name != "at rest"}
KINDS = shapes.KINDS


def difference(splat_pass, *view) -> float:
    return float(np.abs(rendered(splat_pass, *view) - specified(*view)).max())


# ---- the picture is the specification's -----------------------------------------------------


@pytest.mark.parametrize("zoom", ZOOMS)
@pytest.mark.parametrize("name", quick(["star", "frame", "ellipse", "thin"], 2))
def test_at_rest(splat_pass, name, zoom):
    scene = shapes.scene(name)
    camera = scene.camera.windowed(*ZOOMS[zoom])
    splats = scene.puppet.posed(None, Placement())
    assert difference(splat_pass, splats, scene.texture, camera, scene.camera) <= REST


@pytest.mark.parametrize("placement", [*PLACEMENTS, "around the camera"])
def test_placed(splat_pass, placement):
    scene = shapes.scene("star", 250)
    splats, camera = shapes.placed(placement, scene), scene.camera
    drawn = rendered(splat_pass, splats, scene.texture, camera, camera)
    expected = premultiplied(shapes.specified(scene, placement, camera))
    assert np.abs(drawn - expected).max() <= PIXEL


def test_a_soft_fringe_turns_aside_as_in_the_specification(splat_pass):
    scene = shapes.scene("star", 800)
    sides = scene.lifted.sides
    assert sides is not None and (sides.zoom != 0).any()
    fringed = replace(scene.lifted, sides=replace(sides, zoom=-np.abs(sides.zoom)))
    splats = scene.puppet.posed(None, Placement(turn=(20.0, 10.0, 0.0)))
    splats = replace(splats, rest=RestSplats(fringed, scene.camera))
    assert difference(splat_pass, splats, scene.texture, scene.camera, scene.camera) <= PIXEL


@pytest.mark.parametrize(("largeness", "turn"), quick(
    [(2.0, (20.0, 40.0, 0.0)), (0.5, (0.0, 0.0, 0.0)), (0.5, (20.0, 40.0, 0.0)),
     (2.0, (0.0, 0.0, 0.0))], 1,
))  # fmt: skip
@pytest.mark.parametrize(
    "zoom", [pytest.param(zoom, marks=() if zoom == "1x" else pytest.mark.slow) for zoom in ZOOMS]
)
def test_bent(splat_pass, zoom, turn, largeness):
    """A pixel in which two Gaussians are as deep as each other may show either in front."""
    scene, pose = bent("star", 800, largeness)
    camera = scene.camera.windowed(*ZOOMS[zoom])
    pitch, yaw, roll = turn
    views = [
        (scene.puppet.posed(pose, Placement(turn=(pitch + by, yaw, roll))), scene.texture, camera,
         scene.camera)
        for by in (0.0, NUDGE, -NUDGE)
    ]  # fmt: skip
    picture = rendered(splat_pass, *views[0])
    gaps = np.array([np.abs(picture - specified(*view)).max(-1) for view in views])
    assert (gaps[0] > PIXEL).sum() <= TIES
    assert gaps.min(0).max() <= PIXEL


@pytest.mark.parametrize("seed", quick(range(4), 2))
@pytest.mark.parametrize(("splatting", "is_textured"), KINDS)
def test_gaussians_of_every_kind(splat_pass, splatting, is_textured, seed):
    splats, texture = shapes.random_splats(seed, splatting, is_textured)
    camera = shapes.camera()
    drawn = rendered(splat_pass, splats, texture, camera, camera)
    expected = premultiplied(shapes.specified_random(seed, splatting, is_textured))
    assert np.abs(drawn - expected).max() <= PIXEL


@pytest.mark.parametrize("seed", quick(range(4), 1))
@pytest.mark.parametrize(("splatting", "is_textured"), KINDS)
def test_gaussians_of_every_kind_from_afar(splat_pass, splatting, is_textured, seed):
    """None of them at the camera, where it would hide the others."""
    splats, texture = shapes.random_splats(seed, splatting, is_textured)
    away = np.eye(4)
    away[2, 3] = 1.6
    camera = shapes.camera()
    view = (replace(splats, placement=away), texture, camera, camera)
    assert difference(splat_pass, *view) <= PIXEL


@pytest.mark.parametrize("splatting", ["star", "surface", "mip", "classic"])
def test_what_else_is_known_of_a_pixel(splat_pass, splatting):
    camera = shapes.camera()
    if splatting == "star":
        scene, pose = bent("star", 800, 0.5)
        splats, texture = scene.puppet.posed(pose, Placement()), scene.texture
    else:
        splats, texture = shapes.random_splats(2, splatting)
    detail = pixels_of(splat_pass.draw(splats, texture, camera, camera).detail)
    picture = (
        reference.render(splats, texture, camera, camera) if splatting == "star"
        else shapes.specified_random(2, splatting)
    )  # fmt: skip
    depth, shift = detail[..., 0], detail[..., 2:]
    seen = depth > 0
    # At a few pixels a layer is just visible, or half of alpha is just reached, or just not.
    same = seen == np.isfinite(picture.depth)
    same &= ~(seen & (np.abs(depth - picture.depth) > 1e-4))  # world units, of a depth of 3
    same &= ~(seen & (np.abs(shift - picture.shift).max(-1) > 0.02))  # px
    assert (~same).sum() <= 0.002 * seen.sum()
    np.testing.assert_allclose(detail[..., 1], picture.from_photo, atol=PIXEL)


def test_a_painted_object_shows_its_colours(splat_pass):
    scene, pose = bent("star", 800, 0.5)
    splats = scene.puppet.posed(pose, Placement(turn=(10.0, 20.0, 0.0)))
    colors = np.random.default_rng(0).random((len(splats), 3))
    splats = splats.painted(colors)
    assert difference(splat_pass, splats, scene.texture, scene.camera, scene.camera) <= PIXEL


def test_a_picture_larger_than_the_targets_is_drawn_in_bands(splat_pass, monkeypatch):
    from objectmorpher.render import layered_pass

    scene = shapes.scene("star")
    splats = scene.puppet.posed(None, Placement(turn=(35.0, -20.0, 15.0)))
    view = (splats, scene.texture, scene.camera, scene.camera)
    whole = rendered(splat_pass, *view)
    monkeypatch.setattr(layered_pass, "MOST_PIXELS", 160 * 50)
    assert np.abs(rendered(splat_pass, *view) - whole).max() <= REST


# ---- what must hold of any picture ----------------------------------------------------------


@pytest.mark.parametrize(("splatting", "is_textured"), KINDS)
def test_twice_the_same_picture(splat_pass, splatting, is_textured):
    splats, texture = shapes.random_splats(0, splatting, is_textured)
    view = (splats, texture, shapes.camera(), shapes.camera())
    first, other = rendered(splat_pass, *view), shapes.scene("star")
    rendered(splat_pass, other.puppet.posed(None, Placement()), other.texture, *view[2:])
    np.testing.assert_array_equal(rendered(splat_pass, *view), first)


@pytest.mark.parametrize(("splatting", "is_textured"), KINDS)
def test_behind_the_camera_nothing_is_drawn(splat_pass, splatting, is_textured):
    splats, texture = shapes.random_splats(0, splatting, is_textured)
    behind = np.eye(4)
    behind[2, 3] = -20.0
    splats = replace(splats, placement=behind)
    assert not rendered(splat_pass, splats, texture, shapes.camera(), shapes.camera()).any()


@pytest.mark.parametrize("is_textured", [True, False])
def test_resized_and_back_gives_the_same(splat_pass, is_textured):
    splats, texture = shapes.random_splats(1, "classic", is_textured)
    camera = shapes.camera()
    first = rendered(splat_pass, splats, texture, camera, camera)
    twice = camera.windowed(0, 0, 320, 240, 2.0)  # a monitor of twice the density
    assert difference(splat_pass, splats, texture, twice, camera) <= PIXEL
    np.testing.assert_array_equal(rendered(splat_pass, splats, texture, camera, camera), first)


@pytest.mark.parametrize("size", [(0, 0), (0, 120), (160, 0)])
def test_a_view_without_pixels_draws_nothing(splat_pass, size):
    splats, texture = shapes.random_splats(0)
    camera = replace(shapes.camera(), width=size[0], height=size[1])
    assert splat_pass.draw(splats, texture, camera, shapes.camera()) is None


def test_a_view_of_one_pixel_draws_it(splat_pass):
    scene = shapes.scene("ellipse", 800)
    splats = scene.puppet.posed(None, Placement())
    camera = scene.camera.windowed(80.0, 60.0, 1, 1)
    assert difference(splat_pass, splats, scene.texture, camera, scene.camera) <= REST


def test_what_is_not_drawn_any_more_is_released(context):
    from objectmorpher.render.splat_pass import SplatPass

    own = SplatPass(context)
    scene, pose = bent("star", 800, 0.5)
    camera = scene.camera
    own.draw(scene.puppet.posed(pose, Placement()), scene.texture, camera, camera)
    own.sweep()
    assert len(own.uploads) > 0
    own.draw(*shapes.random_splats(0, "classic", False), camera, camera)
    own.sweep()
    few = len(own.uploads)
    own.sweep()
    assert (few, len(own.uploads)) == (4, 0)  # geometry, colours, motion and order; nothing


# ---- drivers --------------------------------------------------------------------------------


def test_a_photo_too_large_for_the_driver_is_halved(context, caplog):
    from objectmorpher.render.layered_pass import _padded
    from objectmorpher.render.splat_pass import SplatPass

    scene = shapes.scene("ellipse", 2000)
    splats = scene.puppet.posed(None, Placement())
    levels = scene.texture.levels
    enough = max(_padded(levels[0], len(levels)))
    smaller = scene.camera.windowed(0, 0, 40, 30, 0.25)  # where the full size is not looked at
    view = (splats, scene.texture, smaller, scene.camera)
    own = SplatPass(context, most_texture=enough)
    assert difference(own, *view) <= REST
    assert not caplog.text
    own = SplatPass(context, most_texture=enough - 1)
    assert np.abs(rendered(own, *view) - specified(*view)).mean() <= 0.5 / 255
    assert "1/2 of the photo's detail" in caplog.text


def test_only_what_is_looked_at_is_uploaded_and_the_picture_is_the_same(context):
    from objectmorpher.render.splat_pass import SplatPass

    scene = shapes.scene("ellipse", 2000)
    splats = scene.puppet.posed(None, Placement((10.0, 5.0), turn=(20.0, 0.0, 0.0)))
    whole, small = scene.camera, scene.camera.windowed(0, 0, 20, 15, 0.125)
    full, sparing = SplatPass(context), SplatPass(context)
    rendered(full, splats, scene.texture, whole, scene.camera)
    photo = [full.uploads("photo", scene.texture, _never)]
    pictures = [rendered(each, splats, scene.texture, small, scene.camera)
                for each in (full, sparing)]  # fmt: skip
    photo.append(sparing.uploads("photo", scene.texture, _never))
    assert [each.uniforms["finest"] for each in photo] == [0.0, 2.0]
    np.testing.assert_allclose(*pictures, atol=1e-3)
    enlarged = scene.puppet.posed(None, Placement(scale=8.0))
    for view, posed in ((whole, splats), (small, enlarged)):  # looked at closely, and enlarged
        pictures = [rendered(each, posed, scene.texture, view, scene.camera)
                    for each in (full, sparing)]  # fmt: skip
        np.testing.assert_allclose(*pictures, atol=1e-3)
        assert sparing.uploads("photo", scene.texture, _never).uniforms["finest"] == 0.0


def _never() -> None:
    raise AssertionError("it is not there")


DRAW = """
import sys
import moderngl, numpy as np
from objectmorpher.render.splat_pass import SplatPass
from objectmorpher_core.document.model import Placement
from tests import shapes
from tests.app.render.pictures import bent, rendered
context = moderngl.create_standalone_context(require=330, backend="egl")
print(context.version_code)
own, camera = SplatPass(context), shapes.camera()
scene, pose = bent("star", 800, 1.0)
pictures = [rendered(own, scene.puppet.posed(pose, Placement()), scene.texture, camera, camera)]
for kind, is_textured in (("surface", True), ("mip", True), ("classic", False)):
    pictures.append(rendered(own, *shapes.random_splats(0, kind, is_textured), camera, camera))
np.save(sys.argv[1], pictures)
"""


@pytest.mark.slow
def test_a_driver_like_that_of_macos_draws_the_same(context, tmp_path):
    if "llvmpipe" not in context.info["GL_RENDERER"]:
        pytest.skip("only Mesa can pretend to be an older driver")
    versions = {
        "410": {"MESA_GL_VERSION_OVERRIDE": "4.1", "MESA_GLSL_VERSION_OVERRIDE": "410"},
        "330": {"MESA_GL_VERSION_OVERRIDE": "3.3", "MESA_GLSL_VERSION_OVERRIDE": "330"},
        str(context.version_code): {},
    }
    pictures = []
    for version, override in versions.items():
        file = tmp_path / f"{version}.npy"
        done = subprocess.run(
            [sys.executable, "-c", DRAW, str(file)], env={**os.environ, **override}, cwd=ROOT,
            capture_output=True, text=True, timeout=300,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert done.stdout.split() == [version]
        pictures.append(np.load(file))
    assert pictures[0].any()
    for other in pictures[1:]:
        np.testing.assert_allclose(pictures[0], other, rtol=0, atol=0.01 / 255)
