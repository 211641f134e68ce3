"""Second stage: what it is like. A flow on the latents of the occupied cells."""

from __future__ import annotations

import math
from dataclasses import replace

import torch
from torch import Tensor, nn
from torch.nn import functional

from .. import LiftError
from .blocks import EPSILON, FlowBlock, NetworkPart, Norm, TimeCode, place_code, unit_layer_norm
from .configs import LatentFlowConfig, ViewLatentFlowConfig
from .voxels import Voxels, pooled


class Kernel(nn.Module):
    """Weights of a 3 x 3 x 3 convolution that is defined on occupied cells only."""

    def __init__(self, channels: int, out: int) -> None:
        super().__init__()
        # As spconv stores them: (out, x, y, z, in), and neighbours not flipped, as in Conv3d.
        self.weight = nn.Parameter(torch.empty(out, 3, 3, 3, channels))
        self.bias = nn.Parameter(torch.zeros(out))
        nn.init.normal_(self.weight, std=1 / math.sqrt(27 * channels))

    def forward(self, x: Tensor, voxels: Voxels) -> Tensor:
        """(B, N, D) from (B, N, C): what a dense convolution gives with 0 where nothing is."""
        kernels = self.weight.flatten(1, 3).unbind(1)  # 27 of (D, C)
        out = self.bias.float().repeat(x.shape[0], len(voxels), 1)  # sums in single precision
        for kernel, (rows, columns) in zip(kernels, voxels.neighbours, strict=True):
            # Whole rows are copied, which indexing does not know; a row comes once, so that the
            # order in which a GPU adds does not matter.
            out.index_add_(1, rows, (x.index_select(1, columns) @ kernel.T).float())
        return out.to(x.dtype)


class SparseConvolution(nn.Module):
    """A `Kernel` under the name that the published weights give it."""

    def __init__(self, channels: int, out: int) -> None:
        super().__init__()
        self.conv = Kernel(channels, out)

    def forward(self, x: Tensor, voxels: Voxels) -> Tensor:
        return self.conv(x, voxels)


class SparseResBlock(nn.Module):
    """Two convolutions at the time that the code says, added to what came in."""

    def __init__(self, channels: int, out: int, code: int) -> None:
        super().__init__()
        self.norm1 = Norm(channels, EPSILON)
        self.norm2 = Norm(out, EPSILON, elementwise_affine=False)
        self.conv1, self.conv2 = SparseConvolution(channels, out), SparseConvolution(out, out)
        self.emb_layers = nn.Sequential(nn.SiLU(), nn.Linear(code, 2 * out))
        self.skip_connection = nn.Linear(channels, out) if channels != out else nn.Identity()

    def forward(self, x: Tensor, voxels: Voxels, code: Tensor) -> Tensor:
        scale, shift = self.emb_layers(code)[:, None].chunk(2, dim=2)
        h = self.conv1(functional.silu(self.norm1(x)), voxels)
        h = functional.silu(self.norm2(h) * (1 + scale) + shift)
        return self.conv2(h, voxels) + self.skip_connection(x)


class LatentFlow(NetworkPart):
    """Velocity of latents (B, N, C) of N cells.

    Convolutions halve the grid, the transformer works there, and convolutions lead back.
    """

    torso = ("input_blocks.", "blocks.", "out_blocks.")

    def __init__(self, form: LatentFlowConfig) -> None:
        super().__init__()
        self.form = form
        widths, code = form.io_block_channels, form.model_channels
        if 2 ** len(widths) != form.patch_size:
            raise LiftError(
                f"{len(widths)} halvings of the grid do not make patches of {form.patch_size}"
            )
        self.t_embedder = TimeCode(code)
        self.input_layer = nn.Linear(form.in_channels, widths[0] if widths else code)
        self.input_blocks = nn.ModuleList()
        more = form.num_io_res_blocks - 1
        for width, wider in zip(widths, (*widths, code)[1:], strict=True):
            self.input_blocks.extend(SparseResBlock(width, width, code) for _ in range(more))
            self.input_blocks.append(SparseResBlock(width, wider, code))
        self.blocks = nn.ModuleList(FlowBlock(form) for _ in range(form.num_blocks))
        self.out_blocks = nn.ModuleList()
        twice = 2 if form.use_skip_connection else 1
        for width, before in zip(widths[::-1], (code, *widths[::-1])[:-1], strict=True):
            self.out_blocks.append(SparseResBlock(twice * before, width, code))
            self.out_blocks.extend(SparseResBlock(twice * width, width, code) for _ in range(more))
        self.out_layer = nn.Linear(widths[0] if widths else code, form.out_channels)

    def forward(self, x: Tensor, time: Tensor, context: Tensor, voxels: Voxels) -> Tensor:
        """(B, N, C) at `time` (B,) in thousandths, with `context` (B, M, D)."""
        own = self.precision
        code, context = self.t_embedder(time).to(own), context.to(own)
        h, grids, skips, every = (
            self.input_layer(x).to(own),
            [voxels],
            [],
            self.form.num_io_res_blocks,
        )
        for i, block in enumerate(self.input_blocks):
            if i % every == every - 1:
                h = pooled(h, grids[-1])
                grids.append(grids[-1].halved.voxels)
            h = block(h, grids[-1], code)
            skips.append(h)
        h = h + place_code(grids[-1].cells, h.shape[2]).to(own)
        for block in self.blocks:
            h = block(h, code, context)
        for i, block in enumerate(self.out_blocks):
            if self.form.use_skip_connection:
                h = torch.cat([h, skips.pop()], 2)
            if i % every == 0:
                grids.pop()
                h = h[:, grids[-1].halved.parents]
            h = block(h, grids[-1], code)
        return self.out_layer(unit_layer_norm(h).to(x.dtype))


# CUPID's second flow: each cell also gets what the picture shows where the cell is seen.


class ViewLatentFlow(LatentFlow):
    """A `LatentFlow` whose inputs are latents, the picture's latents and its colours."""

    def __init__(self, form: ViewLatentFlowConfig) -> None:
        super().__init__(replace(form, in_channels=form.all_channels))
        self.visual_side = form.visual_feat_resolution  # px
        kernel, before = form.visual_conv_kernel_size, form.visual_input_channels
        self.visual_conv_blocks = nn.ModuleList()
        for i, width in enumerate(form.visual_feat_channels):  # each after the first halves
            stride = 1 if i == 0 else 2
            self.visual_conv_blocks.append(
                nn.Conv2d(before, width, kernel, stride, padding=kernel // 2)
            )
            before = width

    def colours(self, picture: Tensor, uv: Tensor) -> Tensor:
        """(1, N, E) of what is seen at `uv` (N, 2), from a picture (1, 3, S, S) in [0, 1]."""
        found, h = [], picture
        for block in self.visual_conv_blocks:
            h = block(h)
            found.append(looked_up(h, uv))
        return torch.cat(found, 2)


def looked_up(grid: Tensor, uv: Tensor) -> Tensor:
    """(1, N, C) of a grid (1, C, S, S) at places (N, 2) in it, whose side is 1."""
    found = functional.grid_sample(grid, 2 * uv[None, None] - 1, align_corners=False)
    return found[:, :, 0].transpose(1, 2)
