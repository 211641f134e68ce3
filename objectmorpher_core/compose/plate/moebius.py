"""Moebius (Duan, Xu et al. 2026, arXiv 2606.19195) in plain PyTorch: PixelHacker's small successor.

Parameters are named as in the published weights (Apache-2.0): https://github.com/hustvl/Moebius.
PixelHacker taught it: 226 million numbers in place of 862, three levels without a middle. All
convolutions of its U-Net are split by channels, both attentions are lambda layers (Bello 2021,
arXiv 2102.08602), and the feed-forward part looks at neighbours (Xie et al. 2024, arXiv
2410.10629). The positions of its cross-attention are learned: it sees squares of one size.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional

from .latent_diffusion import IDS, Denoiser

WINDOW = 15  # cells of the latents, side of the square around each that its self-attention weighs
EXPAND = 2.5  # x channels: of the feed-forward part


class Moebius(Denoiser):
    """A U-Net with `SelfLambda`, `CrossLambda`, `MixFeedForward` and `SplitConvolution`."""

    title = "Moebius"
    published: ClassVar[Mapping[str, Any]] = {
        "sample_size": 64, "in_channels": 9, "out_channels": 4, "attention_head_dim": 8,
        "cross_attention_dim": 768, "encoder_hid_dim": 3072, "mid_block_type": None,
        "down_block_types": ("CrossAttnDownBlock2D",) * 3,
        "up_block_types": ("CrossAttnUpBlock2D",) * 3, "block_out_channels": (320, 640, 1280),
    }  # fmt: skip
    guidance = 2.5

    def replace_parts(self) -> None:
        """See `Denoiser`."""
        net, last = self.diff_model, len(self.diff_model.down_blocks) - 1
        net.conv_in, net.conv_out = _split(net.conv_in), _split(net.conv_out)
        for level, block in enumerate(net.down_blocks):
            _replace(block, net.config.sample_size >> level)
        for level, block in enumerate(net.up_blocks):
            _replace(block, net.config.sample_size >> (last - level))


def _replace(block: Any, side: int) -> None:
    """Of a level whose latents are `side` cells wide."""
    for resnet in block.resnets:
        resnet.conv1, resnet.conv2 = _split(resnet.conv1), _split(resnet.conv2)
    for transformer in getattr(block, "attentions", ()):
        for each in transformer.transformer_blocks:
            channels, heads = each.attn1.to_q.in_features, each.attn1.heads
            told = each.attn2.to_k.in_features
            each.attn1 = SelfLambda(channels, heads)
            each.attn2 = CrossLambda(channels, heads, told, side)
            each.ff = MixFeedForward(channels)


def _split(convolution: nn.Conv2d) -> SplitConvolution:
    return SplitConvolution(convolution.in_channels, convolution.out_channels)


class SplitConvolution(nn.Module):
    """(B, in, h, w) -> (B, out, h, w): 3 x 3 in each channel, then across the channels."""

    def __init__(self, channels: int, out: int) -> None:
        super().__init__()
        self.conv_dw = nn.Conv2d(channels, channels, 3, padding=1, groups=channels, bias=False)
        self.bn1 = nn.BatchNorm2d(channels)
        self.conv_pw = nn.Conv2d(channels, out, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(out)

    def forward(self, x: Tensor) -> Tensor:
        found = self.bn2(self.conv_pw(functional.relu(self.bn1(self.conv_dw(x)))))
        return found + x if found.shape == x.shape else found


class SelfLambda(nn.Module):
    """Tokens (B, N, C) of a square that become linear maps of each other."""

    def __init__(self, channels: int, heads: int) -> None:
        super().__init__()
        own = channels // heads  # of a key, and of a value
        self.heads = heads
        self.to_q = nn.Conv2d(channels, channels, 1, bias=False)
        self.to_k = nn.Conv2d(channels, own, 1, bias=False)
        self.to_v = nn.Conv2d(channels, own, 1, bias=False)
        self.norm_q, self.norm_v = nn.BatchNorm2d(channels), nn.BatchNorm2d(own)
        self.pos_conv = nn.Conv3d(1, own, (1, WINDOW, WINDOW))

    def forward(self, hidden_states: Tensor, *_unused: object, **_unused_too: object) -> Tensor:
        x = _as_picture(hidden_states)
        q, values = self.norm_q(self.to_q(x)), self.norm_v(self.to_v(x))
        keys = self.to_k(x).flatten(2).softmax(-1)  # (B, K, N)
        content = torch.einsum("bkn,bvn->bkv", keys, values.flatten(2))
        # Each channel of the values by itself: what a cell's neighbours add to its own map.
        near = functional.conv2d(
            values.flatten(0, 1)[:, None], self.pos_conv.weight[:, :, 0], self.pos_conv.bias,
            padding=WINDOW // 2,
        )  # fmt: skip
        near = near.unflatten(0, values.shape[:2]).flatten(3)  # (B, V, K, N)
        q = q.flatten(2).unflatten(1, (self.heads, -1))  # (B, H, K, N)
        found = torch.einsum("bhkn,bkv->bhvn", q, content)
        found = found + torch.einsum("bhkn,bvkn->bhvn", q, near)
        return found.flatten(1, 2).transpose(1, 2)


class CrossLambda(nn.Module):
    """Tokens (B, side^2, C) that see the given vectors (B, IDS / 2, D)."""

    def __init__(self, channels: int, heads: int, told: int, side: int) -> None:
        super().__init__()
        own = channels // heads
        self.heads = heads
        self.to_q = nn.Conv2d(channels, channels, 1, bias=False)
        self.to_k, self.to_v = nn.Linear(told, own, bias=False), nn.Linear(told, own, bias=False)
        self.norm_q, self.norm_v = nn.BatchNorm2d(channels), nn.BatchNorm1d(own)
        self.rel_pos_emb = nn.Parameter(torch.randn(side * side, IDS // 2, own, 1))

    def forward(
        self, hidden_states: Tensor, encoder_hidden_states: Tensor, **_unused: object
    ) -> Tensor:
        values = self.norm_v(self.to_v(encoder_hidden_states).transpose(1, 2))  # (B, V, M)
        keys = self.to_k(encoder_hidden_states).transpose(1, 2).softmax(-1)  # (B, K, M)
        q = self.norm_q(self.to_q(_as_picture(hidden_states)))
        q = q.flatten(2).unflatten(1, (self.heads, -1))  # (B, H, K, N)
        weights = keys[:, None] + self.rel_pos_emb[..., 0].transpose(1, 2)  # (B, N, K, M)
        maps = torch.einsum("bnkm,bvm->bnkv", weights, values)
        return torch.einsum("bhkn,bnkv->bhvn", q, maps).flatten(1, 2).transpose(1, 2)


class _Layer(nn.Module):
    """A convolution under the name that the weights give it."""

    def __init__(self, convolution: nn.Conv2d) -> None:
        super().__init__()
        self.conv = convolution

    def forward(self, x: Tensor) -> Tensor:
        return self.conv(x)


class MixFeedForward(nn.Module):
    """Tokens (B, N, C) of a square, each with its eight neighbours."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        inner = int(channels * EXPAND)
        self.inverted_conv = _Layer(nn.Conv2d(channels, 2 * inner, 1))
        self.depth_conv = _Layer(nn.Conv2d(2 * inner, 2 * inner, 3, padding=1, groups=2 * inner))
        self.point_conv = _Layer(nn.Conv2d(inner, channels, 1, bias=False))

    def forward(self, hidden_states: Tensor) -> Tensor:
        x = functional.silu(self.inverted_conv(_as_picture(hidden_states)))
        x, gates = self.depth_conv(x).chunk(2, 1)
        return self.point_conv(x * functional.silu(gates)).flatten(2).transpose(1, 2)


def _as_picture(tokens: Tensor) -> Tensor:
    """(B, C, h, h) of the tokens (B, h^2, C) of a square."""
    return tokens.transpose(1, 2).unflatten(2, (round(tokens.shape[1] ** 0.5), -1))
