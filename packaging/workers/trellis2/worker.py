"""TRELLIS.2: a textured mesh without a pose. PYTHONPATH holds its repository."""

from __future__ import annotations

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from worker_job import Job, cut_square, load_pipeline, run, say

ROOM = 1.2  # the square's side over the object's
TRIANGLES = 200_000  # the surface is sampled to some 20,000 Gaussians
TEXTURE = 2048  # px
MOST = 16_777_216  # triangles, the limit of the published rasteriser
CUBE = [[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]]


def work(job: Job) -> None:
    """Runs the published pipeline and its own export to glTF."""
    os.environ.setdefault("PYTORCH_CUDA_ALLOC_CONF", "expandable_segments:True")
    import o_voxel
    from trellis2.pipelines import Trellis2ImageTo3DPipeline

    weights = os.environ.get("TRELLIS2_WEIGHTS", "microsoft/TRELLIS.2-4B")
    pipeline = load_pipeline(Trellis2ImageTo3DPipeline, "TRELLIS.2", weights)
    mesh = pipeline.run(cut_square(job, ROOM), seed=job.seed)[0]
    mesh.simplify(MOST)
    say(0.8, "Painting it")
    glb = o_voxel.postprocess.to_glb(
        vertices=mesh.vertices, faces=mesh.faces, attr_volume=mesh.attrs, coords=mesh.coords,
        attr_layout=mesh.layout, voxel_size=mesh.voxel_size, aabb=CUBE,
        decimation_target=TRIANGLES, texture_size=TEXTURE, remesh=True, remesh_band=1,
        remesh_project=0,
    )  # fmt: skip
    glb.export(str(job.folder / "object.glb"))  # textures as PNG: every reader knows that


if __name__ == "__main__":
    run(work)
