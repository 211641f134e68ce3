"""What a drag needs is ready before the pointer is pressed, and was made beside the window."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from editor_steps import open_file, wait_for_jobs
from objectmorpher.canvas.derived import MOST_SHAPES
from objectmorpher.canvas.frame import Cache, build_frame
from objectmorpher.canvas.shape import CanvasShape, build_shape, rehearse
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import ViewState
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.session.file import save_session


def _shape(editor: Editor) -> CanvasShape:
    assert editor.document is not None and editor.object is not None
    return editor.derived.shape(editor.document.photo, editor.object)


def _has_deformer(shape: CanvasShape) -> bool:
    return vars(shape.puppet)["_deformer"] is not None


def test_a_lifted_object_is_made_ready(editor: Editor, ball: Document) -> None:
    soft = edits.set_deform(ball, 0, DeformSettings(stiffness=0.7))
    editor.start(soft)
    shape = _shape(editor)
    assert not _has_deformer(shape)  # not at once: the window would stand still
    wait_for_jobs(editor)
    assert _has_deformer(shape)
    assert _shape(editor) is shape


def test_a_session_is_ready_when_it_is_shown(
    editor: Editor, ball: Document, tmp_path: Path
) -> None:
    path = tmp_path / "ball.omorph"
    save_session(ball, path)
    open_file(editor, path)
    shape = _shape(editor)
    assert shape.is_rehearsed and _has_deformer(shape)


def test_what_many_objects_need_is_remembered_of_all_of_them(ball: Document) -> None:
    """Each frame asks for each object's shape: had one no room, all would be built in each."""
    thing = ball.objects[0]
    assert thing.lifted is not None
    many = tuple(
        replace(thing, name=f"Object {k}", lifted=replace(thing.lifted), is_visible=False)
        for k in range(MOST_SHAPES + 6)
    )
    document, shape = replace(ball, objects=many), build_shape(ball.photo.camera, thing)
    made = [(one, replace(shape)) for one in many]
    cache, view = Cache(), ViewState()
    derived = cache.derived
    derived.adopt(made)
    for _ in range(2):
        build_frame(document, view, cache)
        assert all(derived.shape(ball.photo, one) is own for one, own in made)


def test_a_rehearsal_changes_nothing(ball: Document) -> None:
    """The solver that a drag goes on with is not the one that rehearsed."""
    thing = ball.objects[0]
    assert thing.lifted is not None
    point = thing.lifted.control_points[0].astype(np.float64)
    handled = edits.add_handle(ball, 0, point, point + 0.1).objects[0]
    poses = []
    for is_rehearsed in (False, True):
        shape = build_shape(ball.photo.camera, thing)
        deformer = shape.puppet.deformer
        first = deformer.solve(handled.handles)
        if is_rehearsed:
            rehearse(shape, ball.photo.camera)
        poses.append(deformer.solve(handled.handles, start=first.pose).pose)
    np.testing.assert_array_equal(poses[0].points, poses[1].points)
