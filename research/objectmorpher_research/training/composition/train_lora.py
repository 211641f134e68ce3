"""Trains the composition LoRA: flow matching on [B, coarse A] -> A (paper 3.3).

x_s = (1 - s) A + s noise, and the transformer learns noise - A at the noise levels s that its
sampler visits. Every process of Accelerate takes its part of each step's triplets. It holds the
whole transformer, and only the adapter's gradients travel; or, by Accelerate's FSDP, a shard of it.
"""

from __future__ import annotations

import time
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from objectmorpher_core.base.progress import Progress, silent
from objectmorpher_core.compose.refine.diffusion import WHOLE

from . import TrainingError, adapter, edit_models
from .checkpoint import TrainingState, whole
from .edit_models import EditModel, Latents
from .latents_cache import Encoding, LatentsCache, weights_fingerprint
from .lora_plan import LoraPlan, parted
from .loss_log import LossLog
from .randomness import chosen, drawn
from .triplet_folder import Stored, triplets_in

if TYPE_CHECKING:
    from accelerate import Accelerator
    from torch import Tensor, nn

CHECK = 1 << 40  # the first number of the draws for what is held out
SAMPLER = 50  # steps for which the scheduler's shift is computed


@dataclass(frozen=True)
class TrainingFolders:
    """Folders."""

    triplets: Path
    out: Path
    weights: Path  # the pipeline's
    cache: Path  # of latents


@dataclass(frozen=True)
class Course:
    """The length of a training and its intermediate work; it may change on resumption."""

    steps: int = 2000
    saved: int = 50  # steps between two checkpoints
    looked: int = 250  # between two looks at what is held out; 0: never
    sampled: int = 20  # steps of a picture's sampling; 0: losses alone


