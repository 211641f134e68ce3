"""The view's pictures: drafts that keep the frame's time, exact ones that replace them."""

from __future__ import annotations

import time

import numpy as np
import pytest

from conftest import PATIENCE, wait_for_jobs
from objectmorpher.canvas.blend import CELL
from objectmorpher.canvas.layers import FRAME, Layer
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import Shown, View
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement


@pytest.fixture
def moved(ball: Document) -> Document:
    """The ball, turned a little."""
    return edits.set_placement(ball, 0, Placement(turn=(12.0, 0.0, 0.0)))


def test_an_object_at_rest_is_left_to_the_photo(editor: Editor, ball: Document) -> None:
    assert editor.derived.layers.draw(ball, editor.view) == ()


def test_a_draft_is_replaced_by_the_exact_picture(editor: Editor, moved: Document) -> None:
    layers = editor.derived.layers
    layers.frame_time = 1e-4
    (draft,) = layers.draw(moved, editor.view)
    assert draft.is_draft
    assert layers.is_waiting
    end = time.monotonic() + PATIENCE
    while (shown := layers.draw(moved, editor.view)[0]).is_draft:
        assert time.monotonic() < end
        editor.poll()
        time.sleep(0.01)
    layers.frame_time = np.inf
    layers.ask = None
    editor.view.pan(1, 0, (180, 140))
    editor.view.pan(-1, 0, (180, 140))
    layers.draw(lift_free(moved), editor.view)
    (exact,) = layers.draw(moved, editor.view)
    # its window begins elsewhere: interpolation between pixels differs by a rounding
    on_canvas = [_on_canvas(layer, editor.view) for layer in (shown, exact)]
    np.testing.assert_allclose(*on_canvas, atol=1.5 / 255)
    layers.frame_time, layers.ask = FRAME, editor.tasks.render_exact


def lift_free(document: Document) -> Document:
    """The same with the object at rest, so that its picture is forgotten."""
    return edits.set_placement(document, 0, Placement())


def test_a_draft_covers_what_the_exact_picture_covers(editor: Editor, moved: Document) -> None:
    layers = editor.derived.layers
    pictures = []
    for frame_time in (np.inf, 1e-4):
        layers.frame_time = frame_time
        layers.draw(lift_free(moved), editor.view)
        pictures.append(layers.draw(moved, editor.view)[0])
    layers.frame_time = FRAME
    exact, draft = pictures
    assert draft.is_draft and not exact.is_draft
    on_canvas = [_on_canvas(layer, editor.view) for layer in (exact, draft)]
    difference = np.abs(on_canvas[0] - on_canvas[1])[on_canvas[0].any(-1)]
    assert difference.mean() < 0.02  # they differ along the edge only
    wait_for_jobs(editor)


def _on_canvas(layer: Layer, view: View) -> np.ndarray:
    """(h, w, 4) of the canvas."""
    canvas = np.zeros((view.height, view.width, 4))
    x0, y0, x1, y1 = map(int, layer.box)
    canvas[y0:y1, x0:x1] = layer.rgba / 255
    return canvas


def test_the_photo_stays_where_nothing_moved(editor: Editor, moved: Document) -> None:
    blend = editor.derived.blend(moved, editor.view)
    centre = editor.view.canvas_from_image(np.array([90.0, 40.0])) / CELL
    corner = editor.view.canvas_from_image(np.array([5.0, 5.0])) / CELL
    assert blend[int(centre[1]), int(centre[0])] == 1
    assert blend[int(corner[1]), int(corner[0])] == 0
    hidden = edits.set_visible(lift_free(moved), 0, False)
    assert editor.derived.blend(hidden, editor.view)[int(centre[1]), int(centre[0])] == 1


@pytest.mark.parametrize("shown", list(Shown))
def test_every_view_draws_the_object(editor: Editor, moved: Document, shown: Shown) -> None:
    layers = editor.derived.layers
    layers.frame_time = np.inf
    drawn = layers.draw(moved, editor.view, shown)
    assert len(drawn) == (2 if shown is Shown.STRAIN else 1)
    assert (drawn[-1].invented is not None) == (shown is Shown.PROVENANCE)
    assert drawn[-1].is_tint == (shown is Shown.STRAIN)
    is_over_photo = shown in (Shown.COMPOSITE, Shown.PROVENANCE)
    resting = layers.draw(lift_free(moved), editor.view, shown)
    assert len(resting) == (0 if is_over_photo else 1)
    layers.frame_time = FRAME


def test_each_view_remembers_its_pictures(editor: Editor, moved: Document) -> None:
    layers = editor.derived.layers
    layers.frame_time = np.inf
    before = [layers.draw(moved, editor.view, shown) for shown in Shown]
    after = [layers.draw(moved, editor.view, shown) for shown in Shown]
    for first, second in zip(before, after, strict=True):
        assert all(a is b for a, b in zip(first, second, strict=True))
    layers.frame_time = FRAME


@pytest.mark.parametrize("shown", [Shown.DEPTH, Shown.STRAIN, Shown.PROVENANCE])
def test_coarse_pictures_of_a_view_become_exact(
    editor: Editor, moved: Document, shown: Shown
) -> None:
    layers = editor.derived.layers
    layers.draw(lift_free(moved), editor.view)
    layers.frame_time = 1e-4
    assert all(layer.is_draft for layer in layers.draw(moved, editor.view, shown))
    assert layers.is_waiting
    end = time.monotonic() + PATIENCE
    while any(layer.is_draft for layer in layers.draw(moved, editor.view, shown)):
        assert time.monotonic() < end
        editor.poll()
        time.sleep(0.01)
    assert not layers.is_waiting
    last = layers.draw(moved, editor.view, shown)[-1]
    assert (last.invented is not None) == (shown is Shown.PROVENANCE)
    layers.frame_time = FRAME
