"""Samples for the shape network: made in processes, kept in files, read as batches."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from objectmorpher_core.base.arrays import Mask
from objectmorpher_core.base.progress import Progress, silent
from objectmorpher_core.lift.crop import planes_of

from .shapes.sample import Sample, make_sample, make_takes

if TYPE_CHECKING:
    from torch import Tensor

SHARD = 32  # samples in a file
# Tokens of the mirrored crops: those of the crops, left and right exchanged, are others.
MIRRORED = "mirrored_tokens"
NORMAL_STEPS = 127.0  # a normal's coordinate is kept in a byte


@dataclass(frozen=True, eq=False)
class Batch:
    """Tensors float32 for `shape_net.ShapeNet` and its losses, t = s or s / 2 (one phase)."""

    planes: Tensor  # (n, 7, s, s)
    tokens: Tensor  # (n, 768, g, g)
    phase: tuple[int, int] | None  # of the pixels that are compared; None: all
    mask: Tensor  # (n, 1, t, t), as are the next four
    front: Tensor
    thickness: Tensor
    depth: Tensor
    edge: Tensor
    normal: Tensor  # (n, 3, t, t)
    rays: Tensor  # (n, 3, t, t) unit
    away: Tensor  # (n, 1, 1, 1) crop units to the mean of the object


def make_files(
    write: Callable[[Any], None], jobs: Sequence[tuple[Any, ...]], holds: tuple[int, str],
    progress: Progress,
) -> list[Path]:  # fmt: skip
    """The files that come first in `jobs`; `write` makes those that are not there, in all cores.

    `holds`: how many of what are in each.
    """
    (each, what), wanted = holds, [job for job in jobs if not job[0].exists()]
    # Spawned, not forked: a copy of a process whose networks have threads may never end.
    apart = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(os.cpu_count(), apart, cv2.setNumThreads, (1,)) as pool:
        for done, _ in enumerate(pool.map(write, wanted), 1):
            progress(done / len(wanted), f"{done * each} of {len(wanted) * each} {what}")
    return [job[0] for job in jobs]


def write_arrays(file: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write a file of arrays, whole or not at all."""
    partial = file.with_suffix(".part")
    with partial.open("wb") as out:
        np.savez(out, allow_pickle=False, **arrays)
    partial.rename(file)


def shard_name(seed: int, families: tuple[str, ...] | None = None, takes: int = 1) -> str:
    """The file's name; samples of one seed may lie beside others of other families or takes."""
    drawn = f"{','.join(families or ())} {takes}"
    ending = f"-{sha256(drawn.encode()).hexdigest()[:8]}" if families or takes > 1 else ""
    return f"{seed:08d}{ending}.npz"


def write_shards(
    folder: Path, first: int, count: int, progress: Progress = silent,
    families: tuple[str, ...] | None = None, takes: int = 1,
) -> list[Path]:  # fmt: skip
    """Files of samples with the seeds first..; `families`: the only ones drawn.

    With several `takes` there are so many of each thing (`make_takes`), their masks slightly wrong.
    """
    folder.mkdir(parents=True, exist_ok=True)
    jobs = [
        (folder / shard_name(seed, families, takes), range(seed, seed + SHARD), families, takes)
        for seed in range(first, first + count, SHARD)
    ]
    return make_files(_write, jobs, (SHARD, "samples"), progress)


def _write(job: tuple[Path, range, tuple[str, ...] | None, int]) -> None:
    file, seeds, families, takes = job
    if takes == 1:
        samples = [make_sample(seed, families=families) for seed in seeds]
    else:
        samples = [_worn_of(one) for s in seeds for one in make_takes(s, takes, families=families)]
    arrays = packed(samples)
    rgb = np.stack([s.rgb for s in samples])
    arrays["tokens"], arrays[MIRRORED] = _tokens(rgb), _tokens(rgb[:, :, ::-1])
    write_arrays(file, arrays)


def packed(samples: list[Sample]) -> dict[str, np.ndarray]:
    """Arrays (n, ...) of samples, small."""
    arrays: dict[str, np.ndarray] = {}
    for field in fields(Sample):
        values = [getattr(sample, field.name) for sample in samples]
        array = np.array(values)
        if field.name == "normal":
            array = np.rint(array * NORMAL_STEPS).astype(np.int8)
        elif field.name in ("front", "thickness", "depth"):
            array = array.astype(np.float16)
        arrays[field.name] = array
    return arrays


_ENCODER: list[Any] = []


