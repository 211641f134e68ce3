"""The benchmark with ground truth on many machines: each photo is a job, with all its cases.

What a case's method has made is in the folder, whole, before the next is begun: a photo that was
begun by a worker that is lost goes on where it was.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from objectmorpher.server.spread import spread
from objectmorpher_core.base.progress import Progress


def run_photos(folder: Path, seed: int, is_quick: bool, address: str, progress: Progress) -> None:
    """Fills the folder of a run at `address`. Raises SpreadError, EvaluationError."""
    from .running import claim

    claim(folder, seed)
    asked = {"folder": str(folder.absolute()), "seed": seed, "quick": is_quick}
    left = [k for k, job in enumerate(_jobs(asked)) if not job.is_done]
    jobs = [asked | {"photo": k} for k in left]
    for done, answer in enumerate(spread(_photo, jobs, address), 1):
        progress(done / len(jobs), answer["name"])


def _jobs(asked: dict[str, Any]) -> Any:
    from .methods import METHODS
    from .running import jobs_of

    return jobs_of(Path(asked["folder"]), METHODS, asked["seed"], asked["quick"])


def _photo(asked: dict[str, Any]) -> dict[str, Any]:
    """In a worker: one photo."""
    from .running import run_photo

    job = _jobs(asked)[asked["photo"]]
    run_photo(job)
    return {"name": job.name}
