"""The generator of Gaussians from a picture: both flows and decoders, one in memory at a time."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor

from ...base.arrays import F64
from ...base.progress import Progress, part, silent
from ...document.gaussians import Gaussians
from ...models.device import empty_cache
from ...models.plans import Plan
from .. import LiftError
from .camera import Framing, view
from .configs import Pipeline, Sampling, part_path, pipeline
from .latent import looked_up
from .parts import load_part
from .picture import ConditionPicture, Encoder
from .voxels import Voxels

log = logging.getLogger(__name__)
T = TypeVar("T")
CELLS = 1 << 16  # more are never decoded; the networks were trained with half as many at most
FLOW, STRUCTURE = "sparse_structure_flow_model", "sparse_structure_decoder"
LATENT, DECODER = "slat_flow_model", "slat_decoder_gs"


@dataclass(frozen=True)
class Folders:
    """The folders of the weights."""

    model: Path
    encoder: Path
    shared: Path | None = None  # another model's, of which this one uses parts


@dataclass(frozen=True, eq=False)
class Placed:
    """The place of an object."""

    voxels: Voxels
    view: Framing | None = None  # how the picture shows it, of a generator that says so


@dataclass(frozen=True, eq=False)
class Made(Placed):
    """The output of a generator for a picture."""

    gaussians: Gaussians = field(kw_only=True)  # in the cube of side 1 round the origin, z up


@dataclass(frozen=True, eq=False)
class Extras:
    """Channels (1, N, E) that the second flow gets beside the latents."""

    shown: Tensor
    hidden: Tensor  # of the step without the picture


class InParts:
    """A model of several networks; only where the plan keeps them is more than one in memory."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._parts: dict[str, Any] = {}

    @property
    def device(self) -> torch.device:
        return torch.device(self.plan.device)

    @property
    def dtype(self) -> torch.dtype:
        """Return the precision of transformers and convolutions."""
        return getattr(torch, self.plan.number)

    def held(self, role: str, load: Callable[[], T]) -> T:
        """The network of a role, in memory; without `plan.keeps` it replaces the one before."""
        if role not in self._parts:
            if not self.plan.keeps:
                self.release()
            self._parts[role] = load()
        return self._parts[role]

    def release(self) -> None:
        """Gives the memory of all parts back."""
        self._parts.clear()
        empty_cache(self.plan.device)


