"""The refiners' real code on pipelines of random weights out of a folder, without a network."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("diffusers")
pytest.importorskip("peft")

import tiny_pipelines
import torch
from diffusers import Flux2Transformer2DModel, QwenImageTransformer2DModel
from diffusers.pipelines.qwenimage import pipeline_qwenimage_edit_plus
from safetensors.torch import load_file, save_file

from objectmorpher_core import compose, models
from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.compose import InpaintError, refine
from objectmorpher_core.compose.plate.inpaint_klein import framed
from objectmorpher_core.compose.refine import RefineError, diffusion, klein
from objectmorpher_core.models import ModelError, ledger
from tests import photos
from tests.core.models.small_networks import Ways

pytestmark = pytest.mark.slow

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
    pipeline = ledger.SHARED.opened("the refiner")
    assert sorted(pipeline.get_active_adapters()) == ["lightning", "qwen"]
    assert pipeline.scheduler.config.shift_terminal is None


def test_lightning_of_another_version_is_not_used(folders, tmp_path):
    refiner = put("qwen", folders)
    at = tiny_pipelines.write_lora(
        tmp_path / "l", folders["qwen"] / "transformer", KINDS["qwen"], 1
    )
    models.use_folder("qwen-image-edit-2509-lightning-8", at)
    assert refiner.lightning() is None


def test_removal_shares_the_refiners_pipeline_and_neither_has_the_others_adapter(folders, tmp_path):
    refiner, given = put("klein", folders), pictures()
    plain = refiner.refine(*given, silent)
    with pytest.raises(InpaintError, match="models get klein-remove-lora"):
        compose.load("klein")
    transformer = folders["klein"] / "transformer"
    at = tiny_pipelines.write_lora(tmp_path / "lora", transformer, KINDS["klein"], 5)
    models.use_folder("klein-remove-lora", at)
    remover, hole = compose.load("klein"), np.zeros((60, 60), bool)
    hole[20:35, 25:40] = True
    assert np.array_equal(refiner.refine(*given, silent), plain)
    pipeline = ledger.SHARED.opened("the refiner")
    filled = remover.inpaint(given[0], hole, silent)
    assert pipeline.get_active_adapters() == ["removal"]
    assert np.array_equal(refiner.refine(*given, silent), plain)
    assert ledger.SHARED.opened("the refiner") is pipeline  # counted once
    assert np.array_equal(remover.inpaint(given[0], hole, silent), filled)
    # It sees what is to go, and what it makes of the rest is not taken.
    other = given[0].copy()
    other[26:30, 30:34] = 255 - other[26:30, 30:34]
    assert not np.array_equal(remover.inpaint(other, hole, silent)[hole], filled[hole])
    assert np.array_equal(filled[~hole], given[0][~hole])


def test_a_red_frame_shows_each_part_that_is_to_go():
    inside = np.zeros((400, 400), bool)
    inside[50:90, 60:100] = inside[200:300, 220:240] = True
    shown = framed(np.full((400, 400, 3), 0.5, np.float32), inside)
    red = (shown == [255, 0, 0]).all(2)
    count, _, boxes, _ = cv2.connectedComponentsWithStats(red.astype(np.uint8))
    assert count == 3 and np.abs(boxes[1:, 2:4] - [[40, 40], [20, 100]]).max() <= 3
    assert not red[60:80, 70:90].any() and (shown[~red] == 128).all()


def test_an_adapter_in_comfyuis_names_is_read(folders, tmp_path):
    """The published one has them."""
    put("klein", folders)
    given = pictures()
    transformer = Flux2Transformer2DModel.from_pretrained(folders["klein"] / "transformer")
    inner = transformer.transformer_blocks[0].attn.to_q.in_features
    random, found = torch.Generator().manual_seed(0), {}
    for name, out in (("double_blocks.0.img_attn.qkv", 3 * inner), ("img_in", inner)):
        of = inner if "qkv" in name else transformer.x_embedder.in_features
        for side, shape in (("A", (16, of)), ("B", (out, 16))):
            key = f"diffusion_model.{name}.lora_{side}.weight"
            found[key] = torch.randn(shape, generator=random)
    (tmp_path / "lora").mkdir()
    save_file(found, tmp_path / "lora" / "comfy.safetensors")
    models.use_folder("klein-remove-lora", tmp_path / "lora")
    hole = np.zeros((60, 60), bool)
    hole[20:35, 25:40] = True
    adapted = compose.load("klein").inpaint(given[0], hole, silent)
    remover = compose.load("klein")
    remover.strength = 0.0
    assert not np.array_equal(remover.inpaint(given[0], hole, silent), adapted)


def test_klein_needs_its_text_encoder_once(folders, tmp_path):
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
    assert ledger.SHARED.opened("the refiner").text_encoder is None
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


def test_memory_that_runs_out_leads_to_the_next_way(folders, monkeypatch, caplog):
    refiner, given = put("klein", folders), pictures()
    whole = refiner.refine(*given, silent)
    last = ledger.SHARED.plan(refiner._model())
    first = replace(last, way="whole")
    monkeypatch.setattr(refiner, "need", lambda: Ways(first, last))
    run = refiner._run

    def short(pipeline, plan, *rest):
        if plan == first:
            raise MemoryError
        return run(pipeline, plan, *rest)

    monkeypatch.setattr(refiner, "_run", short)
    assert np.array_equal(refiner.refine(*given, silent), whole)
    assert "Memory ran out" in caplog.text
    monkeypatch.setattr(refiner, "need", lambda: Ways(first))
    with pytest.raises(ModelError, match="not enough memory"):
        refiner.refine(*given, silent)


def test_files_say_what_they_need_whatever_the_registry_says(folders, tmp_path):
    refiner = put("qwen", folders)
    networks = refiner.need().networks
    for network, name in zip(networks, refiner.work, strict=True):
        (file,) = (folders["qwen"] / name).glob("*.safetensors")
        numbers = sum(t.numel() for t in load_file(file).values())
        assert network.weights == 2 * numbers
    at = tiny_pipelines.write_lora(
        tmp_path / "l", folders["qwen"] / "transformer", KINDS["qwen"], 5
    )
    models.use_folder("qwen-refine-lora", at)
    beside = sum(p.stat().st_size for p in at.glob("*.safetensors"))
    assert refiner.need().networks[0].weights == networks[0].weights + beside
    # Quantised already: as many bytes as the files have, and no four bits of four bits.
    own = tmp_path / "short"
    shutil.copytree(folders["qwen"], own)
    config = own / "transformer" / "config.json"
    said = json.loads(config.read_text())
    config.write_text(json.dumps({**said, "quantization_config": {"quant_method": "sdnq"}}))
    models.remove_hub("qwen-refine-lora")
    models.use_folder(IDS["qwen"], own)
    need = refiner.need()
    (file,) = (own / "transformer").glob("*.safetensors")
    assert need.is_shrunk and need.networks[0].weights == file.stat().st_size
    assert "sdnq is not installed: `python -m pip install sdnq`" in refine.missing("qwen")


@pytest.mark.parametrize("name", refine.BACKENDS)
@pytest.mark.parametrize("size", [(40, 40), (60, 60), (50, 90), (300, 140)])
def test_the_published_pipeline_sees_both_pictures_and_the_edit_on_one_grid(name, folders, size):
    """Also a small crop, which is enlarged: its own positions, of the published code, say so."""
    refiner, seen = put(name, folders), []
    pipeline = ledger.SHARED.run(refiner._model(), lambda pipeline, plan: pipeline)
    hook = pipeline.transformer.register_forward_pre_hook(
        lambda _, args, told: seen.append(told), with_kwargs=True
    )
    made = refiner.refine(*pictures(*size), silent)
    hook.remove()
    assert made.shape == (*size, 3)
    for told in seen:
        if name == "qwen":
            (shapes,) = told["img_shapes"]
            assert len(shapes) == 3 and len(set(shapes)) == 1
            _, rows, columns = shapes[0]
        else:
            ids = told["img_ids"][0]  # (n, 4): time, row, column, layer
            grids = [ids[ids[:, 0] == t][:, 1:3] for t in ids[:, 0].unique()]
            assert len(grids) == 3 and all(grid.equal(grids[0]) for grid in grids)
            rows, columns = (int(n) + 1 for n in grids[0].max(0).values)
        assert told["hidden_states"].shape[1] == 3 * rows * columns
        px = 64 * 64 / (rows * columns)  # of a cell, if the area is the one it was trained on
        cell = (pipeline.vae_scale_factor * 2) ** 2
        assert 0.6 < cell / px < 1.4


def test_sizes_are_nearly_a_megapixel_and_of_nearly_the_crops_shape():
    from objectmorpher_core.compose.refine.klein import KleinRefiner
    from objectmorpher_core.compose.refine.qwen import QwenRefiner

    for kind, most in ((QwenRefiner, 0.03), (KleinRefiner, 0.02)):
        refiner = kind()
        diffusion.AREA, before = 1024 * 1024, diffusion.AREA
        try:
            for width, height in ((100, 100), (4000, 3000), (300, 801), (2000, 333), (700, 97)):
                w, h = diffusion.working_size((width, height), refiner.step, refiner.sees)
                assert refiner.sees((w, h)) == (w, h) and 0.9 < w * h / 1024**2 < 1.05
                assert abs(np.log(w / h * height / width)) < most
                if kind is QwenRefiner:
                    ratio = w / h
                    published = pipeline_qwenimage_edit_plus.calculate_dimensions(1024**2, ratio)
                    assert published == (w, h)
        finally:
            diffusion.AREA = before


def test_a_picture_in_few_bits_out_of_a_gguf_file(folders, tmp_path):
    gguf = pytest.importorskip("gguf")
    own = tmp_path / "own"
    shutil.copytree(folders["qwen"], own)
    (file,) = (own / "transformer").glob("*.safetensors")
    writer = gguf.GGUFWriter(str(own / "transformer" / "tiny.gguf"), "qwen_image")
    kinds = gguf.GGMLQuantizationType
    for name, tensor in load_file(file).items():
        is_short = tensor.ndim == 2 and not tensor.shape[1] % 32
        kind = kinds.Q8_0 if is_short else kinds.F32
        values = tensor.float().numpy()
        if is_short:
            values = gguf.quants.quantize(values, kind)
        writer.add_tensor(name, values, raw_dtype=kind)
    writer.write_header_to_file()
    writer.write_kv_data_to_file()
    writer.write_tensors_to_file()
    writer.close()
    given = pictures()
    exact = put("qwen", folders).refine(*given, silent)
    file.unlink()
    models.use_folder(IDS["qwen"], own)
    refiner = refine.load("qwen")
    assert refiner.need().is_shrunk
    few = refiner.refine(*given, silent)
    assert not np.array_equal(few, exact) and np.abs(few.astype(int) - exact).mean() < 12


def test_four_bits_keep_the_few_layers_whole_through_which_all_goes(folders):
    """Of both networks; made by bitsandbytes on a GPU, which is not asked for here."""
    pytest.importorskip("bitsandbytes")
    kept = diffusion.quantised(("transformer",)).quant_mapping["transformer"]
    skipped = kept.llm_int8_skip_modules
    seen = set()
    for name, kind in (("qwen", QwenImageTransformer2DModel), ("klein", Flux2Transformer2DModel)):
        network = kind.from_pretrained(folders[name] / "transformer")
        whole = [n for n, m in network.named_modules() if any(n.startswith(s) for s in skipped)]
        numbers = [m for m in network.named_modules() if type(m[1]).__name__ == "Linear"]
        assert 0 < sum(n in whole for n, _ in numbers) < len(numbers) / 2
        seen |= {s for s in skipped for n in whole if n.startswith(s)}
    assert seen == set(skipped)


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


def test_a_large_crop_keeps_its_detail_and_a_change_comes_back_where_it_was_shown():
    coarse = photos.photo("coffee")[:384, :576]
    size = (288, 192)
    small = diffusion._resized(coarse, size)
    assert np.array_equal(diffusion.brought_back(small, small, coarse), coarse)
    # What a network moves by a pixel of its own is two of the photo's: no ghosts of it are left.
    moved = np.roll(small, 1, 1)
    back = diffusion.brought_back(moved, small, coarse).astype(int)
    inner = np.s_[16:-16, 16:-16]
    assert np.abs(back - coarse)[inner].mean() < 2
    plain = coarse + cv2.resize(moved.astype(np.float32) - small, (576, 384))
    assert np.abs(plain - coarse)[inner].mean() > 2 * np.abs(back - coarse)[inner].mean()
    # A small crop is shown enlarged, and what is made of it comes back reduced.
    large = diffusion._resized(coarse, (1152, 768))
    assert np.abs(diffusion.brought_back(large, large, coarse).astype(int) - coarse).mean() < 1.5
