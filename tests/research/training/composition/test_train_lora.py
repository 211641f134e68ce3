"""The composition LoRA learns, is loaded by the refiner, and goes on where it was killed."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
for package in ("diffusers", "peft", "accelerate", "transformers"):
    pytest.importorskip(package)

import made_up  # noqa: E402
from train_in_process import COURSE, FOUR_BITS, PLAN, allow_four_bits  # noqa: E402

from objectmorpher_core import models  # noqa: E402
from objectmorpher_core.base.progress import silent  # noqa: E402
from objectmorpher_core.compose import refine  # noqa: E402
from objectmorpher_core.compose.refine.diffusion import INSTRUCTION, WHOLE  # noqa: E402
from objectmorpher_research.training.composition import (  # noqa: E402
    TrainingError,
    adapter,
    edit_models,
    estimate,
    lora_plan,
    measure,
    train_lora,
    validation,
)
from objectmorpher_research.training.composition.checkpoint import FILE  # noqa: E402
from objectmorpher_research.training.composition.latents_cache import Encoding, LatentsCache  # noqa: E402
from objectmorpher_research.training.composition.loss_log import read_losses  # noqa: E402
from objectmorpher_research.training.composition.randomness import chosen, drawn  # noqa: E402
from objectmorpher_research.training.composition.train_lora import Course, Trainer  # noqa: E402
from objectmorpher_research.training.composition.triplet_folder import triplets_in  # noqa: E402
from tests.core.compose.refine import tiny_pipelines  # noqa: E402

pytestmark = pytest.mark.slow

IDS = {"qwen": "qwen-image-edit-2511", "klein": "flux2-klein-4b"}
PROGRAM = Path(__file__).with_name("train_in_process.py")
F32 = 1e-5
TINY = {  # transformers like the published ones
    "qwen": {"num_layers": 1, "attention_head_dim": 16, "num_attention_heads": 2,
             "axes_dims_rope": (4, 6, 6), "zero_cond_t": True},
    "klein": {"num_layers": 1, "num_single_layers": 1, "attention_head_dim": 16,
              "num_attention_heads": 2, "joint_attention_dim": 7680, "axes_dims_rope": [4] * 4,
              "guidance_embeds": False},
}  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def _here(tmp_path_factory):
    """Models folder of its own, the CPU, one thread, few steps, small conditions."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OBJECTMORPHER_CACHE", str(tmp_path_factory.mktemp("models")))
        tiny_pipelines.make_small(patch, made_up.SIDE)
        yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    return tiny_pipelines.write_both(tmp_path_factory.mktemp("pipelines"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """With triplets, and what of them is encoded."""
    at = tmp_path_factory.mktemp("training")
    made_up.write_triplets(at / "triplets")
    return at


def plan_of(name: str) -> lora_plan.LoraPlan:
    side = made_up.SIDE if name == "qwen" else made_up.SIDE // 2  # its small VAE does not reduce
    return replace(PLAN, model=name, side=side, mean=0.0)


@pytest.mark.parametrize("name", edit_models.BACKENDS)
def test_twenty_steps_lower_the_loss_and_the_refiner_shows_it(name, folder, weights, tmp_path):
    steps = 20 if name == "qwen" else 8
    trainer = Trainer(made_up.places(folder, weights[name], f"learns-{name}"), plan_of(name))
    fixed = range(4)
    with torch.no_grad():
        before = mean_loss(trainer, fixed)
    file = trainer.train(Course(steps, saved=steps, looked=steps // 2, sampled=2))
    with torch.no_grad():
        assert mean_loss(trainer, fixed) < before - 0.01
    rows = read_losses(trainer.places.out)
    assert [row["step"] for row in rows] == list(range(steps))
    assert all(np.isfinite(row["loss"]) for row in rows) and "checked" in rows[-1]
    shown = sorted((trainer.places.out / "validation").glob("*.png"))
    assert len(shown) == 2 * len(trainer.held_out)
    models.use_folder(IDS[name], weights[name])
    refiner = refine.load(name)
    one = made_up.triplet(1)
    given = (one.b, one.coarse, np.ones(one.coarse.shape[:2], np.float32))
    plain = refiner.refine(*given, silent)
    models.use_folder(f"{name}-refine-lora", file.parent)
    adapted = refiner.refine(*given, silent)
    assert not np.array_equal(adapted, plain)
    # It is what was trained, not merely another: nearer than an adapter of no steps would be.
    untrained = save_untrained(trainer, tmp_path)
    models.use_folder(f"{name}-refine-lora", untrained.parent)
    assert np.array_equal(refiner.refine(*given, silent), plain)
    models.remove_hub(f"{name}-refine-lora")


def mean_loss(trainer: Trainer, numbers: range) -> float:
    at = [
        trainer.trained_on[chosen(trainer.plan.seed, k, len(trainer.trained_on))] for k in numbers
    ]
    found = [trainer._loss(trainer.cache.read(t), k) for t, k in zip(at, numbers, strict=True)]
    return float(torch.stack(found).mean())


def save_untrained(trainer: Trainer, folder: Path) -> Path:
    """With B as it begins, zero."""
    values = {
        name: torch.zeros_like(p) if adapter.SECOND in name else p.detach()
        for name, p in trainer.parameters.items()
    }
    return adapter.save_adapter(folder, trainer.transformer, trainer.model, values=values)


@pytest.mark.parametrize("name", edit_models.BACKENDS)
def test_latents_and_velocity_are_the_pipelines_own(name, folder, weights):
    """Sampled from the cache, the picture is the one that the pipeline makes of the pictures."""
    plan = replace(plan_of(name), side=made_up.SIDE)
    trainer = Trainer(made_up.places(folder, weights[name], f"same-{name}"), plan)
    stored, steps = trainer.trained_on[0], 3
    at = trainer.cache.read(stored)
    with torch.no_grad():
        trainer.transformer.eval()
        tokens = validation.sampled(trainer, at, steps, 0)
        decoder = trainer.model.decoder(weights[name], "cpu", "float32")
        made = trainer.model.decode(decoder, tokens, at.grids[0])
    _, noise = drawn(trainer.plan.seed, validation.SAMPLE, tuple(at.target.shape))
    expected = by_pipeline(trainer, weights[name], stored, noise, steps)
    assert made.shape == expected.shape
    assert np.abs(made.astype(int) - expected).max() <= 1  # rounding
    assert made.std() > 1


def by_pipeline(trainer, weights, stored, noise, steps):
    from PIL import Image

    b, coarse, _ = (Image.fromarray(p) for p in stored.read())
    common = {"image": [b, coarse], "num_inference_steps": steps, "output_type": "np"}
    if trainer.plan.model == "qwen":
        pipeline = trainer.model.encoders(weights, "cpu", "float32")
        more = {"prompt": INSTRUCTION, "true_cfg_scale": 1.0, "latents": noise}
    else:
        pipeline = trainer.model.encoders(weights, "cpu", "float32")
        rows, columns = trainer.cache.read(stored).grids[0]
        unpacked = noise.permute(0, 2, 1).reshape(1, -1, rows, columns)
        more = {"prompt_embeds": pipeline.instruction, "guidance_scale": 1.0, "latents": unpacked}
    pipeline.register_modules(transformer=trainer.transformer)
    pipeline.set_progress_bar_config(disable=True)
    side = trainer.plan.side
    with torch.no_grad():
        found = pipeline(**common, **more, height=side, width=side).images[0]
    return np.rint(np.clip(found, 0, 1) * 255).astype(int)


def test_latents_are_computed_once_and_anew_for_other_pictures(folder, weights, tmp_path):
    model = edit_models.load("qwen")
    encoding = Encoding(model, weights["qwen"], made_up.SIDE, "float32", "cpu")
    cache, triplets = LatentsCache(tmp_path, encoding), triplets_in(folder / "triplets")
    assert cache.fill(triplets[:2]) == 2 and cache.fill(triplets[:3]) == 1
    assert cache.fill(triplets[:3]) == 0 and len(list(tmp_path.iterdir())) == 3
    larger = LatentsCache(tmp_path, replace(encoding, side=2 * made_up.SIDE))
    assert larger.file(triplets[0]) != cache.file(triplets[0])
    cache.file(triplets[0]).write_bytes(b"\0" * 40)
    with pytest.raises(TrainingError, match="is damaged, delete it"):
        cache.read(triplets[0])


def test_the_second_half_learns_three_times_as_fast(folder, weights):
    trainer = Trainer(made_up.places(folder, weights["qwen"], "rates"), plan_of("qwen"))
    rates = {
        id(p): group["lr"] for group in trainer.optimiser.param_groups for p in group["params"]
    }
    for name, p in trainer.parameters.items():
        assert rates[id(p)] == pytest.approx(3e-3 if "lora_B" in name else 1e-3)
        assert "attn" in name and p.dtype == torch.float32
    assert len({group["lr"] for group in trainer.optimiser.param_groups}) == 2
    frozen = {n for n, p in trainer.transformer.named_parameters() if not p.requires_grad}
    assert frozen and not any("lora" in name for name in frozen)
    from peft.optimizers import create_loraplus_optimizer

    how = {"optimizer_cls": torch.optim.AdamW, "lr": 1e-3, "loraplus_lr_ratio": 3}
    theirs = create_loraplus_optimizer(model=trainer.transformer, **how)
    for group in theirs.param_groups:
        assert all(rates[id(p)] == pytest.approx(group["lr"]) for p in group["params"])


@pytest.mark.slow
def test_killed_and_called_again_it_has_the_same_losses(folder, weights):
    whole = Trainer(made_up.places(folder, weights["qwen"], "whole"), PLAN)
    whole.train(COURSE)
    expected = read_losses(whole.places.out)
    killed = folder / "killed"
    command = [sys.executable, str(PROGRAM), "train", str(folder), str(weights["qwen"]), ""]
    process = subprocess.Popen(command, env=os.environ | {"OMP_NUM_THREADS": "1"})
    end = time.monotonic() + 300
    while len(read_losses(killed)) < COURSE.saved + 2:
        assert process.poll() is None and time.monotonic() < end
        time.sleep(0.005)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert (killed / FILE).is_file() and len(read_losses(killed)) < COURSE.steps
    Trainer(made_up.places(folder, weights["qwen"], "killed"), PLAN).train(COURSE)
    found = read_losses(killed)
    for one, other in zip(found, expected, strict=True):
        assert one["step"] == other["step"] and one["loss"] == other["loss"]
        assert one["gradient"] == other["gradient"]
    assert lora_bytes(killed) == lora_bytes(whole.places.out)


def lora_bytes(folder: Path) -> bytes:
    return lora_file(folder).read_bytes()


def lora_file(folder: Path) -> Path:
    return next((folder / "lora").glob("*.safetensors"))


def test_it_does_not_go_on_with_another_plan(folder, weights):
    at = made_up.places(folder, weights["qwen"], "plan")
    Trainer(at, PLAN).train(Course(1, looked=0))
    assert Trainer(at, PLAN).step == 1
    with pytest.raises(TrainingError, match=r"begun with another rate \(0.001, now 0.002\)"):
        Trainer(at, replace(PLAN, rate=2e-3))
    (at.out / FILE).write_bytes(b"\0" * 100)
    with pytest.raises(TrainingError, match="is damaged"):
        Trainer(at, PLAN)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["gradients", "sharded"])
def test_two_processes_have_the_gradients_of_one_and_learn_as_it_does(
    how, folder, weights, tmp_path
):
    from safetensors.torch import load_file

    trainer = Trainer(made_up.places(folder, weights["qwen"], f"{how}-alone"), PLAN)
    loss = trainer.losses(range(5)).reshape(1)
    grads = {name: p.grad for name, p in trainer.parameters.items() if p.grad is not None}
    alone = {name: value.cpu() for name, value in (grads | {"loss": loss}).items()}
    file = tmp_path / "two.safetensors"
    run_two(how, folder, weights["qwen"], file)
    together = load_file(file)
    assert alone.keys() == together.keys() and len(alone) > 10
    for name, value in alone.items():
        scale = max(float(value.abs().max()), 1e-8)
        assert float((value - together[name]).abs().max()) <= F32 * scale, name
    assert sum(float(v.abs().sum()) for v in alone.values()) > 0
    if how == "sharded":  # stopped after two steps, and gone on
        trainer.train(Course(4, saved=4, looked=0))
        ours, theirs = (load_file(lora_file(at)) for at in (trainer.places.out, folder / how))
        assert ours.keys() == theirs.keys()
        for name, value in ours.items():
            assert float((value - theirs[name]).abs().max()) < 0.02 * PLAN.rate, name


@pytest.mark.slow
def test_two_processes_share_a_base_in_four_bits(folder, weights, tmp_path, monkeypatch):
    pytest.importorskip("bitsandbytes")
    from accelerate.state import AcceleratorState
    from safetensors.torch import load_file

    run_two("four-bits", folder, weights["qwen"], tmp_path / "two.safetensors")
    together = load_file(lora_file(folder / "four-bits"))
    allow_four_bits(monkeypatch.setattr)
    AcceleratorState._reset_state()  # its numbers are those of the first trainer of a process
    try:
        trainer = Trainer(made_up.places(folder, weights["qwen"], "four-bits-alone"), FOUR_BITS)
        alone = load_file(trainer.train(Course(4, saved=4, looked=0)))
    finally:
        AcceleratorState._reset_state()
    assert alone.keys() == together.keys()
    for name, value in alone.items():
        assert float((value - together[name]).abs().max()) < 0.02 * PLAN.rate, name
    assert sum(float(v.abs().sum()) for n, v in alone.items() if "lora_B" in n) > 0


def run_two(how: str, folder: Path, weights: Path, file: Path) -> None:
    """Of two processes over gloo, as `accelerate launch` starts them."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, str(PROGRAM), how, str(folder), str(weights), str(file)]
    processes = []
    for rank in range(2):
        more = {
            "OMP_NUM_THREADS": "1", "ACCELERATE_USE_CPU": "true", "RANK": str(rank),
            "LOCAL_RANK": str(rank), "WORLD_SIZE": "2", "LOCAL_WORLD_SIZE": "2",
            "MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(port), "GLOO_SOCKET_IFNAME": "lo",
        }  # fmt: skip
        processes.append(subprocess.Popen(command, env=os.environ | more))
    assert [process.wait(300) for process in processes] == [0, 0]


@pytest.mark.parametrize("name", edit_models.BACKENDS)
def test_a_base_in_four_bits_learns_and_takes_what_was_estimated(
    name, folder, weights, monkeypatch
):
    """On the CPU, which bitsandbytes can and diffusers refuses."""
    pytest.importorskip("bitsandbytes")
    allow_four_bits(monkeypatch.setattr)
    plan = replace(plan_of(name), base="nf4")
    trainer = Trainer(made_up.places(folder, weights[name], f"nf4-{name}"), plan)
    frozen = {n: p for n, p in trainer.network.named_parameters() if not p.requires_grad}
    short = {n for n, p in frozen.items() if type(p).__name__ == "Params4bit"}
    assert short and not any(kept in name for name in short for kept in WHOLE)
    size = sum(p.numel() * p.element_size() for p in frozen.values())
    told = estimate.weights_of(
        train_lora.opened(trainer.model, weights[name], plan_of(name), "cpu")
    )
    assert size <= told[1] <= 1.1 * size < told[0]  # beside the scales
    with torch.no_grad():
        before = mean_loss(trainer, range(4))
    file = trainer.train(Course(8, saved=8, looked=0))
    with torch.no_grad():
        assert mean_loss(trainer, range(4)) < before
    models.use_folder(IDS[name], weights[name])
    models.use_folder(f"{name}-refine-lora", file.parent)
    one = made_up.triplet(1)
    refine.load(name).refine(one.b, one.coarse, np.ones(one.coarse.shape[:2], np.float32), silent)
    models.remove_hub(f"{name}-refine-lora")


def test_the_estimate_is_what_a_step_takes():
    """On the CPU, in single precision, as PyTorch's profiler sees it."""
    from torch.profiler import ProfilerActivity, profile

    plan = lora_plan.LoraPlan("klein", 256, rank=4, number="float32")
    size = TINY["klein"] | {"num_layers": 3, "num_single_layers": 5}
    model = edit_models.load("klein")
    network = measure.random_transformer(model, "cpu", "float32", size)
    network = adapter.with_adapter(network, model, plan.rank, 0)
    train_lora.prepared(network)
    optimiser = train_lora.optimiser_of(network, plan)
    at = model.made_up(plan.side, "float32", "cpu")
    measure.step_of(model, network, optimiser, at, "cpu")
    with profile(activities=[ProfilerActivity.CPU], profile_memory=True) as seen:
        measure.step_of(model, network, optimiser, at, "cpu")
    assert seen.profiler is not None and seen.profiler.kineto_results is not None
    events = [e for e in seen.profiler.kineto_results.events() if e.name() == "[memory]"]
    changes = [e.nbytes() for e in sorted(events, key=lambda e: e.start_ns())]
    most = max(np.cumsum(changes))
    learned = sum(p.numel() for p in adapter.parameters(network).values())
    found = estimate.table(plan, size)["float32"]
    assert found.learned == 16 * learned
    assert found.weights == 4 * (sum(p.numel() for p in network.parameters()) - learned)
    given = sum(t.numel() * 4 for t in (at.target, at.conditions, at.embedding))
    # The profiler did not see AdamW's memory being made, nor what is given.
    assert found.step == pytest.approx(most + given - 4 * learned, rel=0.05)


def test_it_says_which_cards_hold_a_plan():
    plan = lora_plan.LoraPlan("qwen", rank=16)
    ways = estimate.table(plan)
    told = estimate.told(plan, ways)
    assert told.count("\n") == len(ways) == 5
    assert 40 << 30 < ways["bfloat16"].whole < 52 << 30 and ways["bfloat16"].fits(80 << 30)
    assert ways["nf4"].fits(24 << 30) and not ways["nf4"].fits(16 << 30)
    larger = estimate.table(replace(plan, rank=64))["bfloat16"]
    assert larger.learned == 4 * ways["bfloat16"].learned
    assert estimate.table(replace(plan, side=1536))["bfloat16"].step > ways["bfloat16"].step
    with pytest.raises(TrainingError, match="one of whole, nf4, not 'int8'"):
        replace(plan, base="int8").check()


def test_order_and_noise_depend_on_seed_and_number_alone():
    for seed in (0, 1):
        passes = [[chosen(seed, 7 * k + j, 7) for j in range(7)] for k in range(3)]
        assert all(sorted(one) == list(range(7)) for one in passes)
        assert passes[0] != passes[1] or passes[1] != passes[2]
    (t, noise), (same_t, same) = drawn(3, 11, (50, 40)), drawn(3, 11, (50, 40))
    assert t == same_t and torch.equal(noise, same)
    assert not torch.equal(noise, drawn(3, 12, (50, 40))[1])
    assert abs(float(noise.mean())) < 0.1 and abs(float(noise.std()) - 1) < 0.1
    times = np.array([drawn(0, k, (1,))[0] for k in range(400)])
    assert abs(times.mean() - 0.5) < 0.05 and times.min() >= 0 and times.max() < 1


@pytest.mark.parametrize("name", edit_models.BACKENDS)
def test_levels_are_those_that_the_sampler_visits(name, weights):
    from diffusers import FlowMatchEulerDiscreteScheduler

    model = edit_models.load(name)
    scheduler = FlowMatchEulerDiscreteScheduler(
        use_dynamic_shifting=True, base_shift=0.5, max_shift=0.9, max_image_seq_len=8192
    )
    mu, steps = model.shift(scheduler, 4096, 50), 50
    scheduler.set_timesteps(sigmas=np.linspace(1, 1 / steps, steps).tolist(), mu=mu)
    own = [edit_models.level(scheduler, mu, 1 - k / steps) for k in range(steps)]
    assert np.allclose(own, scheduler.sigmas[:-1].numpy(), atol=1e-4)


@pytest.mark.parametrize("name", edit_models.BACKENDS)
def test_the_measurement_runs_on_random_weights(name):
    plan = lora_plan.LoraPlan(name, 64, number="bfloat16")
    found = measure.measure(plan, 2, TINY[name])
    assert len(found.steps) == 2 and min(found.steps) > 0
    assert found.trained > 0 and found.parameters > found.trained
    assert found.tokens == (16 + 2 * 4096 if name == "qwen" else 3 * 16)


def test_the_published_sizes_are_those_that_are_told():
    """Counted, without memory for them: BACKENDS' and the paper's rank 16."""
    from accelerate import init_empty_weights

    for name, billions, millions in (("qwen", 20.43, 47.2), ("klein", 3.88, 13.8)):
        model = edit_models.load(name)
        with init_empty_weights():
            transformer = model.transformer_class()(**model.size)
        count = sum(p.numel() for p in transformer.parameters()) / 1e9
        assert count == pytest.approx(billions, abs=0.006)
        with torch.device("meta"):
            adapted = adapter.with_adapter(transformer, model, 16, 0)
        trained = sum(p.numel() for p in adapter.parameters(adapted).values()) / 1e6
        assert trained == pytest.approx(millions, abs=0.06)


def test_what_cannot_be_trained_is_one_sentence(folder, weights, tmp_path):
    with pytest.raises(TrainingError, match="there is no model 'gwen' to train"):
        edit_models.load("gwen")
    with pytest.raises(TrainingError, match="no pipeline's folder"):
        edit_models.folder_of(edit_models.load("qwen"), tmp_path)
    with pytest.raises(TrainingError, match="no model is there: `objectmorpher models get flux2-"):
        edit_models.folder_of(edit_models.load("klein"), None)
    with pytest.raises(TrainingError, match="holds no triplets"):
        triplets_in(tmp_path)
    with pytest.raises(TrainingError, match="too few to hold 40"):
        lora_plan.parted(triplets_in(folder / "triplets"), replace(PLAN, held_out=40))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lora_plan, "has_quantiser", lambda: False)
        with pytest.raises(TrainingError, match="four bits needs bitsandbytes: `pip install"):
            replace(PLAN, base="nf4").check()
    with pytest.raises(TrainingError, match="no multiple of 32"):
        replace(PLAN, side=1000).check()
    with pytest.raises(TrainingError, match="holds a Flux2KleinPipeline, not a Qwen"):
        edit_models.folder_of(edit_models.load("qwen"), weights["klein"])
    with pytest.raises(TrainingError, match="cannot be opened"):
        train_lora.opened(edit_models.load("qwen"), tmp_path, PLAN, "cpu")


def test_a_log_that_was_cut_off_in_a_line_is_read(tmp_path):
    rows = [json.dumps({"step": k, "loss": 1.0}) for k in range(3)]
    (tmp_path / "losses.jsonl").write_text("\n".join(rows) + '\n{"step": 3, "lo')
    assert [row["step"] for row in read_losses(tmp_path)] == [0, 1, 2]
