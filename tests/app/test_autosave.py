"""Unsaved work is on the disk within seconds, costs the window nothing, and goes when saved."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from edit_until_killed import base_document, step_document
from editor_steps import close_all, wait_until
from hands import ROOT
from objectmorpher.editor.autosave import recovery_root
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.settings import Settings
from objectmorpher_core.document.model import Document, EditObject, Matte, Photo, Placement
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.session.journal import DOCUMENT, read_about, read_journal
from tests.tree import PYTHONPATH

INTERVAL = 0.5  # s, for tests that need not wait for the editor's own
MOST_LOST = 10.0  # s of work that a crash may cost
MAIN_THREAD = 0.02  # of what keeping a document takes: what autosaving may take of a frame


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A data folder of the test's own."""
    monkeypatch.setenv("OBJECTMORPHER_DATA", str(tmp_path / "data"))
    monkeypatch.setattr("objectmorpher.editor.autosave.INTERVAL", INTERVAL)
    return recovery_root()


@pytest.fixture
def editor(root: Path, shared_editor: Editor) -> Iterator[Editor]:
    """An editor that shows noise; nothing is unsaved before and after."""
    close_all(shared_editor)
    settle(shared_editor)
    shared_editor.start(base_document())
    yield shared_editor
    close_all(shared_editor)
    settle(shared_editor)


def settle(editor: Editor) -> None:
    """Until the disk holds what is unsaved, and only that."""
    wait_until(editor, lambda: editor.autosave.is_up_to_date)


def folders(root: Path) -> list[Path]:
    return [path.parent for path in root.glob(f"*/{DOCUMENT}")]