class Generator(InParts):
    """TRELLIS. Reads its description at once, and each part's weights when they are needed."""

    def __init__(self, folders: Folders, plan: Plan) -> None:
        """Raises LiftError where the folders do not hold what they should."""
        super().__init__(plan)
        self.folders = folders
        self.pipeline: Pipeline = pipeline(folders.model)

    def make(
        self,
        picture: ConditionPicture,
        progress: Progress = silent,
        seed: int = 0,
        how: tuple[Sampling, Sampling] | None = None,
    ) -> Made:
        """The object of a picture. `how` both flows are sampled; None: as published.

        The same seed gives the same object on one device. Raises LiftError; Cancelled passes.
        """
        structure, latent = how or (self.pipeline.structure, self.pipeline.latent)
        noise = torch.Generator().manual_seed(seed)  # of the host: the same on every device
        try:
            with torch.inference_mode():
                progress(0.0, "Looking at the object")
                seen = self._seen(picture)
                placed = self._placed(
                    self._structure(seen, noise, structure, part(progress, 0.05, 0.5))
                )
                extras = self._extras(picture, seen, placed)
                rest = part(progress, 0.5, 0.95)
                latents = self._filled((seen, extras), placed.voxels, noise, latent, rest)
                progress(0.95, "Making Gaussians")
                return Made(
                    placed.voxels, placed.view, gaussians=self._gaussians(latents, placed.voxels)
                )
        finally:
            if not self.plan.keeps:
                self.release()

    def part(self, role: str) -> Any:
        """The network of a role, in memory. Raises LiftError."""

        def load() -> Any:
            where = self.pipeline.parts.get(role)
            if where is None:
                raise LiftError(f"{self.folders.model / 'pipeline.json'} names no {role}")
            path = part_path(self.folders.model, where, self.folders.shared)
            log.info("Loading %s", path.name)
            return load_part(path, self.device, self.dtype)

        return self.held(role, load)

    def _encoder(self) -> Encoder:
        # In single precision: it runs once, and everything follows from it.
        return self.held(
            "encoder", lambda: Encoder(self.folders.encoder, self.device, torch.float32)
        )

    def _seen(self, picture: ConditionPicture) -> Tensor:
        """(1, M, D) what conditions the flows."""
        encoder = self._encoder()
        return encoder.tokens(picture.on_black(encoder.side))

    def _structure(
        self, seen: Tensor, noise: torch.Generator, how: Sampling, progress: Progress
    ) -> Tensor:
        """(1, C, r, r, r) the latents of where the object is."""
        flow, nothing = self.part(FLOW), unseen(seen)
        shape = (1, flow.form.in_channels, *[flow.form.resolution] * 3)
        start = torch.randn(shape, generator=noise).to(self.device)

        def velocity(x: Tensor, time: Tensor, is_shown: bool) -> Tensor:
            return flow(x, time, seen if is_shown else nothing)

        return sample(velocity, start, how, progress, "Finding the shape")

    def _placed(self, latents: Tensor) -> Placed:
        """Where the object is, from the first flow's latents."""
        return Placed(occupied(self.part(STRUCTURE)(latents)[0, 0]))

    def _extras(self, picture: ConditionPicture, seen: Tensor, placed: Placed) -> Extras | None:
        """What the second flow gets besides."""
        return None

    def _filled(
        self,
        told: tuple[Tensor, Extras | None],
        voxels: Voxels,
        noise: torch.Generator,
        how: Sampling,
        progress: Progress,
    ) -> Tensor:
        """(1, N, C) what it is like there."""
        flow, (seen, extras), nothing = self.part(LATENT), told, unseen(told[0])
        start = torch.randn((len(voxels), flow.form.out_channels), generator=noise)

        def velocity(x: Tensor, time: Tensor, is_shown: bool) -> Tensor:
            if extras is not None:
                x = torch.cat([x, extras.shown if is_shown else extras.hidden], 2)
            return flow(x, time, seen if is_shown else nothing, voxels)

        found = sample(velocity, start[None].to(self.device), how, progress, "Filling it in")
        return self.denormed(found)

    def _gaussians(self, latents: Tensor, voxels: Voxels) -> Gaussians:
        decoder = self.part(DECODER)
        raw = decoder(latents, voxels)[0]
        try:
            return decoder.gaussians(raw, voxels)
        except ValueError as error:  # weights that are not numbers, or overflowed
            raise LiftError(
                f"what the network made of the picture is of no use: {error}"
            ) from error

    def denormed(self, latents: Tensor) -> Tensor:
        """Latents (..., C) in the decoder's units."""
        mean, std = (latents.new_tensor(v) for v in (self.pipeline.mean, self.pipeline.std))
        if mean.shape != latents.shape[-1:] or std.shape != mean.shape:
            raise LiftError(f"pipeline.json tells the scale of {len(mean)} channels, not of these")
        return latents * std + mean


def unseen(seen: Tensor) -> Tensor:
    """Return the (1, 1, D) that a flow gets in place of `seen` (1, M, D) where no picture is shown.

    The networks were trained with M tokens of zeros. Attention to tokens that are all the same is
    attention to one of them: the same answer, without the work on the others.
    """
    return torch.zeros_like(seen[:, :1])


def occupied(logits: Tensor) -> Voxels:
    """The cells of logits (R, R, R) above 0; the surest where they are too many.

    Raises LiftError where there are none.
    """
    count = int((logits > 0).sum())
    if count == 0:
        raise LiftError("no shape was found in the picture: try another seed or another selection")
    if count > CELLS:
        log.warning("%d cells are occupied, the surest %d are used", count, CELLS)
        least = logits.flatten().topk(CELLS).values[-1]
        return Voxels.of(logits >= torch.clamp(least, min=1e-30))
    return Voxels.of(logits > 0)


