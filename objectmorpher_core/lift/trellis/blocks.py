"""The transformer blocks of all parts. Attributes are named as in the published weights.

A batch has the same cells in each of its items, so cells of a sparse grid are plain tokens
(B, N, C): one block serves dense and sparse grids.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from ...document.gaussians import Gaussians
from .configs import (
    Activations,
    GaussianDecoderConfig,
    LatentEncoderConfig,
    StructureFlowConfig,
    Transformer,
    WindowedConfig,
)
from .voxels import Voxels, Windows

# Attention of bounded memory: over all cells, and inside windows.

SCORES = 1 << 27  # at once: what a device without a fused kernel holds of them


def attend(queries: Tensor, keys: Tensor, values: Tensor, is_key: Tensor | None = None) -> Tensor:
    """(B, Q, H, D) from queries (B, Q, H, D), keys and values (B, K, H, D).

    `is_key` (B, K) bool: which keys count. Queries do not see one another, so they are taken in
    portions where there would be too many scores at once.
    """
    q, k, v = (t.transpose(1, 2) for t in (queries, keys, values))
    mask = None if is_key is None else is_key[:, None, None, :]
    portion = max(1, SCORES // (k.shape[0] * k.shape[1] * k.shape[2]))
    found = [
        functional.scaled_dot_product_attention(some, k, v, attn_mask=mask)
        for some in q.split(portion, dim=2)
    ]
    return torch.cat(found, dim=2).transpose(1, 2)


def attend_in_windows(
    queries: Tensor, keys: Tensor, values: Tensor, windows: tuple[Windows, ...]
) -> Tensor:
    """(B, N, H, D) where each of N cells sees those of its window only."""
    out = torch.empty_like(values)
    batch, _, heads, _ = values.shape
    for group in windows:
        length = group.members.shape[1]
        portion = max(1, SCORES // (batch * heads * length * length))
        for index, there in zip(
            group.members.split(portion), group.is_there.split(portion), strict=True
        ):
            q, k, v = (t[:, index].flatten(0, 1) for t in (queries, keys, values))
            is_key = None if bool(there.all()) else there.repeat(batch, 1)
            found = attend(q, k, v, is_key).unflatten(0, (batch, -1))
            out[:, index[there]] = found[:, there]
    return out


PERIOD = 10_000.0  # longest wave of both codes, over 2 pi
TIME_CODE = 256  # channels of the code of a time
EPSILON = 1e-6  # of the layer norms inside blocks
Attend = Callable[[Tensor, Tensor, Tensor], Tensor]


class NetworkPart(nn.Module):
    """A network of its own file. Its torso may be of lower precision than the rest."""

    torso: tuple[str, ...] = ()  # what the names of its modules begin with
    precision = torch.float32  # of the torso

    def lower_precision(self) -> set[str]:
        """Keys of the weights that follow `precision`: the torso's, but not its norms'."""
        return {
            f"{name}.{key}"
            for name, module in self.named_modules()
            if name.startswith(self.torso) and not isinstance(module, Norm | HeadNorm)
            for key, _ in module.named_parameters(recurse=False)
        }


class Norm(nn.LayerNorm):
    """Layer norm in single precision, whatever it is given; over the last axis."""

    def forward(self, input: Tensor) -> Tensor:
        return super().forward(input.float()).to(input.dtype)


class HeadNorm(nn.Module):
    """Vectors of each head (..., H, D) brought to one length, then scaled."""

    def __init__(self, heads: int, width: int) -> None:
        super().__init__()
        self.gamma = nn.Parameter(torch.ones(heads, width))

    def forward(self, x: Tensor) -> Tensor:
        unit = functional.normalize(x.float(), dim=-1)
        return (unit * self.gamma * math.sqrt(x.shape[-1])).to(x.dtype)


class _Heads(nn.Module):
    """What attention to itself and to a context share."""

    def __init__(self, channels: int, heads: int, has_norm: bool) -> None:
        super().__init__()
        self.heads = heads
        self.to_out = nn.Linear(channels, channels)
        if has_norm:
            self.q_rms_norm = HeadNorm(heads, channels // heads)
            self.k_rms_norm = HeadNorm(heads, channels // heads)
        self.has_norm = has_norm

    def _answer(self, q: Tensor, k: Tensor, v: Tensor, how: Attend) -> Tensor:
        if self.has_norm:
            q, k = self.q_rms_norm(q), self.k_rms_norm(k)
        return self.to_out(how(q, k, v).flatten(2))


class SelfAttention(_Heads):
    """Tokens (B, N, C) that see one another."""

    def __init__(self, channels: int, heads: int, has_norm: bool) -> None:
        super().__init__(channels, heads, has_norm)
        self.to_qkv = nn.Linear(channels, 3 * channels)

    def forward(self, x: Tensor, how: Attend = attend) -> Tensor:
        q, k, v = self.to_qkv(x).unflatten(2, (3, self.heads, -1)).unbind(2)
        return self._answer(q, k, v, how)


class CrossAttention(_Heads):
    """Tokens (B, N, C) that see a context (B, M, D)."""

    def __init__(self, channels: int, context: int, heads: int, has_norm: bool) -> None:
        super().__init__(channels, heads, has_norm)
        self.to_q = nn.Linear(channels, channels)
        self.to_kv = nn.Linear(context, 2 * channels)

    def forward(self, x: Tensor, context: Tensor) -> Tensor:
        q = self.to_q(x).unflatten(2, (self.heads, -1))
        k, v = self.to_kv(context).unflatten(2, (2, self.heads, -1)).unbind(2)
        return self._answer(q, k, v, attend)


class FeedForward(nn.Module):
    """A feed-forward network on each token by itself."""

    def __init__(self, channels: int, hidden: int) -> None:
        super().__init__()
        self.mlp = nn.Sequential(
            nn.Linear(channels, hidden), nn.GELU("tanh"), nn.Linear(hidden, channels)
        )

    def forward(self, x: Tensor) -> Tensor:
        return self.mlp(x)


class TransformerBlock(nn.Module):
    """Attention and feed-forward net, each added to what came in."""

    def __init__(self, form: Transformer) -> None:
        super().__init__()
        channels = form.model_channels
        self.norm1 = Norm(channels, EPSILON, elementwise_affine=False)
        self.norm2 = Norm(channels, EPSILON, elementwise_affine=False)
        self.attn = SelfAttention(channels, form.heads, form.qk_rms_norm)
        self.mlp = FeedForward(channels, form.hidden)

    def forward(self, x: Tensor, how: Attend = attend) -> Tensor:
        x = x + self.attn(self.norm1(x), how)
        return x + self.mlp(self.norm2(x))


class FlowBlock(nn.Module):
    """A block with a context, shifted and scaled by the step's time (Peebles & Xie)."""

    def __init__(self, form: StructureFlowConfig) -> None:
        super().__init__()
        channels, heads = form.model_channels, form.heads
        self.norm1 = Norm(channels, EPSILON, elementwise_affine=False)
        self.norm2 = Norm(channels, EPSILON)
        self.norm3 = Norm(channels, EPSILON, elementwise_affine=False)
        self.self_attn = SelfAttention(channels, heads, form.qk_rms_norm)
        self.cross_attn = CrossAttention(
            channels, form.cond_channels, heads, form.qk_rms_norm_cross
        )
        self.mlp = FeedForward(channels, form.hidden)
        self.adaLN_modulation = nn.Sequential(nn.SiLU(), nn.Linear(channels, 6 * channels))

    def forward(self, x: Tensor, time: Tensor, context: Tensor) -> Tensor:
        """(B, N, C) from tokens (B, N, C), time code (B, C) and context (B, M, D)."""
        parts = self.adaLN_modulation(time)[:, None].chunk(6, dim=2)
        shift, scale, gate, shift2, scale2, gate2 = parts
        x = x + gate * self.self_attn(self.norm1(x) * (1 + scale) + shift)
        x = x + self.cross_attn(self.norm2(x), context)
        return x + gate2 * self.mlp(self.norm3(x) * (1 + scale2) + shift2)


