"""The canvas by the processor is what the shaders draw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher.canvas.blend import CELL
from objectmorpher.canvas.layer import CanvasLayer
from objectmorpher.editor.view import ViewState
from objectmorpher.render.scene import Hatch, Scene
from objectmorpher_core.document.model import Plate
from tests.app.render.pictures import make_renderer

pytest_plugins = ["tests.app.render.gpu"]  # the fixtures

moderngl = pytest.importorskip("moderngl")

SIZE = (203, 151)  # px, of the window; not a multiple of anything
VIEWPORT = (12, 7, 181, 133)
PHOTO = (90, 60)
ROUNDED = 2  # of 255: the shaders round after each layer


@pytest.fixture
def renderer(context, monkeypatch):
    yield make_renderer(context, monkeypatch, "tiles", SIZE)
    context.finish()


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A photo with a plate, a shadow, an object in another light, and a blend with soft edges."""
    random = np.random.default_rng(4)
    photo = random.integers(0, 255, (PHOTO[1], PHOTO[0], 3), np.uint8)
    behind = random.integers(0, 255, (40, 50, 3), np.uint8)
    plate = Plate(10, 8, behind, np.ones((40, 50), bool), "made")
    blend = np.zeros((-(-VIEWPORT[3] // CELL), -(-VIEWPORT[2] // CELL)), np.float32)
    blend[4:28, 6:40] = 1.0
    blend[8:20, 36:44] = random.random((12, 8), np.float32)
    shade = np.zeros((20, 24, 4), np.uint8)
    shade[..., 3] = random.integers(0, 200, (20, 24))
    item = random.integers(0, 256, (70, 90, 4)).astype(np.uint8)
    item[10:40, 10:60, 3], item[50:] = 255, 0
    item[..., :3] = np.minimum(item[..., :3], item[..., 3:])  # premultiplied
    shades = (CanvasLayer((20.3, 14.6, 120.1, 99.7), shade, is_coarse=True),)
    layers = (CanvasLayer((40.0, 30.0, 130.0, 100.0), item, gain=(1.2, 0.9, 0.7)),)
    return Scene(photo, (0.1, 0.2, 0.3), plate, shades, layers, blend=blend)


def _view(zoom: float) -> ViewState:
    view = ViewState()
    view.resize(VIEWPORT[2:], 1.0, PHOTO)
    view.set_zoom(zoom, (45, 30), PHOTO)
    return view


def _shown(renderer, scene: Scene, view: ViewState, is_emulated: bool) -> np.ndarray:
    """After another picture of the same view: only what stands still is flattened."""
    renderer._is_emulated = is_emulated
    for drawn in (Scene(scene.photo, scene.surround), scene):
        renderer.begin((0.5, 0.5, 0.5), SIZE)
        renderer.draw(drawn, view, VIEWPORT)
    return renderer.read(SIZE).astype(int)


def _both(
    renderer, monkeypatch, scene: Scene, view: ViewState
) -> tuple[np.ndarray, np.ndarray, int]:
    """The window by the processor and by the shaders, and how often the first was asked."""
    from objectmorpher.render import flattening

    calls = []
    flatten = flattening.flatten
    monkeypatch.setattr(flattening, "flatten", lambda *a: calls.append(1) or flatten(*a))
    flat, drawn = (_shown(renderer, scene, view, emulated) for emulated in (True, False))
    return flat, drawn, len(calls)


@pytest.mark.parametrize("zoom", [0.7, 1.0, 1.9, 6.0])
def test_both_draw_the_same(renderer, monkeypatch, scene: Scene, zoom: float) -> None:
    flat, drawn, calls = _both(renderer, monkeypatch, scene, _view(zoom))
    assert calls == 1
    assert np.abs(flat - drawn).max() <= ROUNDED
    assert len(np.unique(flat.reshape(-1, 3), axis=0)) > 1000  # not of one colour


def test_pixels_that_are_not_there_yet_are_hatched(renderer, monkeypatch, scene: Scene) -> None:
    mask = np.zeros(PHOTO[::-1], bool)
    mask[10:50, 20:70] = True
    hatched = replace(scene, plate=None, mask=mask, hatch=Hatch((0.5, 0.5, 0.5), 0.35, 0.25))
    flat, drawn, calls = _both(renderer, monkeypatch, hatched, _view(1.9))
    assert calls == 1
    assert np.abs(flat - drawn).max() <= ROUNDED


def test_what_it_cannot_draw_is_left_to_the_shaders(renderer, monkeypatch, scene: Scene) -> None:
    item = scene.layers[0]
    marked = replace(item, invented=np.full(item.rgba.shape[:2], 99, np.uint8))
    others = [
        replace(scene, split=0.5),
        replace(scene, paper=((0.1,) * 3, (0.2,) * 3)),
        replace(scene, layers=(marked,), marks=Hatch((1.0, 0.7, 0.0))),
        replace(scene, layers=(replace(item, is_tint=True),)),
        replace(scene, blend=None),
    ]
    for other in others:
        _, _, calls = _both(renderer, monkeypatch, other, _view(1.9))
        assert calls == 0


def test_where_nothing_is_mixed_the_bytes_stay() -> None:
    """Outside the edit the photo's, inside the background's or those of what is opaque there."""
    from objectmorpher.render.flattening import flatten

    random, size = np.random.default_rng(2), (60, 76)
    photo, back, item = (random.integers(0, 256, (*size, 4)).astype(np.uint8) for _ in range(3))
    photo[..., 3] = back[..., 3] = item[..., 3] = 255
    item[:, ::3] = 0
    blend = np.zeros((size[0] // CELL, size[1] // CELL), np.float32)
    blend[:, 8:] = 1.0
    layer = CanvasLayer((0.0, 0.0, float(size[1]), float(size[0])), item)
    flat = flatten(photo, back, blend, (layer,), layer.box)
    edge = 8 * CELL
    wanted = np.where(item[..., 3:] > 0, item, back)[:, edge + CELL :]
    assert np.array_equal(flat[:, : edge - CELL], photo[:, : edge - CELL])
    assert np.array_equal(flat[:, edge + CELL :], wanted)


def test_no_line_shows_where_an_object_that_moved_meets_what_did_not(
    renderer, monkeypatch, scene: Scene
) -> None:
    """However much of the photo and of the edit is shown, where both look alike it looks so."""
    view = _view(1.9)
    left, top, right, bottom = 40, 30, 130, 100
    grey = np.full_like(scene.photo, 120)
    item = np.full((bottom - top, right - left, 4), 120, np.uint8)
    item[..., 3] = 255
    layer = CanvasLayer((float(left), float(top), float(right), float(bottom)), item)
    random = np.random.default_rng(6)
    plate = Plate(0, 0, random.integers(0, 255, grey.shape, np.uint8), grey[..., 0] > 0, "made")
    blend = random.random((-(-VIEWPORT[3] // CELL), -(-VIEWPORT[2] // CELL)), np.float32)
    still = replace(scene, photo=grey, plate=plate, shades=(), layers=(layer,), blend=blend)
    flat, drawn, _ = _both(renderer, monkeypatch, still, view)
    x0, y1 = VIEWPORT[0] + left, SIZE[1] - VIEWPORT[1] - VIEWPORT[3] + bottom
    for shown in (flat, drawn):
        there = shown[y1 - (bottom - top) : y1, x0 : x0 + right - left]
        assert np.abs(there - 120).max() <= 1


def test_another_background_is_seen_at_once(renderer, monkeypatch, scene: Scene) -> None:
    assert scene.plate is not None
    view = _view(1.9)
    _shown(renderer, scene, view, True)
    other = replace(scene, plate=replace(scene.plate, pixels=255 - scene.plate.pixels))
    flat, drawn, _ = _both(renderer, monkeypatch, other, view)
    assert np.abs(flat - drawn).max() <= ROUNDED


@pytest.mark.parametrize("zoom", [0.3, 0.7, 1.0, 1.9, 4.0])
def test_of_another_background_only_what_is_different_is_drawn(
    renderer, monkeypatch, scene: Scene, zoom: float
) -> None:
    """It looks, byte for byte, as if all of it had been drawn."""
    from objectmorpher.render.renderer import StillView

    parts, read = [], renderer._read_canvas
    monkeypatch.setattr(renderer, "_read_canvas", lambda *a: parts.append(a[-1]) or read(*a))
    plate, view, random = scene.plate, _view(zoom), np.random.default_rng(3)
    assert plate is not None
    others, changed = [], []
    _shown(renderer, scene, view, True)
    for _ in range(6):
        (x, y), (w, h) = random.integers(0, (44, 34)), random.integers(1, 7, 2)
        pixels = plate.pixels.copy()
        pixels[y : y + h, x : x + w] = random.integers(0, 255, (h, w, 3))
        others.append(replace(scene, plate=replace(plate, pixels=pixels)))
        renderer.draw(others[-1], view, VIEWPORT)
        changed.append(renderer.read(SIZE))
    assert parts.count(None) == 2, "the photo, and the first background"
    for other, shown in zip(others, changed, strict=True):
        renderer._still = StillView()
        assert np.array_equal(shown, _shown(renderer, other, view, True))
    assert len({shown.tobytes() for shown in changed}) > 3, "they can be told apart"
