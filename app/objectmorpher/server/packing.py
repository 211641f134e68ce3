"""How much of a GPU each process of a server asks for: what its largest network takes at most.

Each stage has processes of its own where they fit side by side, so that nobody waits for another
stage. Where they do not, clicks keep their own, and the other stages share one, whose ledger lets
its networks take turns; and on the smallest cards all share one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from objectmorpher_core import models
from objectmorpher_core.lift.workers.file import worker_names
from objectmorpher_core.model_sets import DRIVER, Card, need_of, this_card
from objectmorpher_core.models import ModelError
from objectmorpher_core.models.ledger import SPARE, Ledger, Model

from .running import Offers, look_at_offers

ALSO = {"depth": "lift"}  # stages of models that work in another one
FINEST = 1000  # parts of a GPU that are counted
GLIMPSE = 0.01  # of a GPU, to look at one


class PackingError(RuntimeError):
    """The processes do not fit on the GPUs that there are; one sentence."""


@dataclass(frozen=True)
class Site:
    """What a process finds where the stages' processes will run."""

    offers: Offers
    card: int  # bytes of its GPU; 0: there is none
    takes: Mapping[str, int]  # stage -> bytes of it that the largest of its networks takes

    def of(self, stages: tuple[str, ...]) -> Site:
        """What matters for some of the stages."""
        return Site(
            {stage: self.offers[stage] for stage in stages}, self.card,
            {stage: self.takes[stage] for stage in stages},
        )  # fmt: skip


def look_at_site() -> Site:
    """This machine, as this process sees it."""
    card, found = this_card(), look_at_offers()
    if card.kind != "cuda" or not card.gpu:
        return Site(found, 0, dict.fromkeys(found, 0))
    takes = {stage: taken(stage, card) for stage in found}
    # What a program of the user's takes is not known, but it has to see the GPU.
    takes["lift"] = max(takes["lift"], len(worker_names()))
    return Site(found, card.gpu, takes)


def taken(stage: str, card: Card) -> int:
    """Bytes of the card that the largest of a stage's models that are here takes, run alone."""
    own = [m for m in models.hub_models() if ALSO.get(m.stage, m.stage) == stage]
    peaks = [0]
    for model in own:
        need = need_of(model) if models.place(model.id) is not None else None
        if need is None:
            continue
        try:
            plan = Ledger(card).plan(Model(model.id, model.id, need, lambda plan: plan))
        except ModelError:
            continue  # it says so when it is asked for
        peaks.append(plan.peak if plan.device == card.kind else 0)
    return max(peaks)


def gpu_count() -> float:
    """GPUs of the Ray that is connected to."""
    import ray

    return cast(dict[str, float], ray.cluster_resources()).get("GPU", 0.0)


def look_there(cpus: float = 1.0) -> Site:
    """What a process finds on the Ray that is connected to."""
    import ray

    remote: Any = ray.remote
    look = remote(num_cpus=cpus, num_gpus=GLIMPSE if gpu_count() else 0)(look_at_site)
    return cast(Site, ray.get(look.remote()))


@dataclass(frozen=True)
class Packing:
    """Stages whose processes are the same, and what of a GPU each of these asks for."""

    stages: tuple[str, ...]
    gpus: float
    room: int = 0  # bytes that it may take; 0: all that is there


def packed(site: Site, count: float, copies: int) -> tuple[Packing, ...]:
    """`copies` processes of each on `count` GPUs, with as few stages sharing as fit.

    Raises PackingError.
    """
    stages = tuple(site.takes)
    rest = tuple(s for s in stages if s != "segment")
    clicks = tuple(s for s in stages if s == "segment")
    told = 0.0
    for groups in (tuple((s,) for s in stages), (clicks, rest), (stages,)):
        found = tuple(packed_together(group, site) for group in groups if group)
        if fit([p.gpus for p in found for _ in range(copies)], count):
            return found
        told = max(p.gpus for p in found)
    raise PackingError(
        f"{copies} processes that take {told:.2f} of a GPU each do not fit on {count:g}:"
        " ask for fewer by --replicas, or for fewer --stages"
    )


def packed_together(group: tuple[str, ...], site: Site) -> Packing:
    """Processes of which each does the work of all these stages."""
    most = max(site.takes[stage] for stage in group)
    if not most:
        return Packing(group, 0.0)
    share = math.ceil(FINEST * (most / SPARE + DRIVER) / site.card) / FINEST
    share = min(share, 1.0)
    return Packing(group, share, int(share * site.card) - DRIVER)


def fit(shares: Sequence[float], count: float) -> bool:
    """Whether processes that take these shares fit on so many GPUs, none of them on two."""
    free = [1.0] * int(count)
    for share in sorted(shares, reverse=True):
        place = next((k for k, left in enumerate(free) if share <= left + 1e-9), None)
        if share and place is None:
            return False
        if share and place is not None:
            free[place] -= share
    return True
