"""TripoSplat's flow and decoder. Attributes are named as in the published weights."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import torch
from torch import Tensor, nn
from torch.nn import functional

from ...document.gaussians import Gaussians
from ..trellis.blocks import (
    EPSILON,
    QUANTITIES,
    CrossAttention,
    FeedForward,
    HeadNorm,
    NetworkPart,
    Norm,
    SelfAttention,
    TimeCode,
    as_gaussians,
    attend,
    even_points,
    quantities,
    unit_layer_norm,
    wave_code,
)
from ..trellis.configs import Activations


@dataclass(frozen=True, kw_only=True)
class Form:
    """Sizes, as published."""

    width: int = 1024
    heads: int = 16
    tokens: int = 8192  # of the latents
    channels: int = 16  # of each
    camera: int = 5  # numbers that say how the picture shows it; which ones is not published
    seen: int = 1280  # channels of the encoder's tokens
    drawn: int = 128  # of the autoencoder's
    blocks: int = 24
    refiners: int = 2
    octree_blocks: int = 4
    gaussian_blocks: int = 16
    per_point: int = 32  # Gaussians


FORM = Form()
HIDDEN = 4  # x width: inside a feed-forward net
SEED = 123  # of the points that tell the latents apart
OFFSET = 0.05  # of a Gaussian from its point, where the network says 0
LEVELS = 8  # of the octree
LEAST, MOST = 1.0, 16.0  # rates with which learned places turn, before training


def forms(form: Form) -> Activations:
    """How the decoder's numbers become Gaussians; `voxel_size` is of offsets."""
    return Activations(
        lr={"_xyz": 1.0, "_features_dc": 1.0, "_opacity": 1.0, "_scaling": 1.0, "_rotation": 0.1},
        perturb_offset=True, voxel_size=1.5, num_gaussians=form.per_point,
        filter_kernel_size=9e-4, scaling_bias=4e-3, opacity_bias=0.1,
        scaling_activation="softplus",
    )  # fmt: skip


