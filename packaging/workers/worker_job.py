"""What every worker shares: the job's files, progress, and a writer of 3DGS .ply.

Only numpy and Pillow, so that it runs in any model's environment. Imports nothing of ObjectMorpher.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

VERSION = 1
SH0 = 0.28209479177387814  # the constant spherical harmonic
COLUMNS = (
    "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
    "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3",
)  # fmt: skip


@dataclass(frozen=True)
class Job:
    """What is to be lifted."""

    folder: Path
    rgba: np.ndarray  # (H, W, 4) u8, the photo; alpha is the soft cut-out
    mask: np.ndarray  # (H, W) bool
    focal: float  # px
    cx: float  # px, the first pixel's centre is 0.5
    cy: float
    seed: int
    count: int  # Gaussians that are wanted, where that can be chosen

    @property
    def size(self) -> tuple[int, int]:
        """Width and height px."""
        return self.mask.shape[1], self.mask.shape[0]


def read_job(folder: Path) -> Job:
    """The job in a folder."""
    told = json.loads((folder / "camera.json").read_text(encoding="utf-8"))
    if told["version"] != VERSION:
        raise ValueError(f"version {told['version']} of the protocol is not known, {VERSION} is")
    with Image.open(folder / "image.png") as image, Image.open(folder / "mask.png") as mask:
        rgba, chosen = np.array(image.convert("RGBA")), np.array(mask.convert("L")) > 127
    return Job(
        folder, rgba, chosen, told["focal"], told["cx"], told["cy"], told["seed"], told["count"]
    )


def say(progress: float, note: str) -> None:
    """Tells the editor how far it is, in [0, 1]."""
    sys.stdout.write(json.dumps({"progress": progress, "note": note}) + "\n")
    sys.stdout.flush()


def load_pipeline(kind: Any, title: str, weights: str) -> Any:
    """A pipeline of the class `kind` on the GPU; `weights` is a folder or a repository's name."""
    say(0.05, f"Loading {title}")
    pipeline = kind.from_pretrained(weights)
    pipeline.cuda()
    say(0.4, "Making the object")
    return pipeline


def run(work: Callable[[Job], None]) -> None:
    """The main of a worker: a failure is told in one sentence, and its trace goes to stderr."""
    try:
        work(read_job(Path(sys.argv[-1])))
    except Exception as error:
        sentence = " ".join(str(error).split()) or type(error).__name__
        sys.stdout.write(json.dumps({"error": sentence}) + "\n")
        sys.stdout.flush()
        raise


def write_seen(job: Job, world_from_object: np.ndarray, focal: float | None = None) -> None:
    """Tells how the object is seen: (4, 4), to axes x right, y down, z away from the camera.

    `focal` px of the camera that sees it so; None: the photo's. Its centre is the photo's.
    """
    width, height = job.size
    told = {
        "version": VERSION, "world_from_object": np.asarray(world_from_object, float).tolist(),
        "focal": float(focal or job.focal), "cx": job.cx, "cy": job.cy,
        "width": width, "height": height,
    }  # fmt: skip
    (job.folder / "object.json").write_text(json.dumps(told), encoding="utf-8")


def write_gaussians(
    job: Job, means: np.ndarray, quats: np.ndarray, scales: np.ndarray, opacities: np.ndarray,
    colors: np.ndarray,
) -> None:  # fmt: skip
    """Means (N, 3), quats (N, 4) wxyz, scales (N, 3), opacities (N,), colours (N, 3) sRGB 0..1."""
    alpha = np.clip(opacities, 1e-6, 1 - 1e-6)
    table = np.concatenate(
        [
            means, np.zeros_like(means), (colors - 0.5) / SH0, np.log(alpha / (1 - alpha))[:, None],
            np.log(scales), quats,
        ],
        axis=1,
    ).astype("<f4")  # fmt: skip
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(table)}\n"
    head += "".join(f"property float {name}\n" for name in COLUMNS) + "end_header\n"
    (job.folder / "object.ply").write_bytes(head.encode("ascii") + table.tobytes())


def cut_square(job: Job, room: float) -> Image.Image:
    """The cut-out in a square `room` x its longer side, RGBA, clear beyond the photo's frame."""
    rows, columns = np.flatnonzero(job.mask.any(1)), np.flatnonzero(job.mask.any(0))
    if not len(rows):
        raise ValueError("the mask is empty")
    x0, x1, y0, y1 = columns[0], columns[-1] + 1, rows[0], rows[-1] + 1
    half = max(int(np.ceil(0.5 * room * max(x1 - x0, y1 - y0))), 1)
    left, top = (x0 + x1) // 2 - half, (y0 + y1) // 2 - half
    image = Image.fromarray(job.rgba, "RGBA")
    return image.crop((int(left), int(top), int(left) + 2 * half, int(top) + 2 * half))
