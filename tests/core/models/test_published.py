"""Official networks that users bring are told by the hash in their published names."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

from objectmorpher.cli import parser as cli
from objectmorpher_core import models

added = import_module("objectmorpher_core.models.added")  # the package has a function of that name

CONTENT = b"the numbers of a network"
BEGINS = "47424a56"  # of its SHA-256


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "models" / "evaluation"


@pytest.fixture
def known() -> models.Trunk:
    """A network whose file we can have: the official ones are of hundreds of megabytes."""
    file = f"small-{BEGINS}.pth"
    return models.Trunk("small", "Small", (file,), 24, "MIT", "https://example.org", "nothing")


def test_every_official_name_tells_eight_digits_of_its_hash():
    for trunk in models.trunks():
        for file in trunk.files:
            assert file.endswith(".pth")
            assert len(trunk.hash_of(file)) == 8 and int(trunk.hash_of(file), 16) > 0
    assert models.trunk("alexnet").hash_of("alexnet-owt-7be5be79.pth") == "7be5be79"
    with pytest.raises(models.ModelError, match="known are alexnet, vgg16"):
        models.trunk("resnet")


def test_what_a_name_says_is_compared_with_the_file(tmp_path, known):
    path = tmp_path / known.files[0]
    path.write_bytes(CONTENT)
    added.check_published(known, path)
    path.write_bytes(CONTENT + b" and more")
    with pytest.raises(models.ModelError, match=rf"SHA-256 starts with \w{{8}}, not {BEGINS}$"):
        added.check_published(known, path)


def test_a_file_is_kept_under_its_published_name(tmp_path, known, cache, monkeypatch):
    monkeypatch.setattr(added, "trunk", lambda id: known)
    (tmp_path / "download (1).pth").write_bytes(CONTENT)
    state = added.add_trunk("small", tmp_path / "download (1).pth")
    assert state.state == "ok" and state.path == cache / known.files[0]
    assert state.path.read_bytes() == CONTENT
    state.path.write_bytes(b"something else")
    found = added.look_trunk("small")
    assert found.state == "damaged" and BEGINS in found.reason
    added.remove_trunk("small")
    assert added.look_trunk("small").state == "missing"
    assert list(cache.iterdir()) == [] and (tmp_path / "download (1).pth").exists()


def said(capsys, *words: str) -> tuple[int, str, str]:
    code = cli.main(["models", *words])
    out, err = capsys.readouterr()
    return code, out, err


def test_the_command_line_tells_where_to_put_them_and_refuses_others(tmp_path, capsys, cache):
    code, out, _ = said(capsys, "list")
    lines = {line.split()[0]: line for line in out.splitlines()}
    assert code == 0 and "models add vgg16 FILE, vgg16-397923af.pth" in lines["vgg16"]
    assert "58.9 MB" in lines["hed-vgg"] and "not installed" in lines["hed-vgg"]
    (tmp_path / "vgg16-397923af.pth").write_bytes(CONTENT)
    code, out, err = said(capsys, "add", "vgg16", str(tmp_path / "vgg16-397923af.pth"))
    assert code == 1 and f"starts with {BEGINS}, not 397923af" in err and not out
    assert len(err.splitlines()) == 1 and not cache.exists()
    code, _, err = said(capsys, "get", "vgg16")
    assert code == 1 and "https://" in err and "models add vgg16 FILE" in err
    assert said(capsys, "path", "vgg16")[0] == 1
    cache.mkdir(parents=True)
    (cache / "vgg16-397923af.pth").write_bytes(CONTENT)
    code, out, err = said(capsys, "verify", "vgg16")
    assert code == 1 and out.startswith("vgg16: damaged (") and "vgg16" in err
    assert said(capsys, "remove", "vgg16")[0] == 0 and list(cache.iterdir()) == []


def test_what_only_evaluation_needs_is_not_missed_and_not_got_unasked(capsys, monkeypatch):
    code, out, err = said(capsys, "verify")
    assert code == 1 and "hed-vgg" not in out + err and "dinov2-vits14: missing" in out
    monkeypatch.setenv(models.OFFLINE, "1")
    for id in ("hed-vgg", "lpips-alex"):
        code, _, err = said(capsys, "get", id)
        assert code == 1 and id in err
    assert {w.id for w in models.weights() if w.category == "edit"} == {"dinov2-vits14", "u2netp"}
