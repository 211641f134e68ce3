"""SHARP: the front of the scene, exactly where the photo shows it; what the mask holds is kept.

Set SHARP_CHECKPOINT to the published .pt file (opened with weights_only).
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from worker_job import Job, run, say, write_seen

NEARER = 1.5  # x the median distance: what lies farther behind the outline is background


def work(job: Job) -> None:
    """Runs the published predictor on the photo."""
    import torch
    from sharp.cli.predict import predict_image
    from sharp.models import PredictorParams, create_predictor
    from sharp.utils.gaussians import save_ply

    say(0.05, "Loading SHARP")
    name = "cuda" if torch.cuda.is_available() else "cpu"
    if name == "cpu" and torch.backends.mps.is_available():
        name = "mps"
    state = torch.load(os.environ["SHARP_CHECKPOINT"], map_location="cpu", weights_only=True)
    predictor = create_predictor(PredictorParams())
    predictor.load_state_dict(state)
    predictor.eval().to(name)
    say(0.4, "Looking at the photo")
    rgb = job.rgba[..., :3].copy()
    found = predict_image(predictor, rgb, job.focal, torch.device(name))
    say(0.9, "Cutting the object out")
    kept = inside(job, found.mean_vectors[0].detach().cpu().numpy())
    if not kept.any():
        raise ValueError("SHARP puts nothing where the mask is")
    index = torch.from_numpy(np.flatnonzero(kept)).to(found.mean_vectors.device)
    own = type(found)(*(values[:, index] for values in found))
    save_ply(own, job.focal, job.mask.shape, job.folder / "object.ply")
    write_seen(job, np.eye(4))


def inside(job: Job, points: np.ndarray) -> np.ndarray:
    """(N,) which points (N, 3) of the camera are seen in the mask, and not far behind it."""
    depth = np.maximum(points[:, 2], 1e-6)
    # The published camera has its centre in the middle of the picture.
    xy = points[:, :2] / depth[:, None] * job.focal + np.array(job.size) / 2
    column, row = np.floor(xy).clip(-1, 1 << 24).astype(int).T
    width, height = job.size
    there = (column >= 0) & (row >= 0) & (column < width) & (row < height) & (points[:, 2] > 0)
    there[there] = job.mask[row[there], column[there]]
    if there.any():
        there &= points[:, 2] < NEARER * np.median(points[there, 2])
    return there


if __name__ == "__main__":
    run(work)
