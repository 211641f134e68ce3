"""PixelHacker's network: a latent diffusion U-Net whose self-attention is gated and linear.

Instead of a text it is told twenty numbers: ten for what is to be filled in, ten for nothing.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from ....models import ModelError

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
        from ....models.device import is_out_of_memory

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
