"""Run as a program by the tests: a training, or its gradients, in a process of its own.

train: FOLDER WEIGHTS STEPS; gradients: FOLDER WEIGHTS FILE, of all processes of a group together.
"""

from __future__ import annotations

import sys
from pathlib import Path

import torch

ROOT = Path(__file__).parents[4]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import made_up  # noqa: E402
from safetensors.torch import save_file  # noqa: E402

from objectmorpher_research.training.composition.lora_plan import LoraPlan  # noqa: E402
from objectmorpher_research.training.composition.train_lora import Course, Trainer  # noqa: E402

PLAN = LoraPlan("qwen", made_up.SIDE, rate=1e-3, batch=2, mean=0.9, held_out=1, number="float32")
COURSE = Course(12, saved=4, looked=0)


def main(what: str, folder: str, weights: str, last: str) -> None:
    torch.set_num_threads(1)
    made_up.small_conditions()
    name = "killed" if what == "train" else "gradients"
    trainer = Trainer(made_up.places(Path(folder), Path(weights), name), PLAN)
    if what == "train":
        trainer.train(COURSE)
        return
    loss = trainer.losses(range(5))
    if trainer.accelerator.is_main_process:
        found = {name: p.grad for name, p in trainer.parameters.items() if p.grad is not None}
        save_file(found | {"loss": loss.reshape(1)}, last)


if __name__ == "__main__":
    main(*sys.argv[1:])
