"""TripoSR: a coloured mesh without a pose. PYTHONPATH holds its repository; runs without a GPU."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from worker_job import Job, cut_square, run, say

SHARE = 0.85  # of the square that the object fills, as in its own example
GREY = 0.5  # what is behind it, likewise
CHUNK, CELLS = 8192, 256


def work(job: Job) -> None:
    """Runs the published network and its marching cubes."""
    import torch
    from tsr.system import TSR

    say(0.05, "Loading TripoSR")
    name = "cuda:0" if torch.cuda.is_available() else "cpu"
    model = TSR.from_pretrained(
        os.environ.get("TRIPOSR_WEIGHTS", "stabilityai/TripoSR"),
        config_name="config.yaml", weight_name="model.ckpt",
    )  # fmt: skip
    model.renderer.set_chunk_size(CHUNK)
    model.to(name)
    say(0.3, "Making the object")
    with torch.no_grad():
        codes = model([on_grey(cut_square(job, 1 / SHARE))], device=name)
    say(0.7, "Finding its surface")
    mesh = model.extract_mesh(codes, resolution=CELLS)[0]
    mesh.vertices = upright(np.asarray(mesh.vertices))
    mesh.export(str(job.folder / "object.glb"))


def on_grey(cut: Image.Image) -> Image.Image:
    """RGB on grey of a cut-out."""
    rgba = np.asarray(cut, np.float32) / 255
    alpha = rgba[..., 3:]
    flat = rgba[..., :3] * alpha + GREY * (1 - alpha)
    return Image.fromarray((255 * flat).astype(np.uint8))


def upright(points: np.ndarray) -> np.ndarray:
    """(N, 3) in glTF's axes, x right, y up, z towards the viewer, of x back, y right, z up."""
    return points[:, [1, 2, 0]]


if __name__ == "__main__":
    run(work)
