"""The view's pictures: drafts that keep the frame's time, exact ones that replace them."""

from __future__ import annotations

import time

import numpy as np
import pytest

from editor_steps import wait_for_jobs
from hands import PATIENCE
from objectmorpher.canvas.blend import CELL
from objectmorpher.canvas.frame import Cache, build_frame
from objectmorpher.canvas.layer import CanvasLayer
from objectmorpher.canvas.layers import FRAME
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.intents.posing import DRAG
from objectmorpher.editor.view import Shown, ViewState
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from tests.tree import quick

MOVING = 1 / 255  # of a level, what the frames of a drag miss on average over the canvas


@pytest.fixture
def editor(editor: Editor) -> Editor:
    """One that has drawn nothing: how long it took others decides on the size of a draft."""
    editor.tabs.close(editor.tab)
    return editor


@pytest.fixture
def moved(ball: Document) -> Document:
    """The ball, turned a little."""
    return edits.set_placement(ball, 0, Placement(turn=(12.0, 0.0, 0.0)))


def test_an_object_at_rest_is_left_to_the_photo(editor: Editor, ball: Document) -> None:
    assert build_frame(ball, editor.view, editor.cache).layers == ()


def test_a_draft_is_replaced_by_the_exact_picture(editor: Editor, moved: Document) -> None:
    cache = editor.cache
    cache.frame_time = 1e-4
    (draft,) = build_frame(moved, editor.view, cache).layers
    assert draft.is_draft
    assert cache.is_waiting
    end = time.monotonic() + PATIENCE
    while (shown := build_frame(moved, editor.view, cache).layers[0]).is_draft:
        assert time.monotonic() < end
        editor.poll()
        time.sleep(0.01)
    cache.frame_time = np.inf
    cache.layers.ask = None
    editor.view.pan(1, 0, (180, 140))
    editor.view.pan(-1, 0, (180, 140))
    build_frame(lift_free(moved), editor.view, cache)
    (exact,) = build_frame(moved, editor.view, cache).layers
    # its window begins elsewhere: interpolation between pixels differs by a rounding
    both = [on_canvas(layer, editor.view) for layer in (shown, exact)]
    np.testing.assert_allclose(*both, atol=1.5 / 255)
    cache.frame_time, cache.layers.ask = FRAME, editor.tasks.render_exact


def lift_free(document: Document) -> Document:
    """The same with the object at rest, so that its picture is forgotten."""
    return edits.set_placement(document, 0, Placement())


def test_a_draft_covers_what_the_exact_picture_covers(editor: Editor, moved: Document) -> None:
    cache = editor.cache
    pictures = []
    for frame_time in (np.inf, 1e-4):
        cache.frame_time = frame_time
        build_frame(lift_free(moved), editor.view, cache)
        pictures.append(build_frame(moved, editor.view, cache).layers[0])
    cache.frame_time = FRAME
    exact, draft = pictures
    assert draft.is_draft and not exact.is_draft
    both = [on_canvas(layer, editor.view) for layer in (exact, draft)]
    difference = np.abs(both[0] - both[1])[both[0].any(-1)]
    assert difference.mean() < 0.02  # they differ along the edge only
    wait_for_jobs(editor)


@pytest.mark.parametrize("seed", quick(range(6), 2))
def test_what_a_drag_shows_is_nearly_exact_and_leaves_nothing(
    editor: Editor, ball: Document, seed: int
) -> None:
    """Of the coarsest drafts; the picture at rest is, byte for byte, that of another window."""
    random, view = np.random.default_rng(seed), editor.view
    moving, resting = Cache(), Cache()
    moving.frame_time, resting.frame_time = 1e-4, np.inf
    deformer = moving.derived.deformer(ball, 0)
    place = deformer.points[random.integers(len(deformer.points))]
    document, pose, misses = edits.add_handle(ball, 0, place, place), deformer.rest(), []
    for _ in range(5):
        place = place + random.normal(0, 0.03 * deformer.diameter, 3)
        document = edits.move_handle(document, 0, 0, place)
        document = moving.derived.solved(document, 0, pose, **DRAG)
        pose = document.objects[0].pose
        shown = [build_frame(document, view, cache).layers[0] for cache in (moving, resting)]
        draft, exact = (on_canvas(layer, view) for layer in shown)
        assert shown[0].is_draft and not shown[1].is_draft
        misses.append(np.abs(draft - exact).mean())
    assert max(misses) <= MOVING
    moving.frame_time = np.inf
    build_frame(lift_free(ball), view, moving)
    (at_rest,) = build_frame(document, view, moving).layers
    assert at_rest.box == shown[1].box
    assert np.array_equal(at_rest.pixels, shown[1].pixels)


