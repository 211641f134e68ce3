"""The ledger on made devices of 8 to 80 GB: never over the limit, never worse than possible."""

from __future__ import annotations

import importlib.util
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from objectmorpher_core.models import ModelError, device, plans
from objectmorpher_core.models.ledger import SPARE, Ledger, Model
from objectmorpher_core.models.plans import Need, Network, PipelineNeed, Plan

GB = 1 << 30
CARDS = (8, 12, 16, 24, 48, 80)  # GB
HOSTS = (8, 16, 32, 64, 128)  # GB
QWEN = PipelineNeed((
    Network(41 * 10**9, 2 * 10**9, True), Network(166 * 10**8, 10**9, True),
    Network(25 * 10**7, 6 * 10**9),
))  # fmt: skip
KLEIN = PipelineNeed((Network(775 * 10**7, 3 * 10**9, True), Network(17 * 10**7, 3 * 10**9)))
NEEDS = {
    "sam": Need(224_000_000, 700_000_000),
    "depth": Need(25_000_000, 300 << 20, numbers=("float32",)),
    "trellis": Need(1_924_000_000, 2 << 30, True, ("float16",), is_slow_on_cpu=True),
    "pixelhacker": Need(1_030_000_000, 1_800_000_000, numbers=("float32", "bfloat16")),
    "qwen": QWEN, "klein": KLEIN,
}  # fmt: skip


@dataclass
class Store:
    """Memory of a device, as PyTorch's allocator keeps it: what was freed stays reserved."""

    size: int
    others: int = 0  # of other programs
    used: int = 0
    reserved: int = 0
    most: int = 0  # bytes ever reserved, with those of other programs

    def take(self, size: int) -> None:
        self.used += size
        self.reserved = max(self.reserved, self.used)
        self.most = max(self.most, self.reserved + self.others)
        if self.reserved + self.others > self.size:
            raise MemoryError

    def free(self) -> int:
        return self.size - self.others - self.used


@dataclass
class Machine:
    """A made GPU and main memory."""

    stores: dict[str, Store]
    closed: list[str] = field(default_factory=list)

    def devices(self) -> tuple[device.Device, ...]:
        return ("cuda", "cpu") if "cuda" in self.stores else ("cpu",)

    def free_memory(self, where: device.Device, /) -> int | None:
        return self.stores[where].free()

    def empty_cache(self, where: device.Device, /) -> None:
        store = self.stores[where]
        store.reserved = store.used

    def opener(self, name: str) -> Callable[[Plan], Weights]:
        return lambda plan: Weights(self, name, plan)


class Weights:
    """A model in a machine's memory, until it is let go."""

    def __init__(self, machine: Machine, name: str, plan: Plan) -> None:
        self.machine, self.name, self.plan = machine, name, plan
        for where in machine.stores:
            machine.stores[where].take(plan.holds(where))  # type: ignore[arg-type]

    def work(self) -> None:
        """Takes what the plan says, and gives it back."""
        for where, store in self.machine.stores.items():
            more = self.plan.takes(where) - self.plan.holds(where)  # type: ignore[arg-type]
            store.take(more)
            store.used -= more

    def __del__(self) -> None:
        self.machine.closed.append(self.name)
        for where, store in self.machine.stores.items():
            store.used -= self.plan.holds(where)  # type: ignore[arg-type]


def machine(gpu: float, host: float) -> Machine:
    return Machine({"cuda": Store(int(gpu * GB)), "cpu": Store(int(host * GB))})


def possible(needs: plans.Needs, there: Machine) -> Plan | None:
    """The best plan when nothing of ours is open."""
    for where in there.devices():
        for plan in needs.on(where) if where != "cpu" or not needs.is_slow_on_cpu else ():
            if all(
                plan.takes(w) <= SPARE * (s.size - s.others)  # type: ignore[arg-type]
                for w, s in there.stores.items()
            ):
                return plan
    return None


@pytest.fixture(autouse=True)
def _bf16(monkeypatch):
    monkeypatch.setattr(device, "half", lambda _: "bfloat16")
    monkeypatch.setattr(plans, "has_quantiser", lambda: True)


