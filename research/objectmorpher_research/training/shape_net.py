"""The decoder: DINOv2's tokens of a crop, its pixels and its mask -> the surface that is seen.

A U-Net (Ronneberger et al. 2015) from the pixels, which takes in the frozen tokens where it is as
coarse as they are. Everything is in crop units (`lift.crop`).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .flatness import GRID as GRID  # tokens across
from .flatness import WIDTH as WIDTH  # of a token: two inner layers of DINOv2 ViT-S/14
from .flatness import FlatNet

PLANES = 7  # red, green, blue, mask, distance to the outline, and the ray's two tangents
OUTPUTS = 9  # front, thickness, depth, normal (3), edge, spread of front, spread of depth
CHANNELS = (24, 48, 96, 160)  # from half the size to a sixteenth
MIXED = 256  # at a sixteenth, with the tokens
HEADS = 4  # of the attention there
FINE = 32  # at half the size
SCALES = {"front": 0.15, "thick": 0.2, "normal": 0.5}  # the usual size of what is predicted
FACING = -0.5  # z of the normals before training, towards the camera


class ResidualBlock(nn.Module):
    """Two convolutions beside the way straight on (He et al. 2016)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first, self.second = _conv(width, width), _conv(width, width, is_active=False)

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(x + self.second(self.first(x)))


class Attention(nn.Module):
    """Every place looks at all others (Vaswani et al. 2017): a thing stands as a whole."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.before, self.between = nn.LayerNorm(width), nn.LayerNorm(width)
        self.mixed, self.out = nn.Linear(width, 3 * width), nn.Linear(width, width)
        self.wide, self.narrow = nn.Linear(width, 4 * width), nn.Linear(4 * width, width)

    def forward(self, x: Tensor) -> Tensor:
        n, c, h, w = x.shape
        flat = x.flatten(2).transpose(1, 2)  # (n, places, c)
        parts = self.mixed(self.before(flat)).view(n, h * w, 3, HEADS, c // HEADS)
        query, key, value = parts.permute(2, 0, 3, 1, 4).unbind(0)
        seen = F.scaled_dot_product_attention(query, key, value)
        flat = flat + self.out(seen.transpose(1, 2).reshape(n, h * w, c))
        flat = flat + self.narrow(F.gelu(self.wide(self.between(flat))))
        return flat.transpose(1, 2).reshape(n, c, h, w)


class ShapeNet(nn.Module):
    """(n, PLANES, s, s) and tokens (n, WIDTH, g, g) -> (n, OUTPUTS, s, s)."""

    def __init__(self) -> None:
        super().__init__()
        a, b, c, d = CHANNELS
        self.down1 = _conv(PLANES, a, stride=2)
        self.down2 = nn.Sequential(_conv(a, b, stride=2), ResidualBlock(b))
        self.down3 = nn.Sequential(_conv(b, c, stride=2), ResidualBlock(c))
        self.down4 = nn.Sequential(_conv(c, d, stride=2), ResidualBlock(d))
        self.tokens = nn.Conv2d(WIDTH, d, 1)
        self.tokens_fine = nn.Conv2d(WIDTH, c // 2, 1)
        self.middle = nn.Sequential(
            _conv(2 * d, MIXED, size=1), ResidualBlock(MIXED), Attention(MIXED), Attention(MIXED)
        )
        self.up3 = nn.Sequential(_conv(MIXED + c + c // 2, 128), ResidualBlock(128))
        self.up2 = nn.Sequential(_conv(128 + b, 64), ResidualBlock(64))
        self.up1 = _conv(64 + a, FINE)
        self.head = nn.Conv2d(FINE, 4 * OUTPUTS, 1)  # of four pixels each (Shi et al. 2016)
        self.flat = FlatNet()  # trained by itself: `flatness.fit`

    def forward(
        self, planes: Tensor, tokens: Tensor, phase: tuple[int, int] | None = None
    ) -> Tensor:
        """`phase`: row and column of the one pixel in each two by two that is wanted; None: all.

        A quarter of the pixels, another one each time, teaches the same in half the time.
        """
        x1 = self.down1(planes)
        x2 = self.down2(x1)
        x3 = self.down3(x2)
        x4 = self.down4(x3)
        coarse = _resized(self.tokens(tokens), x4)
        y = self.middle(torch.cat([x4, coarse], 1))
        y = self.up3(torch.cat([_doubled(y), x3, _resized(self.tokens_fine(tokens), x3)], 1))
        y = self.up2(torch.cat([_doubled(y), x2], 1))
        y = self.up1(torch.cat([_doubled(y), x1], 1))
        with torch.autocast(y.device.type, enabled=False):  # eight bits are too few for a depth
            if phase is None:
                raw = F.pixel_shuffle(self.head(y.float()), 2)
            else:
                own = slice(2 * phase[0] + phase[1], None, 4)
                bias = self.head.bias
                assert bias is not None
                raw = F.conv2d(y.float(), self.head.weight[own], bias[own])
        front = SCALES["front"] * raw[:, :1]
        thick = SCALES["thick"] * F.softplus(raw[:, 1:3])  # never negative
        # Not made unit vectors here: those have no gradient once they are all alike.
        normal = SCALES["normal"] * raw[:, 3:6] + raw.new_tensor([0, 0, FACING])[:, None, None]
        spread = raw[:, 7:9].clamp(-7.0, 2.0)
        return torch.cat([front, thick, normal, raw[:, 6:7], spread], 1)


def _conv(
    inputs: int, outputs: int, size: int = 3, stride: int = 1, is_active: bool = True
) -> nn.Sequential:
    layers: list[nn.Module] = [
        nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False),
        nn.BatchNorm2d(outputs),
    ]
    return nn.Sequential(*layers, *([nn.ReLU()] if is_active else []))


def _resized(x: Tensor, like: Tensor) -> Tensor:
    return F.interpolate(x, size=like.shape[-2:], mode="bilinear", align_corners=False)


def _doubled(x: Tensor) -> Tensor:
    return F.interpolate(x, scale_factor=2, mode="nearest")
