"""`evaluate metrics` on many machines: each pair of pictures is measured by some worker."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from objectmorpher.server.spread import Job, spread
from objectmorpher_core.base.progress import Progress

from .metrics import Choices, OpenedMeasures, Results, Taken
from .pairs import MaskedPair


def measure_spread(
    pairs: Sequence[MaskedPair], choices: Choices, address: str, progress: Progress
) -> Results:
    """Measure like `measure`, on the cluster at `address`. Raises EvaluationError, SpreadError."""
    opened = OpenedMeasures(choices, len(pairs))
    jobs = [_job(k, pair, choices, len(pairs)) for k, pair in enumerate(pairs)]
    taken: dict[int, Taken] = {}
    for answer in spread(take_there, jobs, address):
        taken[answer["number"]] = _taken(answer)
        progress(len(taken) / len(pairs), answer["name"])
    return opened.results([taken[k] for k in range(len(pairs))])


def _job(number: int, pair: MaskedPair, choices: Choices, pairs: int) -> Job:
    files = (pair.a, pair.b, pair.mask)
    return {
        "number": number, "pairs": pairs, "name": pair.name,
        "files": [None if path is None else str(path.absolute()) for path in files],
        "metrics": choices.metrics, "is_lenient": choices.is_lenient,
        "weights": None if choices.weights is None else str(choices.weights.absolute()),
    }  # fmt: skip


def take_there(job: Job) -> dict[str, Any]:
    """Take one pair in a worker. Raises EvaluationError."""
    a, b, mask = (None if name is None else Path(name) for name in job["files"])
    assert a is not None and b is not None
    opened = _opened(tuple(job["metrics"]), job["weights"], job["is_lenient"], job["pairs"])
    taken = opened.take(MaskedPair(job["name"], a, b, mask))
    return {
        "number": job["number"],
        "name": taken.name,
        "values": [[*key, value] for key, value in taken.values.items()],
        "features": {name: [x.tolist() for x in sides] for name, sides in taken.features.items()},
    }


@lru_cache(maxsize=1)
def _opened(
    metrics: tuple[str, ...], weights: str | None, is_lenient: bool, pairs: int
) -> OpenedMeasures:
    """The networks stay open from one pair to the next."""
    folder = None if weights is None else Path(weights)
    return OpenedMeasures(Choices(metrics, folder, is_lenient=is_lenient), pairs)


def _taken(answer: dict[str, Any]) -> Taken:
    values = {(metric, region): value for metric, region, value in answer["values"]}
    features = {
        name: (np.array(a, np.float64), np.array(b, np.float64))
        for name, (a, b) in answer["features"].items()
    }
    return Taken(answer["name"], values, features)
