"""Serves from one or many machines with Ray Serve: its proxies, an ingress, the stages' processes.

What can run, which backend is "auto" and how large the GPU is, is looked up where the processes
will run, not here: this machine may lack their GPU.

A call whose process or machine dies is run again by another one. Ray's dashboard is not started.
Ray's own ports let whoever reaches them run programs, so that a cluster that is started here gets
a token of Ray's, too.
"""

from __future__ import annotations

import logging
import os
import secrets
import socket
import sys
from dataclasses import dataclass, field
from typing import Any

from ..editor.settings import STAGES
from .address import check_token, url_at
from .front import IDLE, RequestLimits
from .packing import Packing, PackingError, Site, gpu_count, look_there, packed
from .table import Table

log = logging.getLogger(__name__)

NAME = "objectmorpher"  # of the application, and of Ray's namespace
MOST_QUEUED = 32  # calls per stage
UPSCALE = 1.0  # s that calls wait before another process is started: someone waits for them
LOOK_BACK = 3.0  # s over which Ray Serve averages how many wait
DOWNSCALE = 300.0  # s: a model that was loaded is soon wanted again
HEALTH = 2.0  # s between two looks at each process
DEADLINE = "RAY_SERVE_QUEUE_LENGTH_RESPONSE_DEADLINE_S"
SAYS = 1.0  # s in which a process says that it is free; after Serve's .1 a slow one counts as busy


@dataclass(frozen=True)
class ClusterPlan:
    """The spread of the stages over processes."""

    address: str | None = None  # of a running cluster; None: one is started here
    stages: tuple[str, ...] = STAGES
    least: int = 1  # processes of each stage that can run
    most: int = 1
    cpus: float = 1.0  # per process, as Ray counts them
    gpus: float | None = None  # per process; None: by the memory that its networks take
    store: int | None = None  # bytes of the object store of one started here; None: Ray's choice


@dataclass(frozen=True)
class Door:
    """Where the proxies listen, and whom they let in."""

    host: str
    port: int  # 0: any free one
    token: str = field(repr=False)
    limits: RequestLimits


class Cluster:
    """The stages on Ray Serve, from the first request that they can take until `close`."""

    def __init__(self, plan: ClusterPlan, door: Door, table: Table) -> None:
        """Blocks until each stage that can run has its processes.

        Raises OSError where the address is taken, TokenError, RuntimeError.
        """
        check_token(door.token)
        self.address = door.host, _free_port(door)
        _start_ray(plan)
        try:
            self._serve(plan, door, table)
        except BaseException:
            self.close()
            raise

    @property
    def url(self) -> str:
        """Return the URL that a client takes."""
        return url_at(*self.address)

    def close(self) -> None:
        """Ends the stages, and the cluster if it was started here."""
        import ray
        from ray import serve

        serve.shutdown()
        ray.shutdown()

    def _serve(self, plan: ClusterPlan, door: Door, table: Table) -> None:
        from ray import serve

        from .ingress import Ingress, proxy_environment

        if serve.status().proxies:
            raise PackingError("Ray Serve runs on that cluster already: `serve shutdown` ends it")
        host, port = self.address
        serve.start(
            proxy_location="EveryNode",
            http_options={"host": host, "port": port, "keep_alive_timeout_s": int(IDLE)},
            controller_options={
                "runtime_env": {"env_vars": proxy_environment(door.token, door.limits)}
            },
            logging_config={"log_level": "WARNING"},
        )
        site, handles = look_there(plan.cpus).of(plan.stages), {}
        for packing in _packings(plan, site):
            log.info("%s: %s", ", ".join(packing.stages), _told(packing))
            handles |= dict.fromkeys(packing.stages, _deployment(packing, plan, site, table))
        made: Any = serve.deployment(serve.ingress()(Ingress))
        ingress = made.options(
            name="ingress", max_ongoing_requests=door.limits.connections,
            ray_actor_options={
                "num_cpus": 0, "runtime_env": {"env_vars": {DEADLINE: str(SAYS)}},
            },
            health_check_period_s=HEALTH, graceful_shutdown_timeout_s=HEALTH,
            logging_config={"log_level": "WARNING"},
        )  # fmt: skip
        bound = ingress.bind(door.token, door.limits, table, handles, site.offers, plan.most)
        serve.run(bound, name=NAME, route_prefix="/")


def _deployment(packing: Packing, plan: ClusterPlan, site: Site, table: Table) -> Any:
    """The processes of some stages; those that cannot run have none until somebody asks."""
    from ray import serve

    from .stages import StageProcess

    least = plan.least if any(site.offers[stage].auto for stage in packing.stages) else 0
    scaling: dict[str, Any] = {"num_replicas": plan.least}
    if plan.most > least:
        scaling = {"autoscaling_config": {
            "min_replicas": least, "max_replicas": plan.most, "initial_replicas": least,
            "target_ongoing_requests": 1, "upscale_delay_s": UPSCALE,
            "look_back_period_s": LOOK_BACK, "downscale_delay_s": DOWNSCALE,
        }}  # fmt: skip
    made: Any = serve.deployment(StageProcess)
    return made.options(
        name="-".join(packing.stages), max_ongoing_requests=1, max_queued_requests=MOST_QUEUED,
        ray_actor_options={"num_cpus": plan.cpus, "num_gpus": packing.gpus},
        health_check_period_s=HEALTH, graceful_shutdown_timeout_s=HEALTH,
        logging_config={"log_level": "WARNING"}, **scaling,
    ).bind(table, packing.room)  # fmt: skip


def _packings(plan: ClusterPlan, site: Site) -> tuple[Packing, ...]:
    """Raises PackingError."""
    if plan.gpus is not None:
        return tuple(Packing((stage,), plan.gpus) for stage in plan.stages)
    return packed(site, gpu_count(), plan.least)


def _told(packing: Packing) -> str:
    if not packing.gpus:
        return "no GPU"
    return f"{packing.gpus:.2f} of a GPU each, {packing.room / 2**30:.1f} GB"


def _free_port(door: Door) -> int:
    """The port, or a free one for 0. Raises OSError where it is taken."""
    family = socket.AF_INET6 if ":" in door.host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind((door.host, door.port))
        return int(probe.getsockname()[1])


def _start_ray(plan: ClusterPlan) -> None:
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    os.environ.setdefault("RAY_DEDUP_LOGS", "0")  # each line of ours says what another does not
    if plan.address is None and "RAY_AUTH_MODE" not in os.environ:
        assert "ray" not in sys.modules, "Ray reads these when it is imported"
        os.environ["RAY_AUTH_MODE"] = "token"
        os.environ["RAY_AUTH_TOKEN"] = secrets.token_hex(32)
    import ray

    common: dict[str, Any] = {"namespace": NAME, "logging_level": logging.WARNING}
    if plan.address is None:
        ray.init(object_store_memory=plan.store, include_dashboard=False, **common)
    else:
        ray.init(address=plan.address, **common)
