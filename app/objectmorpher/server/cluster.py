"""Serves from one or many machines with Ray Serve: each backend is a deployment that grows.

The backend that "auto" is has its processes from the start, of each stage; another one's start with
the first call for it, and end when nobody asks for it any more. Which can run, and which is "auto",
is looked up where the processes will run, not here: this machine may lack their GPU.

A call whose process or machine dies is run again by another one. Only our own front listens to
users: Ray's HTTP proxy and dashboard are not started. Ray's own ports let whoever reaches them
run programs, so that a cluster that is started here gets a token of Ray's, too.
"""

from __future__ import annotations

import asyncio
import logging
import os
import platform
import secrets
import sys
import threading
from collections import OrderedDict
from collections.abc import AsyncIterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, cast

from objectmorpher_core.base.progress import Cancelled, Progress

from ..editor.settings import STAGES
from .offers import Offers, look_at_offers
from .running import Call, JobOutcome, perform
from .table import Served, table

log = logging.getLogger(__name__)

TRIES = 3  # processes that a call may cost
KEPT = 8  # large arrays in Ray's store
WAIT = 0.1  # s between two looks at whether a call is still wanted
MOST_QUEUED = 32  # calls per backend
UPSCALE = 1.0  # s that calls wait before another process is started: someone waits for them
LOOK_BACK = 3.0  # s over which Ray Serve averages how many wait
DOWNSCALE = 300.0  # s: a model that was loaded is soon wanted again
HEALTH = 2.0  # s between two looks at each process
# Backends that no GPU helps: their processes ask Ray for none.
ON_CPU = ("dino", "subject", "grabcut", "sam-onnx", "lama", "migan", "patchmatch", "telea")


@dataclass(frozen=True)
class ClusterPlan:
    """The spread of the backends over processes."""

    address: str | None = None  # of a running cluster; None: one is started here
    stages: tuple[str, ...] = STAGES
    least: int = 1  # processes of the backend that is "auto"
    most: int = 1  # of each backend
    cpus: float = 1.0  # per process, as Ray counts them
    gpus: float | None = None  # per process; None: the backends share one, where there are any
    store: int | None = None  # bytes of the object store of one started here; None: Ray's choice


class Cluster:
    """The stages on Ray Serve."""

    def __init__(self, plan: ClusterPlan) -> None:
        """Blocks until each stage has a process, if it can run. Raises RuntimeError."""
        self._plan = plan
        self._stored: OrderedDict[str, Any] = OrderedDict()  # name -> reference
        self._lock = threading.Lock()
        self._handles: dict[str, Any] = {}  # by the deployment's name
        self._deploying = threading.Lock()
        _start_ray(plan)
        try:
            found = _looked_up(plan)
            self._offers = {stage: found[stage] for stage in plan.stages}
            for stage, offer in self._offers.items():
                if offer.auto:
                    self._handle(stage, offer.auto)
        except BaseException:
            self.close()
            raise

    def stages(self) -> dict[str, int]:
        return dict.fromkeys(self._plan.stages, self._plan.most)

    def offers(self) -> Offers:
        return self._offers

    def run(self, call: Call, served: Served, tell: Progress, stop: threading.Event) -> JobOutcome:
        from ray import exceptions

        lost = exceptions.RayActorError, exceptions.WorkerCrashedError, exceptions.ObjectLostError
        for _ in range(TRIES):
            try:
                return self._try(call, served, tell, stop)
            except lost as error:
                if stop.is_set():
                    raise Cancelled from error
                log.warning("%s lost its process; it is run again", call.name)
                self._forget(call)
                tell(0.0, "once more, in another process")
        return JobOutcome(error=f"{call.name} has ended {TRIES} processes of the server")

    def close(self) -> None:
        """Ends the stages, and the cluster if it was started here."""
        import ray
        from ray import serve

        if self._plan.address is None:
            serve.shutdown()
        else:
            for name in self._handles:
                serve.delete(_app(name))
        self._stored.clear()
        ray.shutdown()

    def _handle(self, stage: str, backend: str) -> Any:
        """To the processes of a backend; its deployment is made with the first call for it."""
        offer = self._offers[stage]
        meant = offer.deployed(backend)
        name = f"{stage}-{meant}"
        with self._deploying:
            if name not in self._handles:
                log.info("%s is deployed", name)
                least = self._plan.least if meant == offer.auto else 0
                self._handles[name] = self._deploy(name, meant, least)
            return self._handles[name]

    def _deploy(self, name: str, backend: str, least: int) -> Any:
        from ray import serve

        plan = self._plan
        scaling: dict[str, Any] = {"num_replicas": plan.least}
        if plan.most > least:
            scaling = {"autoscaling_config": {
                "min_replicas": least, "max_replicas": plan.most, "initial_replicas": least,
                "target_ongoing_requests": 1, "upscale_delay_s": UPSCALE,
                "look_back_period_s": LOOK_BACK, "downscale_delay_s": DOWNSCALE,
            }}  # fmt: skip
        gpus = 0.0 if backend in ON_CPU else _gpus(plan, self._offers)
        made: Any = serve.deployment(Replica)
        deployment = made.options(
            name=name, max_ongoing_requests=1, max_queued_requests=MOST_QUEUED,
            ray_actor_options={"num_cpus": plan.cpus, "num_gpus": gpus},
            health_check_period_s=HEALTH, graceful_shutdown_timeout_s=HEALTH, **scaling,
        )  # fmt: skip
        handle = serve.run(deployment.bind(), name=_app(name), route_prefix=None)
        return handle.options(stream=True)

    def _try(self, call: Call, served: Served, tell: Progress, stop: threading.Event) -> JobOutcome:
        """Raises one of Ray's errors where the process is lost."""
        from ray import exceptions

        handle = self._handle(served.stage, call.backend)
        stream: Any = handle.run.remote(call.name, call.body, self._store(call))
        is_over = threading.Event()

        def watch() -> None:
            while not is_over.wait(WAIT):
                if stop.is_set():
                    stream.cancel()
                    return

        watcher = threading.Thread(target=watch, daemon=True)
        watcher.start()
        try:
            for item in stream:
                what, value = cast(tuple[str, Any], item)
                if what == DONE:
                    if value is None:
                        raise Cancelled
                    return value
                if stop.is_set():
                    raise Cancelled
                if what == STARTED:
                    log.info("%s runs on %s, process %d", call.name, *value)
                fraction, note = (0.0, "") if what == STARTED else value
                tell(fraction, note)
        except exceptions.TaskCancelledError as error:
            raise Cancelled from error
        finally:
            is_over.set()
            watcher.join()
        raise Cancelled  # the stream was closed without an outcome

    def _store(self, call: Call) -> dict[str, Any]:
        """References to the call's large arrays in Ray's store, where each is put once."""
        import ray

        with self._lock:
            for name, body in call.blobs.items():
                if name not in self._stored:
                    self._stored[name] = ray.put(body)
                self._stored.move_to_end(name)
            found = {name: self._stored[name] for name in call.blobs}
            while len(self._stored) > max(KEPT, len(call.blobs)):
                self._stored.popitem(last=False)
            return found

    def _forget(self, call: Call) -> None:
        """What lay on a machine that is gone is put anew."""
        with self._lock:
            for name in call.blobs:
                self._stored.pop(name, None)


