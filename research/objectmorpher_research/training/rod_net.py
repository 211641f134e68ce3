"""A small network that reads the tokens of a handle, and says how it lies about its axis."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from .shape_net import WIDTH

TOKENS, WIDE, HIDDEN, LOOKS = 32, 48, 64, 2
DROPPED, FORGOTTEN = 0.15, 0.3  # share of the tokens' planes, and of what is hidden, in training


class RodNet(nn.Module):
    """Tokens (n, WIDTH, g, g), planes (n, 2, g, g), lean (n,) -> azimuth (n,), log of its error."""

    def __init__(self) -> None:
        super().__init__()
        self.thin, self.narrow = nn.Dropout2d(DROPPED), nn.Conv2d(WIDTH, TOKENS, 1, bias=False)
        self.norms = nn.ModuleList([nn.BatchNorm2d(n) for n in (TOKENS, WIDE, WIDE, WIDE)])
        self.layers = nn.ModuleList(
            nn.Conv2d(n, WIDE, 3, padding=1, bias=False) for n in (TOKENS + 3, WIDE, WIDE)
        )
        self.looks = nn.Conv2d(WIDE, LOOKS, 1)
        self.hidden = nn.Linear((LOOKS + 1) * WIDE + 1, HIDDEN)
        self.forget, self.out = nn.Dropout(FORGOTTEN), nn.Linear(HIDDEN, 2)

    def forward(self, tokens: Tensor, planes: Tensor, lean: Tensor) -> tuple[Tensor, Tensor]:
        x = functional.relu(self.norms[0](self.narrow(self.thin(tokens))))
        flat = lean[:, None, None, None].expand(-1, 1, *planes.shape[2:])
        x = torch.cat([x, 2 * planes, flat], 1)
        for number, (layer, norm) in enumerate(zip(self.layers, self.norms[1:], strict=True)):
            inner = functional.relu(norm(layer(x)))
            x = inner if number == 0 else x + inner
        share = torch.softmax(self.looks(x).flatten(2), -1)
        looked = (share[:, :, None] * x.flatten(2)[:, None]).sum(-1).flatten(1)
        seen = torch.cat([looked, x.mean((2, 3)), lean[:, None]], 1)
        found = self.out(self.forget(functional.relu(self.hidden(seen))))
        return found[:, 0], found[:, 1]


class RodCommittee(nn.Module):
    """Several networks, each trained from another start: their mean, and how far they agree."""

    def __init__(self, members: list[RodNet]) -> None:
        super().__init__()
        self.members = nn.ModuleList(members)

    def forward(self, tokens: Tensor, planes: Tensor, lean: Tensor) -> tuple[Tensor, Tensor]:
        found, doubt = (
            torch.stack(each)
            for each in zip(*(m(tokens, planes, lean) for m in self.members), strict=True)
        )
        mean = found.mean(0)
        error = torch.exp(2 * doubt).mean(0) + ((found - mean) ** 2).mean(0)
        return mean, 0.5 * torch.log(error)