class TimeCode(nn.Module):
    """A time (B,) in thousandths as (B, C)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.mlp = nn.Sequential(
            nn.Linear(TIME_CODE, channels), nn.SiLU(), nn.Linear(channels, channels)
        )

    def forward(self, time: Tensor) -> Tensor:
        waves = time.float()[:, None] * self.rates(TIME_CODE // 2, time.device)
        code = torch.cat([waves.cos(), waves.sin()], 1)
        return self.mlp(code.to(next(self.parameters()).dtype))

    def rates(self, count: int, device: torch.device) -> Tensor:
        """(count,) radians per thousandth."""
        return _rates(count, device)


def place_code(cells: Tensor, channels: int) -> Tensor:
    """(N, channels) waves along each axis, for cells (N, 3); 0 in channels that are left over."""
    return wave_code(cells.float(), _rates(channels // 6, cells.device), channels)


def wave_code(points: Tensor, rates: Tensor, channels: int) -> Tensor:
    """(..., channels) waves of the given rates (R,) along each axis of points (..., 3)."""
    waves = points[..., None] * rates
    code = torch.cat([waves.sin(), waves.cos()], -1).flatten(-2)
    return functional.pad(code, (0, channels - code.shape[-1]))


def _rates(count: int, device: torch.device) -> Tensor:
    """(count,) radians per unit."""
    steps = torch.arange(count, dtype=torch.float32, device=device) / count
    return torch.exp(-math.log(PERIOD) * steps)


def unit_layer_norm(x: Tensor) -> Tensor:
    """Over the last axis, without parameters, with torch's own epsilon: what heads were given."""
    return functional.layer_norm(x, x.shape[-1:])


# Transformers whose attention stays in windows: the decoder to Gaussians, and CUPID's encoder.

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
        start = torch.from_numpy(even_points(count)) * 2 - 1
        self.register_buffer(
            "offset_perturbation", torch.atanh(start / self.activations.voxel_size)
        )

    def gaussians(self, raw: Tensor, voxels: Voxels) -> Gaussians:
        """Return the Gaussians of an output (N, D), in the unit cube around the origin, z up."""
        how = self.activations
        said = quantities(raw, how, QUANTITIES)
        offsets = said["_xyz"] + (self.offset_perturbation if how.perturb_offset else 0.0)
        within = torch.tanh(offsets) * (0.5 * how.voxel_size)
        means = (voxels.cells[:, None] + 0.5 + within) / voxels.resolution - 0.5
        return as_gaussians(said, means, how)


def quantities(raw: Tensor, how: Activations, widths: Mapping[str, int]) -> dict[str, Tensor]:
    """Name -> (N, G, width) of an output (N, D) for G Gaussians at each of N places."""
    sizes = [width * how.num_gaussians for width in widths.values()]
    parts = zip(widths.items(), raw.float().split(sizes, dim=1), strict=True)
    return {
        name: how.lr.get(name, 1.0) * part.unflatten(1, (how.num_gaussians, width))
        for (name, width), part in parts
    }


def as_gaussians(said: Mapping[str, Tensor], means: Tensor, how: Activations) -> Gaussians:
    """The Gaussians of `quantities` at means (N, G, 3). Raises ValueError: not finite."""
    upright = said["_rotation"] + torch.eye(4, device=means.device)[0]
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


def even_points(count: int) -> np.ndarray:
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
