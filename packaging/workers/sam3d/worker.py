"""SAM 3D Objects: Gaussians with their pose. Set SAM3D_ROOT to a clone of the repository.

Only Gaussians are decoded, and the pose is not optimised afterwards: meshes and layouts are where
a GPU of 24 GB runs out, and the editor improves the pose itself.

Its pose takes row vectors to PyTorch3D's camera (x left, y up, z away): X = s p R(q) + t.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from worker_job import Job, run, say, write_seen

LEFT_UP = np.diag([-1.0, -1.0, 1.0])  # PyTorch3D's camera to x right, y down


def work(job: Job) -> None:
    """Runs the pipeline of the published `Inference` on the photo and the mask."""
    root = Path(os.environ.get("SAM3D_ROOT", "."))
    sys.path.insert(0, str(root / "notebook"))
    from inference import Inference

    say(0.05, "Loading SAM 3D Objects")
    config = os.environ.get("SAM3D_CONFIG", str(root / "checkpoints" / "hf" / "pipeline.yaml"))
    inference = Inference(config, compile=False)
    say(0.3, "Making the object")
    cut = np.dstack([job.rgba[..., :3], np.where(job.mask, 255, 0).astype(np.uint8)])
    # `Inference` itself decodes meshes, too, and has no argument for it.
    out = inference._pipeline.run(
        cut, None, job.seed, stage1_only=False, with_mesh_postprocess=False,
        with_texture_baking=False, with_layout_postprocess=False, use_vertex_color=True,
        stage1_inference_steps=None, pointmap=None, decode_formats=["gaussian"],
    )  # fmt: skip
    say(0.95, "Writing it")
    # In its own axes, z up: the pose is told of those.
    out["gs"].save_ply(str(job.folder / "object.ply"))
    pose = pose_of(*(numbers(out[key]) for key in ("rotation", "translation", "scale")))
    write_seen(job, pose, focal_of(numbers(out["pointmap"]), job) if "pointmap" in out else None)


def numbers(tensor: Any) -> np.ndarray:
    """f64, off whatever device it is on."""
    return np.asarray(tensor.detach().cpu().numpy(), np.float64)


def pose_of(quat: np.ndarray, move: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """(4, 4) camera, x right, y down, z away, from object; of quaternion wxyz, place and size."""
    w, x, y, z = quat.reshape(4) / np.linalg.norm(quat)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    pose = np.eye(4)
    pose[:3, :3] = LEFT_UP @ turn.T * scale.reshape(-1)[0]
    pose[:3, 3] = LEFT_UP @ move.reshape(3)
    return pose


def focal_of(points: np.ndarray, job: Job) -> float:
    """Px of the camera that sees the points (h, w, 3) of all pixels where they are."""
    h, w = points.shape[:2]
    across = np.broadcast_to((np.arange(w) + 0.5) / w * job.size[0] - job.cx, (h, w))
    slope = -points[..., 0] / points[..., 2]
    good = np.isfinite(slope) & (points[..., 2] > 0)
    return float((across[good] * slope[good]).sum() / (slope[good] ** 2).sum())


if __name__ == "__main__":
    run(work)
