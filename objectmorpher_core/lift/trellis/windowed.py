"""Transformers whose attention stays in windows: the decoder to Gaussians, and CUPID's encoder."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from ...document.gaussians import Gaussians
from .blocks import NetworkPart, TransformerBlock, attend_in_windows, place_code, unit_layer_norm
from .configs import Activations, GaussianDecoderConfig, LatentEncoderConfig, WindowedConfig
from .voxels import Voxels

SH_C0 = 0.28209479177387814  # the constant spherical harmonic
QUANTITIES = {  # numbers of a Gaussian, in the order in which the decoder says them
    "_xyz": 3, "_features_dc": 3, "_scaling": 3, "_rotation": 4, "_opacity": 1,
}  # fmt: skip


class Windowed(NetworkPart):
    """Features (B, N, C) of N cells to (B, N, D); every second block's windows lie between."""

    torso = ("blocks.",)

    def __init__(self, form: WindowedConfig, channels: int, out: int) -> None:
        super().__init__()
        self.form = form
        self.input_layer = nn.Linear(channels, form.model_channels)
        self.blocks = nn.ModuleList(TransformerBlock(form) for _ in range(form.num_blocks))
        self.out_layer = nn.Linear(form.model_channels, out)

    def forward(self, x: Tensor, voxels: Voxels) -> Tensor:
        own = self.precision
        h = self.input_layer(x) + place_code(voxels.cells, self.form.model_channels)
        h, size = h.to(own), self.form.window_size
        for i, block in enumerate(self.blocks):
            windows = voxels.windows(size, size // 2 * (i % 2))
            h = block(h, lambda q, k, v, w=windows: attend_in_windows(q, k, v, w))
        return self.out_layer(unit_layer_norm(h.to(x.dtype)))


class LatentEncoder(Windowed):
    """Features of cells, such as a picture's tokens, to latents."""

    def __init__(self, form: LatentEncoderConfig) -> None:
        super().__init__(form, form.in_channels, 2 * form.latent_channels)

    def mean(self, x: Tensor, voxels: Voxels) -> Tensor:
        """(B, N, C): the middle of the distribution, whose width is the other half."""
        return self(x, voxels).chunk(2, dim=2)[0]


class GaussianDecoder(Windowed):
    """Latents of cells to what makes up their Gaussians."""

    offset_perturbation: Tensor

    def __init__(self, form: GaussianDecoderConfig) -> None:
        count = form.representation_config.num_gaussians
        super().__init__(form, form.latent_channels, count * sum(QUANTITIES.values()))
        self.activations = form.representation_config
        start = torch.from_numpy(_even_points(count)) * 2 - 1
        self.register_buffer(
            "offset_perturbation", torch.atanh(start / self.activations.voxel_size)
        )

    def gaussians(self, raw: Tensor, voxels: Voxels) -> Gaussians:
        """Return the Gaussians of an output (N, D), in the unit cube around the origin, z up."""
        how = self.activations
        sizes = [width * how.num_gaussians for width in QUANTITIES.values()]
        parts = zip(QUANTITIES, raw.float().split(sizes, dim=1), strict=True)
        said = {
            name: how.lr[name] * part.unflatten(1, (how.num_gaussians, QUANTITIES[name]))
            for name, part in parts
        }
        offsets = said["_xyz"] + (self.offset_perturbation if how.perturb_offset else 0.0)
        within = torch.tanh(offsets) * (0.5 * how.voxel_size)
        means = (voxels.cells[:, None] + 0.5 + within) / voxels.resolution - 0.5
        upright = said["_rotation"] + torch.eye(4, device=raw.device)[0]
        opacities = said["_opacity"][..., 0] + math.log(how.opacity_bias / (1 - how.opacity_bias))
        arrays = (
            means, functional.normalize(upright, dim=-1), _scales(said["_scaling"], how),
            torch.sigmoid(opacities), (0.5 + SH_C0 * said["_features_dc"]).clamp(0, 1),
        )  # fmt: skip
        return Gaussians(*(a.flatten(0, 1).cpu().numpy() for a in arrays))


def _scales(said: Tensor, how: Activations) -> Tensor:
    """Standard deviations; never below the filter with which the network was trained."""
    if how.scaling_activation == "exp":
        own = torch.exp(said + math.log(how.scaling_bias))
    else:
        own = functional.softplus(said + math.log(math.expm1(how.scaling_bias)))
    return torch.sqrt(own * own + how.filter_kernel_size**2)


def _even_points(count: int) -> np.ndarray:
    """Hammersley's points (count, 3) f32 in the unit cube."""
    points = np.empty((count, 3))
    points[:, 0] = np.arange(count) / count
    for column, base in ((1, 2), (2, 3)):
        rest, share, value = np.arange(count), 1.0, np.zeros(count)
        while rest.any():
            share /= base
            value += share * (rest % base)
            rest = rest // base
        points[:, column] = value
    return points.astype(np.float32)
