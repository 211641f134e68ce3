"""As `sharp.cli.predict`: a grid of the whole photo, in the camera's axes."""

from __future__ import annotations

import torch

from ..utils.gaussians import Gaussians3D


def predict_image(predictor, image, f_px, device, precision="float32"):
    assert predictor.is_ready and str(image.dtype) == "uint8"
    height, width = image.shape[:2]
    v, u = torch.meshgrid(torch.arange(0, height, 2), torch.arange(0, width, 2), indexing="ij")
    x, y = (u.flatten() + 0.5 - width / 2) / f_px, (v.flatten() + 0.5 - height / 2) / f_px
    means = 2.0 * torch.stack([x, y, torch.ones_like(x)], 1)[None]
    count = means.shape[1]
    quats = torch.tensor([1.0, 0, 0, 0]).expand(1, count, 4)
    ones = torch.ones(1, count, 3)
    return Gaussians3D(means, 0.01 * ones, quats, 0.2 * ones, 0.9 * torch.ones(1, count))