class Places(nn.Module):
    """Angles (B, N, H, D / 2) by which each head turns its vectors, out of tokens (B, N, C)."""

    def __init__(self, form: Form) -> None:
        super().__init__()
        inner, third = form.width // 8, form.width // form.heads // 6
        self.heads = form.heads
        self.norm = Norm(form.width)
        self.gate_map = nn.Linear(form.width, inner, bias=False)
        self.content_map = nn.Linear(form.width, inner, bias=False)
        self.final_map = nn.Linear(inner, 3 * form.heads, bias=False)
        # By its name: other libraries replace `linspace` while they load, and torch.device may
        # have noted theirs as the one that it leads elsewhere.
        device = torch.get_default_device()
        for axis, count in enumerate((third, third, form.width // form.heads // 2 - 2 * third)):
            rates = torch.linspace(LEAST, MOST, count, device=device)
            self.register_parameter(f"freqs_{axis}", nn.Parameter(rates))

    def forward(self, x: Tensor) -> Tensor:
        x = self.norm(x)
        at = self.final_map(functional.silu(self.gate_map(x)) * self.content_map(x))
        at = at.unflatten(2, (self.heads, 3, 1)).float()
        rates = (self.freqs_0, self.freqs_1, self.freqs_2)
        return torch.cat([at[..., i, :] * r.float() for i, r in enumerate(rates)], -1) * torch.pi


class TurnedAttention(nn.Module):
    """Tokens (B, N, C) that see one another; queries and keys are turned by their places."""

    def __init__(self, form: Form) -> None:
        super().__init__()
        self.heads = form.heads
        self.qkv = nn.Linear(form.width, 3 * form.width)
        self.out = nn.Linear(form.width, form.width)
        self.q_norm, self.k_norm = (
            HeadNorm(form.heads, form.width // form.heads) for _ in range(2)
        )

    def forward(self, x: Tensor, angles: Tensor) -> Tensor:
        q, k, v = self.qkv(x).unflatten(2, (3, self.heads, -1)).unbind(2)
        turns = angles.cos(), angles.sin()
        q, k = self.q_norm(_turned(q, *turns)), self.k_norm(_turned(k, *turns))
        return self.out(attend(q, k, v).flatten(2))


def _turned(x: Tensor, cos: Tensor, sin: Tensor) -> Tensor:
    """Each two neighbouring channels as a vector in a plane."""
    a, b = x.float().unflatten(-1, (-1, 2)).unbind(-1)
    return torch.stack([a * cos - b * sin, a * sin + b * cos], -1).flatten(-2).to(x.dtype)


class TurnedBlock(nn.Module):
    """Attention and feed-forward net; `is_timed`: shifted and scaled by the step's time."""

    def __init__(self, form: Form, is_timed: bool) -> None:
        super().__init__()
        self.norm1, self.norm2 = (
            Norm(form.width, EPSILON, elementwise_affine=not is_timed) for _ in range(2)
        )
        self.attn = TurnedAttention(form)
        self.mlp = FeedForward(form.width, HIDDEN * form.width)
        if is_timed:
            self.shift_table = nn.Parameter(torch.randn(1, 6 * form.width) / form.width**0.5)

    def forward(self, x: Tensor, angles: Tensor, timed: Tensor | None = None) -> Tensor:
        if timed is None:
            x = x + self.attn(self.norm1(x), angles)
            return x + self.mlp(self.norm2(x))
        parts = (timed + self.shift_table)[:, None].chunk(6, 2)
        shift, scale, gate, shift2, scale2, gate2 = parts
        x = x + gate * self.attn(self.norm1(x) * (1 + scale) + shift, angles)
        return x + gate2 * self.mlp(self.norm2(x) * (1 + scale2) + shift2)


class Flow(NetworkPart):
    """Velocity of latents and of a camera that belong to a picture.

    They come packed as (B, T + 1, C): the last row is the camera, and zeros.
    """

    torso = ("",)  # all but its norms

    def __init__(self, form: Form) -> None:
        super().__init__()
        self.form, width = form, form.width

        def blocks(count: int, is_timed: bool) -> nn.ModuleList:
            return nn.ModuleList(TurnedBlock(form, is_timed) for _ in range(count))

        def places(count: int) -> nn.ModuleList:
            return nn.ModuleList(Places(form) for _ in range(count))

        self.t_embedder = TimeCode(width)
        self.adaLN_modulation = nn.Sequential(nn.SiLU(), nn.Linear(width, 6 * width))
        self.input_layer = nn.Linear(form.channels, width)
        self.cond_embedder = nn.Linear(form.seen, width)
        self.cond_embedder2 = nn.Linear(form.drawn, width)
        self.noise_repo_layers = places(form.refiners)
        self.context_repo_layers = places(form.refiners)
        self.repo_layers = places(form.blocks)
        self.noise_refiner = blocks(form.refiners, True)
        self.context_refiner = blocks(form.refiners, False)
        self.cam_refiner = _Named(
            nn.Linear(form.camera, width), nn.GELU("tanh"), nn.Linear(width, width)
        )
        self.blocks = blocks(form.blocks, True)
        self.shift_table = nn.Parameter(torch.randn(1, 2, width) / width**0.5)
        self.out_layer = nn.Linear(width, form.channels)
        self.cam_out_layer = nn.Linear(width, form.camera)

    def forward(self, x: Tensor, time: Tensor, condition: Tensor) -> Tensor:
        """At `time` (B,) in thousandths; `condition` (B, M, seen + drawn) of the picture."""
        own, count = self.precision, x.shape[1] - 1
        latents, camera = x[:, :-1].to(own), x[:, -1:, : self.form.camera].to(own)
        seen, drawn = condition.to(own).split((self.form.seen, self.form.drawn), 2)
        code = self.t_embedder(time)
        timed = self.adaLN_modulation(code)
        h = self.input_layer(latents) + _marks(count, self.form.width).to(x.device, own)
        for block, places in zip(self.noise_refiner, self.noise_repo_layers, strict=True):
            h = block(h, places(h), timed)
        context = self.cond_embedder(seen) + self.cond_embedder2(drawn)
        for block, places in zip(self.context_refiner, self.context_repo_layers, strict=True):
            context = block(context, places(context))
        h = torch.cat([h, context, self.cam_refiner(camera)], 1)
        for block, places in zip(self.blocks, self.repo_layers, strict=True):
            h = block(h, places(h), timed)
        ends = unit_layer_norm(torch.cat([h[:, :count], h[:, -1:]], 1).float()).to(own)
        shift, scale = (self.shift_table.to(own) + code[:, None]).chunk(2, 1)
        ends = ends * (1 + scale) + shift
        camera = self.cam_out_layer(ends[:, -1:])
        camera = functional.pad(camera, (0, self.form.channels - self.form.camera))
        return torch.cat([self.out_layer(ends[:, :-1]), camera], 1).to(x.dtype)


class _Named(nn.Module):
    """Layers under the name that the weights give them."""

    def __init__(self, *layers: nn.Module) -> None:
        super().__init__()
        self.mlp = nn.Sequential(*layers)

    def forward(self, x: Tensor) -> Tensor:
        return self.mlp(x)


@cache
def _marks(count: int, channels: int) -> Tensor:
    """(count, channels) that tell latents apart: waves of points that fill a cube evenly."""
    with torch.device("cpu"):  # where Sobol's points are drawn
        points = torch.quasirandom.SobolEngine(3, scramble=True, seed=SEED).draw(count)
        waves, octaves = channels // 6, 16
        more = torch.arange(max(0, waves - octaves)) / max(waves - octaves, 1) * octaves
        rates = torch.cat([torch.arange(octaves), more])[:waves].float().exp2() * (2 * torch.pi)
    return wave_code(points, rates, channels)


class LevelCode(TimeCode):
    """How many cells (B,) a level of the octree has along an edge, as (B, C)."""

    def rates(self, count: int, device: torch.device) -> Tensor:
        """(count,) radians per cell."""
        steps = torch.arange(count, dtype=torch.float32, device=device) / count
        return torch.exp(-math.log(1024) * steps) * (2 * torch.pi)


class OctreeBlock(nn.Module):
    """Attention to the latents and feed-forward net, shifted and scaled by the level."""

    def __init__(self, form: Form) -> None:
        super().__init__()
        self.norm1, self.norm2 = (
            Norm(form.width, EPSILON, elementwise_affine=False) for _ in range(2)
        )
        self.cross_attn = CrossAttention(form.width, form.channels, form.heads, True)
        self.mlp = FeedForward(form.width, HIDDEN * form.width)

    def forward(self, x: Tensor, level: Tensor, latents: Tensor) -> Tensor:
        shift, scale, gate, shift2, scale2, gate2 = level[:, None].chunk(6, 2)
        x = x + gate * self.cross_attn(self.norm1(x) * (1 + scale) + shift, latents)
        return x + gate2 * self.mlp(self.norm2(x) * (1 + scale2) + shift2)


class PointBlock(nn.Module):
    """Attention among points and to the latents, and a feed-forward net."""

    def __init__(self, form: Form) -> None:
        super().__init__()
        self.norm1 = Norm(form.width, EPSILON, elementwise_affine=False)
        self.norm2 = Norm(form.width, EPSILON)
        self.norm3 = Norm(form.width, EPSILON, elementwise_affine=False)
        self.self_attn = SelfAttention(form.width, form.heads, True)
        self.cross_attn = CrossAttention(form.width, form.channels, form.heads, True)
        self.mlp = FeedForward(form.width, HIDDEN * form.width)

    def forward(self, x: Tensor, latents: Tensor) -> Tensor:
        x = x + self.self_attn(self.norm1(x))
        x = x + self.cross_attn(self.norm2(x), latents)
        return x + self.mlp(self.norm3(x))


class _OfPoints(nn.Module):
    """What is said at points (B, N, 3) of the unit cube."""

    def __init__(self, form: Form, blocks: list[nn.Module], out: int) -> None:
        super().__init__()
        self.width = form.width
        self.in_proj = nn.Linear(3, form.width)
        self.input_layer = nn.Linear(form.width, form.width)
        self.blocks = nn.ModuleList(blocks)
        self.out_proj = nn.Linear(form.width, out)

    def entered(self, points: Tensor) -> Tensor:
        own = self.in_proj.weight.dtype
        octaves = torch.linspace(0, 10, self.width // 6, device=points.device)
        code = wave_code(points.float(), octaves.exp2() * torch.pi, self.width)
        return self.input_layer(self.in_proj(points.to(own)) + code.to(own))

    def left(self, h: Tensor) -> Tensor:
        return self.out_proj(unit_layer_norm(h.float()).to(h.dtype))


class Octree(_OfPoints):
    """Logits (B, N, 8) of where in a cell around each point there is how much."""

    def __init__(self, form: Form) -> None:
        super().__init__(form, [OctreeBlock(form) for _ in range(form.octree_blocks)], 8)
        self.l_embedder = LevelCode(form.width)
        self.adaLN_modulation = nn.Sequential(nn.SiLU(), nn.Linear(form.width, 6 * form.width))

    def forward(self, points: Tensor, edge: int, latents: Tensor) -> Tensor:
        """Of cells, as many as `edge` along an edge once they are parted."""
        level = torch.full((len(points),), edge, device=points.device)
        h, code = self.entered(points), self.adaLN_modulation(self.l_embedder(level))
        for block in self.blocks:
            h = block(h, code, latents)
        return self.left(h)


class Points(_OfPoints):
    """Numbers (B, N, D) that make up the Gaussians of each point."""

    points_offset_perturbation: Tensor
    base_offset_scale: Tensor

    def __init__(self, form: Form) -> None:
        self.how, self.widths = forms(form), {**QUANTITIES, "_offset_scale": 1}
        out = form.per_point * sum(self.widths.values())
        super().__init__(form, [PointBlock(form) for _ in range(form.gaussian_blocks)], out)
        start = torch.from_numpy(even_points(form.per_point)) * 2 - 1
        start = torch.atanh(start / self.how.voxel_size)
        self.register_buffer("points_offset_perturbation", start)
        self.register_buffer("base_offset_scale", torch.tensor(math.log(math.expm1(OFFSET))))

    def forward(self, points: Tensor, latents: Tensor) -> Tensor:
        h = self.entered(points)
        for block in self.blocks:
            h = block(h, latents)
        return self.left(h)

    def gaussians(self, raw: Tensor, points: Tensor) -> Gaussians:
        """The Gaussians of an output (N, D) for points (N, 3), around the origin, z up."""
        said = quantities(raw, self.how, self.widths)
        within = torch.tanh(said["_xyz"] + self.points_offset_perturbation.float())
        far = functional.softplus(said["_offset_scale"] + self.base_offset_scale.float())
        means = points[:, None] + within * (0.5 * self.how.voxel_size) * far - 0.5
        return as_gaussians(said, means, self.how)


class Decoder(NetworkPart):
    """Latents (1, T, C) to as many Gaussians as are asked for."""

    torso = ("",)

    def __init__(self, form: Form) -> None:
        super().__init__()
        self.form = form
        self.octree, self.gs = Octree(form), Points(form)

    def decode(self, latents: Tensor, count: int, noise: torch.Generator) -> Gaussians:
        """About `count` Gaussians. Raises ValueError where they are not finite."""
        latents = latents.to(self.precision)
        points = self.drawn(latents, max(1, count // self.form.per_point), noise)
        return self.gs.gaussians(self.gs(points[None], latents)[0], points)

    def drawn(self, latents: Tensor, count: int, noise: torch.Generator) -> Tensor:
        """(count, 3) points of the unit cube, drawn level by level from what the octree says."""
        device = latents.device
        corners = torch.cartesian_prod(*[torch.arange(2)] * 3).flip(1).to(device)  # x fastest
        cells = torch.zeros(1, 3, dtype=torch.long, device=device)
        counts = torch.full((1,), count, dtype=torch.long, device=device)
        for level in range(LEVELS):
            edge = 1 << level
            logits = self.octree((cells[None] + 0.5) / edge, 2 * edge, latents)[0]
            start = torch.rand(len(cells), 1, generator=noise).to(device)
            shares = dealt(logits.double().softmax(-1), counts, start)
            cells = (2 * cells[:, None] + corners).flatten(0, 1)
            counts = shares.flatten()
            cells, counts = cells[counts > 0], counts[counts > 0]
        cells = cells.repeat_interleave(counts, 0)
        inside = torch.rand(cells.shape, generator=noise).to(device)
        return (cells + inside) / (1 << LEVELS)


def dealt(shares: Tensor, counts: Tensor, start: Tensor) -> Tensor:
    """(N, 8) counts whose sums are `counts` (N,), nearly as the shares (N, 8) are.

    Systematic sampling: evenly spaced draws, the first of them at `start` (N, 1) of a spacing.
    """
    sums = shares.cumsum(-1) * counts[:, None]
    upto = ((sums - start).floor() + 1).clamp(min=0).minimum(counts[:, None])
    upto[:, -1] = counts
    return upto.diff(dim=-1, prepend=torch.zeros_like(upto[:, :1])).long()