def assert_is_step(document: Document, n: int) -> None:
    expected = step_document(document, n)
    thing, other = document.objects[0], expected.objects[0]
    assert thing.placement.move == (float(n), 0.0)
    old = step_document(document, n // 20 * 20).objects[0] if n >= 20 else other
    assert thing.matte is not None and old.matte is not None
    np.testing.assert_array_equal(thing.mask, old.mask)
    np.testing.assert_array_equal(thing.matte.alpha, old.matte.alpha)
    np.testing.assert_array_equal(thing.matte.foreground, old.matte.foreground)
    np.testing.assert_array_equal(document.photo.pixels, base_document().photo.pixels)


def test_what_is_unsaved_is_kept_until_it_is_saved(editor: Editor, root: Path) -> None:
    assert editor.committed is not None and editor.history is not None
    settle(editor)
    assert folders(root) == []
    editor.apply("Step", step_document(editor.committed, 3))
    settle(editor)
    (folder,) = folders(root)
    assert_is_step(read_journal(folder), 3)
    assert read_about(folder)["name"] == editor.committed.photo.name
    editor.tab.path = root / "of the walk.omorph"
    editor.history.mark_saved()
    settle(editor)
    assert folders(root) == []
    editor.apply("Step", step_document(editor.committed, 4))
    settle(editor)
    (folder,) = folders(root)
    assert read_about(folder)["name"] == "of the walk.omorph"


def test_undoing_everything_leaves_nothing_to_keep(editor: Editor, root: Path) -> None:
    assert editor.committed is not None
    editor.apply("Step", step_document(editor.committed, 3))
    settle(editor)
    assert folders(root)
    editor.undo()
    settle(editor)
    assert folders(root) == []


def test_work_goes_on_while_it_is_kept(editor: Editor, root: Path) -> None:
    """Steps in quick succession are written every few seconds, not one by one."""
    base = editor.committed
    assert base is not None
    end, n = time.monotonic() + INTERVAL + 1.0, 0
    while time.monotonic() < end:
        n += 1
        editor.apply("Step", replace(base, seed=n))
        editor.poll()
        time.sleep(0.02)
    (folder,) = folders(root)
    assert n - read_journal(folder).seed < 1.5 / 0.02


def test_the_window_is_not_held_up_by_a_large_photo(editor: Editor, root: Path) -> None:
    pixels = np.zeros((4000, 6000, 3), np.uint8)
    assert editor.committed is not None
    source = os.urandom(8 << 20)
    photo = Photo(Picture(pixels), editor.committed.photo.camera, source, "large.jpg")
    matte = Matte(0, 0, np.ones((1500, 1500), np.float32), np.ones((1500, 1500, 3), np.float32))
    thing = replace(EditObject("Object 1", mask=pixels[..., 0] > 0), matte=matte)
    document = Document(photo, (thing,))
    editor.jobs.cancel()
    assert editor.history is not None
    editor.history.apply("Step", document)
    longest = 0.0
    begun, end = time.process_time(), time.monotonic() + 30
    while not (editor.autosave.is_up_to_date and folders(root)) and time.monotonic() < end:
        started = time.thread_time()
        editor.autosave.poll()
        longest = max(longest, time.thread_time() - started)
        time.sleep(0.002)
    (folder,) = folders(root)
    first = sum(path.stat().st_size for path in folder.iterdir())
    assert longest < MAIN_THREAD * (time.process_time() - begun)
    before = {path.name for path in folder.iterdir()}
    moved = document.with_object(0, replace(thing, placement=Placement(move=(3.0, 0.0))))
    editor.history.apply("Step", moved)
    time.sleep(INTERVAL)
    editor.autosave.poll()
    wait_until(editor, lambda: editor.autosave.is_up_to_date)
    assert {path.name for path in folder.iterdir()} == before
    assert (folder / DOCUMENT).stat().st_size < 20_000 < first


def test_a_disk_that_takes_nothing_is_told_once_and_the_work_goes_on(
    editor: Editor, root: Path
) -> None:
    root.parent.mkdir(parents=True, exist_ok=True)
    if root.is_dir():
        shutil.rmtree(root)
    root.write_text("a file where the folder should be")
    assert editor.committed is not None
    editor.apply("Step", step_document(editor.committed, 1))
    wait_until(editor, lambda: editor.message is not None)
    assert editor.message is not None and editor.message.is_error
    assert "\n" not in editor.message.text
    editor.message = None
    root.unlink()
    editor.apply("Step", step_document(editor.committed, 2))
    wait_until(editor, lambda: bool(folders(root)) and editor.autosave.is_up_to_date)
    assert editor.message is None


def kill_and_read(tmp_path: Path, seconds: float) -> tuple[Document | None, int, int]:
    """The document that a killed editor has left; its last step, and that of 10 s before."""
    log, data = tmp_path / "log", tmp_path / "data"
    environment = {**os.environ, "OBJECTMORPHER_DATA": str(data), "PYTHONPATH": PYTHONPATH}
    command = [sys.executable, str(Path(__file__).parent / "edit_until_killed.py"), str(log)]
    with subprocess.Popen(command, env=environment, cwd=ROOT) as process:
        while not log.exists() or not log.read_text():
            time.sleep(0.02)
            assert process.poll() is None
        time.sleep(seconds)
        process.send_signal(signal.SIGKILL)
        killed = time.monotonic()
    steps = [line.split() for line in log.read_text().splitlines() if line.count(" ") == 1]
    old = [int(n) for n, at in steps if float(at) <= killed - MOST_LOST]
    editor = Editor(Settings())
    try:
        os.environ["OBJECTMORPHER_DATA"] = str(data)
        editor.recovery.look()
        if not editor.recovery.left:
            return None, int(steps[-1][0]), max(old, default=0)
        (left,) = editor.recovery.left
        assert left.name == "noise.png" and left.objects == 1 and not left.problem
        editor.recovery.recover(left)
        wait_until(editor, lambda: editor.chores.is_idle)
        assert not editor.is_saved
        return editor.committed, int(steps[-1][0]), max(old, default=0)
    finally:
        editor.close_document()
        editor.shut_down()


@pytest.fixture
def own_data(monkeypatch: pytest.MonkeyPatch) -> None:
    """`kill_and_read` names a data folder; it is put back."""
    monkeypatch.setenv("OBJECTMORPHER_DATA", os.environ["OBJECTMORPHER_DATA"])


@pytest.mark.slow
def test_a_killed_editor_loses_seconds(tmp_path: Path, own_data: None) -> None:
    document, last, _ = kill_and_read(tmp_path, 4.5)
    assert document is not None
    n = int(document.objects[0].placement.move[0])
    assert last - n < 5.0 / 0.05
    assert_is_step(document, n)


@pytest.mark.slow
@pytest.mark.parametrize("run", range(4))
def test_killed_at_any_moment_it_loses_ten_seconds_at_most(
    tmp_path: Path, own_data: None, run: int
) -> None:
    seconds = random.Random(run).uniform(0.0, 13.0)
    document, _, least = kill_and_read(tmp_path, seconds)
    n = 0 if document is None else int(document.objects[0].placement.move[0])
    assert n >= least
    if document is not None:
        assert_is_step(document, n)
