"""Where a network runs: what fits is taken, what does not is followed by what needs less."""

from __future__ import annotations

import importlib.util

import pytest

from objectmorpher_core.models import ModelError, device
from objectmorpher_core.models.device import Need, Plan

GB = 1 << 30


@pytest.fixture(autouse=True)
def _torch(monkeypatch):
    if importlib.util.find_spec("torch") is None:
        pytest.skip("torch is not installed")
    monkeypatch.delenv(device.DEVICE, raising=False)


def tiers(free: float, **more) -> list[str]:
    """On a GPU with `free` GB, for 4 GB of weights and 2 GB of work at half precision."""
    need = Need(2 * GB, 2 * GB, **more)
    return [p.tier for p in device._on("mps", need, None if free < 0 else int(free * GB))]


def test_what_fits_is_taken_whole_and_what_does_not_in_parts_where_it_can():
    assert tiers(16) == ["whole"]
    assert tiers(4) == []
    assert tiers(16, parts=True) == ["whole", "offload"]
    assert tiers(4, parts=True) == ["offload"]
    assert tiers(1, parts=True) == []
    assert tiers(-1, parts=True) == ["whole", "offload"]  # nobody knows: try


def test_exact_numbers_need_twice_as_much():
    assert tiers(10) == ["whole"] and tiers(10, only_float32=True) == []
    assert device._on("mps", Need(1, 1, only_float32=True), GB)[0].number == "float32"


def test_the_last_tier_is_the_cpu_with_exact_numbers():
    last = device.plans(Need(1000, 1000))[-1]
    assert (last.device, last.number, last.tier) == ("cpu", "float32", "cpu")
    free = device.free_memory("cpu")
    assert free is not None and 0 < free < 1 << 50


def test_the_environment_decides_and_its_nonsense_is_one_sentence(monkeypatch):
    monkeypatch.setenv(device.DEVICE, "cpu")
    assert device.devices() == ("cpu",)
    monkeypatch.setenv(device.DEVICE, "abacus")
    with pytest.raises(ModelError, match=r"'abacus'; this machine has .*cpu"):
        device.devices()


@pytest.mark.parametrize("kind", ["MemoryError", "torch", "words"])
def test_memory_that_runs_out_leads_to_the_next_tier_and_then_to_one_sentence(kind, caplog):
    import torch

    full = {
        "MemoryError": MemoryError(), "torch": torch.OutOfMemoryError("full"),
        "words": RuntimeError("DefaultCPUAllocator: can't allocate memory"),
    }[kind]  # fmt: skip
    plans = tuple(Plan("cpu", "float32", tier, "1 GB free") for tier in ("whole", "cpu"))
    tried: list[str] = []

    def attempt(plan: Plan) -> str:
        tried.append(plan.tier)
        if len(tried) % 2:
            raise full
        return plan.tier

    with caplog.at_level("WARNING"):
        assert device.run(plans, attempt) == "cpu"
    assert tried == ["whole", "cpu"]
    assert caplog.text.count("Memory ran out on the CPU") == 1
    with pytest.raises(ModelError, match="not enough memory on the CPU"):
        device.run(plans[:1], attempt)


def test_other_errors_pass_through():
    def attempt(plan: Plan) -> None:
        raise RuntimeError("shapes differ")

    with pytest.raises(RuntimeError, match="shapes differ"):
        device.run(device.plans(Need(1, 1)), attempt)
