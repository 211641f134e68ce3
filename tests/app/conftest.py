"""A made photo, an editor with its worker, and an X display for the window."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

import hands
from hands import PATIENCE
from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.settings import Settings
from objectmorpher.editor.view import ToolName, ViewState
from objectmorpher_core.document.model import Document, Placement

try:
    import fcntl
except ImportError:
    fcntl = None  # Windows has none

if TYPE_CHECKING:
    from desk import Desk

WIDTH, HEIGHT = 180, 140  # px of the made photo
CENTRE = (90.0, 72.0)  # px, of the ball in it
RADII = (34.0, 44.0)
CANVAS = ((720, 560), 1.0, None)


def made_photo() -> np.ndarray:
    """A shaded red ball before a blue-green wall (H, W, 3) u8."""
    random = np.random.default_rng(7)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    wall = np.stack([40 + 0.1 * x, 90 + 0.3 * y, 110 + 0.2 * x], -1)
    wall += random.normal(0, 4, (HEIGHT, WIDTH, 1))
    dx, dy = (x - CENTRE[0]) / RADII[0], (y - CENTRE[1]) / RADII[1]
    inside = 1 - dx**2 - dy**2
    shade = 0.45 + 0.55 * np.sqrt(inside.clip(0)) - 0.15 * dx
    ball = np.array([225, 60, 40]) * shade[..., None] + random.normal(0, 3, (HEIGHT, WIDTH, 1))
    share = (inside / 0.05).clip(0, 1)[..., None]
    return (wall * (1 - share) + ball * share).clip(0, 255).astype(np.uint8)


@pytest.fixture(scope="session")
def photo_bytes() -> bytes:
    out = io.BytesIO()
    Image.fromarray(made_photo()).save(out, "PNG")
    return out.getvalue()


@pytest.fixture
def photo_path(tmp_path: Path, photo_bytes: bytes) -> Path:
    path = tmp_path / "ball.png"
    path.write_bytes(photo_bytes)
    return path


@pytest.fixture(scope="session", autouse=True)
def data_folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    """What editors keep safe is not the user's."""
    os.environ["OBJECTMORPHER_DATA"] = str(tmp_path_factory.mktemp("data"))


@pytest.fixture(scope="session")
def shared_editor(compiled: None, data_folder: None) -> Iterator[Editor]:
    editor = Editor(Settings(gaussians=3000))
    editor.view.resize(*CANVAS)
    yield editor
    editor.shut_down()


@pytest.fixture
def editor(shared_editor: Editor, photo_path: Path) -> Editor:
    """An editor with the made photo open; the worker is shared, it takes seconds to start."""
    shared_editor.close_document()
    wait_until(shared_editor, lambda: shared_editor.jobs.is_idle)
    shared_editor.view = ViewState()  # nothing of it stays from the test before
    shared_editor.view.resize(*CANVAS)
    open_file(shared_editor, photo_path)
    assert shared_editor.message is None, shared_editor.message
    return shared_editor


@pytest.fixture(scope="session")
def ball(
    shared_editor: Editor, photo_bytes: bytes, tmp_path_factory: pytest.TempPathFactory
) -> Document:
    """The made photo's document, its ball lifted and with a background behind it."""
    path = tmp_path_factory.mktemp("ball") / "ball.png"
    path.write_bytes(photo_bytes)
    shared_editor.close_document()
    open_file(shared_editor, path)
    return lift_ball(shared_editor)


def open_file(editor: Editor, path: Path) -> None:
    """Opens it and waits for it, or for the question about unsaved changes."""
    editor.filing.open(path)
    wait_until(editor, lambda: editor.chores.is_idle)


def wait_until(editor: Editor, is_reached: Callable[[], bool]) -> None:
    """Polls as the window's loop does."""
    end = time.monotonic() + PATIENCE
    while not is_reached():
        assert time.monotonic() < end, f"nothing came in time; the message is {editor.message}"
        editor.poll()
        time.sleep(0.005)


def wait_for_jobs(editor: Editor) -> None:
    wait_until(
        editor,
        lambda: not editor.poll() and editor.jobs.is_idle and editor.chores.is_idle,
    )


def lift_ball(editor: Editor) -> Document:
    """The ball, selected, lifted and with a background behind it."""
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    assert editor.mask is not None, editor.message
    run(editor, "lift")
    wait_for_jobs(editor)
    assert editor.is_lifted, editor.message
    assert editor.document is not None
    assert editor.document.plate is not None
    return editor.document


def duplicate(editor: Editor, document: Document, *move: float) -> None:
    """Opens the document; a copy of its object, moved by so many px, becomes the current one."""
    editor.start(document)
    editor.view.tool = ToolName.PLACE
    run(editor, "duplicate")
    editor.placing.move_to(Placement(move=(move[0], move[1])))
    editor.commit("Move object")


@pytest.fixture
def own_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of settings that are the test's own; no server is named by the environment."""
    monkeypatch.setenv("OBJECTMORPHER_SETTINGS", str(tmp_path / "own" / "settings.toml"))
    monkeypatch.delenv("OBJECTMORPHER_SERVER", raising=False)
    monkeypatch.delenv("OBJECTMORPHER_TOKEN", raising=False)
    return tmp_path / "own"


@pytest.fixture
def alone(own_settings: Path) -> Iterator[Editor]:
    """An editor with those settings and a worker of its own."""
    editor = Editor(Settings())
    yield editor
    editor.shut_down()


@pytest.fixture
def desk() -> Iterator[Desk]:
    """A window's jobs and the server that they may go to."""
    from desk import Desk

    desk = Desk()
    yield desk
    desk.close()


@pytest.fixture(scope="session")
def display() -> Iterator[str]:
    """An X display of our own, 1440 x 900."""
    if shutil.which("Xvfb") is None:
        pytest.skip("Xvfb is not installed")
    with hands.x_display(1440, 900) as name:
        if name is None:
            pytest.skip("no free X display was found")
        yield name


@pytest.fixture(scope="session")
def compiled(pytestconfig: pytest.Config) -> None:
    """The kernels are on the disk: who compiles them answers nobody for a minute or two.

    To load them all takes seconds: a list of them is kept until a source changes or one is gone.
    """
    folders = [hands.ROOT / "objectmorpher_core", hands.ROOT / "app" / "objectmorpher"]
    sources = sorted(path for folder in folders for path in folder.rglob("*.py"))
    times = repr([(str(path), path.stat().st_mtime_ns) for path in sources])
    kept = pytestconfig.rootpath / ".pytest_cache" / "kernels.txt"
    kept.parent.mkdir(exist_ok=True)
    with kept.with_suffix(".lock").open("w") as lock:
        if fcntl is not None:  # other processes of this run wait, and find the list
            fcntl.flock(lock, fcntl.LOCK_EX)
        before = kept.read_text(encoding="utf-8").splitlines() if kept.exists() else []
        if before[:1] == [times] and all(map(os.path.exists, before[1:])):
            return
        command = [sys.executable, "-m", "objectmorpher.system.warm_up"]
        subprocess.run(command, cwd=hands.ROOT, check=True)
        found = [str(path) for folder in folders for path in folder.rglob("*.nbi")]
        kept.write_text("\n".join([times, *sorted(found)]), encoding="utf-8")


@pytest.fixture
def window_environment(compiled: None, display: str, tmp_path: Path) -> dict[str, str]:
    """For a process with a window: its display, and settings of its own."""
    settings = 'dialogs = "built-in"\ngaussians = 3000\n'
    return hands.window_environment(display, tmp_path, settings)
