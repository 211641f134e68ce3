"""`objectmorpher train shape`: samples, training, figures and the weights that are shipped.

Everything is kept in one folder; called again it goes on where it was stopped.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from objectmorpher_core.base.progress import Progress, silent
from objectmorpher_core.lift.shapes.recognition import FLAT

from . import flatness
from .export_shape import weights_of
from .shape_data import SHARD, Batch, batch_of, batches, write_shards
from .shape_eval import ShapeError, Surfaces, learned, relief, score, surfaces_of, true_surfaces
from .shape_losses import losses
from .shape_net import ShapeNet

UNSEEN = 50_000_000  # the first seed of a sample that is never trained on
APART = 1_000_000  # between the samples' first seeds of two plans, whose seeds are neighbours
CHECKED = 8 * SHARD  # unseen samples
WARM_UP = 0.04  # share of the steps, during which the rate rises
STEEPEST = 5.0  # length of a gradient that is not shortened
GENTLE = 0.5  # x the rate, for weights that have learned
MEMORY = 0.999  # of the mean of weights that is kept and shipped
CURVE = 100  # points of the learning curve that are told
SAVED = 120.0  # s between two checkpoints


@dataclass(frozen=True)
class SampleSet:
    """Samples of one seed; a plan may draw several such sets."""

    seed: int
    samples: int
    families: tuple[str, ...] = ()  # the only ones that are drawn; none: all


@dataclass(frozen=True)
class TrainingPlan:
    """A plan of training; the same plan gives the same weights, but for rounding."""

    samples: int = 8192
    passes: float = 4.0  # over all samples
    size: int = 16  # samples at a time
    rate: float = 1.5e-3
    decay: float = 0.02
    held_out: tuple[str, ...] = ()  # families that are not trained on
    seed: int = 0  # another one has other samples
    also: tuple[SampleSet, ...] = ()  # sets that are drawn beside its own
    start: str = ""  # SHA-256 of the weights that it goes on from; none: from nothing

    @property
    def steps(self) -> int:
        return max(1, int(self.passes * self.total / self.size))

    @property
    def total(self) -> int:
        """How many samples there are in all sets."""
        return sum(own.samples for own in self.sets)

    @property
    def sets(self) -> tuple[SampleSet, ...]:
        """Its own samples, and all further ones."""
        return (SampleSet(self.seed, self.samples), *self.also)

    @property
    def file(self) -> str:
        """Name of the checkpoint."""
        return "-without-".join(["checkpoint", *self.held_out]) + ".pt"


def train(
    folder: Path,
    plan: TrainingPlan,
    minutes: float | None = None,
    progress: Progress = silent,
    weights: Path | None = None,
) -> Path:
    """Trains in `folder`, for so many minutes at most; the path of the checkpoint.

    It goes on from `weights`, exported before, where they are given.

    Raises ValueError for fewer samples than a step takes, for a seed whose samples others have, for
    two sets of one seed, for weights of another network or of families that are held out, and for a
    folder in which another plan was begun.
    """
    if plan.samples < plan.size:
        raise ValueError(f"{plan.samples} samples are fewer than the {plan.size} of one step")
    seeds = [own.seed for own in plan.sets]
    if len(set(seeds)) < len(seeds):
        raise ValueError("two sets of samples cannot have one seed")
    for own in plan.sets:
        if not 0 <= own.seed < UNSEEN // APART or not 0 < own.samples <= APART:
            raise ValueError(
                f"a seed is from 0 to {UNSEEN // APART - 1}, with 1 to {APART} samples"
            )
    if weights is not None and plan.held_out:
        raise ValueError("weights that have seen all families cannot tell how well it does without")
    start = None
    if weights is not None:
        start = weights_of(weights, ShapeNet())
        digest = hashlib.sha256(weights.read_bytes()).hexdigest()
        plan = replace(plan, start=digest, rate=GENTLE * plan.rate)
    state = _State.resumed(folder, plan, start)
    files = [
        file
        for own in plan.sets
        for file in write_shards(
            folder / "samples", own.seed * APART, own.samples, progress, own.families or None
        )
    ]
    write_shards(folder / "unseen", UNSEEN, CHECKED, progress)
    begun = saved = time.monotonic()
    for batch in _endless(files, plan, state.step):
        if state.step >= plan.steps or (minutes and time.monotonic() - begun > 60 * minutes):
            break
        state.learn(batch)
        progress(state.step / plan.steps, f"loss {state.recent():.3f}")
        if time.monotonic() - saved > SAVED:
            state.save()
            saved = time.monotonic()
    state.save()
    return state.file


def _endless(files: list[Path], plan: TrainingPlan, done: int) -> Iterator[Batch]:
    number = done * plan.size // max(plan.total, 1)
    while True:
        rng = np.random.default_rng([plan.seed, number, done])
        yield from batches(files, plan.size, rng, plan.held_out)
        number += 1


def _device() -> torch.device:
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def _quick_numbers(device: torch.device) -> AbstractContextManager[Any]:
    """Bfloat16 where the processor multiplies matrices of it (AMX).

    Where it only has AVX-512's instructions for bfloat16 a step takes a fifth longer than in
    float32, and where it has neither 15 times as long.
    """
    is_quick = device.type == "cuda" or torch.cpu._is_amx_tile_supported()
    return torch.autocast(device.type, dtype=torch.bfloat16) if is_quick else nullcontext()


def _on(batch: Batch, device: torch.device) -> Batch:
    tensors = {f.name: getattr(batch, f.name) for f in fields(batch) if f.name != "phase"}
    moved = {name: tensor.to(device) for name, tensor in tensors.items()}
    return replace(batch, **moved)


class _State:
    """The network, what trains it, and how far it is."""

    def __init__(self, file: Path, plan: TrainingPlan, start: dict[str, Tensor] | None) -> None:
        torch.manual_seed(plan.seed)
        self.file, self.plan, self.step = file, plan, 0
        self.device = _device()
        net = ShapeNet()
        if start is not None:
            net.load_state_dict(start)
        self.net = net.to(device=self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.mean = {k: v.clone() for k, v in self.net.state_dict().items()}
        self.optimiser = torch.optim.AdamW(
            self.net.parameters(), plan.rate, weight_decay=plan.decay
        )
        self.history: list[dict[str, float]] = []

    @staticmethod
    def resumed(folder: Path, plan: TrainingPlan, start: dict[str, Tensor] | None = None) -> _State:
        """Resume from the last save, or start where there is none.

        Raises ValueError where it is another plan's.
        """
        state = _State(folder / plan.file, plan, start)
        kept = checkpoint_of(state.file, json.dumps(asdict(plan)), state.device)
        if kept is not None:
            state.net.load_state_dict(kept["net"])
            state.optimiser.load_state_dict(kept["optimiser"])
            state.mean, state.step, state.history = kept["mean"], kept["step"], kept["history"]
        return state

    def learn(self, batch: Batch) -> None:
        """Take one step."""
        self.net.train()
        for group in self.optimiser.param_groups:
            group["lr"] = self.plan.rate * schedule(self.step / self.plan.steps)
        batch = _on(batch, self.device)
        with _quick_numbers(self.device):
            planes = batch.planes.contiguous(memory_format=torch.channels_last)
            found = self.net(planes, batch.tokens, batch.phase)
        parts = losses(found.float(), batch)
        self.optimiser.zero_grad(set_to_none=True)
        parts["all"].backward()
        torch.nn.utils.clip_grad_norm_(self.net.parameters(), STEEPEST)
        self.optimiser.step()
        self.step += 1
        follow(self.mean, self.net, self.step)
        self.history.append({k: round(float(v.detach()), 5) for k, v in parts.items()})

    def recent(self) -> float:
        return float(np.mean([row["all"] for row in self.history[-50:]]))

    def save(self) -> None:
        partial = self.file.with_suffix(".part")
        kept = {
            "net": self.net.state_dict(), "mean": self.mean, "step": self.step,
            "optimiser": self.optimiser.state_dict(), "history": self.history,
            "plan": json.dumps(asdict(self.plan)),
        }  # fmt: skip
        torch.save(kept, partial)
        os.replace(partial, self.file)


def checkpoint_of(file: Path, plan: str, device: torch.device) -> dict[str, Any] | None:
    """What was saved; None where nothing was. Raises ValueError where it is another plan's."""
    if not file.exists():
        return None
    kept = torch.load(file, map_location=device, weights_only=True)
    if kept["plan"] != plan:
        raise ValueError(
            f"{file} was begun with other options: give the same, another folder, or move it away"
        )
    return kept


