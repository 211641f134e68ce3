"""Whether a thing is flat: two small layers over the mean and the spread of its tokens.

The depths that the shape network sees do not say it: of a print it sees what is printed, and puffs
that. The tokens do: a photograph of a leaf, a sign or a butterfly looks like one.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from objectmorpher_core.base.progress import Progress, silent

GRID, WIDTH = 16, 768  # tokens across, numbers of each
HIDDEN, DROPPED = 64, (0.3, 0.5)  # shares that are forgotten in training, of both layers' inputs
FLAT = "prints"  # the family whose members are flat
SOLID = 0.2  # depth over the root of the area, from which the others are not
LEAST = 50  # px of a sample that is looked at
PASSES, SIZE, RATE, DECAY = 10, 128, 1e-3, 0.1
NOISE, DOUBT = 0.1, 0.02  # added to what is read; how unsure every label is


class FlatNet(nn.Module):
    """Mask (n, 1, s, s) and tokens (n, WIDTH, g, g) -> log odds (n,) that the object is flat."""

    def __init__(self) -> None:
        super().__init__()
        self.middle: Tensor
        self.scale: Tensor
        self.register_buffer("middle", torch.zeros(2 * WIDTH))
        self.register_buffer("scale", torch.ones(2 * WIDTH))
        self.hidden, self.out = nn.Linear(2 * WIDTH, HIDDEN), nn.Linear(HIDDEN, 1)

    def forward(self, mask: Tensor, tokens: Tensor) -> Tensor:
        return self.judged(pooled(mask, tokens))

    def judged(self, seen: Tensor) -> Tensor:
        """Log odds (n,) by what `pooled` gives, (n, 2 WIDTH)."""
        seen = functional.dropout((seen - self.middle) / self.scale, DROPPED[0], self.training)
        inner = functional.dropout(functional.gelu(self.hidden(seen)), DROPPED[1], self.training)
        return self.out(inner)[:, 0]


def pooled(mask: Tensor, tokens: Tensor) -> Tensor:
    """Mean and deviation (n, 2 WIDTH) of the tokens within a mask, as in `FlatNet`."""
    share = functional.avg_pool2d(mask, mask.shape[-1] // GRID)
    share = share / share.sum((2, 3), keepdim=True).clamp_min(1e-6)
    mean = (share * tokens).sum((2, 3), keepdim=True)
    variance = (share * (tokens - mean) ** 2).sum((2, 3))
    return torch.cat([mean[:, :, 0, 0], (variance + 1e-6).sqrt()], 1)


class FlatSamples(NamedTuple):
    """What is learned from: each sample as it is, and mirrored."""

    seen: Tensor  # (n, 2, 2 WIDTH), see `pooled`
    is_flat: Tensor  # (n,) float32


def samples_of(files: Iterable[Path], progress: Progress = silent) -> FlatSamples:
    """Prints and solids among packed samples (`shape_data.write_shards`); not what is between."""
    seen, labels = [], []
    for number, file in enumerate(chosen := list(files), 1):
        arrays = np.load(file)
        masks = arrays["mask"]
        deep = np.array([
            np.median(depth[mask]) / np.sqrt(mask.mean()) if mask.sum() >= LEAST else np.nan
            for depth, mask in zip(arrays["depth"].astype(np.float32), masks, strict=True)
        ])  # fmt: skip
        is_flat = arrays["family"] == FLAT
        rows = np.flatnonzero(np.isfinite(deep) & (is_flat | (deep > SOLID)))
        if len(rows):
            ways = [("tokens", masks), ("mirrored_tokens", masks[:, :, ::-1])]
            looks = [
                pooled(*(torch.from_numpy(part[rows].astype(np.float32)) for part in (
                    mask[:, None], arrays[name]
                )))
                for name, mask in ways
            ]  # fmt: skip
            seen.append(torch.stack(looks, 1))
            labels.append(torch.from_numpy(is_flat[rows].astype(np.float32)))
        progress(number / len(chosen), "looking at what is flat")
    return FlatSamples(torch.cat(seen), torch.cat(labels))


def found(net: FlatNet, samples: FlatSamples, odds: float) -> dict[str, int]:
    """Count flat ones, solids, and those of each whose log odds are at least `odds`."""
    with torch.inference_mode():
        said = torch.stack([net.judged(samples.seen[:, way]) for way in (0, 1)]).mean(0) >= odds
    is_flat = samples.is_flat > 0.5
    return {
        "flat": int(is_flat.sum()), "found": int((said & is_flat).sum()),
        "solid": int((~is_flat).sum()), "mistaken": int((said & ~is_flat).sum()),
    }  # fmt: skip


def fit(net: FlatNet, samples: FlatSamples, seed: int = 0) -> None:
    """Train `net` anew, and leave it ready to predict; ten seconds for 8,192 samples on two cores.

    Raises ValueError where either kind is missing.
    """
    if len(samples.is_flat.unique()) < 2:
        raise ValueError("there are too few samples to learn from what is flat: prints and solids")
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        for layer in (net.hidden, net.out):
            layer.reset_parameters()
        seen, labels = samples.seen.flatten(0, 1), samples.is_flat.repeat_interleave(2)
        net.middle.copy_(seen.mean(0))
        net.scale.copy_(seen.std(0) + 1e-3)
        optimiser = torch.optim.AdamW(net.parameters(), RATE, weight_decay=DECAY)
        net.train()
        for done in range(PASSES):
            for group in optimiser.param_groups:
                group["lr"] = RATE * (1 - done / PASSES)
            for rows in torch.randperm(len(labels)).split(SIZE):
                noisy = seen[rows] + NOISE * net.scale * torch.randn_like(seen[rows])
                wanted = labels[rows] * (1 - 2 * DOUBT) + DOUBT
                loss = functional.binary_cross_entropy_with_logits(net.judged(noisy), wanted)
                optimiser.zero_grad(set_to_none=True)
                loss.backward()
                optimiser.step()
    net.eval()
