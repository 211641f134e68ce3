"""Models are offered, downloaded only when asked for, and a failure leaves nothing behind."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from editor_steps import wait_until
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.intents.models import NAMES
from objectmorpher.editor.settings import Settings
from objectmorpher_core import models


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache, and a pip that finds wheels only in `tmp_path`/wheels."""
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(tmp_path / "wheels"))
    (tmp_path / "wheels").mkdir()
    return tmp_path / "cache" / "models"


@pytest.fixture(scope="module")
def own_editor(compiled: None, data_folder: None) -> Iterator[Editor]:
    """One of this file: a worker that starts here would keep this empty cache for all others."""
    editor = Editor(Settings())
    yield editor
    editor.shut_down()


@pytest.fixture
def choosing(own_editor: Editor) -> Editor:
    """An editor that knows what is there: nothing."""
    own_editor.settings = Settings()
    own_editor.message = None
    own_editor.models.look()
    wait_until(own_editor, lambda: own_editor.chores.is_idle)
    return own_editor


def test_every_model_that_editing_uses_is_listed_and_has_a_name_for_people(
    choosing: Editor,
) -> None:
    assert set(NAMES) == {weight.id for weight in models.weights() if weight.category == "edit"}
    assert {state.weight.id for state in choosing.models.states} == set(NAMES)


def test_the_best_missing_model_is_offered_until_declined(choosing: Editor) -> None:
    found = choosing.models
    assert found.offered is not None and found.offered.id == "dinov2-vits14"
    found.decline("dinov2-vits14")
    assert found.offered is not None and found.offered.id == "u2netp"
    found.decline("u2netp")
    assert found.offered is None
    assert {state.state for state in found.states} == {"missing"}


def test_looking_downloads_nothing(choosing: Editor, cache: Path) -> None:
    choosing.models.open()
    wait_until(choosing, lambda: choosing.chores.is_idle)
    assert not cache.exists()


def test_a_failed_download_is_a_sentence_and_leaves_nothing(choosing: Editor, cache: Path) -> None:
    choosing.models.download("u2netp")
    assert choosing.models.downloading == "u2netp"
    wait_until(choosing, lambda: choosing.models.downloading is None)
    assert choosing.message is not None and choosing.message.is_error
    assert "\n" not in choosing.message.text
    assert list(cache.iterdir()) == []
    retry = choosing.message.action
    assert retry is not None and retry.label == "Retry"
    retry.run()
    assert choosing.models.downloading == "u2netp"
    wait_until(choosing, lambda: choosing.models.downloading is None)


def test_a_cancelled_download_leaves_nothing(choosing: Editor, cache: Path) -> None:
    choosing.models.download("u2netp")
    choosing.models.cancel()
    assert choosing.models.downloading is None
    wait_until(choosing, lambda: choosing.chores.is_idle)
    wait_until(choosing, lambda: not cache.exists() or list(cache.iterdir()) == [])
