"""PixelHacker (Xu et al. 2025, arXiv 2504.20438) in plain PyTorch: a diffusion that fills holes.

The paper's own inpainter (3.3). Parameters are named as in the published weights (Apache-2.0):
https://github.com/hustvl/PixelHacker. The network is a latent diffusion U-Net whose self-attention
is gated and linear; instead of a text it is told twenty numbers: ten for what is to be filled in,
ten for nothing. DDIM steps (Song et al. 2020) lead from noise to a picture, guided by the masked
photo. Settings and order are those of the published pipeline, but for where the noise starts from:
there it is the photo with what the hole hides, which would shine through; here its hole is smooth.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from ...base.arrays import F32, Mask
from ...base.progress import Progress
from ...models import ModelError

IDS = 20  # half of them what is to be filled in, half of them nothing
PUBLISHED: Mapping[str, Any] = {  # beside diffusers' defaults
    "sample_size": 64, "in_channels": 9, "out_channels": 4, "attention_head_dim": 8,
    "cross_attention_dim": 768, "encoder_hid_dim": 3072,
}  # fmt: skip
OTHER = (  # what a config may say besides
    "block_out_channels", "layers_per_block", "down_block_types", "up_block_types",
    "norm_num_groups",
)  # fmt: skip
CONFIG = "config.json"


class PixelHacker(nn.Module):
    """Predicts the noise of latents. float32, but for the U-Net, which may be of less."""

    def __init__(self, config: Mapping[str, Any]) -> None:
        from diffusers.models.unets.unet_2d_condition import UNet2DConditionModel

        super().__init__()
        self.embedding_layer = nn.Embedding(IDS, int(config["encoder_hid_dim"]))
        self.diff_model: Any = UNet2DConditionModel(**config)
        for block in self.diff_model.modules():
            if type(block).__name__ == "BasicTransformerBlock":
                old = block.attn1
                block.attn1 = GatedLinearAttention(old.to_q.in_features, old.heads)

    def forward(self, latents: Tensor, time: Tensor, ids: Tensor) -> Tensor:
        """(B, 4, h, w) of latents (B, 9, h, w) at a `time`; ids (B, IDS / 2)."""
        told = self.embedding_layer(ids).to(latents.dtype)
        return self.diff_model(latents, time, told, return_dict=False)[0]


def read_config(folder: Path) -> dict[str, Any]:
    """Read the U-Net's config.json; the published values where there is none.

    Raises ModelError.
    """
    at = folder / CONFIG
    if not at.exists():
        return dict(PUBLISHED)
    try:
        said = json.loads(at.read_text(encoding="utf-8"))
        return dict(PUBLISHED) | {key: said[key] for key in (*PUBLISHED, *OTHER) if key in said}
    except (OSError, ValueError, TypeError) as error:
        raise ModelError(f"{folder.name}/{CONFIG} cannot be read") from error


def build(config: Mapping[str, Any]) -> PixelHacker:
    """The network with weights as torch makes them. Raises ModelError."""
    try:
        return PixelHacker(config)
    except (ValueError, TypeError, KeyError, RuntimeError) as error:
        raise ModelError("PixelHacker's config describes no network") from error


def load(at: Path, device: str, number: torch.dtype) -> PixelHacker:
    """The network of a safetensors file; every key and shape has to be right. Raises ModelError."""
    from safetensors import SafetensorError, safe_open

    with torch.device("meta"):
        network = build(read_config(at.parent))
    wanted = {key: tuple(t.shape) for key, t in network.state_dict().items()}
    try:
        with safe_open(str(at), framework="pt") as file:
            shapes = {k: tuple(file.get_slice(k).get_shape()) for k in file.keys()}  # noqa: SIM118
            check_shapes(at.name, shapes, wanted)
            found = {key: file.get_tensor(key).to(device, number) for key in wanted}
    except (SafetensorError, OSError) as error:
        raise ModelError(f"{at.name} is damaged or no safetensors file") from error
    network.load_state_dict(found, strict=True, assign=True)
    return network.eval().requires_grad_(False)


def check_shapes(
    name: str, found: Mapping[str, tuple[int, ...]], wanted: Mapping[str, tuple[int, ...]]
) -> None:
    """Raises ModelError where weights have other keys or shapes than the network."""
    absent, more = sorted(wanted.keys() - found.keys()), sorted(found.keys() - wanted.keys())
    if absent:
        raise ModelError(f"{name} is not PixelHacker's: it lacks {absent[0]}")
    if more:
        raise ModelError(f"{name} is not PixelHacker's: it has {more[0]}")
    for key, shape in wanted.items():
        if found[key] != shape:
            raise ModelError(f"{name} does not fit its config: {key} is {found[key]}, not {shape}")


def load_codec(folder: Path, device: str) -> Any:
    """The autoencoder of a folder, in float32: its decoder shows bands with less.

    Raises ModelError.
    """
    from diffusers.models.autoencoders.autoencoder_kl import AutoencoderKL
    from diffusers.utils import logging

    level = logging.get_verbosity()
    logging.set_verbosity_error()
    try:
        loaded: Any = AutoencoderKL.from_pretrained(
            folder, local_files_only=True, use_safetensors=True, torch_dtype=torch.float32,
            output_loading_info=True,
        )  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RuntimeError) as error:
        from ...models.device import is_out_of_memory

        if is_out_of_memory(error):
            raise
        raise ModelError(f"{folder.name} cannot be opened as an autoencoder") from error
    finally:
        logging.set_verbosity(level)
    codec, told = loaded
    if told["missing_keys"] or told["mismatched_keys"]:
        raise ModelError(f"{folder.name} lacks some of its weights")
    return codec.eval().requires_grad_(False).to(device)


# Gated linear attention (Yang et al. 2023, arXiv 2312.06635) without a kernel of its own.

CHUNK = 16  # tokens that are attended to pairwise; a power of two
NORMALIZER = 16.0  # of a gate's logarithm
LOW_RANK = 16  # of the gates' projection
EXPAND_KEYS = 0.5  # x channels
EPSILON = 1e-6  # of the norm
AT_ONCE = 1 << 25  # numbers of the pairs that are held at once: 134 MB


def recurrence(queries: Tensor, keys: Tensor, values: Tensor, gates: Tensor) -> Tensor:
    """(B, H, T, V), token by token: the clear twin of `chunked`.

    Queries, keys and gates (B, H, T, K), values (B, H, T, V); gates are logarithms, at most 0.
    """
    state = values.new_zeros(*keys.shape[:2], keys.shape[-1], values.shape[-1])
    out = []
    for t in range(keys.shape[2]):
        state = state * gates[:, :, t].exp()[..., None]
        state = state + keys[:, :, t, :, None] * values[:, :, t, None, :]
        out.append((queries[:, :, t, :, None] * state).sum(-2))
    return torch.stack(out, 2) * keys.shape[-1] ** -0.5


def chunked(queries: Tensor, keys: Tensor, values: Tensor, gates: Tensor) -> Tensor:
    """Compute `recurrence` chunk by chunk. float32.

    Every exponent is of a difference of cumulative gates that is at most 0, so that nothing
    overflows however closed a gate is.
    """
    length, kind = keys.shape[2], queries.dtype
    rest = -length % CHUNK  # tokens of nothing at the end change none before them

    def in_chunks(x: Tensor) -> Tensor:  # (B, H, N, C, K)
        return functional.pad(x.float(), (0, 0, 0, rest)).unflatten(2, (-1, CHUNK))

    q, k, v, g = (in_chunks(x) for x in (queries, keys, values, gates))
    q = q * keys.shape[-1] ** -0.5
    total = g.cumsum(3)  # of the gates since the chunk began
    last = total[:, :, :, -1:]
    gains = torch.einsum("bhnck,bhncv->bhnkv", k * (last - total).exp(), v)
    decay = last.transpose(3, 4).exp()  # (B, H, N, K, 1)
    state, before = torch.zeros_like(gains[:, :, 0]), []
    for n in range(gains.shape[2]):
        before.append(state)
        state = decay[:, :, n] * state + gains[:, :, n]
    out = (q * total.exp()) @ torch.stack(before, 2) + _inside(q, k, total) @ v
    return out.flatten(2, 3)[:, :, :length].to(kind)


def _inside(q: Tensor, k: Tensor, total: Tensor) -> Tensor:
    """(B, H, N, C, C) weights of the tokens of a chunk for one another, the later ones' are 0."""
    later = torch.ones(CHUNK, CHUNK, dtype=torch.bool, device=q.device).triu(1)[..., None]
    portion = max(1, AT_ONCE // (q[:, :, :1].numel() * CHUNK))
    found = []
    for some, others, sums in zip(
        q.split(portion, 2), k.split(portion, 2), total.split(portion, 2), strict=True
    ):
        gap = sums[..., :, None, :] - sums[..., None, :, :]
        fading = gap.masked_fill_(later, -torch.inf).exp_()
        found.append(torch.einsum("bhntk,bhnsk,bhntsk->bhnts", some, others, fading))
    return torch.cat(found, 2)


class NormGate(nn.Module):
    """Vectors (..., V) of one RMS, scaled, times swish of the gates (..., V)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.ones(channels))

    def forward(self, x: Tensor, gates: Tensor) -> Tensor:
        kind, x = x.dtype, x.float()
        unit = x * torch.rsqrt(x.square().mean(-1, keepdim=True) + EPSILON)
        return (unit * self.weight.float() * functional.silu(gates.float())).to(kind)


class GatedLinearAttention(nn.Module):
    """Tokens (B, T, C) that see those before them."""

    def __init__(self, channels: int, heads: int) -> None:
        super().__init__()
        keys = int(channels * EXPAND_KEYS)
        self.heads = heads
        self.q_proj = nn.Linear(channels, keys, bias=False)
        self.k_proj = nn.Linear(channels, keys, bias=False)
        self.v_proj = nn.Linear(channels, channels, bias=False)
        self.g_proj = nn.Linear(channels, channels, bias=False)
        self.gk_proj = nn.Sequential(
            nn.Linear(channels, LOW_RANK, bias=False), nn.Linear(LOW_RANK, keys)
        )
        self.o_proj = nn.Linear(channels, channels, bias=False)
        self.g_norm_swish_gate = NormGate(channels // heads)

    def forward(self, hidden_states: Tensor, **_unused: object) -> Tensor:
        """Attend like the attention that it replaces, which may also take a context or a mask."""

        def by_head(x: Tensor) -> Tensor:  # (B, H, T, K)
            return x.unflatten(2, (self.heads, -1)).transpose(1, 2)

        x = hidden_states
        gates = functional.logsigmoid(self.gk_proj(x).float()) / NORMALIZER
        found = chunked(
            by_head(self.q_proj(x)), by_head(self.k_proj(x)), by_head(self.v_proj(x)),
            by_head(gates),
        )  # fmt: skip
        gated = self.g_norm_swish_gate(found, by_head(self.g_proj(x)))
        return self.o_proj(gated.transpose(1, 2).flatten(2))


STEPS = 20
STRENGTH = 0.999  # of the noise: one of the steps is left out
GUIDANCE = 4.5
NOISE_OFFSET = 0.0357  # x a number for each channel of all the noise
SCHEDULE = {
    "beta_start": 0.00085, "beta_end": 0.012, "beta_schedule": "scaled_linear",
    "num_train_timesteps": 1000, "clip_sample": False,
}  # fmt: skip


def sample(
    network: PixelHacker, codec: Any, picture: F32, hole: Mask, progress: Progress, seed: int
) -> F32:
    """(n, n, 3) in [0, 1]: the picture (n, n, 3) with its hole (n, n) filled, and nearly as it was.

    n is a multiple of what the autoencoder shrinks by. The same seed gives the same numbers on
    one device. Of what is in the hole only how bright and colourful it is on the whole matters.
    """
    from diffusers.schedulers.scheduling_ddim import DDIMScheduler

    number = next(network.diff_model.parameters()).dtype
    device = next(codec.parameters()).device
    shrink = 2 ** (len(codec.config.block_out_channels) - 1)
    # On the CPU, so that a seed means the same on every device.
    random = torch.Generator().manual_seed(seed)
    with torch.inference_mode():
        given = torch.from_numpy(picture).permute(2, 0, 1)[None].to(device) * 2 - 1
        mask = in_cells(torch.from_numpy(hole)[None, None].float(), shrink).to(device)
        start = _encode(codec, given, random)
        known = _encode(codec, given * (1 - mask), random)
        small = functional.interpolate(mask, scale_factor=1 / shrink)  # nearest
        noise = torch.randn(start.shape, generator=random)
        offset = torch.randn((*start.shape[:2], 1, 1), generator=random)
        noise = (noise + NOISE_OFFSET * offset).to(device)
        scheduler: Any = DDIMScheduler(**SCHEDULE)
        scheduler.set_timesteps(STEPS)
        times = scheduler.timesteps[STEPS - int(STEPS * STRENGTH) :]
        latents = scheduler.add_noise(start, noise, times[:1])
        ids = torch.arange(IDS, device=device).view(2, -1).flip(0)  # nothing, what is filled in
        for k, time in enumerate(times):
            progress(k / len(times), f"inventing what is behind: step {k + 1} of {len(times)}")
            one = torch.cat([latents, small, known], 1).to(number)
            nothing, wanted = network(one.expand(2, -1, -1, -1), time.to(device), ids).float()
            guided = (nothing + GUIDANCE * (wanted - nothing))[None]
            latents = scheduler.step(guided, time, latents, return_dict=False)[0]
        progress(1.0, "developing what was invented")
        decoded = codec.decode(latents / codec.config.scaling_factor, return_dict=False)[0]
    filled = (decoded[0].permute(1, 2, 0).float().cpu().numpy() + 1) / 2
    return np.clip(np.nan_to_num(filled, nan=0.5), 0, 1).astype(np.float32)


def in_cells(mask: Tensor, shrink: int) -> Tensor:
    """A mask (1, 1, h, w) that holds whole cells of the latents: all that it touched.

    The latents' mask is every `shrink`th pixel of it, which would miss what lies between.
    """
    cells = functional.max_pool2d(mask, shrink)
    return functional.interpolate(cells, scale_factor=float(shrink))


def _encode(codec: Any, picture: Tensor, random: torch.Generator) -> Tensor:
    found = codec.encode(picture, return_dict=False)[0].sample(random)
    return found * codec.config.scaling_factor
