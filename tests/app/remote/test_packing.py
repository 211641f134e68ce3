"""Processes on cards of 8 to 80 GB: they fit side by side, and no network runs worse for it."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from objectmorpher.editor.settings import STAGES
from objectmorpher.server.packing import PackingError, Site, fit, packed
from objectmorpher.server.running import Offer
from objectmorpher_core.model_sets import DRIVER, Card, need_of
from objectmorpher_core.models import hub_model
from objectmorpher_core.models.ledger import Ledger, Model
from objectmorpher_core.models.plans import Plan

GB = 1 << 30
HOST = 128 * GB
NETWORKS = {  # that a server may have, by stage
    "segment": ("sam2.1-small", "sam-vit-huge"), "lift": ("trellis-image-large",),
    "inpaint": ("pixelhacker",), "refine": ("flux2-klein-4b", "qwen-image-edit-2511"),
}  # fmt: skip
NOBODY = dict.fromkeys(STAGES, Offer("", ()))


def plan_on(id: str, card: Card) -> Plan:
    need: Any = need_of(hub_model(id))
    return Ledger(card).plan(Model(id, id, need, lambda plan: plan))


@settings(max_examples=200, deadline=None)
@given(
    gb=st.sampled_from((8, 12, 16, 24, 48, 80)), count=st.integers(1, 4), copies=st.integers(1, 3),
    ids=st.sets(st.sampled_from(sum(NETWORKS.values(), ())), min_size=1),
)  # fmt: skip
def test_processes_fit_and_each_network_runs_as_if_it_had_the_card(gb, count, copies, ids):
    card = Card(gb * GB, HOST)
    own = {stage: [i for i in NETWORKS[stage] if i in ids] for stage in STAGES}
    takes = {s: max([plan_on(i, card).peak for i in own[s]], default=0) for s in STAGES}
    try:
        found = packed(Site(NOBODY, card.gpu, takes), count, copies)
    except PackingError:
        assert copies > count, "one process a card always fits"
        return
    assert sorted(s for p in found for s in p.stages) == sorted(STAGES)
    assert copies * sum(p.room + DRIVER for p in found if p.gpus) <= count * card.gpu
    for packing in found:
        for id in (i for stage in packing.stages for i in own[stage]):
            assert plan_on(id, Card(packing.room + DRIVER, HOST)) == plan_on(id, card)


def test_clicks_keep_a_process_of_their_own_for_as_long_as_possible():
    def groups(gb: int, refiner: str) -> tuple[tuple[str, ...], ...]:
        ids = ("sam2.1-small", "trellis-image-large", "pixelhacker", refiner)
        card = Card(gb * GB, HOST)
        takes = {s: plan_on(i, card).peak for s, i in zip(STAGES, ids, strict=True)}
        return tuple(p.stages for p in packed(Site(NOBODY, card.gpu, takes), 1, 1))

    apart, clicks = tuple((stage,) for stage in STAGES), (STAGES[:1], STAGES[1:])
    assert groups(8, "qwen-image-edit-2511") == (STAGES,)
    for gb in (12, 16, 24, 48, 80):
        assert groups(gb, "qwen-image-edit-2511") == clicks
    assert groups(48, "flux2-klein-4b") == apart
    none = Site(NOBODY, 0, dict.fromkeys(STAGES, 0))
    assert tuple(p.stages for p in packed(none, 0, 4)) == apart


def test_no_process_lies_on_two_cards():
    assert fit((0.5, 0.5, 0.5, 0.5), 2) and fit((0.6, 0.4, 0.6, 0.4), 2)
    assert not fit((0.6, 0.6, 0.6), 2) and not fit((0.1,), 0)
    with pytest.raises(PackingError, match="fewer by --replicas"):
        packed(Site(NOBODY, 8 * GB, {"lift": 5 * GB}), 1, 2)
