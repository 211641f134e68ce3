"""`objectmorpher train rods`: handles, training, figures and the weights that are shipped.

Handles are kept in one folder, as the tokens that the network reads: called again it makes those
that are missing, and trains anew, which takes minutes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from objectmorpher_core.base.progress import Progress, part, silent
from objectmorpher_core.lift.shapes.rod_look import GRID, UNIT, planes_of

from .export_shape import write_onnx
from .rod_net import RodCommittee, RodNet
from .rods.sample import RodSample, make_sample
from .shape_data import _tokens, make_files, write_arrays
from .shape_net import WIDTH
from .train_shape import follow, schedule

SHARD = 32  # handles in a file
HELD_OUT = 0.1  # of the files
RATE, DECAY, STEEPEST = 3e-3, 0.05, 2.0
LEAN_OFF = 0.05  # radians, deviation: a fitted axis leans otherwise than the true one
INPUTS, OUTPUTS = ("tokens", "planes", "lean"), ("azimuth", "doubt")
SURE = (0.5, 1.0)  # shares of those that are held out, the surest first


@dataclass(frozen=True)
class RodPlan:
    """A plan of training."""

    samples: int = 3072
    steps: int = 2500
    size: int = 32  # samples at a time
    members: int = 3  # networks that are trained, each from another start
    seed: int = 0


@dataclass(frozen=True, eq=False)
class RodData:
    """What is learned from; float32."""

    tokens: Tensor  # (n, WIDTH, GRID, GRID), float16
    planes: Tensor  # (n, 2, GRID, GRID)
    angles: Tensor  # (n, 2) azimuth and lean, UNITs

    def batch(self, rng: np.random.Generator, size: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Some of them, moved by a token, half of them mirrored: tokens, planes, lean, azimuth."""
        which = torch.from_numpy(rng.integers(len(self.angles), size=size))
        x, y = (int(n) for n in rng.integers(-1, 2, 2))
        fields = [torch.roll(f[which].float(), (y, x), (2, 3)) for f in (self.tokens, self.planes)]
        if rng.random() < 0.5:
            fields = [field.flip(-1) for field in fields]
        azimuth, lean = self.angles[which].T
        noise = torch.from_numpy(rng.normal(0, LEAN_OFF / UNIT, size).astype(np.float32))
        return fields[0], fields[1], lean + noise, azimuth


def write_rods(folder: Path, plan: RodPlan, progress: Progress = silent) -> list[Path]:
    """Files of handles, those that are not there yet, in all cores."""
    folder.mkdir(parents=True, exist_ok=True)
    first = plan.seed * 1_000_000
    seeds = range(first, first + plan.samples, SHARD)
    jobs = [(folder / f"{seed:08d}.npz", seed) for seed in seeds]
    return make_files(_write, jobs, (SHARD, "handles"), progress)


def _write(job: tuple[Path, int]) -> None:
    file, seed = job
    write_arrays(file, packed([make_sample(seed + k) for k in range(SHARD)]))


def packed(samples: list[RodSample]) -> dict[str, np.ndarray]:
    """The arrays of `RodData`."""
    return {
        "tokens": _tokens(np.stack([s.rgb for s in samples])),
        "planes": np.stack([planes_of(s.mask, s.rod) for s in samples]),
        "angles": np.array([[s.azimuth, s.lean] for s in samples], np.float32) / np.float32(UNIT),
    }


def data_of(arrays: list[dict[str, np.ndarray]]) -> RodData:
    """Those of several files together."""
    return RodData(*(
        torch.from_numpy(np.concatenate([a[name] for a in arrays]))
        for name in ("tokens", "planes", "angles")
    ))  # fmt: skip


def train(
    folder: Path, plan: RodPlan, progress: Progress = silent
) -> tuple[RodCommittee, dict[str, float]]:
    """Train in `folder`; the networks, and how far off they are on handles held out."""
    files = write_rods(folder, plan, part(progress, 0.0, 0.9))
    arrays = [dict(np.load(file, allow_pickle=False)) for file in files]
    count = max(1, round(HELD_OUT * len(files)))
    learned = data_of(arrays[count:] or arrays)
    members, share = [], 0.1 / plan.members
    for number in range(plan.members):
        step = part(progress, 0.9 + share * number, 0.9 + share * (number + 1))
        members.append(learn(learned, plan, plan.seed + number, step))
    net = RodCommittee(members).eval()
    return net, figures(net, data_of(arrays[:count]))


def learn(data: RodData, plan: RodPlan, seed: int, progress: Progress = silent) -> RodNet:
    """The mean of a trained network's weights, ready to predict.

    Its error is that of a Laplace distribution, which forgives the few that nobody could know.
    """
    torch.manual_seed(seed)
    rng, net = np.random.default_rng(seed), RodNet()
    mean = {name: value.clone() for name, value in net.state_dict().items()}
    optimiser = torch.optim.AdamW(net.parameters(), RATE, weight_decay=DECAY)
    for step in range(plan.steps):
        for group in optimiser.param_groups:
            group["lr"] = RATE * schedule(step / plan.steps)
        tokens, planes, lean, azimuth = data.batch(rng, plan.size)
        found, doubt = net(tokens, planes, lean)
        doubt = doubt.clamp(-4, 2)
        loss = (torch.exp(-doubt) * (found - azimuth).abs() + doubt).mean()
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), STEEPEST)
        optimiser.step()
        follow(mean, net, step + 1)
        progress((step + 1) / plan.steps, f"loss {float(loss.detach()):.3f}")
    net.load_state_dict(mean)
    return net.eval()


def figures(net: torch.nn.Module, data: RodData) -> dict[str, float]:
    """Degrees that azimuths are off: root mean square and median, also of the surest half."""
    with torch.no_grad():
        found, doubt = net(data.tokens.float(), data.planes, data.angles[:, 1])
    off = np.degrees(UNIT * (found - data.angles[:, 0]).abs().numpy())
    order, told = np.argsort(doubt.numpy()), {}
    for share in SURE:
        own = off[order[: max(1, round(share * len(off)))]]
        told[f"rms of {share:.0%}"] = float(np.sqrt((own**2).mean()))
        told[f"median of {share:.0%}"] = float(np.median(own))
    return told


def export(net: torch.nn.Module, path: Path) -> str:
    """Write `path`, an ONNX file; its SHA-256."""
    inputs = (torch.zeros(1, WIDTH, GRID, GRID), torch.zeros(1, 2, GRID, GRID), torch.zeros(1))
    return write_onnx(net, inputs, path, INPUTS, OUTPUTS)
