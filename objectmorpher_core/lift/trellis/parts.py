"""The parts of a model: built from their description, loaded strictly from safetensors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from .. import LiftError
from .blocks import (
    FlowBlock,
    GaussianDecoder,
    LatentEncoder,
    NetworkPart,
    Norm,
    TimeCode,
    place_code,
    unit_layer_norm,
)
from .configs import (
    GaussianDecoderConfig,
    LatentEncoderConfig,
    LatentFlowConfig,
    StructureDecoderConfig,
    StructureFlowConfig,
    ViewLatentFlowConfig,
    config,
    read_json,
)
from .latent import LatentFlow, ViewLatentFlow

# First stage: where something is. A flow on a dense grid of latents, then a decoder.


class StructureFlow(NetworkPart):
    """Velocity of latents (B, C, R, R, R) that become an object's structure."""

    torso = ("blocks.",)
    pos_emb: Tensor

    def __init__(self, form: StructureFlowConfig) -> None:
        super().__init__()
        if form.patch_size != 1:
            raise LiftError(f"a structure flow in patches of {form.patch_size} is not known")
        self.form = form
        channels = form.model_channels
        self.t_embedder = TimeCode(channels)
        cells = torch.cartesian_prod(*[torch.arange(form.resolution)] * 3)
        self.register_buffer("pos_emb", place_code(cells, channels))
        self.input_layer = nn.Linear(form.in_channels, channels)
        self.blocks = nn.ModuleList(FlowBlock(form) for _ in range(form.num_blocks))
        self.out_layer = nn.Linear(channels, form.out_channels)

    def forward(self, x: Tensor, time: Tensor, context: Tensor) -> Tensor:
        """(B, C, R, R, R) at `time` (B,) in thousandths, with `context` (B, M, D)."""
        own = self.precision
        h = self.input_layer(x.flatten(2).transpose(1, 2)) + self.pos_emb
        h, code, context = h.to(own), self.t_embedder(time).to(own), context.to(own)
        for block in self.blocks:
            h = block(h, code, context)
        h = self.out_layer(unit_layer_norm(h.to(x.dtype)))
        return h.transpose(1, 2).unflatten(2, x.shape[2:])


class ChannelNorm(Norm):
    """Layer norm over the channels of (B, C, ...)."""

    def forward(self, input: Tensor) -> Tensor:
        return super().forward(input.movedim(1, -1)).movedim(-1, 1)


class ResBlock(nn.Module):
    """Two 3 x 3 x 3 convolutions, added to what came in."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.norm1, self.norm2 = ChannelNorm(channels), ChannelNorm(channels)
        self.conv1 = nn.Conv3d(channels, channels, 3, padding=1)
        self.conv2 = nn.Conv3d(channels, channels, 3, padding=1)

    def forward(self, x: Tensor) -> Tensor:
        h = self.conv1(functional.silu(self.norm1(x)))
        return x + self.conv2(functional.silu(self.norm2(h)))


class Doubling(nn.Module):
    """(B, C, R, R, R) to (B, D, 2R, 2R, 2R): eight times the channels, then dealt out."""

    def __init__(self, channels: int, out: int) -> None:
        super().__init__()
        self.conv = nn.Conv3d(channels, 8 * out, 3, padding=1)

    def forward(self, x: Tensor) -> Tensor:
        h = self.conv(x).unflatten(1, (-1, 2, 2, 2))  # (B, D, 2, 2, 2, R, R, R)
        h = h.permute(0, 1, 5, 2, 6, 3, 7, 4)
        return h.flatten(6, 7).flatten(4, 5).flatten(2, 3)


class StructureDecoder(NetworkPart):
    """Latents (B, C, r, r, r) to (B, D, R, R, R): above 0 in the first channel is occupied."""

    torso = ("middle_block.", "blocks.")

    def __init__(self, form: StructureDecoderConfig) -> None:
        super().__init__()
        self.form = form
        widths = form.channels
        self.input_layer = nn.Conv3d(form.latent_channels, widths[0], 3, padding=1)
        self.middle_block = nn.Sequential(
            *(ResBlock(widths[0]) for _ in range(form.num_res_blocks_middle))
        )
        self.blocks = nn.ModuleList()
        for width, wider in zip(widths, (*widths[1:], None), strict=True):
            self.blocks.extend(ResBlock(width) for _ in range(form.num_res_blocks))
            if wider is not None:
                self.blocks.append(Doubling(width, wider))
        self.out_layer = nn.Sequential(
            ChannelNorm(widths[-1]),
            nn.SiLU(),
            nn.Conv3d(widths[-1], form.out_channels, 3, padding=1),
        )

    def forward(self, x: Tensor) -> Tensor:
        own = self.precision
        h = self.middle_block(self.input_layer(x).to(own))
        for block in self.blocks:
            h = block(h)
        return self.out_layer(h.to(x.dtype))


PICKLES = (".pt", ".pth", ".bin", ".ckpt", ".pkl")


@dataclass(frozen=True)
class PublishedKind:
    """The meaning of a published class name."""

    config: type[Any]
    part: Callable[[Any], NetworkPart]


KINDS = {
    "SparseStructureFlowModel": PublishedKind(StructureFlowConfig, StructureFlow),
    "SparseStructureDecoder": PublishedKind(StructureDecoderConfig, StructureDecoder),
    "SLatFlowModel": PublishedKind(LatentFlowConfig, LatentFlow),
    "SLatGaussianDecoder": PublishedKind(GaussianDecoderConfig, GaussianDecoder),
    "SLatEncoder": PublishedKind(LatentEncoderConfig, LatentEncoder),
    "VisualLatentConditioningSLatFlowModel": PublishedKind(ViewLatentFlowConfig, ViewLatentFlow),
}


def build(description: dict[str, Any]) -> NetworkPart:
    """The network of a part's json, with weights as torch makes them. Raises LiftError."""
    name, args = description.get("name"), description.get("args")
    kind = KINDS.get(str(name).removeprefix("Elastic"))
    if kind is None or not isinstance(args, dict):
        raise LiftError(f"a part called {name!r} is not known; known are {', '.join(KINDS)}")
    return kind.part(config(kind.config, args))


