"""A made photo, an editor with its worker, and an X display for the window."""

from __future__ import annotations

import io
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from PIL import Image

import hands
from editor_steps import close_all, lift_ball, made_photo, open_file, wait_until
from objectmorpher.editor import state
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.settings import Settings
from objectmorpher.editor.view import ViewState
from objectmorpher.worker.jobs import Jobs
from objectmorpher_core.document.model import Document
from objectmorpher_core.models import device
from tests import kernels, remembered

if TYPE_CHECKING:
    from desk import Desk

state.WARM = (*state.WARM, remembered.__name__)  # for the worker processes, too
CANVAS = ((720, 560), 1.0, None)


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
def editor(request: pytest.FixtureRequest, shared_editor: Editor, photo_path: Path) -> Editor:
    """An editor with the made photo open; the worker is shared, it takes seconds to start.

    A test that has the lifted `ball` opens that: for it nothing is opened, and what the canvas has
    computed of the ball stays known.
    """
    close_all(shared_editor)
    wait_until(shared_editor, lambda: shared_editor.jobs.is_idle)
    shared_editor.view = ViewState()  # nothing of it stays from the test before
    shared_editor.filing.wanted = shared_editor.filing.question = None
    shared_editor.view.resize(*CANVAS)
    if "ball" not in request.fixturenames:
        open_file(shared_editor, photo_path)
    assert shared_editor.message is None, shared_editor.message
    return shared_editor


@pytest.fixture(scope="session")
def ball(
    shared_editor: Editor, photo_bytes: bytes, tmp_path_factory: pytest.TempPathFactory
) -> Document:
    """The made photo's document, its ball lifted and with a background behind it."""

    def lift() -> Document:
        path = tmp_path_factory.mktemp("ball") / "ball.png"
        path.write_bytes(photo_bytes)
        close_all(shared_editor)
        open_file(shared_editor, path)
        return lift_ball(shared_editor)

    return remembered.once(b"the lifted ball", lift)


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


@pytest.fixture(scope="session")
def desk_jobs() -> Iterator[Jobs]:
    jobs = Jobs()
    yield jobs
    jobs.close()


@pytest.fixture
def desk(desk_jobs: Jobs) -> Iterator[Desk]:
    """A window's jobs and the server that they may go to."""
    from desk import Desk

    desk = Desk(desk_jobs)
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
def compiled() -> None:
    """The kernels are on the disk: who compiles them answers nobody for a minute or two."""
    kernels.compile_kernels()


@pytest.fixture
def window_environment(compiled: None, display: str, tmp_path: Path) -> dict[str, str]:
    """For a process with a window: its display, and settings of its own."""
    settings = 'dialogs = "built-in"\ngaussians = 3000\n'
    # On the CPU: else each window imports PyTorch, if there is one, to look for a GPU.
    return hands.window_environment(display, tmp_path, settings) | {device.DEVICE: "cpu"}


@pytest.fixture
def without_networks(window_environment: dict[str, str], tmp_path: Path) -> dict[str, str]:
    """As on a machine without weights, where it does not matter how well something is selected.

    A window that opens a photo has its network look at it: most of what its test would cost.
    """
    return window_environment | {"OBJECTMORPHER_CACHE": str(tmp_path / "weights")}