class Trainer:
    """A transformer with its LoRA, and what trains it."""

    def __init__(
        self, places: TrainingFolders, plan: LoraPlan, progress: Progress = silent
    ) -> None:
        """Encodes what is not encoded yet, loads, and goes on from a checkpoint.

        Of several processes each calls it. Raises TrainingError.
        """
        plan.check()
        _be_quiet()
        self.places, self.plan = places, plan
        self.model: EditModel = edit_models.load(plan.model)
        self.accelerator = accelerator_of(plan.number)
        self.device = str(self.accelerator.device)
        everything = triplets_in(places.triplets)
        self.trained_on, self.held_out = parted(everything, plan)
        encoding = Encoding(self.model, places.weights, plan.side, plan.number, self.device)
        self.cache = LatentsCache(places.cache, encoding)
        self._encode(everything, progress)
        self.scheduler = edit_models.scheduler_of(places.weights)
        progress(0.0, "Loading the transformer")
        network = adapter.with_adapter(
            opened(self.model, places.weights, plan, self.device), self.model, plan.rank, plan.seed
        )
        prepared(network)
        self.transformer, self.optimiser = self.accelerator.prepare(
            network, optimiser_of(network, plan)
        )
        self.network = self.accelerator.unwrap_model(self.transformer, keep_torch_compile=False)
        self.parameters = adapter.parameters(self.network)
        own = {name: p.detach().clone() for name, p in self.parameters.items()}
        self.mean = own if plan.mean else None
        weights = weights_fingerprint(places.weights, ("transformer",))
        self._facts = plan.facts(self.trained_on, weights)
        self.state = TrainingState(self.parameters, self.optimiser, self.mean)
        self.step = self.state.load(places.out, self._facts)

    def train(self, course: Course, progress: Progress = silent) -> Path:
        """Up to `course.steps` in all; the file of the LoRA. Raises TrainingError."""
        is_first = self.accelerator.is_main_process
        log = LossLog(self.places.out, self.step) if is_first else None
        while self.step < course.steps:
            began = time.perf_counter()
            row: dict[str, Any] = {"step": self.step, "loss": self._learn()}
            row |= {"gradient": self.length, "rate": self.optimiser.param_groups[0]["lr"]}
            row["seconds"] = round(time.perf_counter() - began, 3)
            self.step += 1
            if course.looked and self.step % course.looked == 0 and self.held_out:
                row["checked"] = self.checked()
                if course.sampled:
                    self._show(course.sampled)
            if log is not None:
                log.add(row)
                progress(self.step / course.steps, f"step {self.step}, loss {row['loss']:.4f}")
            if self.step % course.saved == 0 or self.step == course.steps:
                self.save()
        self.accelerator.wait_for_everyone()
        return self.save()

    def save(self) -> Path:
        """A checkpoint, and the LoRA as it is now; its file. To be called by each process."""
        held = self.state.held()
        values = {name: whole(value) for name, value in (self.mean or self.parameters).items()}
        if not self.accelerator.is_main_process:
            return self.places.out
        self.state.save(self.places.out, self.step, self._facts, held)
        return adapter.save_adapter(
            self.places.out / "lora", self.network, self.model, self.plan.number, values
        )

    def losses(self, numbers: range) -> Tensor:
        """Gradients of the mean loss of these samples, added to the parameters'; that loss.

        Of several processes each computes its own part; all get the sum of both.
        """
        import torch

        world, own = self.accelerator.num_processes, self.accelerator.process_index
        total = torch.zeros((), device=self.device)
        rounds = -(-len(numbers) // world)
        for k in range(rounds):  # as many for each process: shards are gathered by all together
            place = k * world + own
            number = numbers[min(place, len(numbers) - 1)]
            share = 1 / len(numbers) if place < len(numbers) else 0.0
            triplet = self.trained_on[chosen(self.plan.seed, number, len(self.trained_on))]
            is_last = k == rounds - 1
            with nullcontext() if is_last else self.accelerator.no_sync(self.transformer):
                loss = self._loss(self.cache.read(triplet, self.device), number) * share
                self.accelerator.backward(loss * world)  # of which the mean over processes is taken
            total += loss.detach()
        for value in self.parameters.values():
            if value.grad is None:  # of what the last block does with the text: nobody reads it
                value.grad = torch.zeros_like(value)
        found = self.accelerator.reduce(total, reduction="sum")
        assert isinstance(found, torch.Tensor)
        return found

    def checked(self) -> float:
        """Mean loss of the triplets held out, at noise that is always the same."""
        import torch

        with torch.no_grad():
            found = [
                self._loss(self.cache.read(triplet, self.device), CHECK + k)
                for k, triplet in enumerate(self.held_out)
            ]
        return float(torch.stack(found).mean())

    def _learn(self) -> float:
        """One step; its loss."""
        import torch

        plan = self.plan
        for group in self.optimiser.param_groups:
            group["lr"] = group["full_rate"] * min(1.0, (self.step + 1) / max(plan.warm_up, 1))
        self.optimiser.zero_grad(set_to_none=True)
        loss = self.losses(range(self.step * plan.batch, (self.step + 1) * plan.batch))
        own = list(self.parameters.values())
        self.length = float(whole(torch.nn.utils.clip_grad_norm_(own, plan.steepest)))
        if not (torch.isfinite(loss) and self.length < float("inf")):
            raise TrainingError(f"the loss of step {self.step} is no number: lower --rate")
        self.optimiser.step()
        if self.mean is not None:
            for name, value in self.parameters.items():
                self.mean[name].lerp_(value.detach(), 1 - plan.mean)
        return float(loss)

    def _loss(self, at: Latents, number: int) -> Tensor:
        import torch

        moment, noise = drawn(self.plan.seed, number, tuple(at.target.shape))
        mu = self.model.shift(self.scheduler, at.target.shape[1], SAMPLER)
        level = edit_models.level(self.scheduler, mu, moment)
        noise, target = noise.to(self.device), at.target.float()
        noisy = ((1 - level) * target + level * noise).to(at.target.dtype)
        sigma = torch.full((1,), level, device=self.device, dtype=torch.float32)
        with self.accelerator.autocast():
            found = self.model.velocity(self.transformer, noisy, sigma.to(noisy.dtype), at)
        return torch.nn.functional.mse_loss(found.float(), noise - target)

    def _encode(self, triplets: tuple[Stored, ...], progress: Progress) -> None:
        world, own = self.accelerator.num_processes, self.accelerator.process_index
        self.cache.fill(triplets[own::world], progress)
        self.accelerator.wait_for_everyone()

    def _show(self, steps: int) -> None:
        from .validation import write_pictures

        write_pictures(self, steps)


def _be_quiet() -> None:
    """The libraries draw no bars of their own."""
    import diffusers
    import transformers

    for library in (diffusers, transformers):
        library.utils.logging.disable_progress_bar()
        library.utils.logging.set_verbosity_error()


def accelerator_of(number: str) -> Accelerator:
    """The processes of this training, as `accelerate launch` (or torchrun) started them."""
    from accelerate import Accelerator, DistributedDataParallelKwargs

    from objectmorpher_core.models import device

    is_cpu = "cuda" not in device.devices()
    mixed = "bf16" if number == "bfloat16" else "no"
    # The last block's text is read by nobody: its adapter gets no gradient.
    unused = DistributedDataParallelKwargs(find_unused_parameters=True)
    found = Accelerator(mixed_precision=mixed, cpu=is_cpu, kwargs_handlers=[unused])
    if found.distributed_type == "FSDP" and not found.is_fsdp2:
        raise TrainingError("a LoRA is sharded by FSDP 2: choose it in `accelerate config`")
    return found


def opened(model: EditModel, weights: Path, plan: LoraPlan, device: str) -> nn.Module:
    """The pipeline's transformer; in four bits on the `device`. Raises TrainingError."""
    import torch

    number, more = getattr(torch, plan.number), {}
    if plan.base == "nf4":
        more = {"quantization_config": in_four_bits(number), "device_map": {"": device}}
    try:
        return model.transformer_class().from_pretrained(
            weights / "transformer", dtype=number, local_files_only=True, use_safetensors=True,
            **more,
        )  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError, RuntimeError) as error:
        told = " ".join(str(error).split())[:300]
        raise TrainingError(f"{weights}'s transformer cannot be opened: {told}") from error


def in_four_bits(number: Any) -> Any:
    """QLoRA's base (Dettmers et al. 2023): NF4, its scales quantised too, layers as refiners'."""
    from diffusers.quantizers.quantization_config import BitsAndBytesConfig

    return BitsAndBytesConfig(
        load_in_4bit=True, bnb_4bit_quant_type="nf4", bnb_4bit_use_double_quant=True,
        bnb_4bit_compute_dtype=number, bnb_4bit_quant_storage=number,  # FSDP shards no bytes
        llm_int8_skip_modules=list(WHOLE),
    )  # fmt: skip


def prepared(transformer: Any) -> None:
    """Ready to be trained in little memory: blocks are computed again on the way back."""
    transformer.train()
    transformer.enable_gradient_checkpointing()


def optimiser_of(transformer: nn.Module, plan: LoraPlan) -> Any:
    """AdamW with LoRA+'s two rates."""
    import torch

    found = adapter.groups(transformer, plan.rate, plan.ratio)
    return torch.optim.AdamW(found, weight_decay=plan.decay)