def load_part(path: Path, device: torch.device, dtype: torch.dtype) -> NetworkPart:
    """The part whose files are `path`.json and `path`.safetensors, on `device`, to be run.

    Its transformer or convolutions get `dtype`, the rest stays in single precision, as published.
    Every key and shape must be as the description says. Raises LiftError: one sentence.
    """
    with torch.device("meta"):
        part = build(read_json(path.with_name(path.name + ".json")))
    return filled(part, path.with_name(path.name + ".safetensors"), device, dtype)


def filled(part: NetworkPart, path: Path, device: torch.device, dtype: torch.dtype) -> NetworkPart:
    """The part with the weights of a safetensors file, as `load_part` says. Raises LiftError."""
    wanted = part.state_dict()
    lower = part.lower_precision()
    found = {}
    with opened(path) as file:
        shapes = {key: tuple(file.get_slice(key).get_shape()) for key in file.keys()}  # noqa: SIM118
        refuse_differences(path.stem, shapes, {key: tuple(t.shape) for key, t in wanted.items()})
        for key in wanted:
            own = dtype if key in lower else torch.float32
            found[key] = file.get_tensor(key).to(device=device, dtype=own)
    part.load_state_dict(found, strict=True, assign=True)
    part.precision = dtype
    return part.eval().requires_grad_(False)


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """A safetensors file. Nothing else is ever read: other formats can run code."""
    from safetensors import SafetensorError, safe_open

    if not path.exists():
        beside = [end for end in PICKLES if path.with_suffix(end).exists()]
        reason = f"; {path.stem}{beside[0]} could run code and is not read" if beside else ""
        raise LiftError(f"{path} is missing{reason}")
    try:
        with safe_open(str(path), framework="pt") as file:
            yield file
    except (SafetensorError, OSError) as error:
        raise LiftError(f"{path} is damaged: {error}") from error


def refuse_differences(
    name: str, found: dict[str, tuple[int, ...]], wanted: dict[str, tuple[int, ...]]
) -> None:
    """Raises LiftError where the keys or shapes of weights are not those that are wanted."""
    absent, more = sorted(set(wanted) - set(found)), sorted(set(found) - set(wanted))
    if absent or more:
        parts = [f"lacks {absent[0]} and {len(absent) - 1} others"] if absent else []
        parts += [f"has {more[0]} and {len(more) - 1} others too many"] if more else []
        raise LiftError(
            f"the weights {name} are not those of their description: {'; '.join(parts)}"
        )
    for key, shape in wanted.items():
        if found[key] != shape:
            raise LiftError(f"in the weights {name} {key} is {found[key]}, expected {shape}")
