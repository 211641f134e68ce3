"""`objectmorpher train shadow`: scenes, training, and the weights that are shipped.

Scenes are kept in one folder, and so is what was learned: called again it goes on where it was
stopped. Samples are made of scenes as fast as the other cores allow, and each is used a few times;
so two runs of the same plan are alike, and not the same.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from multiprocessing.process import BaseProcess
from multiprocessing.queues import Queue
from pathlib import Path
from queue import Empty
from typing import NamedTuple

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from objectmorpher_core.base.progress import Progress, part, silent
from objectmorpher_core.compose.shadow.shadow_look import PLANES, SEEN, SIDE

from .export_shape import weights_of, write_onnx
from .shadow_net import ShadowNet
from .shadows.grounds import Grounds, photographs
from .shadows.samples import ShadowSample, make_sample
from .shadows.scenes import SceneGeometry, make_geometry, packed, unpacked
from .shadows.solids import silhouettes
from .shape_data import make_files, write_arrays
from .train_shape import checkpoint_of, follow, schedule

SHARD = 64  # scenes in a file, and samples that are handed over at once
BOARDS, BOARDS_SEED = 160, 5
OPEN, OTHER_FILE = 8, 0.25  # files of scenes that are at hand; how often one of them is replaced
RING = 16_000  # samples that are kept
LEAST = 512  # of them, before anything is learned
LOOKED = 1.0  # s between two looks at whether those that make samples still do
RATE, DECAY, STEEPEST = 2e-3, 0.02, 2.0
GENTLE = 0.35  # x that rate, going on from weights that have learned
HALF_WAY = 0.5  # from those to the ones that it has learned, is what is exported
FAINT, CLEAR = 0.06, 0.18  # share of light that is taken, between which a cell is half in shade
SHADE, MAP = 2.0, 4.0  # more weight of what is in shade, and of the map over the verdict
LEAST_CELLS = 50.0
SAVED = 120.0  # s between two checkpoints
INPUT, OUTPUTS = "planes", ("shade", "odds")


@dataclass(frozen=True)
class ShadowPlan:
    """A plan of training."""

    scenes: int = 2880
    steps: int = 5000
    size: int = 32  # samples at a time
    seed: int = 0
    grounds: Path | None = None  # a folder of pictures of any ground
    rate: float = RATE
    start: str = ""  # SHA-256 of the weights from which it goes on


class ShadowLosses(NamedTuple):
    """Of where the shade lies, and of whether there is any."""

    shade: Tensor
    verdict: Tensor


def write_scenes(folder: Path, plan: ShadowPlan, progress: Progress = silent) -> list[Path]:
    """Files of scenes, those that are not there yet, in all cores."""
    folder.mkdir(parents=True, exist_ok=True)
    jobs = [
        (folder / f"{plan.seed:02d}-{number:05d}.npz", plan.seed, number)
        for number in range(-(-plan.scenes // SHARD))
    ]
    return make_files(_write, jobs, (SHARD, "scenes"), progress)


def _write(job: tuple[Path, int, int]) -> None:
    file, seed, number = job
    shapes = silhouettes(BOARDS, BOARDS_SEED)
    scenes = [make_geometry(np.random.default_rng([seed, number, k]), shapes) for k in range(SHARD)]
    write_arrays(file, packed(scenes))


@dataclass(eq=False)
class SampleRing:
    """The newest samples."""

    count: int = RING
    made: int = 0
    planes: np.ndarray = field(init=False)
    fields: np.ndarray = field(init=False)  # (count, 2, s, s) what is dark, and what counts
    labels: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.planes = np.zeros((self.count, PLANES, SIDE, SIDE), np.float16)
        self.fields = np.zeros((self.count, 2, SIDE, SIDE), np.float16)
        self.labels = np.zeros(self.count, np.float32)

    def add(self, planes: np.ndarray, fields: np.ndarray, labels: np.ndarray) -> None:
        """Add samples, over the oldest ones."""
        where = (self.made + np.arange(len(labels))) % self.count
        self.planes[where], self.fields[where], self.labels[where] = planes, fields, labels
        self.made += len(labels)

    def drawn(self, rng: np.random.Generator, size: int) -> tuple[Tensor, Tensor, Tensor]:
        """Planes, fields and labels of a few, mirrored, brightened and blurred by noise."""
        which = rng.integers(min(self.made, self.count), size=size)
        arrays = (self.planes, self.fields, self.labels)
        planes, fields, labels = (torch.from_numpy(a[which].astype(np.float32)) for a in arrays)
        turned = torch.from_numpy(rng.random(size) < 0.5)
        planes[turned], fields[turned] = planes[turned].flip(-1), fields[turned].flip(-1)
        is_seen = ((planes[:, 3] > SEEN) | (planes[:, 4] > 0)).float()
        gain, shift, noise = (
            torch.from_numpy(v.astype(np.float32).reshape(-1, 1, 1))
            for v in (np.exp(rng.normal(0, 0.2, size)), rng.normal(0, 0.15, size),
                      rng.uniform(0, 0.04, size))
        )  # fmt: skip
        noisy = planes[:, 0] * gain + shift + noise * torch.randn(size, SIDE, SIDE)
        planes[:, 0] = noisy * is_seen
        tint = torch.from_numpy(rng.uniform(0.5, 1.3, (size, 1, 1, 1)).astype(np.float32))
        planes[:, 1:3] *= tint
        return planes, fields, labels


def arrays_of(samples: list[ShadowSample]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What `SampleRing.add` takes."""
    fields = [np.stack([s.dark, s.weight]) for s in samples]
    return (
        np.stack([s.planes for s in samples]).astype(np.float16),
        np.stack(fields).astype(np.float16),
        np.array([s.label for s in samples], np.float32),
    )


