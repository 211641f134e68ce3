"""What views paint: colours that rise where their amount does, and shares that the export has."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from objectmorpher.canvas import painter
from objectmorpher.canvas.frame import Cache, build_frame
from objectmorpher.canvas.layer import PAINTED, FrameObject
from objectmorpher.canvas.painter import depth_range, moved_normals, shown_now
from objectmorpher.canvas.shares import count_changed
from objectmorpher.canvas.shares import shares as shares_of
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import Shown, ToolName, ViewState
from objectmorpher_core.base.brush import Brush, Stroke
from objectmorpher_core.base.rotations import matrix_from_vector
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.paint import look, with_stroke
from objectmorpher_core.deform.puppet import puppet_of
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.document.settings import Refined
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.scripting.runner import coarse_edit

COUNTED = 0.06  # of all changed pixels: the view counts on a small picture, its blend is coarser
F32 = 1e-6
RED, YELLOW, BLUE = painter.STRAIN_STOPS[::-1]


@pytest.fixture
def turned(ball: Document) -> Document:
    """The ball, turned so far that its back comes into sight."""
    return edits.set_placement(ball, 0, Placement(turn=(70.0, 0.0, 0.0)))


@pytest.fixture
def bent(editor: Editor, ball: Document) -> Document:
    """The ball, its top pulled to the right."""
    point = ball.objects[0].lifted.control_points[0].astype(float)  # type: ignore[union-attr]
    diameter = ball.objects[0].lifted.diameter  # type: ignore[union-attr]
    moved = edits.add_handle(ball, 0, point, point + (0.3 * diameter, 0, 0))
    return editor.derived.solved(moved, 0, None)


def test_what_is_farther_is_darker() -> None:
    spread = painter.DepthRange(2.0, 5.0, 3.0)
    colors = painter.depth_colors(np.linspace(2, 5, 200), spread).astype(float)
    lightness = colors @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(lightness) < 0).all()
    outside = painter.depth_colors(np.array([1.0, 9.0, np.nan]), spread)
    expected = painter.DEPTH_STOPS[:1] + painter.DEPTH_STOPS[-1:] * 2
    np.testing.assert_allclose(outside, expected, atol=F32)


def test_the_range_of_depths_holds_all_and_a_little_more() -> None:
    spread = painter.depth_range(np.array([2.0, 3.0, 2.5]), 2.0)
    assert (spread.near, spread.far) == pytest.approx((1.9, 3.1), abs=1e-5)
    assert spread.half == pytest.approx(0.3, abs=1e-5)
    flat = painter.depth_range(np.array([2.0, 2.0]), 2.0)
    assert flat.far > flat.near


def test_normals_of_a_sphere_point_outward() -> None:
    normals = _sphere(400)
    still = np.broadcast_to(np.eye(3), (400, 3, 3))
    colors = painter.normal_colors(normals, still)
    right, up, near = (normals * (1, -1, -1)).T
    np.testing.assert_allclose(colors, 0.5 + 0.5 * np.stack([right, up, near], 1), atol=F32)


def test_normals_turn_with_the_object_and_stand_on_what_is_squeezed() -> None:
    normals = _sphere(200)
    turn = matrix_from_vector(np.array([0.3, -0.8, 0.2]))
    np.testing.assert_allclose(
        painter.moved_normals(normals, np.broadcast_to(turn, (200, 3, 3))),
        normals @ turn.T,
        atol=F32,
    )
    squeeze = np.diag([1.0, 0.25, 1.0])  # a sphere becomes an ellipsoid: gradient of its equation
    squeezed = painter.moved_normals(normals, np.broadcast_to(squeeze, (200, 3, 3)))
    expected = normals / (1.0, 0.25, 1.0)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(squeezed, expected, atol=F32)
    mirrored = painter.moved_normals(normals, np.broadcast_to(np.diag([-1.0, 1, 1]), (200, 3, 3)))
    np.testing.assert_allclose(mirrored, normals * (-1, 1, 1), atol=F32)


def test_strain_goes_from_blue_by_yellow_to_red() -> None:
    nodes, weights = np.array([[0], [1], [2], [3]], np.int32), np.ones((4, 1))
    full = painter.FULL_STRAIN
    most, least = np.array([1.0, 1 + full / 2, 1 + full, 1.0]), np.array([1.0, 1.0, 1.0, 0.1])
    colors = painter.strain_colors(painter.stretch(most, least), nodes, weights)
    np.testing.assert_allclose(colors, [BLUE, YELLOW, RED, RED], atol=F32)


@pytest.mark.parametrize("shown", PAINTED)
def test_an_unchanged_object_is_painted_once(editor: Editor, ball: Document, shown: Shown) -> None:
    first = painted(editor.cache, ball, shown)
    painted(editor.cache, ball, Shown.NORMALS)
    assert painted(editor.cache, ball, shown) is first
    assert not first.rest.is_textured


def painted(cache: Cache, document: Document, shown: Shown) -> PosedSplats:
    """The document's object as a view shows it."""
    own = build_frame(document, ViewState(), cache, shown, "gl").objects[-1]
    assert isinstance(own, FrameObject)
    return own.splats


