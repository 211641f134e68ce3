"""Shards of triplets on many machines."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from objectmorpher.server.spread import spread
from objectmorpher_core.base.progress import Progress

STAGES = ("segment", "lift", "inpaint")  # whose networks make a triplet

if TYPE_CHECKING:
    from .shards import Shard
    from .triplet import TripletPlan


def write_shards(
    out: Path, shards: tuple[Shard, ...], how: TripletPlan, address: str, progress: Progress
) -> None:
    """Writes `shards` (of `composition.shards`) on the cluster at `address`; "local" starts a Ray.

    Raises SpreadError.
    """
    common = {"out": str(out.absolute()), "how": asdict(how)}
    jobs = [common | {"shard": asdict(shard)} for shard in shards]
    for done, _ in enumerate(spread(_written, jobs, address, STAGES), 1):
        progress(done / len(shards), f"{done} of {len(shards)} shards")


def _written(job: dict[str, Any]) -> dict[str, Any]:
    """In a worker: one shard."""
    from .shards import Shard, write_shard
    from .sources import pair_from
    from .triplet import how_from

    pairs = tuple(pair_from(pair) for pair in job["shard"]["pairs"])
    shard = Shard(job["shard"]["number"], pairs)
    is_new = write_shard(Path(job["out"]), shard, how_from(job["how"]))
    return {"shard": shard.number, "new": is_new}
