"""As `tsr.system`: x back, y right, z up."""

from __future__ import annotations

import trimesh


class Renderer:
    def set_chunk_size(self, size):
        assert size > 0


class TSR:
    renderer = Renderer()

    @classmethod
    def from_pretrained(cls, pretrained_model_name_or_path, config_name, weight_name):
        assert (config_name, weight_name) == ("config.yaml", "model.ckpt")
        return cls()

    def to(self, device):
        return self

    def __call__(self, images, device):
        assert images[0].mode == "RGB" and images[0].getpixel((0, 0)) == (127, 127, 127)
        return images

    def extract_mesh(self, scene_codes, resolution=256, threshold=25.0):
        return [trimesh.creation.box((0.3, 1.0, 2.0))]