def test_an_object_at_rest_or_moved_as_a_whole_has_no_strain(
    editor: Editor, ball: Document, turned: Document, bent: Document
) -> None:
    for document in (ball, turned):
        colors = painted(editor.cache, document, Shown.STRAIN).rest.lifted.gaussians.colors
        np.testing.assert_allclose(colors, np.broadcast_to(BLUE, colors.shape), atol=F32)
    colors = painted(editor.cache, bent, Shown.STRAIN).rest.lifted.gaussians.colors
    assert (colors[:, 0] > BLUE[0] + 0.1).any()


def test_depths_keep_their_colours_until_they_are_measured_again(
    ball: Document, turned: Document
) -> None:
    cache = Cache()
    painter, rest = cache.painter, cache.painter.measure(ball)
    painted(cache, turned, Shown.DEPTH)
    assert painter.spread(turned) is rest
    again, splats = painter.measure(turned), cache.derived.posed(turned, 0)
    is_facing = (moved_normals(splats.rest.normals, splats.linear) * splats.means).sum(1) < 0
    assert again is not rest
    expected = depth_range(splats.means[is_facing, 2], rest.diameter)
    assert (again.near, again.far) == (expected.near, expected.far)
    assert painter.measure(ball) is rest


@pytest.mark.parametrize("turn", [20.0, 70.0])
def test_shares_are_about_those_of_the_export(editor: Editor, ball: Document, turn: float) -> None:
    document = edits.set_placement(ball, 0, Placement(move=(25.0, 0.0), turn=(turn, 0.0, 0.0)))
    shares, exact = shares_of(document, editor.cache), composite(document).shares
    for name in ("from_photo", "from_lifter", "from_inpainter"):
        assert getattr(shares, name) == pytest.approx(getattr(exact, name), abs=COUNTED), name
    assert shares_of(ball, editor.cache).from_photo == 0  # nothing is changed


@pytest.mark.parametrize("strength", [1.0, 0.4])
def test_a_refinements_share_is_about_that_of_the_export(
    editor: Editor, ball: Document, strength: float
) -> None:
    document = edits.set_placement(ball, 0, Placement(move=(25.0, 0.0), turn=(30.0, 0.0, 0.0)))
    edit = coarse_edit(document)
    made = Refined(edit.left, edit.top, 255 - edit.coarse, edit.shown, "klein", strength=strength)
    document = edits.set_refined(document, made)
    shares, exact = shares_of(document, editor.cache), composite(document).shares
    for name in ("from_photo", "from_lifter", "from_inpainter", "from_refiner"):
        assert getattr(shares, name) == pytest.approx(getattr(exact, name), abs=COUNTED), name
    parts = shares.from_photo + shares.from_lifter + shares.from_inpainter + shares.from_refiner
    assert parts == pytest.approx(1, abs=F32) and shares.from_refiner > strength / 2


