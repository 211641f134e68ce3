"""Sets: what of them runs on which card, and getting all of one from a hub on this machine."""

from __future__ import annotations

import hashlib
import os
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from objectmorpher_core import model_sets, models
from objectmorpher_core.base.progress import Cancelled
from objectmorpher_core.model_sets import Card, offer
from objectmorpher_core.models import ModelError, hub, registry
from tests.core.models.local_hub import TINY_SAM2, own_cache, serving

GB = 1 << 30


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    return own_cache(tmp_path, monkeypatch)


def test_light_fits_every_card_and_paper_is_what_the_card_holds():
    for gb, way in ((8, "four bits"), (12, "whole"), (48, "whole")):
        clicks, light, _ = model_sets.offers(Card(gb * GB, 32 * GB))
        assert clicks.fits and light.fits and light.steps[-1].plan.way == way
        assert clicks.missing == clicks.size < light.missing == light.size
        assert light.licences == ("Apache-2.0", "MIT") and 10 < light.seconds < 60
    ways = {}
    for gb, host in ((16, 64), (24, 64), (48, 96), (80, 96), (8, 16)):
        paper = model_sets.offers(Card(gb * GB, host * GB))[2]
        assert paper.fits
        ways[gb] = paper.steps[-1].model.id, paper.steps[-1].plan.way
        ids = [step.model.id for step in paper.steps]
        assert ids.index("dinov2-with-registers-large") < ids.index("trellis-image-large")
        assert ("qwen-image-edit-2511-lightning-4" in ids) == (gb > 8)
    qwen = "qwen-image-edit-2511"
    assert ways == {
        8: ("flux2-klein-4b", "four bits"), 16: (qwen, "layers"), 24: (qwen, "parts in four bits"),
        48: (qwen, "parts"), 80: (qwen, "whole"),
    }  # fmt: skip


def test_what_does_not_fit_and_a_machine_without_a_gpu_say_so():
    tiny = model_sets.offers(Card(2 * GB, 16 * GB))[1]
    assert not tiny.fits and tiny.seconds is None
    assert any("not enough memory" in step.why_not for step in tiny.steps)
    none = model_sets.offers(Card(0, 16 * GB))
    assert none[0].fits and none[0].seconds is None  # on the CPU


@pytest.fixture
def served(monkeypatch):
    """A set of two models that are known by commit and hash, on a hub of this machine."""
    small, tiny = models.hub_model("sam2.1-small"), models.hub_model("sam2.1-tiny")
    size = sum(map(len, TINY_SAM2.values()))
    known = tuple(
        replace(m, revision="", sha256={}, size=size) if m in (small, tiny) else m
        for m in registry.hub_models()
    )
    monkeypatch.setattr(registry, "hub_models", lambda: known)
    with serving() as server:
        monkeypatch.setenv("HF_ENDPOINT", server.url)
        server.repositories = {m.repository: dict(TINY_SAM2) for m in (small, tiny)}
        yield server


BOTH = models.ModelSet("both", ("sam2.1-tiny", "sam2.1-small"), "a test")


@given(there=st.sets(st.sampled_from([model.id for model in models.hub_models()])))
def test_what_a_model_needs_comes_before_it(there: set[str]) -> None:
    for model in models.hub_models():
        wanted = [each.id for each in models.with_needs(model.id, there.__contains__)]
        assert wanted[-1] == model.id and len(set(wanted)) == len(wanted)
        assert not there & set(wanted[:-1])
        for k, id in enumerate(wanted):
            for need in models.hub_model(id).needs:
                assert set(need.split(" | ")) & (there | set(wanted[:k]))


def test_a_model_is_got_with_what_it_needs(served, monkeypatch) -> None:
    pytest.importorskip("huggingface_hub")
    known = tuple(
        replace(m, needs=("sam2.1-large | sam2.1-small",)) if m.id == "sam2.1-tiny" else m
        for m in registry.hub_models()
    )
    monkeypatch.setattr(registry, "hub_models", lambda: known)
    wanted = models.missing("sam2.1-tiny")
    assert [model.id for model in wanted] == ["sam2.1-small", "sam2.1-tiny"]
    models.get_all(wanted, "sam2.1-tiny")
    assert models.missing("sam2.1-tiny") == () and models.place("sam2.1-small") is not None


