"""Run as a program by the tests: shards on a Ray of two nodes on this machine, a worker killed.

Arguments: SOURCE OUT NOTES, and models that seem to be installed, with which each machine has a
GPU. Prints what happened as JSON.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[3]))

from objectmorpher_research.training.composition import shards as disk
from objectmorpher_research.training.composition.sources import SourceReading, find_pairs
from objectmorpher_research.training.composition.spread_shards import write_shards
from objectmorpher_research.training.composition.triplet import TripletPlan
from tests.research.spread.ray_apart import place_models

HOW = TripletPlan("auto", "relief", "telea", "same-pose", gaussians=2000)
SIZE = 2


def main(source: Path, out: Path, notes: Path, *installed: str) -> None:
    from ray.cluster_utils import Cluster

    place_models(*installed)
    small = {"num_cpus": 2, "num_gpus": int(bool(installed)), "object_store_memory": 100 << 20}
    cluster = Cluster(initialize_head=True, head_node_args=small | {"include_dashboard": False})
    cluster.add_node(**small)
    cluster.wait_for_nodes()
    parts = disk.shards_of(find_pairs(source, SourceReading(both_ways=False)), SIZE)
    disk.begin(out, parts, HOW)
    killed: list[int] = []
    threading.Thread(target=kill_one, args=(notes, killed), daemon=True).start()
    told: list[float] = []
    write_shards(out, parts, HOW, cluster.address, lambda share, note: told.append(share))
    unfinished = len(list(out.glob(f"{disk.UNFINISHED}*")))
    asked = [tuple(map(int, p.read_text().split()[:2])) for p in notes.iterdir()]
    gpus = {p.read_text().partition("gpu")[2] for p in notes.iterdir()}
    found = disk.finish(out, parts)
    cluster.shutdown()
    print(json.dumps({
        "shards": [s.name for s in parts], "killed": killed, "unfinished": unfinished,
        "asked": len(asked), "workers": len({a for a, _ in asked}),
        "nodes": len({b for _, b in asked}), "progress": told, "gpus": sorted(gpus), **found,
    }))  # fmt: skip


def kill_one(notes: Path, killed: list[int]) -> None:
    """The third process that asks for a pose, while it waits for it."""
    while len(list(notes.iterdir())) < 3:
        time.sleep(0.02)
    time.sleep(0.2)
    latest = max(notes.iterdir(), key=lambda p: p.stat().st_mtime)
    killed.append(int(latest.read_text().split()[0]))
    os.kill(killed[0], signal.SIGKILL)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:4]), *sys.argv[4:])
