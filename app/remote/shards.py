"""Shards of triplets on many machines, by Ray Data: each worker takes a shard after the other.

A worker that is lost has left nothing but a folder of another name; Ray gives its shard to another
one. Every machine sees the source and the output folder under the same names.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from objectmorpher_core.progress import Progress

if TYPE_CHECKING:
    from objectmorpher_core.training.composition.shards import Shard
    from objectmorpher_core.training.composition.triplet import How

HERE = "local"  # instead of an address: a Ray is started on this machine


def write_shards(
    out: Path, shards: tuple[Shard, ...], how: How, address: str, progress: Progress
) -> None:
    """Writes `shards` (of `composition.shards`) on the cluster at `address`; "local" starts a Ray.

    Raises TrainingError.
    """
    import ray
    from ray.exceptions import RayError

    from objectmorpher_core.training.composition import TrainingError

    is_ours = not ray.is_initialized()
    if is_ours:
        try:
            _start(address)
        except (ConnectionError, OSError, RuntimeError, ValueError) as error:
            raise TrainingError(f"there is no Ray at {address}: {_line(error)}") from error
    try:
        for done, _ in enumerate(_answers(out, shards, how), 1):
            progress(done / len(shards), f"{done} of {len(shards)} shards")
    except RayError as error:
        raise TrainingError(f"the cluster gave up: {_line(error)}") from error
    finally:
        if is_ours:
            ray.shutdown()


def _answers(out: Path, shards: tuple[Shard, ...], how: How) -> Iterable[dict[str, Any]]:
    """One for each shard, as they are finished."""
    import ray.data

    context = ray.data.DataContext.get_current()
    context.enable_progress_bars = False
    context.execution_options.preserve_order = False
    common = {"out": str(out.absolute()), "how": asdict(how)}
    rows = [{"job": json.dumps(common | {"shard": asdict(shard)})} for shard in shards]
    # A block a shard: what is lost with a worker is one shard, and one is asked for at a time.
    found = ray.data.from_items(rows, override_num_blocks=len(rows))
    return found.map(_written, num_cpus=1).iter_rows()


def _written(row: dict[str, Any]) -> dict[str, Any]:
    """In a worker: the shard of a row."""
    from objectmorpher_core.training.composition.shards import Shard, write_shard
    from objectmorpher_core.training.composition.sources import pair_from
    from objectmorpher_core.training.composition.triplet import how_from

    told = json.loads(row["job"])
    pairs = tuple(pair_from(pair) for pair in told["shard"]["pairs"])
    shard = Shard(told["shard"]["number"], pairs)
    is_new = write_shard(Path(told["out"]), shard, how_from(told["how"]))
    return {"shard": shard.number, "new": is_new}


def _start(address: str) -> None:
    import ray

    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    if address == HERE:
        ray.init(include_dashboard=False, log_to_driver=False)
    else:
        ray.init(address=address, log_to_driver=False)


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())[:300]
