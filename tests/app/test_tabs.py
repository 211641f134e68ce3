"""Several photos in tabs: each keeps what is its own, and none is lost."""

from __future__ import annotations

import gc
import random
import threading
import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from editor_steps import close_all, open_file, wait_for_jobs, wait_until
from objectmorpher.commands import run, why_not
from objectmorpher.editor.autosave import recovery_root
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.filing import Dialog
from objectmorpher.editor.shortcuts import Shortcuts
from objectmorpher.editor.state import Tab
from objectmorpher.editor.view import Shown, ToolName
from objectmorpher.gui.window.input import Input
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.session.file import decode_session


@pytest.fixture
def tabs(editor: Editor, ball: Document) -> Iterator[Editor]:
    """Three tabs, the last one shown: two of the lifted ball, and one of the photo alone."""
    editor.tabs.open(ball)
    editor.tabs.open(replace(ball, photo=replace(ball.photo, name="other.png")))
    editor.tabs.open(replace(ball, photo=replace(ball.photo, name="bare.png"), objects=()))
    yield editor
    close_all(editor)
    wait_for_jobs(editor)


def go(editor: Editor, tab: Tab) -> None:
    editor.tabs.go(tab)
    wait_until(editor, lambda: editor.tab is tab)


def move(editor: Editor, x: float) -> None:
    """A step in the tab that is shown."""
    editor.placing.move_to(Placement(move=(x, 0.0)))
    editor.commit("Move object")


def facts(tab: Tab) -> tuple[object, ...]:
    assert tab.history is not None
    return tab.document, tab.history, tab.history.steps, tab.path, tab.source, tab.current


def test_going_from_tab_to_tab_changes_no_document(tabs: Editor) -> None:
    """Each has its own document, steps, files, selection and view; undo stays within it."""
    first, second, third = tabs.tabs.all
    go(tabs, first)
    move(tabs, 5.0)
    tabs.view.tool = ToolName.PLACE
    tabs.view.set_zoom(3.0, (100.0, 80.0), (180, 140))
    place = tabs.view.place
    go(tabs, second)
    tabs.view.shown = Shown.DEPTH
    tabs.tab.source = Path("/photos/other.png")
    kept = {tab: facts(tab) for tab in (first, second, third)}
    way = random.Random(3)
    for _ in range(12):
        if way.random() < 0.5:
            go(tabs, way.choice((first, second, third)))
        else:
            at, by = tabs.tabs.all.index(tabs.tab), way.choice((1, -1))
            run(tabs, "next_tab" if by > 0 else "previous_tab")
            wait_until(tabs, lambda at=at, by=by: tabs.tabs.all.index(tabs.tab) == (at + by) % 3)
        tabs.poll()
        assert {tab: facts(tab) for tab in (first, second, third)} == kept
        assert tabs.view.shown is (Shown.DEPTH if tabs.tab is second else Shown.COMPOSITE)
    go(tabs, second)
    tabs.undo()
    assert facts(second) == kept[second], "there is nothing to undo"
    go(tabs, first)
    assert tabs.view.place == place and tabs.view.tool is ToolName.PLACE
    tabs.undo()
    assert first.is_saved


def test_painting_goes_on_in_the_tab_that_it_began_in_only(tabs: Editor) -> None:
    first, second, _ = tabs.tabs.all
    go(tabs, first)
    tabs.view.compose.is_painting, tabs.view.compose.source = True, (12.0, 30.0)
    go(tabs, second)
    assert not tabs.view.compose.is_painting and tabs.view.compose.source is None
    go(tabs, first)
    assert tabs.view.compose.is_painting and tabs.view.compose.source == (12.0, 30.0)