# Following a flow from noise to what it makes, by Euler steps, with guidance.

Velocity = Callable[[Tensor, Tensor, bool], Tensor]
"""velocity(x, time (B,) in thousandths, whether the picture is shown) -> like x"""


def times(how: Sampling) -> np.ndarray:
    """(steps + 1,) from 1, noise, to 0."""
    t = np.linspace(1, 0, how.steps + 1)
    return how.rescale_t * t / (1 + (how.rescale_t - 1) * t)


def sample(
    velocity: Velocity, noise: Tensor, how: Sampling, progress: Progress, note: str
) -> Tensor:
    """Follow the flow from `noise`. `progress` is called before each step, and may cancel."""
    x = noise
    moments = times(how)
    for i, (now, then) in enumerate(pairwise(moments)):
        progress(i / how.steps, f"{note}, step {i + 1} of {how.steps}")
        time = torch.full((len(x),), float(1000 * now), dtype=torch.float32, device=x.device)
        v = velocity(x, time, True)
        if how.interval[0] <= now <= how.interval[1] and how.guidance != 0:
            v = (1 + how.guidance) * v - how.guidance * velocity(x, time, False)
        x = x - float(now - then) * v
    return x


# CUPID (Huang et al. 2025): TRELLIS that also says how the picture shows what it makes.
#
# Its first flow makes two latents: where the object is, and where each cell is seen in the picture.
# The second gets the picture's own tokens and colours at those places.

PLACES = "sparse_structure_uv_decoder"
TOKENS = "slat_encoder"  # TRELLIS's own, which CUPID takes from there
TOKENS_PATH = "microsoft/TRELLIS-image-large/ckpts/slat_enc_swin8_B_64l8_fp16"
REGISTERS = 5  # tokens before those of the patches: one of the whole, four registers
LEAST_CELLS = 10  # whose places tell the camera; where fewer are occupied, the likeliest


class CupidGenerator(Generator):
    """A `Generator` whose objects know how they are seen."""

    def __init__(self, folders: Folders, plan: Plan) -> None:
        super().__init__(folders, plan)
        self.pipeline.parts.setdefault(TOKENS, TOKENS_PATH)

    def _placed(self, latents: Tensor) -> Placed:
        decoder = self.part(STRUCTURE)
        own = decoder.form.latent_channels
        logits = decoder(latents[:, :own])[0, 0]
        voxels = occupied(logits)
        places = self.part(PLACES)(latents[:, own:])[0, 1:3]
        telling = voxels if len(voxels) >= LEAST_CELLS else _likeliest(logits)
        uv = torch.sigmoid(places[:, *telling.cells.T].T)
        return Placed(voxels, view(centres(telling), uv.cpu().double().numpy()))

    def _extras(self, picture: ConditionPicture, seen: Tensor, placed: Placed) -> Extras | None:
        assert placed.view is not None
        xy = placed.view.project(centres(placed.voxels)).clip(0, 1)
        uv = torch.from_numpy(xy.astype(np.float32)).to(seen.device)
        side = round((seen.shape[1] - REGISTERS) ** 0.5)
        patches = seen[:, REGISTERS:].transpose(1, 2).unflatten(2, (side, side))
        tokens = self.part(TOKENS).mean(looked_up(patches, uv), placed.voxels)
        flow = self.part(LATENT)
        rgb = torch.from_numpy(picture.on_black(flow.visual_side)).permute(2, 0, 1)[None]
        rgb = rgb.to(seen.device)
        return Extras(
            torch.cat([tokens, flow.colours(rgb, uv)], 2),
            torch.cat([torch.zeros_like(tokens), flow.colours(torch.zeros_like(rgb), uv)], 2),
        )


def centres(voxels: Voxels) -> F64:
    """(N, 3) f64 of cells, in the cube of side 1 around the origin."""
    return (voxels.cells.cpu().double().numpy() + 0.5) / voxels.resolution - 0.5


def _likeliest(logits: Tensor) -> Voxels:
    """The few cells that are most likely occupied."""
    least = logits.flatten().topk(LEAST_CELLS).values[-1]
    return Voxels.of(logits >= least)
