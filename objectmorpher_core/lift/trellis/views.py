"""CUPID's second flow: each cell also gets what the picture shows where the cell is seen."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor, nn
from torch.nn import functional

from .configs import ViewLatentFlowConfig
from .latent import LatentFlow


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