def follow(mean: dict[str, Tensor], net: torch.nn.Module, step: int) -> None:
    """Move a running mean of a network's weights towards those after so many steps."""
    kept = min(MEMORY, (1 + step) / (10 + step))
    for name, value in net.state_dict().items():
        if value.is_floating_point():
            mean[name].lerp_(value, 1 - kept)
        else:
            mean[name].copy_(value)


def schedule(share: float) -> float:
    """The share of the highest rate after this share of the steps: up, then down along a cosine."""
    if share < WARM_UP:
        return share / WARM_UP
    return 0.505 + 0.495 * math.cos(math.pi * min((share - WARM_UP) / (1 - WARM_UP), 1.0))


def trained(checkpoint: Path) -> ShapeNet:
    """The mean of the weights, ready to predict."""
    net = ShapeNet()
    net.load_state_dict(torch.load(checkpoint, map_location="cpu", weights_only=True)["mean"])
    return net.eval()


def figures(checkpoint: Path, net: ShapeNet) -> dict[str, Any]:
    """Scores on samples that were never trained on, by family and in all, and the curve."""
    kept = torch.load(checkpoint, map_location="cpu", weights_only=True)
    unseen = sorted((checkpoint.parent / "unseen").glob("*.npz"))
    scores = check(net, unseen)
    families = sorted({family for family, _ in scores})
    everything = [row for _, row in scores]
    history = kept["history"]
    bins = np.array_split(np.arange(len(history)), min(CURVE, len(history)))
    return {
        "plan": json.loads(kept["plan"]),
        "steps": kept["step"],
        "parameters": sum(p.numel() for p in net.parameters()),
        "flat": flatness.found(net.flat, flatness.samples_of(unseen), FLAT),
        "means": _middles(everything, np.mean),
        "medians": _middles(everything, np.median),
        "families": {
            name: _middles([row for family, row in scores if family == name], np.mean)
            for name in families
        },
        "curve": [
            {part: round(float(np.mean([history[k][part] for k in own])), 4) for part in history[0]}
            for own in bins
        ],
    }


