"""How wrong a prediction of `shape_net` is."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from .shape_data import Batch

STEPS = (1, 2, 4, 8, 16)  # px, over which differences are compared
WEIGHTS = {
    "front": 4.0, "thickness": 2.0, "depth": 2.0, "slope": 6.0, "normal": 0.5, "agree": 0.3,
    "edge": 0.3, "spread": 0.1,
}  # fmt: skip
RARE = 6.0  # x weight of a pixel that is an edge


def losses(found: Tensor, batch: Batch) -> dict[str, Tensor]:
    """The parts of the loss, each a mean over the object's pixels of (n, OUTPUTS, s, s)."""
    mask = batch.mask
    area = mask.sum((1, 2, 3), keepdim=True).clamp(min=1)
    error = found[:, :1] - batch.front
    # About which depth the object lies is not in the photo: the mean is free.
    error = (error - (error * mask).sum((1, 2, 3), keepdim=True) / area) * mask
    thick, deep = (
        (found[:, k : k + 1] - true) * mask for k, true in ((1, batch.thickness), (2, batch.depth))
    )
    parts = {
        "front": _mean(error.abs(), mask),
        "thickness": _mean(thick.abs(), mask),
        "depth": _mean(deep.abs(), mask),
        "slope": _slopes(error, mask),
        "normal": _mean(1 - (found[:, 3:6] * batch.normal).sum(1, keepdim=True), mask),
        "agree": _agreement(found[:, :1], batch),
        "edge": _edges(found[:, 6:7], batch),
        "spread": _spread(error, found[:, 7:8], mask) + _spread(thick, found[:, 8:9], mask),
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
    """How far the surface's own slopes are from the true normals, away from jumps."""
    points = batch.rays * (batch.away - front)  # (n, 3, s, s)
    across = points[:, :, 1:-1, 2:] - points[:, :, 1:-1, :-2]
    down = points[:, :, 2:, 1:-1] - points[:, :, :-2, 1:-1]
    normal = F.normalize(torch.cross(down, across, dim=1), dim=1, eps=1e-8)
    bad = 1 - batch.mask + batch.edge
    clear = 1 - F.max_pool2d(bad.clamp(max=1), 3, 1)
    return _mean(1 - (normal * batch.normal[:, :, 1:-1, 1:-1]).sum(1, keepdim=True), clear)


def _edges(logit: Tensor, batch: Batch) -> Tensor:
    weight = 1 + (RARE - 1) * batch.edge
    loss = F.binary_cross_entropy_with_logits(logit, batch.edge, weight, reduction="none")
    return _mean(loss, batch.mask)


def _spread(error: Tensor, spread: Tensor, mask: Tensor) -> Tensor:
    """Laplace's: the predicted log of the mean error; it does not change the prediction."""
    return _mean(error.abs().detach() * torch.exp(-spread) + spread, mask)
