"""As `trellis2.pipelines`."""

from __future__ import annotations


class Mesh:
    vertices = faces = attrs = coords = layout = None
    voxel_size = 1 / 512

    def simplify(self, target):
        assert target <= 16777216


class Trellis2ImageTo3DPipeline:
    @classmethod
    def from_pretrained(cls, path):
        return cls()

    def cuda(self):
        pass

    def run(self, image, num_samples=1, seed=42):
        assert image.mode == "RGBA" and image.getchannel("A").getextrema() == (0, 255)
        return [Mesh()]
