"""The window shows an edit's refinement as it is exported, however strong it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher.canvas.frame import Cache, build_frame
from objectmorpher.editor.view import ViewState
from objectmorpher.gui.window.scenes import REFINED, splat_objects
from objectmorpher.render.scene import Scene
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.plate.plate import plate_cover
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.document.settings import Refined
from objectmorpher_core.pipeline import make_plate
from tests import shapes
from tests.app.render.pictures import make_renderer

pytest_plugins = ["tests.app.render.gpu"]  # the fixtures

moderngl = pytest.importorskip("moderngl")

SIZE = (shapes.WIDTH, shapes.HEIGHT)
LEVELS = 2.5 / 255  # alpha and colour are bytes, and so are both of the window's pictures


def refined_edit(strength: float) -> Document:
    """An object moved and shown in the complement of its colours."""
    scene = shapes.scene("ellipse", 800)
    document = edits.set_placement(scene.document(), 0, Placement(move=(20.0, -6.0)))
    plate = make_plate(document.photo.pixels, plate_cover(document), "telea")
    document = edits.set_plate(document, plate)
    result = composite(document, keeps_weights=True)
    assert result.box is not None and result.weights is not None
    x0, y0, x1, y1 = result.box
    pixels = 255 - result.pixels[y0:y1, x0:x1]
    alpha = np.round(result.weights * 255).astype(np.uint8)
    return edits.set_refined(document, Refined(x0, y0, pixels, alpha, "klein", strength=strength))


@pytest.fixture
def view() -> ViewState:
    view = ViewState()
    view.resize(SIZE, 1.0, SIZE)
    view.set_zoom(1.0, (80, 60), SIZE)
    view.left = view.top = 0.0
    return view


def scene_of(
    document: Document, view: ViewState, kind: str, cache: Cache, is_marked: bool = False
) -> Scene:
    frame = build_frame(document, view, cache, renderer=kind)
    refined = cache.refined.layers(document, view, is_marked)
    objects = splat_objects(document, frame) if kind == "gl" else ()
    layers = frame.layers if kind == "tiles" else ()
    return Scene(
        document.photo.pixels, (0, 0, 0), document.plate, (),
        layers + (refined if kind == "tiles" else ()),
        objects + (refined if kind == "gl" else ()), refined=REFINED,
        blend=frame.blend,
    )  # fmt: skip


@pytest.mark.parametrize("strength", [1.0, 0.4])
@pytest.mark.parametrize("kind", ["tiles", "gl"])
def test_the_window_shows_a_refinement_as_it_is_exported(
    context, monkeypatch, view, kind, strength
):
    renderer, cache = make_renderer(context, monkeypatch, kind, SIZE), Cache()
    cache.frame_time = np.inf
    document = refined_edit(strength)
    plain = replace(document, refined=None)

    def shown(which: Document) -> np.ndarray:
        renderer.begin((0.0, 0.0, 0.0), SIZE)
        renderer.draw(scene_of(which, view, kind, cache), view, (0, 0, *SIZE))
        return renderer.read(SIZE).astype(np.float32) / 255

    def exported(which: Document) -> np.ndarray:
        return composite(which).pixels.astype(np.float32) / 255

    assert document.refined is not None
    weights = np.zeros((*SIZE[::-1], 1), np.float32)
    x0, y0, x1, y1 = document.refined.box
    weights[y0:y1, x0:x1, 0] = document.refined.weights
    # The first picture is the shaders', the next ones, where OpenGL is emulated, the processor's.
    for window in (shown(document), (shown(plain), shown(document))[1]):
        # What the two differ by without it, the draft's edge, shows through as far as all does.
        difference = (1 - weights) * (shown(plain) - exported(plain))
        assert np.abs(window - exported(document) - difference).max() <= LEVELS
    assert np.abs(exported(document) - exported(plain)).max() > 0.2
    context.finish()


@pytest.mark.parametrize("kind", ["tiles", "gl"])
def test_the_provenance_hatches_it_in_an_ink_of_its_own(context, monkeypatch, view, kind):
    renderer, cache = make_renderer(context, monkeypatch, kind, SIZE), Cache()
    cache.frame_time = np.inf
    document = refined_edit(1.0)

    def shown(is_marked: bool) -> np.ndarray:
        scene = scene_of(document, view, kind, cache, is_marked)
        renderer.begin((0.0, 0.0, 0.0), SIZE)
        renderer.draw(scene, view, (0, 0, *SIZE))
        return renderer.read(SIZE).astype(np.float32) / 255

    plain, hatched = shown(False), shown(True)
    assert np.array_equal(shown(False), plain), "the same layer without marks, not the marked one"
    assert document.refined is not None
    inside = np.zeros(SIZE[::-1], bool)
    x0, y0, x1, y1 = document.refined.box
    inside[y0:y1, x0:x1] = document.refined.alpha == 255
    outside = ~composite(document).footprint
    assert np.array_equal(hatched[outside], plain[outside])
    ink = np.abs(hatched - np.array(REFINED.ink, np.float32)).max(2) < 0.15
    assert 0.2 < ink[inside].mean() < 0.5, "the stripes"
    between = np.abs(hatched - REFINED.brightness * plain).max(2) < 0.02
    assert (ink | between)[inside].mean() > 0.6, "and the picture, darker, between their edges"
    columns = ink & inside
    assert columns[:, columns.any(0)].sum() > 0.5 * inside[:, columns.any(0)].sum(), "upright"
    context.finish()


def test_where_nothing_is_edited_the_window_shows_the_photo(context, monkeypatch, view):
    renderer, cache = make_renderer(context, monkeypatch, "gl", SIZE), Cache()
    document = refined_edit(1.0)
    renderer.begin((0.0, 0.0, 0.0), SIZE)
    renderer.draw(scene_of(document, view, "gl", cache), view, (0, 0, *SIZE))
    outside = ~composite(document).footprint
    assert np.array_equal(renderer.read(SIZE)[outside], document.photo.pixels[outside])


def test_a_strength_of_nothing_is_no_layer(view):
    assert Cache().refined.layers(refined_edit(0.0), view) == ()


def test_another_strength_in_the_same_view_is_another_picture(view):
    cache, document = Cache(), refined_edit(1.0)
    (first,) = cache.refined.layers(document, view)
    assert cache.refined.layers(document, view) == (first,), "remembered"
    weaker = edits.set_strength(document, 0.5)
    (second,) = cache.refined.layers(weaker, view)
    assert abs(int(second.rgba.max()) - int(first.rgba.max()) / 2) <= 1
