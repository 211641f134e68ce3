"""What stays in front is shown by both renderers as it is exported."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher.canvas.frame import Cache, build_frame
from objectmorpher.canvas.fronts import Fronts
from objectmorpher.canvas.layer import CanvasLayer, FrameObject, is_front
from objectmorpher.editor.view import ViewState
from objectmorpher.gui.window.scenes import OF_THE_PHOTO, splat_objects
from objectmorpher.render.scene import Scene
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.plate.plate import plate_cover
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement, Prompt
from objectmorpher_core.pipeline import cut_front, make_plate
from tests import shapes
from tests.app.render.pictures import make_renderer

pytest_plugins = ["tests.app.render.gpu"]  # the fixtures

moderngl = pytest.importorskip("moderngl")

PIXEL = 3 / 255  # see test_splat_pass; and the window's 8 bits
SIZE = (shapes.WIDTH, shapes.HEIGHT)
POST = slice(112, 128)  # columns of what stays in front


@pytest.fixture(scope="module")
def document() -> Document:
    """An ellipse moved behind a post of another colour."""
    inside = shapes.mask("ellipse")
    inside[:, 100:] = False
    pixels = shapes.picture(inside)
    mask = np.zeros(SIZE[::-1], bool)
    mask[:, POST] = True
    pixels[mask] = pixels[mask][:, [1, 0, 2]] // 2 + 100
    document = shapes.lifted_scene(pixels, inside, 800).document()
    document = edits.set_mask(edits.add_object(document), 1, mask, Prompt())
    document = edits.keep_in_front(document, 1, cut_front(pixels, mask))
    document = edits.set_plate(document, make_plate(pixels, plate_cover(document), "telea"))
    return edits.set_placement(document, 0, Placement(move=(50.0, 0.0), depth=-0.3))


def _view(zoom: float) -> ViewState:
    view = ViewState()
    view.resize(SIZE, 1.0, SIZE)
    view.set_zoom(zoom, (80, 60), SIZE)
    view.left, view.top = (0.0, 0.0) if zoom == 1 else (105.0, 20.0)
    return view


@pytest.mark.parametrize("kind", ["tiles", "gl"])
def test_the_window_shows_it_as_it_is_exported(context, monkeypatch, document, kind):
    renderer, cache, view = make_renderer(context, monkeypatch, kind, SIZE), Cache(), _view(1.0)
    cache.frame_time = np.inf
    frame = build_frame(document, view, cache, renderer=kind)
    assert len(frame.objects) == 2
    layers = frame.layers if kind == "tiles" else ()
    objects = splat_objects(document, frame) if kind == "gl" else ()
    scene = Scene(
        document.photo.pixels, (0.0, 0.0, 0.0), frame.plate, (), layers, objects,
        blend=frame.blend,
    )  # fmt: skip
    for _ in range(2):  # the second time put together by the processor, where that is faster
        renderer.begin((0.0, 0.0, 0.0), SIZE)
        renderer.draw(scene, view, (0, 0, *SIZE))
        window = renderer.read(SIZE).astype(np.float32) / 255
        exported = composite(document).pixels.astype(np.float32) / 255
        assert np.abs(window - exported).mean() <= PIXEL
        assert np.abs(window - exported)[:, 114:126].max() <= PIXEL, "the post itself"
    without = composite(edits.stop_keeping_in_front(document, 1)).pixels.astype(np.float32) / 255
    assert np.abs(without - exported).max() > 0.2
    context.finish()


@pytest.mark.parametrize("zoom", [0.5, 1.0, 1.7, 6.0])
def test_its_picture_is_the_photo_at_every_zoom(document, zoom):
    view = _view(zoom)
    layer = Fronts().layer(document.objects[1], view)
    assert layer is not None and not layer.is_coarse
    x0, y0, x1, y1 = (int(v) for v in layer.box)
    assert layer.rgba.shape == (y1 - y0, x1 - x0, 4)
    y, x = np.mgrid[y0:y1, x0:x1] + 0.5
    at = view.image_from_canvas(np.stack([x, y], -1))
    deep = (np.abs(at[..., 0] - 120) < 3) & (at[..., 1] > 4) & (at[..., 1] < 116)
    assert deep.any()
    assert (layer.rgba[..., 3][deep] == 255).all()
    if zoom >= 4:  # single pixels
        column, row = at[deep].astype(int).T
        own = document.photo.pixels[row, column].astype(int)
        assert np.abs(layer.rgba[..., :3][deep] - own).max() <= 1


def test_it_is_shown_over_the_edit_and_not_while_selecting(document):
    assert is_front(document, 1) and not is_front(document, 0)
    assert OF_THE_PHOTO  # where the photo is shown as it was
    own, front = build_frame(document, _view(1.0), Cache(), renderer="gl").objects
    assert isinstance(own, FrameObject) and own.k == 0 and isinstance(front, CanvasLayer)
