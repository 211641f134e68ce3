"""Work on many machines by Ray Data: each worker takes a job after the other.

Where the jobs use networks and there are GPUs, the workers are actors, of which as many lie on a
GPU as their largest network leaves room for; what it has loaded stays for the next job.

A job is JSON, and so is its answer. A worker that is lost has answered nothing, and Ray gives its
job to another one: a job leaves its results whole or not at all, and one that is done again does
no harm. Every machine has this program, and sees all files under the same names.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from objectmorpher_core.models import device

from ..cli.terminal import FAILURES, failure_sentence
from .packing import Packing, gpu_count, look_there, packed_together

HERE = "local"  # instead of an address: a Ray is started on this machine

Job = dict[str, Any]  # plain JSON
Perform = Callable[[Job], dict[str, Any]]  # a function of a module, so that workers find it


class SpreadError(RuntimeError):
    """The cluster is not there or gave up, or a job failed; one sentence."""


def spread(
    perform: Perform, jobs: Sequence[Job], address: str, stages: tuple[str, ...] = ()
) -> Iterator[dict[str, Any]]:
    """The answers of `perform` on the cluster at `address`, as they come; "local" starts a Ray.

    `stages`: whose networks the jobs use. Raises SpreadError.
    """
    if not jobs:
        return
    import ray
    from ray.exceptions import RayError

    is_ours = not ray.is_initialized()
    if is_ours:
        try:
            _start(address)
        except (ConnectionError, OSError, RuntimeError, ValueError) as error:
            raise SpreadError(f"there is no Ray at {address}: {_line(error)}") from error
    try:
        for row in _rows(perform, jobs, stages):
            told = json.loads(row["told"])
            if "failed" in told:
                raise SpreadError(told["failed"])
            yield told["answer"]
    except RayError as error:
        raise SpreadError(f"the cluster gave up: {_line(error)}") from error
    finally:
        if is_ours:
            ray.shutdown()


def _rows(
    perform: Perform, jobs: Sequence[Job], stages: tuple[str, ...]
) -> Iterator[dict[str, Any]]:
    import ray.data

    context = ray.data.DataContext.get_current()
    context.enable_progress_bars = False
    context.execution_options.preserve_order = False
    rows = [{"job": json.dumps(job)} for job in jobs]
    # A block a job: what is lost with a worker is one job, and one is asked for at a time.
    found = ray.data.from_items(rows, override_num_blocks=len(rows))
    count = int(gpu_count()) if stages else 0
    packing = packed_together(stages, look_there()) if count else Packing((), 0.0)
    worker: Any = _answered  # Ray's types know no arguments of it
    how: dict[str, Any] = {"fn_args": (perform,)}
    if packing.gpus:
        most = min(len(rows), count * int(1 / packing.gpus))
        pool = ray.data.ActorPoolStrategy(
            min_size=1, max_size=most, max_tasks_in_flight_per_actor=1
        )
        worker = _Worker
        how = {"fn_constructor_args": (perform, packing.room), "compute": pool,
               "num_gpus": packing.gpus}  # fmt: skip
    return iter(found.map(worker, num_cpus=1, **how).iter_rows())


class _Worker:
    """An actor that has a part of a GPU."""

    def __init__(self, perform: Perform, room: int) -> None:
        self._perform = perform
        device.keep_to(room)

    def __call__(self, row: dict[str, Any]) -> dict[str, Any]:
        return _answered(row, self._perform)


def _answered(row: dict[str, Any], perform: Perform) -> dict[str, Any]:
    """In a worker: one job."""
    try:
        told = {"answer": perform(json.loads(row["job"]))}
    except FAILURES as error:  # in its own words: Ray's would be a traceback
        told = {"failed": failure_sentence(error)}
    return {"told": json.dumps(told)}


def _start(address: str) -> None:
    import ray

    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    if address == HERE:
        ray.init(include_dashboard=False, log_to_driver=False)
    else:
        ray.init(address=address, log_to_driver=False)


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())[:300]
