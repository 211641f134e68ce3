"""Models are offered, downloaded only when asked for, and a failure leaves nothing behind."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import wait_until

from app.editor import Editor
from app.settings import Settings
from objectmorpher_core import models


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache, and a pip that finds wheels only in `tmp_path`/wheels."""
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(tmp_path / "wheels"))
    (tmp_path / "wheels").mkdir()
    return tmp_path / "cache" / "models"


@pytest.fixture
def choosing(editor: Editor) -> Editor:
    """An editor that knows what is there: nothing."""
    editor.settings = Settings()
    editor.models.look()
    wait_until(editor, lambda: editor.chores.is_idle)
    return editor


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


def test_every_model_has_a_name_for_people() -> None:
    from app.editing.models import NAMES

    assert set(NAMES) == {weight.id for weight in models.weights()}