def test_all_of_a_set_is_got_and_what_is_there_is_not_got_again(served):
    pytest.importorskip("huggingface_hub")
    found, told = offer(BOTH, Card(8 * GB, 8 * GB)), []
    model_sets.get_set(found, lambda share, note: told.append(share))
    assert told == sorted(told) and told[-1] == 1.0
    assert all(models.place(id) is not None for id in BOTH.models)
    assert offer(BOTH, Card(8 * GB, 8 * GB)).missing == 0
    models.remove_hub("sam2.1-tiny")
    served.ranges.clear()
    model_sets.get_set(offer(BOTH, Card(8 * GB, 8 * GB)))
    assert len(served.ranges) == 2  # one model's two files


def test_a_disk_that_is_too_small_is_said_before_anything_starts(served, monkeypatch):
    found = offer(BOTH, Card(8 * GB, 8 * GB))
    large = replace(found.steps[1], model=replace(found.steps[1].model, size=1 << 60))
    with pytest.raises(ModelError, match=r"both needs .* GB in .* GB are free"):
        model_sets.get_set(replace(found, steps=(found.steps[0], large)))
    assert not served.ranges and models.place("sam2.1-tiny") is None


def test_a_set_that_was_stopped_goes_on(served):
    pytest.importorskip("huggingface_hub")
    found = offer(BOTH, Card(8 * GB, 8 * GB))

    def stop(share: float, note: str) -> None:
        if share > 0.6:
            raise Cancelled

    with pytest.raises(Cancelled):
        model_sets.get_set(found, stop)
    assert models.place("sam2.1-tiny") is not None
    model_sets.get_set(offer(BOTH, Card(8 * GB, 8 * GB)))
    assert models.place("sam2.1-small") is not None


def test_files_that_another_program_has_fetched_are_used(served, monkeypatch):
    library = pytest.importorskip("huggingface_hub")
    repository = models.hub_model("sam2.1-tiny").repository
    shared = Path(os.environ["HF_HOME"]) / "hub"
    for name in TINY_SAM2:
        library.hf_hub_download(repository, name, endpoint=served.url, cache_dir=shared)
    served.ranges.clear()
    assert (models.get("sam2.1-tiny") / "config.json").read_bytes() == TINY_SAM2["config.json"]
    assert not served.ranges and models.verify_hub("sam2.1-tiny").state == "ok"


def test_a_pinned_file_comes_without_the_hubs_library_and_is_gone_on_with(monkeypatch, cache):
    data = b"\x08" * 300_000
    known = models.hub_model("moge-2-vits")
    mine = replace(known, sha256={"model.onnx": hashlib.sha256(data).hexdigest()}, size=len(data))
    every = tuple(mine if m is known else m for m in registry.hub_models())
    monkeypatch.setattr(registry, "hub_models", lambda: every)
    find = hub.importlib.util.find_spec
    monkeypatch.setattr(
        hub.importlib.util, "find_spec", lambda n, *a: None if "huggingface" in n else find(n, *a)
    )
    with serving() as server:
        monkeypatch.setenv("HF_ENDPOINT", server.url)
        server.commit = known.revision
        server.repositories[known.repository] = {"model.onnx": data}
        partial = cache / f"{hub.PARTIAL}{known.id}"
        partial.mkdir(parents=True)
        (partial / "model.onnx.part").write_bytes(data[:100_000])
        at = models.get(known.id)
        assert (at / "model.onnx").read_bytes() == data and server.ranges == [
            ("model.onnx", 100_000)
        ]
        models.remove_hub(known.id)
        server.wrong.add("model.onnx")
        with pytest.raises(ModelError, match="wrong checksum"):
            models.get(known.id)