def test_what_is_being_changed_in_a_field_goes_with_its_tab_or_tool(tabs: Editor) -> None:
    first, second, _ = tabs.tabs.all
    go(tabs, first)
    move(tabs, 5.0)
    kept = first.document, second.document
    finish = replace(tabs.chosen.finish, opacity=0.5)
    leave: tuple[Callable[[], None], ...] = (
        partial(go, tabs, second), partial(run, tabs, "pose"), partial(run, tabs, "undo"),
    )  # fmt: skip
    for away in leave:
        go(tabs, first)
        tabs.choose_tool(ToolName.COMPOSE)
        tabs.composing.preview_finish(finish)
        assert tabs.preview is not None
        away()
        assert tabs.preview is None and tabs.document is tabs.tab.document
        tabs.commit("Look of object")  # the button goes up
    assert second.document is kept[1]
    tabs.redo()
    assert first.document is kept[0]


def test_a_tab_is_put_elsewhere_in_the_bar_and_changes_in_nothing(tabs: Editor) -> None:
    kept = {tab: facts(tab) for tab in tabs.tabs.all}
    way, order = random.Random(5), list(tabs.tabs.all)
    for _ in range(20):
        tab, at = way.choice(order), way.randrange(len(order))
        shown = tabs.tab
        tabs.tabs.move(tab, at)
        order.remove(tab)
        order.insert(at, tab)
        assert list(tabs.tabs.all) == order and tabs.tab is shown
    assert {tab: facts(tab) for tab in tabs.tabs.all} == kept


def test_a_tab_that_is_left_holds_no_more_than_its_document(tabs: Editor) -> None:
    """What drawing takes is kept for the tab that was left last, so that one can go back."""
    first, second, third = tabs.tabs.all
    go(tabs, first)
    document = first.document
    assert document is not None
    shape = weakref.ref(tabs.derived.shape(document.photo, document.objects[0]))
    cache = weakref.ref(tabs.cache)
    go(tabs, second)
    wait_for_jobs(tabs)
    gc.collect()
    assert cache() is None and shape() is not None
    tabs.tabs.go(first)
    assert tabs.tab is first, "at once"
    go(tabs, second)
    go(tabs, third)
    wait_for_jobs(tabs)
    gc.collect()
    assert shape() is None


