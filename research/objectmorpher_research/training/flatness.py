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
ROUND = "padded"  # the family whose members look so, and are not
SOLID = 0.2  # depth over the root of the area, from which the others are not
LEAST = 50  # px of a sample that is looked at
PASSES, SIZE, RATE, DECAY = 10, 128, 1e-3, 0.1
NOISE, DOUBT = 0.1, 0.02  # added to what is read; how unsure every label is
# Of `tune`: passes and rate, and how far it goes from what the net was to what it would become.
# Half way it knows nearly all of both (Wortsman et al. 2022).
TUNED, MIXED = (30, 2e-3), 0.5
CARE = 4.0  # times that a solid counts in it: one that is taken for flat loses more than a print


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
        is_sure = is_flat | (arrays["family"] == ROUND)
        rows = np.flatnonzero(np.isfinite(deep) & (is_sure | (deep > SOLID)))
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
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        for layer in (net.hidden, net.out):
            layer.reset_parameters()
        net.middle.copy_(samples.seen.flatten(0, 1).mean(0))
        net.scale.copy_(samples.seen.flatten(0, 1).std(0) + 1e-3)
        _train(net, samples, PASSES, RATE, 1.0)


def tune(net: FlatNet, samples: FlatSamples, seed: int = 0) -> None:
    """Train `net` further, and leave it half way between what it was and what it is then.

    Raises ValueError where either kind is missing.
    """
    before = {name: value.clone() for name, value in net.state_dict().items()}
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        _train(net, samples, *TUNED, CARE)
    after = net.state_dict()
    net.load_state_dict({name: before[name].lerp(after[name], MIXED) for name in before})


def _train(net: FlatNet, samples: FlatSamples, passes: int, rate: float, care: float) -> None:
    if len(samples.is_flat.unique()) < 2:
        raise ValueError("there are too few samples to learn from what is flat: prints and solids")
    ways = samples.seen.shape[1]
    seen, labels = samples.seen.flatten(0, 1), samples.is_flat.repeat_interleave(ways)
    optimiser = torch.optim.AdamW(net.parameters(), rate, weight_decay=DECAY)
    net.train()
    for done in range(passes):
        for group in optimiser.param_groups:
            group["lr"] = rate * (1 - done / passes)
        for rows in torch.randperm(len(labels)).split(SIZE):
            noisy = seen[rows] + NOISE * net.scale * torch.randn_like(seen[rows])
            wanted = labels[rows] * (1 - 2 * DOUBT) + DOUBT
            weights = care + (1 - care) * labels[rows]
            loss = functional.binary_cross_entropy_with_logits(net.judged(noisy), wanted, weights)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            optimiser.step()
    net.eval()
