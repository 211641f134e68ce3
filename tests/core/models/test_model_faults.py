"""Faults of downloads that other tests leave out; the tests that the docs name are there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from objectmorpher_core import models
from objectmorpher_core.models import hub, registry
from tests.core.models.local_hub import TINY_SAM2, Hub, offering, own_cache

ROOT = Path(__file__).parents[3]
FREE = models.hub_model("sam2.1-tiny")
TABLE = "## What goes wrong, and what is said"


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    return own_cache(tmp_path, monkeypatch)


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Hub]:
    with offering(monkeypatch, TINY_SAM2, FREE) as hub:
        yield hub


def test_every_fault_of_the_page_names_tests_that_are_there() -> None:
    page = (ROOT / "docs" / "model-measurements.md").read_text(encoding="utf-8")
    lines = page[page.index(TABLE) :].splitlines()
    rows = [line.split(" | ") for line in lines if line.startswith("| ")][1:]
    assert len(rows) > 20 and all(len(row) == 3 for row in rows)
    for fault, told, tests in rows:
        named = re.findall(r"`(tests/[a-z0-9_/]+\.py)::(test_\w+)`", tests)
        assert told and named, fault
        for file, test in named:
            source = (ROOT / file).read_text(encoding="utf-8")
            assert re.search(rf"^def {test}\(", source, re.MULTILINE), f"{file}::{test}"


def test_commits_and_hashes_of_the_registry_are_some() -> None:
    for model in models.hub_models():
        assert re.fullmatch("([0-9a-f]{40})?", model.revision), model.id
        assert all(re.fullmatch("[0-9a-f]{64}", told) for told in model.sha256.values()), model.id
        if not any("*" in pattern for pattern in model.files):
            assert set(model.sha256) <= set(model.files), model.id


def test_another_file_than_the_registrys_is_refused(
    server: Hub, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pinned = replace(FREE, revision=server.commit, sha256={"model.safetensors": "0" * 64})
    monkeypatch.setattr(registry, "hub_models", lambda: (pinned,))
    with pytest.raises(models.ModelError, match="wrong checksum") as error:
        models.get(FREE.id)
    assert "\n" not in str(error.value)
    assert models.place(FREE.id) is None and not (cache / FREE.id).exists()


def test_a_disk_that_fills_up_is_one_sentence_and_what_came_stays(server: Hub, cache: Path) -> None:
    """A limit on the size of files stands for the disk: both fail in the middle of writing."""
    resource = pytest.importorskip("resource")  # not on Windows
    whole = b"\0" * 3_000_000
    server.repositories[FREE.repository]["model.safetensors"] = whole
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, before[1]))
    try:
        with pytest.raises(models.ModelError, match="cannot be downloaded") as error:
            models.get(FREE.id)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "full" in str(error.value) and "\n" not in str(error.value)
    assert models.look_hub(FREE.id).state == "missing"
    left = [p for p in (cache / f"{hub.PARTIAL}{FREE.id}").rglob("model*") if p.is_file()]
    assert [p.stat().st_size for p in left] == [1_000_000]
    models.get(FREE.id)  # goes on from there
    assert (cache / FREE.id / "model.safetensors").read_bytes() == whole
    assert server.ranges[-1] == ("model.safetensors", 1_000_000)
