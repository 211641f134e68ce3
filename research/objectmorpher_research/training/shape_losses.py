"""The loss of a prediction of `shape_net`."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from .shape_data import Batch

STEPS = (1, 2, 8)  # places, over which differences are compared
SPAN = 1  # places each way, over which the surface must lie as its normal says
WEIGHTS = {
    "front": 4.0, "thickness": 2.0, "depth": 2.0, "slope": 4.0, "normal": 2.0, "agree": 0.05,
    "edge": 0.5, "spread": 0.1,
}  # fmt: skip
SIZE = 0.25  # crop units, of depth: an object USUAL deep counts once, a much thinner one more
USUAL = 0.15
RARE = 6.0  # x weight of a pixel that is an edge


def losses(found: Tensor, batch: Batch) -> dict[str, Tensor]:
    """The parts of the loss, each a mean over the object's pixels of (n, OUTPUTS, t, t)."""
    mask = batch.mask
    area = mask.sum((1, 2, 3), keepdim=True).clamp(min=1)
    front, thickness, depth, normal, edge, *spreads = found.split([1, 1, 1, 3, 1, 1, 1], 1)
    # Of what is thin less is far off: errors count in proportion.
    scale = SIZE / (SIZE - USUAL + (batch.depth * mask).sum((1, 2, 3), keepdim=True) / area)
    error = front - batch.front
    # About which depth the object lies is not in the photo: the mean is free.
    error = (error - (error * mask).sum((1, 2, 3), keepdim=True) / area) * mask
    thick, deep = (thickness - batch.thickness) * mask, (depth - batch.depth) * mask
    parts = {
        "front": _mean(scale * error.abs(), mask),
        "thickness": _mean(scale * thick.abs(), mask),
        "depth": _mean(scale * deep.abs(), mask),
        "slope": _slopes(scale * error, mask),
        "normal": _mean((normal - batch.normal).square().sum(1, keepdim=True), mask),
        "agree": _agreement(front, batch),
        "edge": _edges(edge, batch),
        "spread": _spread(error, spreads[0], mask) + _spread(deep, spreads[1], mask),
    }
    parts["all"] = torch.stack([WEIGHTS[name] * part for name, part in parts.items()]).sum()
    return parts


def _mean(values: Tensor, mask: Tensor) -> Tensor:
    """Every object counts the same, however large."""
    return ((values * mask).sum((1, 2, 3)) / mask.sum((1, 2, 3)).clamp(min=1)).mean()


def _slopes(error: Tensor, mask: Tensor) -> Tensor:
    """Mean change of the error over some px each way: shapes, whatever lies where."""
    total = error.new_zeros(())
    for step in STEPS:
        for axis in (2, 3):
            first, last = (
                torch.narrow(error, axis, s, error.shape[axis] - step) for s in (0, step)
            )
            a, b = (torch.narrow(mask, axis, s, mask.shape[axis] - step) for s in (0, step))
            total = total + _mean((last - first).abs(), a * b)
    return total / (2 * len(STEPS))


def _agreement(front: Tensor, batch: Batch) -> Tensor:
    """How far short steps along the surface leave the true tangent planes, away from jumps.

    Unlike the angle between normals it is linear in the depth, so a rough start is no cliff.
    """
    points = batch.rays * (batch.away - front)  # (n, 3, t, t)
    bad = (1 - batch.mask + batch.edge).clamp(max=1)
    clear = 1 - F.max_pool2d(bad, 2 * SPAN + 1, 1, SPAN)
    total = front.new_zeros(())
    for axis in (2, 3):
        room = front.shape[axis] - 2 * SPAN
        before, after = (torch.narrow(points, axis, at, room) for at in (0, 2 * SPAN))
        normal, own = (torch.narrow(x, axis, SPAN, room) for x in (batch.normal, clear))
        off = ((after - before) * normal).sum(1, keepdim=True).abs()
        total = total + _mean(off * front.shape[axis] / (2 * SPAN), own)
    return total / 2


def _edges(logit: Tensor, batch: Batch) -> Tensor:
    weight = 1 + (RARE - 1) * batch.edge
    loss = F.binary_cross_entropy_with_logits(logit, batch.edge, weight, reduction="none")
    return _mean(loss, batch.mask)


def _spread(error: Tensor, spread: Tensor, mask: Tensor) -> Tensor:
    """Laplace's: the predicted log of the mean error; it does not change the prediction."""
    return _mean(error.abs().detach() * torch.exp(-spread) + spread, mask)
