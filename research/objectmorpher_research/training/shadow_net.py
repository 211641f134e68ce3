"""A small U-Net that finds the shadow of a thing on the ground about it, and how surely."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from objectmorpher_core.compose.shadow.shadow_look import PLANES

WIDTHS = (24, 40, 64, 96)  # at a half, a quarter, an eighth and a sixteenth of the planes' side
FOLD = 2  # cells of a side that are folded into one
HIDDEN = 64


class _Block(nn.Module):
    """Two convolutions, and the way around them."""

    def __init__(self, before: int, after: int) -> None:
        super().__init__()
        self.c1 = nn.Conv2d(before, after, 3, padding=1, bias=False)
        self.n1 = nn.BatchNorm2d(after)
        self.c2 = nn.Conv2d(after, after, 3, padding=1, bias=False)
        self.n2 = nn.BatchNorm2d(after)
        self.skip = nn.Conv2d(before, after, 1) if before != after else nn.Identity()

    def forward(self, x: Tensor) -> Tensor:
        inner = functional.relu(self.n1(self.c1(x)))
        return functional.relu(self.n2(self.c2(inner)) + self.skip(x))


class ShadowNet(nn.Module):
    """Planes (n, PLANES, s, s) -> log odds (n, s, s) of shade, and (n,) of a shadow at all."""

    def __init__(self) -> None:
        super().__init__()
        a, b, c, d = WIDTHS
        self.down = nn.ModuleList(
            [_Block(FOLD * FOLD * PLANES, a), _Block(a, b), _Block(b, c), _Block(c, d)]
        )
        self.glob, self.mid = nn.Linear(d, d), _Block(d, d)
        self.up = nn.ModuleList([_Block(d + c, c), _Block(c + b, b), _Block(b + a, a)])
        self.out, self.att = nn.Conv2d(a, FOLD * FOLD, 1), nn.Conv2d(b, 1, 1)
        self.scene = nn.Sequential(nn.Linear(d + b, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 1))

    def forward(self, planes: Tensor) -> tuple[Tensor, Tensor]:
        x, skips = functional.pixel_unshuffle(planes, FOLD), []
        for block in self.down:
            x = block(x if not skips else functional.max_pool2d(x, 2))
            skips.append(x)
        x = self.mid(x + self.glob(x.mean((2, 3)))[:, :, None, None])
        whole, looked = x.mean((2, 3)), x
        for block, skip in zip(self.up, skips[-2::-1], strict=True):
            x = functional.interpolate(x, scale_factor=2.0, mode="nearest")
            x = block(torch.cat([x, skip], 1))
            if block is self.up[1]:
                share = torch.softmax(self.att(x).flatten(1), 1)
                looked = (x.flatten(2) * share[:, None]).sum(-1)
        odds = self.scene(torch.cat([whole, looked], 1))[:, 0]
        return functional.pixel_shuffle(self.out(x), FOLD)[:, 0], odds
