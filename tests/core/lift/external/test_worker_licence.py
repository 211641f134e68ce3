"""A worker whose licence is not for every use runs only after it was accepted by its name."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from objectmorpher_core import doctor, lift
from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.workers import file as worker_file
from objectmorpher_core.lift.workers.file import accept_licence, forget_licence, read_worker

PACKAGED = Path(__file__).parents[4] / "packaging" / "workers"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(worker_file.FOLDER, str(tmp_path))
    return tmp_path


def install(folder: Path, licence: str = "Terms of Use", **more: str) -> None:
    told = {"licence": licence, "licence_kind": "non-commercial", **more}
    lines = ['command = ["{python}", "-c", "raise SystemExit(9)"]']
    lines += [f"{key} = {json.dumps(value)}" for key, value in told.items()]
    (folder / "mine.toml").write_text("\n".join(lines), "utf-8")


def test_a_licence_that_is_not_for_every_use_is_accepted_by_its_name(folder: Path) -> None:
    install(folder, page="https://example.org/terms")
    for wrong in ("", "yes", "MIT"):
        with pytest.raises(LiftError, match="--accept-licence 'Terms of Use'") as error:
            accept_licence("mine", wrong)
        assert "https://example.org/terms" in str(error.value) and "\n" not in str(error.value)
    with pytest.raises(LiftError, match="is not for every use"):
        lift.load("mine")
    stage = next(stage for stage in doctor.look_at_stages() if stage.name == "lift")
    assert "mine" not in stage.able and "Terms of Use" in dict(stage.others)["mine"]
    accept_licence("mine", " terms of use ")
    assert lift.load("mine").name == "mine"
    forget_licence("mine")
    assert not read_worker("mine").is_accepted


def test_another_licence_is_another_question(folder: Path) -> None:
    install(folder)
    accept_licence("mine", "Terms of Use")
    install(folder, "Other Terms")
    assert not read_worker("mine").is_accepted
    install(folder)
    assert read_worker("mine").is_accepted


def test_what_is_free_asks_nothing_and_what_is_damaged_asks_again(folder: Path) -> None:
    install(folder, "MIT", licence_kind="permissive")
    assert lift.load("mine").name == "mine"
    install(folder)
    for damage in ("{", "[]", '{"mine": 7}', "\xff"):
        (folder / worker_file.ACCEPTED).write_text(damage, "utf-8")
        assert not read_worker("mine").is_accepted


@pytest.mark.parametrize(
    ("told", "sentence"),
    [
        ({"licence_kind": "secret"}, "not one of permissive"),
        ({"licence": " "}, "has a name"),
    ],
)
def test_a_file_that_says_nonsense_of_its_licence_is_of_no_use(
    folder: Path, told: dict[str, str], sentence: str
) -> None:
    install(folder, **told)
    with pytest.raises(LiftError, match=sentence):
        read_worker("mine")


def test_the_packaged_workers_say_which_licences_are_not_for_every_use(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(worker_file.FOLDER, str(PACKAGED))
    asking = {n for n in worker_file.worker_names() if not read_worker(n).is_free}
    assert asking == {"sam3d", "sharp", "trellis2"}
    assert all(read_worker(name).page.startswith("https://") for name in asking)