def _make_samples(files: list[Path], folder: Path | None, seed: int, ready: Queue) -> None:
    """Make samples for ever."""
    cv2.setNumThreads(1)
    rng = np.random.default_rng(seed)
    grounds, scenes = Grounds(rng, folder=folder), [_read(rng, files)]
    while True:
        if len(scenes) < OPEN:
            scenes.append(_read(rng, files))
        elif rng.random() < OTHER_FILE:
            scenes[rng.integers(OPEN)] = _read(rng, files)
        made = []
        for _ in range(SHARD):
            one, other = (scenes[rng.integers(len(scenes))] for _ in range(2))
            pair = one[rng.integers(len(one))], other[rng.integers(len(other))]
            made.append(make_sample(rng, *pair, grounds))
        ready.put(arrays_of(made))


def _read(rng: np.random.Generator, files: list[Path]) -> list[SceneGeometry]:
    with np.load(files[rng.integers(len(files))], allow_pickle=False) as kept:
        return unpacked({name: kept[name] for name in kept.files})


def losses(net: ShadowNet, planes: Tensor, fields: Tensor, labels: Tensor) -> ShadowLosses:
    """Cross entropies of the map and of the verdict; a label that is NaN has none."""
    shade, odds = net(planes.contiguous(memory_format=torch.channels_last))
    dark, weight = fields[:, 0], fields[:, 1]
    wanted = ((dark - FAINT) / (CLEAR - FAINT)).clamp(0, 1)
    off = functional.binary_cross_entropy_with_logits(shade, wanted, reduction="none")
    off = (off * weight * (1 + SHADE * wanted)).sum((1, 2))
    known = ~torch.isnan(labels)
    verdict = functional.binary_cross_entropy_with_logits(odds[known], labels[known])
    return ShadowLosses((off / weight.sum((1, 2)).clamp(min=LEAST_CELLS)).mean(), verdict)