def on_canvas(layer: CanvasLayer, view: ViewState) -> np.ndarray:
    """(h, w, 4) of the canvas."""
    canvas = np.zeros((view.height, view.width, 4))
    x0, y0, x1, y1 = map(int, layer.box)
    canvas[y0:y1, x0:x1] = layer.rgba / 255
    return canvas


def test_the_photo_stays_where_nothing_moved(editor: Editor, moved: Document) -> None:
    blend = build_frame(moved, editor.view, editor.cache).blend
    centre = editor.view.canvas_from_image(np.array([90.0, 40.0])) / CELL
    corner = editor.view.canvas_from_image(np.array([5.0, 5.0])) / CELL
    assert blend[int(centre[1]), int(centre[0])] == 1
    assert blend[int(corner[1]), int(corner[0])] == 0
    hidden = edits.set_visible(lift_free(moved), 0, False)
    assert build_frame(hidden, editor.view, editor.cache).blend[int(centre[1]), int(centre[0])] == 1


@pytest.mark.parametrize("shown", list(Shown))
def test_every_view_draws_the_object(editor: Editor, moved: Document, shown: Shown) -> None:
    cache = editor.cache
    cache.frame_time = np.inf
    drawn = build_frame(moved, editor.view, cache, shown).layers
    assert len(drawn) == (2 if shown is Shown.STRAIN else 1)
    assert (drawn[-1].invented is not None) == (shown is Shown.PROVENANCE)
    assert drawn[-1].is_tint == (shown is Shown.STRAIN)
    is_over_photo = shown in (Shown.COMPOSITE, Shown.PROVENANCE)
    resting = build_frame(lift_free(moved), editor.view, cache, shown).layers
    assert len(resting) == (0 if is_over_photo else 1)
    cache.frame_time = FRAME


def test_each_view_remembers_its_pictures(editor: Editor, moved: Document) -> None:
    cache = editor.cache
    cache.frame_time = np.inf
    before = [build_frame(moved, editor.view, cache, shown).layers for shown in Shown]
    after = [build_frame(moved, editor.view, cache, shown).layers for shown in Shown]
    for first, second in zip(before, after, strict=True):
        assert all(a is b for a, b in zip(first, second, strict=True))
    cache.frame_time = FRAME


@pytest.mark.parametrize("shown", [Shown.DEPTH, Shown.STRAIN, Shown.PROVENANCE])
def test_coarse_pictures_of_a_view_become_exact(
    editor: Editor, moved: Document, shown: Shown
) -> None:
    cache = editor.cache
    build_frame(lift_free(moved), editor.view, cache)
    cache.frame_time = 1e-4
    assert all(layer.is_draft for layer in build_frame(moved, editor.view, cache, shown).layers)
    assert cache.is_waiting
    end = time.monotonic() + PATIENCE
    while any(layer.is_draft for layer in build_frame(moved, editor.view, cache, shown).layers):
        assert time.monotonic() < end
        editor.poll()
        time.sleep(0.01)
    assert not cache.is_waiting
    last = build_frame(moved, editor.view, cache, shown).layers[-1]
    assert (last.invented is not None) == (shown is Shown.PROVENANCE)
    cache.frame_time = FRAME
