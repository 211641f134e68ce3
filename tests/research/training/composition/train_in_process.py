"""Run as a program by the tests: a training, or its gradients, in a process of its own.

train: FOLDER WEIGHTS STEPS; gradients, sharded, four-bits: FOLDER WEIGHTS FILE, of all processes
of a group together, of which each holds all weights or a shard; sharded and four-bits also train,
and go on. The last has a base in four bits, in bfloat16.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

ROOT = Path(__file__).parents[4]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import made_up  # noqa: E402
from safetensors.torch import save_file  # noqa: E402

from objectmorpher_research.training.composition import train_lora  # noqa: E402
from objectmorpher_research.training.composition.checkpoint import whole  # noqa: E402
from objectmorpher_research.training.composition.lora_plan import LoraPlan  # noqa: E402
from objectmorpher_research.training.composition.train_lora import Course, Trainer  # noqa: E402

PLAN = LoraPlan("qwen", made_up.SIDE, rate=1e-3, batch=2, mean=0.9, held_out=1, number="float32")
FOUR_BITS = replace(PLAN, number="bfloat16", base="nf4")
COURSE = Course(12, saved=4, looked=0)


def shard() -> None:
    """Trainers are sharded by FSDP 2. Accelerate does it on GPUs alone, PyTorch on the CPU, too."""
    from accelerate.state import AcceleratorState
    from accelerate.utils import DistributedType, FullyShardedDataParallelPlugin

    made = train_lora.accelerator_of

    def sharded(number: str) -> Any:
        found = made(number)
        plugin = FullyShardedDataParallelPlugin(fsdp_version=2, cpu_ram_efficient_loading=False)
        state = {"distributed_type": DistributedType.FSDP, "fsdp_plugin": plugin}
        AcceleratorState._shared_state.update(state)
        assert found.is_fsdp2
        return found

    train_lora.accelerator_of = sharded


def allow_four_bits(patch: Callable[[object, str, object], None] = setattr) -> None:
    """On the CPU, which bitsandbytes can and diffusers refuses.

    For processors with bfloat16 it packs layers anew, and fails at those narrower than 64.
    """
    import bitsandbytes
    from diffusers.quantizers.bitsandbytes import BnB4BitDiffusersQuantizer

    patch(BnB4BitDiffusersQuantizer, "validate_environment", lambda *_, **__: None)
    patch(bitsandbytes.nn.modules, "has_avx512bf16", lambda: False)


def main(what: str, folder: str, weights: str, last: str) -> None:
    torch.set_num_threads(1)
    made_up.small_conditions()
    name = {"train": "killed"}.get(what, what)
    plan = PLAN
    if what in ("sharded", "four-bits"):
        shard()
    if what == "four-bits":
        allow_four_bits()
        plan = FOUR_BITS
    trainer = Trainer(made_up.places(Path(folder), Path(weights), name), plan)
    if what == "train":
        trainer.train(COURSE)
        return
    loss = trainer.losses(range(5))
    grads = {name: p.grad for name, p in trainer.parameters.items() if p.grad is not None}
    found = {name: whole(grad).contiguous() for name, grad in grads.items()}
    if trainer.accelerator.is_main_process:
        save_file(found | {"loss": loss.reshape(1)}, last)
    if what in ("sharded", "four-bits"):
        assert all(hasattr(p, "full_tensor") for p in trainer.parameters.values())
        trainer.train(Course(2, saved=2, looked=2, sampled=1))
        again = Trainer(trainer.places, plan)
        assert again.step == 2
        again.train(Course(4, saved=4, looked=0))


if __name__ == "__main__":
    main(*sys.argv[1:])