class ShadowState:
    """The network, what trains it, and how far it is."""

    def __init__(
        self, file: Path, plan: ShadowPlan, start: dict[str, Tensor] | None = None
    ) -> None:
        torch.manual_seed(plan.seed)
        self.file, self.plan, self.step = file, plan, 0
        net = ShadowNet()
        if start is not None:
            net.load_state_dict(start)
        self.net = net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.mean = {k: v.clone() for k, v in self.net.state_dict().items()}
        self.optimiser = torch.optim.AdamW(self.net.parameters(), plan.rate, weight_decay=DECAY)
        self.loss, self.start = 0.0, start
        kept = checkpoint_of(file, repr(plan), torch.device("cpu"))
        if kept is not None:
            self.net.load_state_dict(kept["net"])
            self.optimiser.load_state_dict(kept["optimiser"])
            self.mean, self.step = kept["mean"], kept["step"]

    def learn(self, planes: Tensor, fields: Tensor, labels: Tensor) -> ShadowLosses:
        """Take one step."""
        self.net.train()
        for group in self.optimiser.param_groups:
            group["lr"] = self.plan.rate * schedule(self.step / self.plan.steps)
        parts = losses(self.net, planes, fields, labels)
        whole = MAP * parts.shade + parts.verdict
        self.optimiser.zero_grad(set_to_none=True)
        whole.backward()
        torch.nn.utils.clip_grad_norm_(self.net.parameters(), STEEPEST)
        self.optimiser.step()
        self.step += 1
        follow(self.mean, self.net, self.step)
        self.loss += (float(whole.detach()) - self.loss) / min(self.step, 50)
        return parts

    def save(self) -> None:
        """Save all that going on takes."""
        partial = self.file.with_suffix(".part")
        kept = {
            "net": self.net.state_dict(), "mean": self.mean, "step": self.step,
            "optimiser": self.optimiser.state_dict(), "plan": repr(self.plan),
        }  # fmt: skip
        torch.save(kept, partial)
        os.replace(partial, self.file)

    def trained(self) -> ShadowNet:
        """The mean of the weights, ready to predict.

        Gone on from others, it is half way from those: it finds more than either (see
        docs/compositing).
        """
        net, found = ShadowNet(), dict(self.mean)
        for name, before in (self.start or {}).items():
            if before.is_floating_point():
                found[name] = torch.lerp(before, found[name], HALF_WAY)
        net.load_state_dict(found)
        return net.eval()


def train(
    folder: Path, plan: ShadowPlan, minutes: float | None = None, progress: Progress = silent,
    weights: Path | None = None,
) -> ShadowNet:  # fmt: skip
    """Train in `folder`, for so many minutes at most.

    `weights`: exported ones to go on from, more gently. Raises ValueError for those of another
    network, for a folder of grounds without pictures, and for one in which another plan was begun.
    """
    photographs(plan.grounds)  # or there are none
    start = None
    if weights is not None:
        start = weights_of(weights, ShadowNet())
        digest = hashlib.sha256(weights.read_bytes()).hexdigest()
        plan = replace(plan, start=digest, rate=GENTLE * plan.rate)
    state = ShadowState(folder / "shadow.pt", plan, start)
    files = write_scenes(folder / "scenes", plan, part(progress, 0.0, 0.2))
    begun = saved = time.monotonic()
    spawn, rng = (
        multiprocessing.get_context("spawn"),
        np.random.default_rng([plan.seed, state.step]),
    )
    ready = spawn.Queue(4)
    makers = [
        spawn.Process(
            target=_make_samples,
            args=(files, plan.grounds, plan.seed + 1000 * k, ready),
            daemon=True,
        )
        for k in range(max((os.cpu_count() or 2) - 1, 1))
    ]
    for maker in makers:
        maker.start()
    try:
        ring = SampleRing()
        while state.step < plan.steps and not (minutes and _since(begun) > 60 * minutes):
            _take(ring, ready, makers)
            state.learn(*ring.drawn(rng, plan.size))
            progress(0.2 + 0.8 * state.step / plan.steps, f"loss {state.loss:.3f}")
            if _since(saved) > SAVED:
                state.save()
                saved = time.monotonic()
    finally:
        for maker in makers:
            maker.terminate()
    state.save()
    return state.trained()


def _since(start: float) -> float:
    return time.monotonic() - start


def _take(ring: SampleRing, ready: Queue, makers: Sequence[BaseProcess]) -> None:
    """All that is ready; at the start, as many samples as learning begins with.

    Raises RuntimeError where one of those that make them has ended.
    """
    while True:
        if not all(maker.is_alive() for maker in makers):
            raise RuntimeError("a process that makes samples has ended: its reason stands above")
        is_enough = ring.made >= LEAST
        try:
            ring.add(*(ready.get_nowait() if is_enough else ready.get(timeout=LOOKED)))
        except Empty:
            if is_enough:
                return


def export(net: ShadowNet, path: Path) -> str:
    """Write `path`, an ONNX file; its SHA-256."""
    inputs = (torch.zeros(1, PLANES, SIDE, SIDE),)
    return write_onnx(net, inputs, path, (INPUT,), OUTPUTS)