def _app(name: str) -> str:
    return f"objectmorpher-{name}"


def _looked_up(plan: ClusterPlan) -> Offers:
    """What the machines can run, by a process that has what the backends' will have."""
    import ray

    remote: Any = ray.remote
    look = remote(num_cpus=plan.cpus, num_gpus=_gpus(plan, {}))(look_at_offers)
    return cast(Offers, ray.get(look.remote()))


def _gpus(plan: ClusterPlan, offers: Offers) -> float:
    """Of one process, as Ray counts them."""
    import ray

    if plan.gpus is not None:
        return plan.gpus
    has_any = cast(dict[str, float], ray.cluster_resources()).get("GPU", 0) > 0
    sharing = sum(name not in ON_CPU for offer in offers.values() for name in offer.able)
    return int(100 / max(sharing, 1)) / 100 if has_any else 0.0


def _start_ray(plan: ClusterPlan) -> None:
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    if plan.address is None and "RAY_AUTH_MODE" not in os.environ:
        assert "ray" not in sys.modules, "Ray reads these when it is imported"
        os.environ["RAY_AUTH_MODE"] = "token"
        os.environ["RAY_AUTH_TOKEN"] = secrets.token_hex(32)
    import ray
    from ray import serve

    common: dict[str, Any] = {"log_to_driver": False, "namespace": "objectmorpher"}
    if plan.address is None:
        ray.init(object_store_memory=plan.store, include_dashboard=False, **common)
    else:
        ray.init(address=plan.address, **common)
    serve.start(http_options={"location": "NoServer"})


# One process of a stage on a cluster: runs a call at a time, and tells how far it is.

BEAT = 0.1  # s between two looks at a running job
STARTED, PROGRESS, DONE = "started", "progress", "done"  # what it tells


class Replica:
    """The class that Ray Serve starts as often as the plan says."""

    def __init__(self) -> None:
        # One thread: job functions remember their last photo, and are not made for two at a time.
        self._thread = ThreadPoolExecutor(1)

    async def run(
        self, name: str, body: bytes, blobs: dict[str, Any]
    ) -> AsyncIterator[tuple[str, Any]]:
        """Tells the place, then steps, then the outcome; `blobs` are references to Ray's store.

        When the stream is closed the job is asked to stop.
        """
        stop = threading.Event()
        steps: list[tuple[float, str]] = []

        def work() -> JobOutcome | None:
            import ray

            arrays: Any = {key: ray.get(reference) for key, reference in blobs.items()}
            call = Call(name, body, arrays)
            try:
                return perform(call, table()[name], lambda *s: steps.append(s), stop.is_set)
            except Cancelled:
                return None

        yield STARTED, (platform.node(), os.getpid())
        job = asyncio.get_running_loop().run_in_executor(self._thread, work)
        try:
            while not job.done():
                await asyncio.wait({job}, timeout=BEAT)
                if steps:
                    step = steps[-1]
                    steps.clear()
                    yield PROGRESS, step
            yield DONE, job.result()
        finally:
            stop.set()
