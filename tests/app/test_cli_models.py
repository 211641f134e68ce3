"""`objectmorpher models` and `doctor` on the command line: consent, licences, one sentence."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from objectmorpher.cli import parser as cli
from objectmorpher_core import models
from tests.core.models.local_hub import TINY_SAM2, TOKEN, Hub, offering, own_cache

FREE, GATED = models.hub_model("sam2.1-tiny"), models.hub_model("sam3")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = own_cache(tmp_path, monkeypatch)
    monkeypatch.setenv(models.OFFLINE, "")  # what `--offline` sets is undone
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    return folder


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Hub]:
    with offering(monkeypatch, TINY_SAM2, FREE, GATED) as hub:
        yield hub


class Terminal(io.StringIO):
    """What is typed at a terminal."""

    def isatty(self) -> bool:
        return True


def said(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    """Exit code, stdout, stderr."""
    code = cli.main(["models", *words])
    out, err = capsys.readouterr()
    return code, out, err


def test_the_list_tells_size_licence_and_what_is_there(capsys) -> None:
    code, out, _ = said(capsys, "list")
    assert code == 0
    lines = {line.split()[0]: line for line in out.splitlines()}
    assert "155.9 MB" in lines[FREE.id] and "Apache-2.0 " in lines[FREE.id]
    assert "SAM License*" in lines[GATED.id] and "not installed" in lines[GATED.id]
    assert "models add mobile-sam FOLDER" in lines["mobile-sam"]


def test_nothing_is_downloaded_without_consent(capsys, monkeypatch, server: Hub) -> None:
    code, _, err = said(capsys, "get", FREE.id)
    assert code == 1 and "155.9 MB" in err and "Apache-2.0" in err and "--yes" in err
    monkeypatch.setattr(sys, "stdin", Terminal("n\n"))
    code, _, err = said(capsys, "get", FREE.id)
    assert code == 1 and "[y/N]" in err and "was not downloaded" in err
    assert server.ranges == []
    monkeypatch.setattr(sys, "stdin", Terminal("y\n"))
    code, out, _ = said(capsys, "get", FREE.id)
    assert code == 0 and FREE.id in out


def test_what_a_model_needs_is_named_before_it_is_got(capsys) -> None:
    code, _, err = said(capsys, "get", "trellis-image-large")
    assert code == 1 and "trellis-image-large with dinov2-with-registers-large: " in err
    assert "licence Apache-2.0 and MIT" in err and "--yes" in err


def test_a_model_is_got_verified_told_of_and_removed(capsys, server: Hub, cache: Path) -> None:
    assert said(capsys, "get", FREE.id, "--yes")[:2] == (0, f"{FREE.id}: {cache / FREE.id}\n")
    assert said(capsys, "path", FREE.id)[1] == f"{cache / FREE.id}\n"
    assert said(capsys, "verify", FREE.id)[1] == f"{FREE.id}: ok\n"
    assert " installed" in next(
        line for line in said(capsys, "list")[1].splitlines() if line.startswith(FREE.id)
    )
    (cache / FREE.id / "config.json").write_bytes(b"{}")
    code, out, err = said(capsys, "verify", FREE.id)
    assert code == 1 and "bytes" in out and FREE.id in err
    assert said(capsys, "remove", FREE.id)[0] == 0
    assert said(capsys, "path", FREE.id)[0] == 1


def test_a_gated_model_wants_its_licence_by_name(capsys, server: Hub, monkeypatch) -> None:
    code, _, err = said(capsys, "get", GATED.id, "--yes")
    assert code == 1 and "--accept-licence 'SAM License'" in err
    monkeypatch.setenv("HF_TOKEN", TOKEN)
    code, out, _ = said(capsys, "get", GATED.id, "--yes", "--accept-licence", "SAM License")
    assert code == 0 and GATED.id in out


def test_what_is_only_optional_is_not_missed(capsys) -> None:
    out = said(capsys, "verify")[1].splitlines()
    assert "dinov2-vits14: not installed" in out and "depth: not installed (optional)" in out


def test_offline_is_one_sentence(capsys, server: Hub) -> None:
    for words in ([FREE.id, "--yes"], ["u2netp", "--yes"], [FREE.id], ["lama"]):
        code, _, err = said(capsys, "get", *words, "--offline")
        assert "--yes" not in err
        assert code == 1 and models.OFFLINE in err and err.strip().count("\n") <= 1


def test_a_folder_is_added_and_forgotten(capsys, tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    for name, data in TINY_SAM2.items():
        (folder / name).write_bytes(data)
    code, out, _ = said(capsys, "add", "sam2", str(folder))
    assert code == 0 and "yours" in out and str(folder) in out
    assert said(capsys, "path", FREE.id)[1] == f"{folder}\n"
    assert said(capsys, "remove", FREE.id)[0] == 0 and folder.exists()
    code, _, err = said(capsys, "add", "dinosaur", str(folder))
    assert code == 1 and "known are depth, sam2" in err
    (folder / "model.safetensors").rename(folder / "model.bin")
    code, _, err = said(capsys, "add", "sam2", str(folder))
    assert code == 1 and "only pickled weights" in err


def test_each_name_that_can_be_added_is_named_once(capsys) -> None:
    _, _, err = said(capsys, "add", "dinosaur", "x")
    names = err.strip().partition("known are ")[2].split(", ")
    assert len(names) == len(set(names))
    assert set(names) == {"depth", *models.families(), *(m.id for m in models.hub_models())}


def test_a_family_is_removed_where_one_folder_is_meant(capsys, tmp_path: Path) -> None:
    for name, data in TINY_SAM2.items():
        (tmp_path / name).write_bytes(data)
    code, out, err = said(capsys, "remove", "sam2")
    assert code == 1 and out == "" and "sam2 is a family" in err and "none of them is there" in err
    assert said(capsys, "add", "sam2", str(tmp_path))[0] == 0
    gone = f"{FREE.id}: {tmp_path} is no longer used\n"
    assert said(capsys, "remove", "sam2")[:2] == (0, gone)
    assert models.place(FREE.id) is None
    for id in (FREE.id, "sam2.1-large"):
        assert said(capsys, "add", id, str(tmp_path))[0] == 0
    code, out, err = said(capsys, "remove", "sam2")
    assert code == 1 and out == "" and f"sam2.1-large, {FREE.id}" in err
    for words, sentence in ((["dinosaur"], "no model called 'dinosaur'"), ([], "which model")):
        code, out, err = said(capsys, "remove", *words)
        assert code == 1 and out == "" and sentence in err and "models list" in err
    assert models.place(FREE.id) == models.place("sam2.1-large") == tmp_path


def test_the_list_and_verifying_agree_on_damage(capsys, cache: Path) -> None:
    cache.mkdir(parents=True)
    (cache / models.weight("u2netp").file).write_bytes(b"not a network")
    lines = {line.split()[0]: line for line in said(capsys, "list")[1].splitlines()}
    assert " damaged " in lines["u2netp"] and " not installed " in lines["dinov2-vits14"]
    assert "u2netp: damaged" in said(capsys, "verify")[1].splitlines()


def test_verifying_says_that_a_folder_of_the_users_has_no_known_hash(capsys, tmp_path) -> None:
    for name, data in TINY_SAM2.items():
        (tmp_path / name).write_bytes(data)
    assert said(capsys, "add", "sam2", str(tmp_path))[0] == 0
    code, out, _ = said(capsys, "verify", FREE.id)
    assert code == 0 and out.startswith(f"{FREE.id}: ok (yours: ") and "hash is not kept" in out


def test_the_doctor_tells_what_each_stage_uses_and_what_would_help(capsys) -> None:
    assert cli.main(["doctor"]) == 0
    out = capsys.readouterr().out
    for stage in ("select: grabcut", "lift: ", "background: ", "refine: "):
        assert f"\n{stage}" in out
    assert "not dino: " in out and "better with: `objectmorpher models get`" in out
    assert cli.main(["doctor", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    names = ["select", "lift", "background", "refine"]
    assert [stage["name"] for stage in told["stages"]] == names
    assert told["machine"]["cores"] >= 1
