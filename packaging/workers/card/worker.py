"""A flat card at distance 1: the smallest worker, which shows the protocol. Pure numpy."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from worker_job import Job, run, say, write_gaussians, write_seen


def work(job: Job) -> None:
    """One Gaussian on each of about `count` pixels of the mask, facing the camera."""
    say(0.1, "Cutting the card")
    step = max(1, int(np.sqrt(job.mask.sum() / max(job.count, 1))))
    rows, columns = np.nonzero(job.mask[::step, ::step])
    rows, columns = rows * step, columns * step
    x, y = (columns + 0.5 - job.cx) / job.focal, (rows + 0.5 - job.cy) / job.focal
    means = np.column_stack([x, y, np.ones(len(x))])
    side = 0.66 * step / job.focal
    scales = np.column_stack([np.full((len(x), 2), side), np.full(len(x), 0.1 * side)])
    quats = np.tile([0.0, 1.0, 0.0, 0.0], (len(x), 1))  # local +z towards the camera
    say(0.6, "Writing it")
    colors = job.rgba[rows, columns, :3] / 255.0
    write_gaussians(job, means, quats, scales, np.full(len(x), 0.99), colors)
    write_seen(job, np.eye(4))


if __name__ == "__main__":
    run(work)