events = st.lists(
    st.one_of(st.sampled_from(tuple(NEEDS)), st.sampled_from([0, 1, 3, 6])), min_size=1, max_size=25
)


@settings(max_examples=400, deadline=None)
@given(card=st.sampled_from(CARDS), host=st.sampled_from(HOSTS), events=events)
def test_never_over_the_limit_and_never_a_worse_way_than_possible(card, host, events):
    """A number is how many GB of the GPU another program takes from then on."""
    there = machine(card, host)
    book = Ledger(there)
    for event in events:
        if isinstance(event, int):
            gpu = there.stores["cuda"]
            gpu.others = min(event * GB, gpu.size - gpu.reserved)
            continue
        model = Model(event, 0, NEEDS[event], there.opener(event))
        best = possible(NEEDS[event], there)
        if best is None:
            with pytest.raises(ModelError, match=r"not enough memory .* GB.* are free"):
                book.run(model, lambda weights, plan: weights.work())
            continue
        assert book.plan(model) == best

        def job(weights: Weights, plan: Plan) -> Plan:
            weights.work()
            return plan

        assert book.run(model, job) == best
        for store in there.stores.values():
            assert store.most <= store.size
        assert sum(book.holds("cuda").values()) <= there.stores["cuda"].used


def test_the_least_recently_used_gives_way_and_no_more_than_that():
    there = machine(15, 64)
    book = Ledger(there)
    need = Need(GB, GB, numbers=("bfloat16",))  # 2 GB stay, 3 GB at work

    def use(name: str, needs: Need = need) -> Weights:
        return book.run(Model(name, 0, needs, there.opener(name)), lambda weights, _: weights)

    first = use("a")
    for name in "bcdef":
        use(name)
    assert use("a") is first and not there.closed  # 12 GB of 15 are held
    del first
    use("g")
    assert there.closed == ["b"]  # not a, which was used since
    use("large", Need(5 * GB // 2, GB, numbers=("bfloat16",)))
    assert there.closed == ["b", "c", "d"]
    assert set(book.holds("cuda")) == {"e", "f", "a", "g", "large"}
    book.clear()
    assert there.stores["cuda"].used == 0


def test_another_file_or_another_room_opens_a_model_anew():
    there = machine(12, 64)
    book = Ledger(there)
    need = NEEDS["pixelhacker"]
    number = lambda made_of: book.run(  # noqa: E731
        Model("pixelhacker", made_of, need, there.opener("p")), lambda _, plan: plan.number
    )
    assert number(0) == number(0) == "float32" and not there.closed
    assert number(1) == "float32" and there.closed == ["p"]
    there.stores["cuda"].others = 6 * GB
    assert number(1) == "bfloat16"
    there.stores["cuda"].others = 0
    assert number(1) == "float32"


def test_memory_that_runs_out_is_followed_by_what_needs_less_and_not_tried_in_vain(caplog):
    there = machine(24, 64)
    book, tried = Ledger(there), []
    need = Need(GB, GB, True, ("float32", "float16"), is_slow_on_cpu=True)

    def job(weights: Weights, plan: Plan) -> str:
        tried.append((plan.number, plan.way))
        if plan.way == "whole":
            raise MemoryError
        return plan.way

    book.run(Model("other", 0, need, there.opener("other")), lambda weights, plan: None)
    model = Model("m", 0, need, there.opener("m"))
    assert book.run(model, job) == "parts"
    # The other model gives way first, and the same is tried once more.
    assert tried == [("float32", "whole")] * 2 + [("float16", "whole"), ("float32", "parts")]
    assert there.closed.count("other") == 1 and "Memory ran out on the GPU" in caplog.text
    tried.clear()
    assert book.run(model, job) == "parts" and tried == [("float32", "parts")]
    there.stores["cuda"].size *= 2
    assert book.run(model, job) == "parts" and tried[1] == ("float32", "whole")
    with pytest.raises(RuntimeError, match="shapes differ"):
        book.run(model, lambda *_: (_ for _ in ()).throw(RuntimeError("shapes differ")))


def test_two_jobs_at_a_time_share_what_is_there():
    """A job that runs neither gives way nor loses what it has not taken yet."""
    there = machine(12, 64)
    book, inside, leave = Ledger(there), threading.Event(), threading.Event()
    need = Need(GB, 6 * GB, numbers=("float16",))  # 8 GB at work

    def wait(weights: Weights, plan: Plan) -> None:
        inside.set()
        assert leave.wait(60)
        weights.work()

    first = Model("first", 0, need, there.opener("first"))
    running = threading.Thread(target=lambda: book.run(first, wait))
    running.start()
    assert inside.wait(60)
    try:
        second = Model("second", 0, need, there.opener("second"))
        assert book.plan(second).device == "cpu"
        assert book.run(second, lambda weights, plan: plan.device) == "cpu"
        book.clear()
        assert "first" in book.holds("cuda")
    finally:
        leave.set()
        running.join()
    assert book.plan(second).device == "cuda"


def ways(gpu: float, host: float, need: PipelineNeed = QWEN) -> str:
    """Of a refiner that is alone on a card, or why there is none."""
    there = machine(gpu, host)
    try:
        return Ledger(there).plan(Model("qwen", 0, need, there.opener("qwen"))).way
    except ModelError as error:
        return str(error)


def test_qwen_and_klein_on_the_cards_that_there_are(monkeypatch):
    assert [ways(card, 64) for card in (80, 48, 24)] == ["whole", "parts", "parts in four bits"]
    assert ways(48, 32) == "four bits"  # 58 GB do not go into main memory
    assert ways(12, 128) == "layers" and "not enough memory" in ways(12, 32)
    assert [ways(card, 32, KLEIN) for card in (8, 12)] == ["four bits", "whole"]
    monkeypatch.setattr(plans, "has_quantiser", lambda: False)
    told = ways(24, 32)
    assert "of the CPU are needed" in told and "bitsandbytes is not installed" in told
    # No GPU that is too small is followed by 127 GB of float32; without one they are asked for.
    assert "on the GPU" in ways(6, 16)
    there = Machine({"cpu": Store(64 * GB)})
    with pytest.raises(ModelError, match=r"on the CPU with float32 .* 1\d\d\.\d GB are needed"):
        Ledger(there).plan(Model("qwen", 0, QWEN, there.opener("qwen")))


def test_files_that_are_quantised_are_planned_by_their_size():
    short = PipelineNeed(
        (Network(13 * 10**9, 2 * 10**9), Network(5 * 10**9, 10**9)), is_shrunk=True
    )
    assert ways(24, 32, short) == "whole"
    assert ways(24, 8, short) == "whole" and "not enough" in ways(16, 8, short)
    assert ways(18, 32, short) == "parts"


@pytest.mark.skipif(importlib.util.find_spec("torch") is None, reason="torch is not installed")
def test_the_environment_decides_and_its_nonsense_is_one_sentence(monkeypatch):
    monkeypatch.setenv(device.DEVICE, "cpu")
    with monkeypatch.context() as without:  # it takes seconds to import
        without.setitem(sys.modules, "torch", None)
        assert device.devices() == ("cpu",)
    free = device.free_memory("cpu")
    assert free is not None and 0 < free < 1 << 50
    monkeypatch.setenv(device.DEVICE, "abacus")
    with pytest.raises(ModelError, match=r"'abacus'; this machine has .*cpu"):
        device.devices()


@pytest.mark.parametrize("kind", ["MemoryError", "torch", "words"])
def test_pytorchs_words_for_no_memory_are_known(kind):
    torch = pytest.importorskip("torch")
    full = {
        "MemoryError": MemoryError(), "torch": torch.OutOfMemoryError("full"),
        "words": RuntimeError("DefaultCPUAllocator: can't allocate memory"),
    }[kind]  # fmt: skip
    assert device.is_out_of_memory(full) and not device.is_out_of_memory(RuntimeError("shapes"))
