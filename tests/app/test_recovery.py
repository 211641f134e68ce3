"""What crashed editors have left is offered, whatever state it is in."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from edit_until_killed import base_document, step_document
from editor_steps import close_all, wait_until
from objectmorpher.commands import run, why_not
from objectmorpher.editor.autosave import LOCK, FileLock, recovery_root
from objectmorpher.editor.editor import Editor
from objectmorpher_core.session.journal import DOCUMENT, Journal
from test_autosave import folders, settle


@pytest.fixture
def editor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared_editor: Editor
) -> Iterator[Editor]:
    """With nothing open, and a data folder of its own."""
    close_all(shared_editor)
    settle(shared_editor)
    monkeypatch.setenv("OBJECTMORPHER_DATA", str(tmp_path / "data"))
    yield shared_editor
    close_all(shared_editor)
    settle(shared_editor)


def leave(name: str, hour: int, step: int = 1) -> Path:
    """What an editor leaves that crashes."""
    folder = recovery_root() / name
    about = {"name": f"{name}.jpg", "edited": f"2026-05-04T{hour:02}:02:00", "objects": 1,
             "path": None, "source": f"/photos/{name}.jpg"}  # fmt: skip
    Journal(folder).write(step_document(base_document(), step), about)
    return folder


def recover(editor: Editor, name: str) -> None:
    (left,) = (left for left in editor.recovery.left if left.folder.name == name)
    editor.recovery.recover(left)
    wait_until(editor, lambda: editor.chores.is_idle)


def test_every_crashed_editor_is_listed_the_newest_first(editor: Editor) -> None:
    leave("cat", 9), leave("dog", 14)
    editor.recovery.look()
    assert [left.name for left in editor.recovery.left] == ["dog.jpg", "cat.jpg"]
    recover(editor, "dog")  # in whose place no list is: the other is offered there
    assert editor.message is not None and editor.message.action is not None
    assert "cat.jpg" in editor.message.text
    editor.message.action.run()
    wait_until(editor, lambda: editor.chores.is_idle)
    assert editor.message is not None and "Recovered cat.jpg" in editor.message.text


def test_a_command_recovers_what_was_left_or_shows_the_list(editor: Editor) -> None:
    editor.recovery.look()
    assert why_not(editor, "recover") == "No unsaved work of an earlier session is there"
    leave("cat", 9), leave("dog", 14)
    editor.recovery.look()
    run(editor, "recover")
    assert editor.message is not None
    assert editor.message.text == "Choose in the list what to recover"
    assert editor.document is None and len(editor.recovery.left) == 2
    recover(editor, "dog")
    run(editor, "recover")
    wait_until(editor, lambda: editor.chores.is_idle)
    assert editor.message is not None and "Recovered cat.jpg" in editor.message.text
    assert len(editor.tabs.all) == 2 and editor.recovery.left == ()


def test_what_is_recovered_is_unsaved_and_stays_safe(editor: Editor) -> None:
    folder = leave("cat", 9, step=7)
    editor.recovery.look()
    recover(editor, "cat")
    assert editor.committed is not None
    assert editor.committed.objects[0].placement.move == (7.0, 0.0)
    assert not editor.is_saved
    assert editor.source == Path("/photos/cat.jpg")
    assert editor.recovery.left == ()
    settle(editor)
    assert folders(recovery_root()) == [folder]  # another crash would lose nothing
    editor.close_document()
    settle(editor)
    assert folders(recovery_root()) == []


def test_what_is_recovered_and_closed_at_once_is_not_offered_again(editor: Editor) -> None:
    folder = leave("cat", 9)
    editor.recovery.look()
    recover(editor, "cat")
    editor.close_document()
    settle(editor)
    assert not folder.exists()


def test_it_is_offered_after_the_last_of_several_files(editor: Editor, photo_path: Path) -> None:
    """As the program is started with them: the tabs before the last are left at once."""
    leave("cat", 9)
    other = photo_path.with_name("other.png")
    other.write_bytes(photo_path.read_bytes())
    editor.recovery.look(is_shown=False)
    editor.filing.open_all([photo_path, other])
    wait_until(editor, lambda: editor.tab.name == "other.png" and editor.chores.is_idle)
    assert editor.message is not None and editor.message.action is not None
    assert "cat" in editor.message.text


def test_discarding_deletes_it(editor: Editor) -> None:
    folder = leave("cat", 9)
    editor.recovery.look()
    (left,) = editor.recovery.left
    editor.recovery.ask_to_discard(left)
    assert folder.exists() and editor.recovery.left == (left,), "it is asked first"
    editor.recovery.ask_to_discard(left)
    assert not folder.exists()
    assert editor.recovery.left == ()


def test_a_running_editors_work_is_not_offered(editor: Editor) -> None:
    folder = leave("cat", 9)
    lock = FileLock.take(folder / LOCK)
    assert lock is not None
    editor.recovery.look()
    assert editor.recovery.left == ()
    lock.release()
    editor.recovery.look()
    assert len(editor.recovery.left) == 1


@pytest.mark.parametrize("victim", [DOCUMENT, "*.photo", "*.npy"])
def test_damage_is_a_sentence_and_the_rest_is_still_offered(editor: Editor, victim: str) -> None:
    broken = leave("cat", 9)
    leave("dog", 14)
    path = next(broken.glob(victim))
    path.write_bytes(path.read_bytes()[:50])
    editor.recovery.look()
    assert len(editor.recovery.left) == 2
    if victim != DOCUMENT:
        recover(editor, "cat")
        assert editor.committed is None
        assert editor.message is not None and editor.message.is_error
    (damaged,) = (left for left in editor.recovery.left if left.folder == broken)
    assert damaged.problem and "\n" not in damaged.problem
    recover(editor, "dog")
    assert editor.committed is not None
    editor.recovery.discard(damaged)
    assert not broken.exists()


def test_it_is_recovered_beside_other_unsaved_work(editor: Editor) -> None:
    left = leave("cat", 9, step=7)
    base = base_document()
    editor.start(base)
    editor.apply("Step", step_document(base, 1))
    editor.recovery.look()
    recover(editor, "cat")
    assert [tab.document.objects[0].placement.move[0] for tab in editor.tabs.all if tab.document] \
        == [1.0, 7.0]  # fmt: skip
    wait_until(editor, lambda: all(tab.autosave.is_up_to_date for tab in editor.tabs.all))
    assert len(folders(recovery_root())) == 2 and left in folders(recovery_root())
