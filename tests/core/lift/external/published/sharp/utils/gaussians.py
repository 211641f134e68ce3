"""As `sharp.utils.gaussians`: the tuple and its writer."""

from __future__ import annotations

from typing import NamedTuple

import plain_ply
import torch


class Gaussians3D(NamedTuple):
    mean_vectors: torch.Tensor
    singular_values: torch.Tensor
    quaternions: torch.Tensor
    colors: torch.Tensor
    opacities: torch.Tensor


def save_ply(gaussians, f_px, image_shape, path):
    assert len(image_shape) == 2 and gaussians.opacities.shape == gaussians.colors.shape[:2]
    plain_ply.write(path, gaussians.mean_vectors.flatten(0, 1).numpy())