Scores = dict[str, ShapeError]  # of one sample, by way


def _middles(rows: list[Scores], middle: Callable[..., Any]) -> dict[str, dict[str, float]]:
    """The middle score of each way."""
    return {
        way: {
            name: round(float(middle([getattr(row[way], name) for row in rows])), 4)
            for name in ShapeError._fields
        }
        for way in rows[0]
    }


@torch.inference_mode()
def check(net: ShapeNet, files: list[Path]) -> list[tuple[str, Scores]]:
    """Family and scores of each sample, of the network and of what does without."""
    rows: list[tuple[str, Scores]] = []
    for file in files:
        arrays = dict(np.load(file))
        batch = batch_of(arrays)
        found = net(batch.planes, batch.tokens).numpy()
        for k, family in enumerate(arrays["family"]):
            mask, tangents = arrays["mask"][k], arrays["tangents"][k]
            inflated = surfaces_of(relief(mask, tangents, is_standing=False), mask)
            flat = np.full(mask.shape, float(inflated.thickness[mask].mean()))
            ways = {
                "network": surfaces_of(learned(mask, tangents, found[k]), mask),
                "relief": surfaces_of(relief(mask, tangents), mask),
                "inflation": inflated,
                "flat": Surfaces(np.zeros(mask.shape), flat),
            }
            true = true_surfaces(arrays["front"][k], arrays["depth"][k], tangents)
            rows.append((str(family), {way: score(own, true, mask) for way, own in ways.items()}))
    return rows
