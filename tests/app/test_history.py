"""Undo is a list of documents and a cursor."""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np
import pytest

from objectmorpher.editor import history
from objectmorpher.editor.history import History
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import Document, EditObject, Matte, Photo
from objectmorpher_core.document.pose import Pose
from objectmorpher_core.pictures.image import Picture

POSE = Pose(np.zeros((4, 3)), np.zeros((4, 3, 3)))


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


def test_a_snapshot_outlives_the_steps_and_is_replaced_by_its_name() -> None:
    past = History(document(), limit=0)
    kept = replace(document(), seed=3)
    past.apply("One", kept)
    past.keep("Mine")
    for _ in range(3):
        past.apply("Other", document())
    assert past.count < 4, "the oldest steps went"
    assert [(step.label, step.document) for step in past.snapshots] == [("Mine", kept)]
    past.apply("Mine", past.snapshots[0].document)
    assert past.document is kept
    past.apply("Other", document())
    past.keep("Mine")
    assert [step.document for step in past.snapshots] == [past.document]
    past.drop("Mine")
    assert past.snapshots == () and past.old_bytes >= 0


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
    past.mark_saved()
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


def test_what_is_computed_while_a_file_is_written_keeps_saved_what_comes_back_by_itself() -> None:
    past = History(document())
    for is_repeatable in (True, False):
        past.apply("One", document())
        written = past.step
        past.amend(document(), is_repeatable=is_repeatable)
        past.mark_saved(written)
        assert past.is_saved == is_repeatable
        past.apply("Two", document())
        past.mark_saved(written)
        assert not past.is_saved
        past.undo()
        assert past.is_saved == is_repeatable
    past.mark_saved()
    past.amend(document(), is_repeatable=False)
    assert not past.is_saved, "opened again, the file would not show it"


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


def heavy(base: Document, megabytes: int) -> Document:
    """A document with an array of its own."""
    alpha = np.zeros((1024 * megabytes, 256), np.float32)
    matte = Matte(0, 0, alpha, np.zeros((0, 0, 3), np.float32))
    return replace(base, objects=(EditObject("Object 1", matte=matte),))


def test_old_steps_go_when_what_they_alone_hold_is_too_large() -> None:
    base = document()
    past = History(base, limit=10 << 20)
    for n in range(8):
        past.apply(f"Step {n}", heavy(base, 3))
    assert past.old_bytes <= 10 << 20
    assert past.steps == tuple(f"Step {n}" for n in range(4, 8))
    shown = past.document
    for _ in range(9):
        past.undo()
    assert (past.cursor, past.undo_label) == (0, None)
    for _ in range(9):
        past.redo()
    assert past.document is shown


def test_what_documents_share_counts_once() -> None:
    base = heavy(document(), 8)
    past = History(base, limit=1 << 20)
    for n in range(50):
        past.apply(f"Step {n}", replace(base, seed=n + 1))
    assert len(past.steps) == 51
    assert past.old_bytes == 0


def test_the_shown_step_stays_however_large() -> None:
    base = document()
    past = History(base, limit=0)
    past.apply("One", heavy(base, 2))
    past.apply("Two", heavy(base, 3))
    assert past.steps == ("Two",)
    past.amend(heavy(base, 4))
    assert past.steps == ("Two",)


def test_forgotten_steps_free_their_memory() -> None:
    past = History(heavy(document(), 1))
    past.apply("One", heavy(document(), 2))
    past.undo()
    past.apply("Other", document())
    assert 0 < past.old_bytes < 2 << 20


def test_each_block_counts_once_however_documents_share_it() -> None:
    """Against a count of everything, over random edits and undos of documents of many objects."""
    chance, past = random.Random(2), History(document(), limit=40_000)

    def blocks(one: Document) -> dict[int, int]:
        return dict(history._blocks(one))

    for n in range(300):
        shown = past.document
        objects = [thing for thing in shown.objects if chance.random() < 0.9]
        if chance.random() < 0.5:
            handles = np.zeros((chance.randrange(1, 99), 3))
            objects.append(EditObject("New", pose=Pose(handles, np.zeros((len(handles), 3, 3)))))
        if objects and chance.random() < 0.5:
            objects.append(replace(objects[-1], harmony=0.5))
        getattr(past, chance.choice(("undo", "redo")))()
        changed = replace(past.document, objects=tuple(objects))
        past.amend(changed) if chance.random() < 0.2 else past.apply(str(n), changed)
        everything = {k: v for step in past._steps for k, v in blocks(step.document).items()}
        own = blocks(past.document)
        assert past._memory.bytes == sum(everything.values())
        assert past.old_bytes == sum(everything.values()) - sum(own.values())
    assert past.count > 2


def test_ten_thousand_steps_are_undone_and_done_again() -> None:
    objects = tuple(EditObject(f"Object {k}", pose=POSE) for k in range(20))
    base = replace(document(), objects=objects)
    past, made = History(base), [base]
    for n in range(10_000):
        k = n % len(objects)
        changed = replace(made[-1].objects[k], harmony=n / 10_000)
        made.append(made[-1].with_object(k, changed))
        past.apply(f"Step {n}", made[-1])
    for one in reversed(made):
        assert past.document is one
        past.undo()
    assert past.undo_label is None
    for one in made:
        assert past.document is one
        past.redo()
    assert past.redo_label is None


def test_jumping_shows_any_step_and_stops_at_the_ends() -> None:
    steps = [document() for _ in range(4)]
    past = History(steps[0])
    for n, step in enumerate(steps[1:]):
        past.apply(str(n), step)
    assert past.steps == ("Open", "0", "1", "2")
    for index, expected in ((1, 1), (3, 3), (-5, 0), (99, 3)):
        past.jump(index)
        assert past.document is steps[expected]
        assert past.cursor == expected


def test_what_no_file_holds_is_unsaved() -> None:
    past = History(document())
    past.mark_unsaved()
    assert not past.is_saved