def test_the_steps_of_all_tabs_together_hold_what_one_may(tabs: Editor) -> None:
    whole = tabs.settings.history_mb << 20
    histories = [tab.history for tab in tabs.tabs.all if tab.history is not None]
    assert sum(history._limit for history in histories) <= whole
    tabs.tabs.close(tabs.tabs.all[0])
    assert len(tabs.tabs.all) == 2
    assert all(tab.history and tab.history._limit == whole // 2 for tab in tabs.tabs.all)


def test_a_session_that_is_open_is_not_opened_twice(
    tabs: Editor, tmp_path: Path, photo_bytes: bytes
) -> None:
    first, _, third = tabs.tabs.all
    go(tabs, first)
    tabs.filing.save_as(tmp_path / "a.omorph")
    wait_until(tabs, lambda: first.path is not None)
    go(tabs, third)
    tabs.filing.open(tmp_path / "a.omorph")
    wait_until(tabs, lambda: tabs.tab is first)
    (tmp_path / "fourth.png").write_bytes(photo_bytes)
    open_file(tabs, tmp_path / "fourth.png")
    assert [tab.name for tab in tabs.tabs.all] == [
        "a.omorph", "fourth.png", "other.png", "bare.png"
    ]  # fmt: skip


def test_the_start_screen_of_a_new_tab_gives_way_to_what_is_opened(
    tabs: Editor, photo_path: Path
) -> None:
    run(tabs, "new_tab")
    assert tabs.document is None and len(tabs.tabs.all) == 4
    assert why_not(tabs, "new_tab") is not None
    open_file(tabs, photo_path)
    assert len(tabs.tabs.all) == 4 and tabs.source == photo_path
    run(tabs, "new_tab")
    run(tabs, "close")
    wait_until(tabs, lambda: len(tabs.tabs.all) == 4)
    assert tabs.source == photo_path


def test_a_chosen_file_is_for_the_tab_that_asked_for_it(tabs: Editor, tmp_path: Path) -> None:
    """A dialog of the system stays open while a photo that was being read comes, and is shown."""
    first, second, _ = tabs.tabs.all
    path = tmp_path / "a.omorph"
    for is_closed in (False, True):
        go(tabs, first)
        move(tabs, 3.0 + is_closed)
        first.path = None
        run(tabs, "save")
        tabs.filing.wanted = None  # the window shows it
        go(tabs, second)
        if is_closed:
            tabs.tabs.close(first)
        tabs.filing.choose(Dialog.SAVE, path)
        wait_for_jobs(tabs)
        assert second.path is None
        assert tabs.tab is (second if is_closed else first)
        assert decode_session(path.read_bytes()).objects[0].placement.move == (3.0, 0.0)
    assert tabs.message is not None and tabs.message.is_error


def test_closing_asks_for_each_tab_and_quitting_once_for_all(tabs: Editor, tmp_path: Path) -> None:
    first, second, third = tabs.tabs.all
    for tab, x in ((first, 3.0), (second, 4.0)):
        go(tabs, tab)
        move(tabs, x)
    go(tabs, third)
    tabs.filing.close(first)
    wait_until(tabs, lambda: tabs.filing.question is not None)
    assert tabs.tab is first, "the user sees what the question is about"
    tabs.filing.answer_cancel()
    assert first in tabs.tabs.all
    run(tabs, "quit")
    assert tabs.filing.asked == (first, second) and not tabs.is_over
    tabs.filing.answer_save()
    keys = Input(Shortcuts(tabs))

    def press_enter(is_reached: Callable[[], bool]) -> bool:
        """It is for the dialog that comes, not for the photo between two of them."""
        if is_reached():
            return True
        keys._run_key(tabs, "Enter")
        assert tabs.exporting.draft is None, "the next step of the photo that is seen"
        return False

    for tab, name in ((first, "a"), (second, "b")):

        def is_asked(tab: Tab = tab) -> bool:
            return tabs.tab is tab and tabs.filing.wanted is Dialog.SAVE

        wait_until(tabs, partial(press_enter, is_asked))
        tabs.filing.wanted = None
        tabs.filing.choose(Dialog.SAVE, tmp_path / f"{name}.omorph")
    wait_until(tabs, lambda: press_enter(lambda: tabs.is_over))
    assert not tabs.filing.is_asking
    tabs.is_over = False
    for name, x in (("a", 3.0), ("b", 4.0)):
        saved = decode_session((tmp_path / f"{name}.omorph").read_bytes())
        assert saved.objects[0].placement.move == (x, 0.0)


@pytest.mark.parametrize("name", ["a.png", "no folder/a.omorph"])
def test_keys_are_for_the_photo_again_where_a_session_is_not_saved(
    tabs: Editor, tmp_path: Path, name: str
) -> None:
    go(tabs, tabs.tabs.all[0])
    move(tabs, 3.0)
    run(tabs, "quit")
    tabs.filing.answer_save()
    assert tabs.filing.wanted is Dialog.SAVE
    tabs.filing.wanted = None
    tabs.filing.choose(Dialog.SAVE, tmp_path / name)
    wait_for_jobs(tabs)
    assert tabs.message is not None and tabs.message.is_error and not tabs.is_over
    is_done = threading.Event()
    tabs.chores.start(
        "Waiting", lambda progress: is_done.wait(), done=lambda _: None, failed=lambda _: None
    )
    assert not tabs.chores.is_idle and not tabs.filing.is_asking
    is_done.set()


def test_a_save_that_ends_in_another_tab_is_of_the_one_it_began_in(
    tabs: Editor, tmp_path: Path
) -> None:
    first, second, _ = tabs.tabs.all
    go(tabs, first)
    move(tabs, 3.0)
    tabs.filing.save_as(tmp_path / "a.omorph")
    tabs.tabs.go(second)
    wait_until(tabs, lambda: first.is_saved and tabs.tab is second)
    assert first.path == tmp_path / "a.omorph" and second.path is None


def test_quitting_waits_for_what_is_being_saved_and_asks_only_if_it_is_not(
    tabs: Editor, tmp_path: Path
) -> None:
    first, filing = tabs.tabs.all[0], tabs.filing
    go(tabs, first)
    move(tabs, 3.0)
    for name, stops in (("a", True), ("b", False)):
        path = tmp_path / f"{name}.omorph"
        filing.save_as(path)
        run(tabs, "quit")
        assert filing.question is None and filing.writing == (path.name,) and not tabs.is_over
        if stops:
            filing.answer_stop()
            wait_until(tabs, lambda: filing.question is not None)
            assert filing.asked == (first,) and not tabs.is_over, "nothing holds it now"
            filing.answer_cancel()
    wait_until(tabs, lambda: tabs.is_over)
    assert decode_session(path.read_bytes()).objects[0].placement.move == (3.0, 0.0)
    tabs.is_over = False


def test_unsaved_work_of_every_tab_is_kept_safe(
    tabs: Editor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OBJECTMORPHER_DATA", str(tmp_path / "data"))
    first, second, third = tabs.tabs.all
    for tab, x in ((first, 3.0), (second, 4.0)):
        go(tabs, tab)
        move(tabs, x)
    go(tabs, third)

    def settled() -> bool:
        return all(tab.autosave.is_up_to_date for tab in tabs.tabs.all)

    wait_until(tabs, settled)
    assert len(list(recovery_root().iterdir())) == 2
    tabs.tabs.close(first)
    wait_until(tabs, lambda: len(list(recovery_root().iterdir())) == 1)
    go(tabs, second)
    tabs.undo()
    wait_until(tabs, lambda: settled() and not list(recovery_root().iterdir()))


def test_a_lift_that_was_left_goes_on_when_one_comes_back(tabs: Editor, ball: Document) -> None:
    selected = replace(ball.objects[0], matte=None, lifted=None)
    unlifted = replace(ball, objects=(selected,), plate=None)
    tabs.tabs.open(unlifted)
    tab, first = tabs.tab, tabs.tabs.all[0]
    wait_for_jobs(tabs)
    run(tabs, "lift")
    go(tabs, first)
    wait_for_jobs(tabs)
    assert tab.document is unlifted
    go(tabs, tab)
    wait_until(tabs, lambda: tabs.is_lifted)
    assert tab.history is not None and tab.history.count == 2


def test_a_word_about_a_shape_that_was_left_is_heeded_when_one_comes_back(tabs: Editor) -> None:
    first, second, _ = tabs.tabs.all
    go(tabs, first)
    tabs.shaping.say("Other side", back="mirrored")
    go(tabs, second)
    wait_for_jobs(tabs)
    assert first.history is not None and first.history.count == 1
    assert tabs.shaping.settings.back == "auto"
    go(tabs, first)
    wait_until(tabs, lambda: tabs.chosen.shape.back == "mirrored")


def test_no_file_of_another_tab_is_overwritten(
    editor: Editor, ball: Document, photo_path: Path, tmp_path: Path
) -> None:
    """Neither its photo, by a picture or a mask, nor its session."""
    session, photo = tmp_path / "one.omorph", photo_path.read_bytes()
    open_file(editor, photo_path)
    editor.filing.save_as(session)
    wait_for_jobs(editor)
    first, written = editor.tab, session.read_bytes()
    editor.tabs.open(ball)
    for tab in (editor.tab, first):
        go(editor, tab)
        for write in (editor.exporting.export_to, editor.masking.write_file):
            editor.message = None
            write(photo_path)
            assert editor.message is not None and "overwrite the opened" in editor.message.text
    go(editor, next(tab for tab in editor.tabs.all if tab is not first))
    editor.filing.save_as(session)
    assert editor.message is not None and "open in another tab" in editor.message.text
    wait_for_jobs(editor)
    assert photo_path.read_bytes() == photo and session.read_bytes() == written
    close_all(editor)
