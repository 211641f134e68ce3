"""PixelHacker (Xu et al. 2025, arXiv 2504.20438) in plain PyTorch: the paper's own inpainter (3.3).

Parameters are named as in the published weights (Apache-2.0): https://github.com/hustvl/PixelHacker.
A latent diffusion U-Net whose self-attention is gated and linear.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional

from .latent_diffusion import Denoiser


class PixelHacker(Denoiser):
    """A U-Net with `GatedLinearAttention`."""

    title = "PixelHacker"
    published: ClassVar[Mapping[str, Any]] = {
        "sample_size": 64, "in_channels": 9, "out_channels": 4, "attention_head_dim": 8,
        "cross_attention_dim": 768, "encoder_hid_dim": 3072,
    }  # fmt: skip
    guidance = 4.5

    def replace_parts(self) -> None:
        """See `Denoiser`."""
        for block in self.diff_model.modules():
            if type(block).__name__ == "BasicTransformerBlock":
                old = block.attn1
                block.attn1 = GatedLinearAttention(old.to_q.in_features, old.heads)


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
