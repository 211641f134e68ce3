"""As `trellis.pipelines`."""

from __future__ import annotations

import numpy as np
import plain_ply


class Splats:
    def save_ply(self, path, transform=((1, 0, 0), (0, 0, -1), (0, 1, 0))):
        points = np.random.default_rng(0).uniform(-0.5, 0.5, (200, 3)) * [0.6, 0.6, 1.0]  # z up
        plain_ply.write(path, points @ np.array(transform).T)


class TrellisImageTo3DPipeline:
    @classmethod
    def from_pretrained(cls, path):
        return cls()

    def cuda(self):
        pass

    def run(self, image, num_samples=1, seed=42, formats=("mesh", "gaussian", "radiance_field")):
        assert image.mode == "RGBA" and image.width == image.height
        assert image.getchannel("A").getextrema() == (0, 255)
        return {"gaussian": [Splats()]}
