"""Models of several files in the list: sizes, licences, downloads, folders of the user's."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from editor_steps import wait_until
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.intents import models as hub_models
from objectmorpher.editor.settings import Settings
from objectmorpher.gui.dialogs.models_dialog import GAINS, NAMES, SETS, SIZES, STAGES
from objectmorpher_core import models
from objectmorpher_core.base.progress import Progress
from tests.core.models.local_hub import TINY_SAM2, TOKEN, Hub, offering, own_cache

FREE, GATED = models.hub_model("sam2.1-tiny"), models.hub_model("sam3")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    return own_cache(tmp_path, monkeypatch)


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Hub]:
    with offering(monkeypatch, TINY_SAM2, FREE, GATED) as hub:
        yield hub


@pytest.fixture
def choosing(editor: Editor) -> Editor:
    """An editor that knows what is there: nothing."""
    editor.models.look()
    wait_until(editor, lambda: editor.chores.is_idle)
    return editor


@pytest.fixture
def own_editor(cache: Path, compiled: None) -> Iterator[Editor]:
    """An editor whose worker process keeps models in the test's own folder, too."""
    editor = Editor(Settings())
    yield editor
    editor.shut_down()


def settle(editor: Editor) -> None:
    wait_until(editor, lambda: editor.chores.is_idle and editor.jobs.is_idle)


def test_every_family_and_size_has_a_name_for_people() -> None:
    assert set(NAMES) == set(GAINS) == set(models.families())
    for family in NAMES:
        sizes = [model for model in models.hub_models() if model.family == family]
        assert len(sizes) == 1 or {model.id for model in sizes} <= set(SIZES)
        assert {model.stage for model in sizes} <= set(STAGES)


def test_a_family_offers_its_small_size_until_one_is_chosen(choosing: Editor) -> None:
    hub = choosing.models.hub
    assert hub.shown("sam2").model is FREE
    hub.choose("sam2", "sam2.1-large")
    assert hub.shown("sam2").model.id == "sam2.1-large"
    hub.choose("sam2", FREE.id)


@pytest.mark.slow  # the worker imports PyTorch
def test_a_model_is_downloaded_and_removed(choosing: Editor, server: Hub) -> None:
    hub = choosing.models.hub
    hub.download(FREE.id)
    assert choosing.models.downloading == FREE.id
    settle(choosing)
    assert choosing.message is not None and choosing.message.text == f"{FREE.id} is ready"
    assert hub.shown("sam2").state == "ok"
    hub.remove(FREE.id)
    settle(choosing)
    assert hub.shown("sam2").state == "missing"


@pytest.mark.slow
def test_a_licence_is_accepted_before_a_download(
    choosing: Editor, server: Hub, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not hub_models.has_torch():
        pytest.skip("torch is not installed")
    hub = choosing.models.hub
    assert hub.why_not(GATED) == "Accept its licence first"
    hub.download(GATED.id)
    settle(choosing)
    assert choosing.message is not None and "SAM License" in choosing.message.text
    hub.accept(GATED, True)
    assert hub.why_not(GATED) is None
    monkeypatch.setenv("HF_TOKEN", TOKEN)
    hub.download(GATED.id)
    settle(choosing)
    assert hub.shown("sam3").state == "ok"
    hub.accept(GATED, False)


@pytest.mark.slow
def test_a_folder_of_the_users_is_taken_by_one_of_its_files(
    own_editor: Editor, tmp_path: Path
) -> None:
    choosing, hub, folder = own_editor, own_editor.models.hub, tmp_path / "mine"
    folder.mkdir()
    hub.wanted = FREE.id
    hub.use_folder(folder / "config.json")
    settle(choosing)
    assert choosing.message is not None and "holds no" in choosing.message.text
    for name, data in TINY_SAM2.items():
        (folder / name).write_bytes(data)
    hub.use_folder(folder / "config.json")
    settle(choosing)
    assert hub.shown("sam2").is_own and hub.shown("sam2").path == folder
    hub.remove(FREE.id)
    settle(choosing)
    assert json.loads((folder / "config.json").read_bytes()) == {"model_type": "sam2"}


@pytest.mark.slow
def test_a_set_is_told_for_this_machine_and_downloads_queue(choosing: Editor, server: Hub) -> None:
    offers = {offer.set.id: offer for offer in choosing.models.offers}
    assert set(offers) == set(SETS) and offers["clicks"].missing > 0
    began: list[str] = []

    def fetch(name: str, progress: Progress) -> Path:
        began.append(name)
        return Path(name)

    for name in ("one", "two", "three"):
        choosing.models.run(name, name, partial(fetch, name))
    assert choosing.models.downloading == "one" and choosing.models.is_waiting("two")
    choosing.models.forget_waiting("two")
    settle(choosing)
    assert began == ["one", "three"] and choosing.models.downloading is None
