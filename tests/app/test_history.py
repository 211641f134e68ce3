"""Undo is a list of documents and a cursor."""

from __future__ import annotations

import numpy as np
import pytest

from app import history
from app.history import History
from objectmorpher_core.camera import Camera
from objectmorpher_core.document import Document, Photo
from objectmorpher_core.image import Picture


def document() -> Document:
    return Document(
        Photo(Picture(np.zeros((6, 8, 3), np.uint8)), Camera.from_fov(8, 6), b"", "a.png")
    )


def test_undo_gives_the_same_documents_back() -> None:
    first, second, third = document(), document(), document()
    past = History(first)
    past.apply("One", second)
    past.apply("Two", third)
    past.undo()
    assert past.document is second
    past.undo()
    assert past.document is first
    past.undo()
    assert past.document is first
    past.redo()
    past.redo()
    past.redo()
    assert past.document is third


def test_labels_name_what_undo_and_redo_would_do() -> None:
    past = History(document())
    assert (past.undo_label, past.redo_label) == (None, None)
    past.apply("Move handle", document())
    assert past.undo_label == "Move handle"
    past.undo()
    assert (past.undo_label, past.redo_label) == (None, "Move handle")


def test_a_new_step_forgets_what_was_undone() -> None:
    past = History(document())
    past.apply("One", document())
    past.undo()
    other = document()
    past.apply("Other", other)
    assert past.redo_label is None
    assert past.document is other


def test_the_same_document_is_no_step() -> None:
    first = document()
    past = History(first)
    past.apply("Nothing", first)
    assert past.undo_label is None


def test_unsaved_means_not_the_saved_document() -> None:
    first, second = document(), document()
    past = History(first)
    assert past.is_saved
    past.apply("One", second)
    assert not past.is_saved
    past.mark_saved(second)
    assert past.is_saved
    past.undo()
    assert not past.is_saved


def test_a_computed_addition_is_no_step_and_keeps_saved() -> None:
    past = History(document())
    added = document()
    past.amend(added)
    assert past.document is added
    assert past.is_saved
    assert past.undo_label is None


def test_the_list_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history, "DEPTH", 3)
    past = History(document())
    documents = [document() for _ in range(5)]
    for i, step in enumerate(documents):
        past.apply(str(i), step)
    assert past.document is documents[-1]
    for _ in range(9):
        past.undo()
    assert past.document is documents[2]
