"""As `notebook/inference.py` of SAM 3D Objects: the class, its call, and what it answers."""

from __future__ import annotations

import numpy as np
import plain_ply
import torch

POINTS = np.random.default_rng(0).uniform(-0.5, 0.5, (200, 3))  # z up
FOCAL = 1.2  # x width, of its own depth network


class Splats:
    def save_ply(self, path):
        plain_ply.write(path, POINTS)


class Inference:
    def __init__(self, config_file, compile=False):
        assert config_file.endswith("pipeline.yaml")
        self._pipeline = Pipeline()


class Pipeline:
    def run(
        self,
        image,
        mask=None,
        seed=None,
        stage1_only=False,
        with_mesh_postprocess=True,
        with_texture_baking=True,
        with_layout_postprocess=True,
        use_vertex_color=False,
        stage1_inference_steps=None,
        pointmap=None,
        decode_formats=None,
    ):
        assert image.dtype == np.uint8 and image.shape[2] == 4 and mask is None
        assert set(np.unique(image[..., 3])) == {0, 255}
        # What takes the memory, and nobody asks for.
        assert decode_formats == ["gaussian"]
        assert not (with_mesh_postprocess or with_texture_baking or with_layout_postprocess)
        height, width = image.shape[:2]
        half = torch.tensor(0.5).sqrt()
        rows, columns = np.mgrid[0 : height // 2, 0 : width // 2]
        z = 4.0 + 0 * rows
        focal = FOCAL * width / 2
        x = -(columns + 0.5 - width / 4) / focal * z  # PyTorch3D: x left, y up
        y = -(rows + 0.5 - height / 4) / focal * z
        return {
            "gs": Splats(),
            "rotation": torch.stack([half, half, 0 * half, 0 * half])[None],  # z up to y up
            "translation": torch.tensor([[0.2, 0.1, 4.0]]),
            "scale": torch.tensor([[0.6, 0.6, 0.6]]),
            "pointmap": torch.from_numpy(np.stack([x, y, z], -1)),
        }
