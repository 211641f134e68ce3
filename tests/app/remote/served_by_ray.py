"""Run as a program by the tests: `served_jobs` on Ray Serve, on a Ray of its own with one GPU.

The GPU is a claim of Ray's; how large it is says an `nvidia-smi` on the test's PATH. Argument: the
limits as JSON. Prints where it listens and what of the GPU is taken; ends with its standard input.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[3]))

import served_jobs

from objectmorpher.server.cluster import Cluster, ClusterPlan, Door
from objectmorpher.server.front import RequestLimits
from tests.research.spread.ray_apart import place_models

PLACED = "sam2.1-small", "trellis-image-large"


def main(limits: RequestLimits) -> None:
    import ray
    from ray.cluster_utils import Cluster as Machines

    place_models(*PLACED)
    machine = {
        "num_cpus": 4, "num_gpus": 1, "object_store_memory": 200 << 20, "include_dashboard": False,
    }  # fmt: skip
    machines = Machines(initialize_head=True, head_node_args=machine)
    plan = ClusterPlan(str(machines.address), ("segment", "lift"), cpus=0.5)
    cluster = Cluster(plan, Door("127.0.0.1", 0, sys.argv[2], limits), served_jobs.TABLE)
    taken = 1 - ray.available_resources().get("GPU", 0.0)
    sys.stdout.write(json.dumps({"port": cluster.address[1], "taken": taken}) + "\n")
    sys.stdout.flush()
    sys.stdin.read()
    cluster.close()
    machines.shutdown()


if __name__ == "__main__":
    main(RequestLimits(**json.loads(sys.argv[1])))
