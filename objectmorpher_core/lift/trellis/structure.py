"""First stage: where something is. A flow on a dense grid of latents, then a decoder."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from .. import LiftError
from .blocks import FlowBlock, NetworkPart, Norm, TimeCode, place_code, unit_layer_norm
from .configs import StructureDecoderConfig, StructureFlowConfig


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
