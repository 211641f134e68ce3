"""TRELLIS, the published program: Gaussians without a pose. PYTHONPATH holds its repository."""

from __future__ import annotations

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from worker_job import Job, cut_square, load_pipeline, run, say

ROOM = 1.2  # the square's side over the object's, as its own cropping has it


def work(job: Job) -> None:
    """Runs the published pipeline on the cut-out; its alpha tells it what is meant."""
    os.environ.setdefault("SPCONV_ALGO", "native")
    from trellis.pipelines import TrellisImageTo3DPipeline

    weights = os.environ.get("TRELLIS_WEIGHTS", "microsoft/TRELLIS-image-large")
    pipeline = load_pipeline(TrellisImageTo3DPipeline, "TRELLIS", weights)
    out = pipeline.run(cut_square(job, ROOM), seed=job.seed, formats=["gaussian"])
    say(0.95, "Writing it")
    # The file's axes are x right, y down, z away: what the published transform makes of z up.
    out["gaussian"][0].save_ply(str(job.folder / "object.ply"))


if __name__ == "__main__":
    run(work)
