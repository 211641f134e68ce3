"""The refiners' real code on pipelines of random weights out of a folder, without a network."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("diffusers")
pytest.importorskip("peft")

import tiny_pipelines

from objectmorpher_core import models
from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.compose import refine
from objectmorpher_core.compose.refine import RefineError, diffusion, klein, memory, qwen
from objectmorpher_core.models import ModelError

GB = 1 << 30
IDS = {"qwen": "qwen-image-edit-2511", "klein": "flux2-klein-4b"}
KINDS = {"qwen": "QwenImageEditPlusPipeline", "klein": "Flux2KleinPipeline"}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    return tiny_pipelines.write_both(tmp_path_factory.mktemp("pipelines"))


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch, folders):
    """Models folder of its own, the CPU, few steps, and conditions as small as the networks."""
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path))
    tiny_pipelines.make_small(monkeypatch, 64)


def put(name: str, folders) -> refine.Refiner:
    models.use_folder(IDS[name], folders[name])
    return refine.load(name)


def pictures(height: int = 60, width: int = 60):
    random = np.random.default_rng(1)
    original, coarse = random.integers(0, 255, (2, height, width, 3), np.uint8)
    return original, coarse, np.ones((height, width), np.float32)


@pytest.mark.parametrize("name", refine.BACKENDS)
def test_the_contract_of_a_refiner(name, folders):
    refiner, given, told = put(name, folders), pictures(), []
    before = [p.copy() for p in given]
    made = refiner.refine(*given, lambda f, note: told.append((f, note)), seed=3)
    assert made.shape == given[1].shape and made.dtype == np.uint8
    assert all(np.array_equal(a, b) for a, b in zip(given, before, strict=True))
    assert np.array_equal(made, refiner.refine(*given, silent, seed=3))
    assert not np.array_equal(made, refiner.refine(*given, silent, seed=4))
    fractions = [f for f, _ in told]
    assert fractions == sorted(fractions) and fractions[0] >= 0 and fractions[-1] <= 1
    assert any("step 2 of 2" in note for _, note in told)
    # Both pictures are looked at.
    original, coarse, alpha = given
    assert not np.array_equal(made, refiner.refine(255 - original, coarse, alpha, silent, seed=3))
    assert not np.array_equal(made, refiner.refine(original, 255 - coarse, alpha, silent, seed=3))


@pytest.mark.parametrize("name", refine.BACKENDS)
def test_it_stops_within_a_step_and_works_again(name, folders):
    refiner, given = put(name, folders), pictures()

    def stop(fraction: float, note: str) -> None:
        if "step 1" in note:
            raise Cancelled

    with pytest.raises(Cancelled):
        refiner.refine(*given, stop)
    assert refiner.refine(*given, silent).shape == given[1].shape


@pytest.mark.parametrize("name", refine.BACKENDS)
def test_an_adapter_changes_the_picture_and_goes_when_it_is_taken_away(name, folders, tmp_path):
    refiner, given = put(name, folders), pictures()
    plain = refiner.refine(*given, silent)
    at = tiny_pipelines.write_lora(tmp_path / "lora", folders[name] / "transformer", KINDS[name], 5)
    models.use_folder(f"{name}-refine-lora", at)
    adapted = refiner.refine(*given, silent)
    assert not np.array_equal(adapted, plain)
    models.remove_hub(f"{name}-refine-lora")
    assert np.array_equal(refiner.refine(*given, silent), plain)


def test_lightning_takes_its_own_steps_and_schedule_and_stacks_with_ours(folders, tmp_path):
    refiner, given = put("qwen", folders), pictures()
    transformer, told = folders["qwen"] / "transformer", []
    quick = tiny_pipelines.write_lora(tmp_path / "quick", transformer, KINDS["qwen"], 1)
    models.use_folder("qwen-image-edit-2511-lightning-4", quick)
    alone = refiner.refine(*given, lambda f, note: told.append(note))
    assert told[-1].endswith("step 4 of 4")
    own = tiny_pipelines.write_lora(tmp_path / "own", transformer, KINDS["qwen"], 2)
    models.use_folder("qwen-refine-lora", own)
    assert not np.array_equal(refiner.refine(*given, silent), alone)
    pipeline = refiner._opened[1]
    assert sorted(pipeline.get_active_adapters()) == ["lightning", "qwen"]
    assert pipeline.scheduler.config.shift_terminal is None


def test_lightning_of_another_version_is_not_used(folders, tmp_path):
    refiner = put("qwen", folders)
    at = tiny_pipelines.write_lora(
        tmp_path / "l", folders["qwen"] / "transformer", KINDS["qwen"], 1
    )
    models.use_folder("qwen-image-edit-2509-lightning-8", at)
    assert refiner.lightning() is None


def test_klein_needs_its_text_encoder_once(folders, tmp_path):
    import shutil

    own = tmp_path / "own"
    shutil.copytree(folders["klein"], own)
    models.use_folder(IDS["klein"], own)
    given = pictures()
    made = refine.load("klein").refine(*given, silent)
    assert klein.prompt_file(own).is_file()
    for left in (own / "text_encoder").glob("*.safetensors"):
        left.unlink()
    models.use_folder(IDS["klein"], own)
    fresh = refine.load("klein")
    assert np.array_equal(fresh.refine(*given, silent), made)
    assert fresh._opened[1].text_encoder is None
    klein.prompt_file(own).unlink()
    with pytest.raises(ModelError, match="text encoder"):
        refine.load("klein").refine(*given, silent)


def test_what_is_missing_is_one_sentence(monkeypatch, folders):
    for name in refine.BACKENDS:
        assert "objectmorpher models get" in refine.missing(name)
        with pytest.raises(RefineError, match="no model is there"):
            refine.load(name)
    monkeypatch.setattr(diffusion, "PACKAGES", ("torch", "no_such_package"))
    assert refine.missing("qwen") == f"no_such_package is not installed: {models.EXTRA}"
    with pytest.raises(RefineError, match="known are qwen, klein"):
        refine.load("gwen")


def test_memory_that_runs_out_leads_to_the_next_tier(folders, monkeypatch, caplog):
    refiner, given = put("klein", folders), pictures()
    whole = refiner.refine(*given, silent)
    last = memory.plans(refiner.need())[-1]
    first = replace(last, reason="of too little")
    refiner._tiers, run = (first, last), refiner._run

    def short(pipeline, plan, *rest):
        if plan == first:
            raise MemoryError
        return run(pipeline, plan, *rest)

    monkeypatch.setattr(refiner, "_run", short)
    assert np.array_equal(refiner.refine(*given, silent), whole)
    assert "Memory ran out" in caplog.text and refiner._tiers == (last,)
    refiner._tiers = (first,)
    with pytest.raises(ModelError, match="not enough memory"):
        refiner.refine(*given, silent)


def test_the_memory_plan_goes_down_the_tiers(monkeypatch):
    need = qwen.QwenRefiner()
    monkeypatch.setattr(need, "model", lambda: models.hub_model(IDS["qwen"]))
    asked = need.need()

    def ways(free: float) -> list[str]:
        return [p.way for p in memory.on_device("cuda", asked, int(free * GB))]

    monkeypatch.setattr(memory, "four_bits", lambda: ("four bits",))
    assert ways(80) == ["whole", "four bits", "networks", "layers"]
    assert ways(60) == ["four bits", "networks", "layers"]
    assert ways(32) == ["four bits", "layers"]
    assert ways(10) == ["layers"] and ways(4) == []
    monkeypatch.setattr(memory, "four_bits", lambda: ())
    assert ways(32) == ["layers"]
    assert [p.way for p in memory.on_device("cpu", asked, GB)] == ["cpu"]


def test_weights_that_are_cut_off_or_of_another_kind_are_one_sentence(folders, tmp_path):
    with pytest.raises(ModelError, match="holds a Flux2KleinPipeline, not a Qwen"):
        models.use_folder(IDS["qwen"], folders["klein"])
    bad = tmp_path / "bad"
    bad.mkdir()
    (bad / "lora.safetensors").write_bytes(b"\x10\0\0\0\0\0\0\0{}")
    with pytest.raises(ModelError, match="safetensors"):
        models.use_folder("qwen-refine-lora", bad)
    (bad / "lora.safetensors").unlink()
    (bad / "lora.bin").write_bytes(b"\x80\x04.")
    with pytest.raises(ModelError, match="can run any code"):
        models.use_folder("qwen-refine-lora", bad)


def test_a_large_crop_keeps_its_detail():
    coarse = np.random.default_rng(0).integers(0, 255, (200, 300, 3), np.uint8)
    small = coarse[::2, ::2]
    assert np.array_equal(diffusion.with_detail(small, small, coarse), coarse)
    width, height = diffusion.working_size(4000, 3000)
    assert width * height <= 1.05 * diffusion.AREA and width % 32 == height % 32 == 0