def painted_ball(ball: Document, place: Placement) -> tuple[Document, np.ndarray]:
    """The ball with a stroke across what is seen of it in its place; (h, w) the stroke."""
    document = edits.set_placement(ball, 0, place)
    item, camera = document.objects[0], document.photo.camera
    assert item.matte is not None
    posed = puppet_of(item, camera).posed(item.pose, item.placement)
    (x0, y0), (x1, y1) = np.percentile(camera.project(posed.means), (25, 75), axis=0)
    stroke = Stroke(document.photo.size, Brush(12.0, 1.0))
    stroke.move_to(float(x0), float(y0))
    stroke.move_to(float(x1), float(y1))
    assert stroke.box is not None
    left, top, right, bottom = stroke.box
    seen = look(posed, item.matte, camera, stroke.box)
    coverage = stroke.coverage[top:bottom, left:right]
    matte = with_stroke(item.matte, seen, coverage, np.array([0.1, 0.8, 0.2]))
    return document.with_object(0, replace(item, matte=matte)), stroke.coverage


PAINTED_AT = (Placement(), Placement(move=(25.0, 0.0), turn=(30.0, 0.0, 0.0)))


@pytest.mark.parametrize("place", PAINTED_AT)
def test_a_paints_share_is_about_that_of_the_export(
    editor: Editor, ball: Document, place: Placement
) -> None:
    document, _ = painted_ball(ball, place)
    shares, exact = shares_of(document, editor.cache), composite(document).shares
    for name in ("from_photo", "from_lifter", "from_inpainter", "from_paint"):
        assert getattr(shares, name) == pytest.approx(getattr(exact, name), abs=COUNTED), name
    assert exact.from_paint > 0.05


@pytest.mark.parametrize("seconds", [60.0, 1e-9])
@pytest.mark.parametrize("renderer", ["tiles", "gl"])
def test_painted_pixels_are_marked_and_the_photos_own_are_not(
    ball: Document, renderer: str, seconds: float
) -> None:
    """In the exact picture, and in the draft of a drag."""
    plain = edits.set_placement(ball, 0, Placement(move=(25.0, 0.0)))
    document, coverage = painted_ball(ball, Placement(move=(25.0, 0.0)))
    width, height = document.photo.size
    view, cache = ViewState(zoom=1.0, width=width, height=height), Cache()
    cache.frame_time = seconds
    marked, unmarked = (_invented(d, view, cache, renderer) for d in (document, plain))
    assert marked[coverage >= 1].mean() > (230 if seconds > 1 else 128)  # px of a draft are 6 wide
    assert unmarked[coverage >= 1].mean() < 25
    far = cv2.dilate((coverage > 0).astype(np.uint8), np.ones((15, 15))) == 0
    assert (marked[far] > 128).mean() < 0.05


def _invented(document: Document, view: ViewState, cache: Cache, renderer: str) -> np.ndarray:
    """(h, w) of the canvas, what of its object the view marks; 0 where it marks nothing."""
    (own,) = build_frame(document, view, cache, Shown.PROVENANCE, renderer).objects
    assert isinstance(own, FrameObject)
    whole = np.zeros((view.height, view.width), np.uint8)
    if own.layer is not None and own.layer.invented is not None:
        x0, y0, x1, y1 = map(int, own.layer.box)
        whole[y0:y1, x0:x1] = own.layer.invented
    return whole


def test_the_number_of_changed_pixels_is_about_that_of_the_export(
    editor: Editor, ball: Document
) -> None:
    document = edits.set_placement(ball, 0, Placement(move=(25.0, 0.0)))
    exact = (composite(document).pixels != document.photo.pixels).any(2).sum()
    count = count_changed(document, editor.cache)
    assert count == pytest.approx(exact, rel=0.1)
    assert len(str(count).rstrip("0")) <= 2, "two figures: it is not exact"
    assert count_changed(ball, editor.cache) == 0


def test_a_view_waits_for_an_object(editor: Editor, ball: Document) -> None:
    view = ViewState(tool=ToolName.POSE, shown=Shown.STRAIN)
    assert shown_now(None, view) is Shown.COMPOSITE
    assert shown_now(editor.document, view) is Shown.COMPOSITE
    assert shown_now(ball, view) is Shown.STRAIN


@pytest.mark.parametrize("tool", [ToolName.SELECT, ToolName.MASK])
def test_selecting_shows_the_photo_whatever_the_view(ball: Document, tool: ToolName) -> None:
    assert shown_now(ball, ViewState(tool=tool, shown=Shown.STRAIN)) is Shown.COMPOSITE


def _sphere(count: int) -> np.ndarray:
    points = np.random.default_rng(3).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)
