"""Attention of bounded memory: over all cells, and inside windows."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from .voxels import Windows

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