def _tokens(rgb: np.ndarray) -> np.ndarray:
    """(n, 768, g, g) float16 of crops (n, s, s, 3)."""
    from objectmorpher_core.segment.dino_tokens import TokenNet

    if not _ENCODER:
        _ENCODER.append(TokenNet(threads=1))
    found = np.stack([_ENCODER[0].inner_tokens(np.ascontiguousarray(one)) for one in rgb])
    return np.ascontiguousarray(found.transpose(0, 3, 1, 2), np.float16)


def batches(
    files: list[Path], size: int, rng: np.random.Generator, held_out: tuple[str, ...] = ()
) -> Iterator[Batch]:
    """The samples of the files, mixed within some files at a time, half of them mirrored.

    `held_out`: families that are left out. Raises ValueError for samples of an earlier version.
    """
    order = rng.permutation(len(files))
    for begin in range(0, len(order), 8):
        chosen = [dict(np.load(files[k])) for k in order[begin : begin + 8]]
        if any(MIRRORED not in c for c in chosen):
            raise ValueError("these samples were made by an earlier version: take another folder")
        joined = {name: np.concatenate([c[name] for c in chosen]) for name in chosen[0]}
        mixed = rng.permutation(np.flatnonzero(~np.isin(joined["family"], held_out)))
        for start in range(0, len(mixed) - size + 1, size):
            rows = mixed[start : start + size]
            picked = {name: array[rows] for name, array in joined.items()}
            yield batch_of(_mirrored(picked, rng.random(size) < 0.5), rng)


def _mirrored(arrays: dict[str, np.ndarray], which: np.ndarray) -> dict[str, np.ndarray]:
    """Packed samples, left and right exchanged in some (n,)."""
    found = {name: array.copy() for name, array in arrays.items() if name != MIRRORED}
    for name, array in found.items():
        if array.ndim > 2 and name != "tokens":
            array[which] = np.flip(array[which], 2)
    found["tokens"][which] = arrays[MIRRORED][which]
    found["normal"][which, ..., 0] *= -1
    found["tangents"][which, 0] *= -1
    return found


def batch_of(arrays: dict[str, np.ndarray], rng: np.random.Generator | None = None) -> Batch:
    """Return a batch of packed samples; with `rng`, for training, masks are slightly wrong."""
    import torch

    count = len(arrays["mask"])
    masks = [m if rng is None else _worn(m, rng) for m in arrays["mask"]]
    planes = [planes_of(arrays["rgb"][k], masks[k], arrays["tangents"][k]) for k in range(count)]
    phase = None if rng is None else (int(rng.integers(2)), int(rng.integers(2)))
    wanted = [slice(None)] * 2 if phase is None else [slice(at, None, 2) for at in phase]
    own = (slice(None), *wanted)

    def image(name: str) -> Tensor:
        return torch.from_numpy(arrays[name][own].astype(np.float32))[:, None]

    normal = arrays["normal"][own].astype(np.float32).transpose(0, 3, 1, 2) / NORMAL_STEPS
    stacked = np.stack(planes)
    x, y = (stacked[:, plane : plane + 1, wanted[0], wanted[1]] for plane in (5, 6))
    ways = np.concatenate([x, y, np.ones_like(x)], 1)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    tangents = arrays["tangents"]
    away = np.sqrt(1 + tangents[:, 0] ** 2 + tangents[:, 1] ** 2) / tangents[:, 2]
    return Batch(
        torch.from_numpy(stacked), torch.from_numpy(arrays["tokens"].astype(np.float32)), phase,
        image("mask"), image("front"), image("thickness"), image("depth"), image("edge"),
        torch.from_numpy(np.ascontiguousarray(normal)), torch.from_numpy(ways),
        torch.from_numpy(away.astype(np.float32))[:, None, None, None],
    )  # fmt: skip


def _worn_of(sample: Sample) -> Sample:
    """The sample as a click selects it."""
    rng = np.random.default_rng(int(sample.mask.sum()))
    return replace(sample, mask=_worn(sample.mask, rng))


def _worn(mask: Mask, rng: np.random.Generator) -> Mask:
    """A mask whose outline is up to two px off, smoothly."""
    if rng.random() < 0.5:
        return mask
    noise = cv2.GaussianBlur(rng.normal(0, 1, mask.shape).astype(np.float32), (0, 0), 6)
    noise *= rng.uniform(0, 2) / max(float(noise.std()), 1e-6)
    inside = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 3)
    outside = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 3)
    return inside - outside + noise.clip(-2, 2) > 0
