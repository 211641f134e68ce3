"""A training's state on the disk: adapter, AdamW's memory, mean, and how far it is. No pickle.

Written whole or not at all, so that a training that is killed goes on from the last one.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from objectmorpher_core.base.files import write_all

from . import TrainingError

if TYPE_CHECKING:
    from torch import Tensor, nn, optim

FILE = "checkpoint.safetensors"
VALUE, FIRST, SECOND, MEAN = "value.", "exp_avg.", "exp_avg_sq.", "mean."
TOLD = "objectmorpher"  # key of what the file says besides


@dataclass(frozen=True, eq=False)
class TrainingState:
    """The state of a training."""

    parameters: dict[str, nn.Parameter]
    optimiser: optim.Optimizer
    mean: dict[str, Tensor] | None  # moving mean of the parameters

    def held(self) -> dict[str, Tensor]:
        """All of it, on the CPU; where it is sharded each process has to ask."""
        held: dict[str, Tensor] = {}
        for name, value in self.parameters.items():
            held[VALUE + name] = value.detach()
            memory = self.optimiser.state.get(value)
            if memory:
                held[FIRST + name], held[SECOND + name] = memory["exp_avg"], memory["exp_avg_sq"]
            if self.mean is not None:
                held[MEAN + name] = self.mean[name]
        return {name: whole(value).contiguous().cpu() for name, value in held.items()}

    def save(self, folder: Path, step: int, plan: dict[str, Any], held: dict[str, Tensor]) -> None:
        """What is `held` after `step` steps of a `plan`."""
        from safetensors.torch import save

        told = json.dumps({"step": step, "plan": plan})
        write_all({folder / FILE: save(held, metadata={TOLD: told})})

    def load(self, folder: Path, plan: dict[str, Any]) -> int:
        """Load a checkpoint and return the steps that were done; 0 where there is none.

        Raises TrainingError where it is damaged, or another plan's.
        """
        import torch
        from safetensors import SafetensorError, safe_open

        at = folder / FILE
        if not at.exists():
            return 0
        try:
            with safe_open(at, "pt") as file:
                told = json.loads((file.metadata() or {})[TOLD])
                _check_plan(folder, told["plan"], plan)
                for name, value in self.parameters.items():
                    value.data.copy_(like(file.get_tensor(VALUE + name), value))
                    self.optimiser.state[value] = {
                        "step": torch.tensor(float(told["step"])),
                        "exp_avg": like(file.get_tensor(FIRST + name), value),
                        "exp_avg_sq": like(file.get_tensor(SECOND + name), value),
                    }
                    if self.mean is not None:
                        self.mean[name].copy_(like(file.get_tensor(MEAN + name), value))
                return int(told["step"])
        except (OSError, KeyError, ValueError, RuntimeError, SafetensorError) as error:
            if isinstance(error, TrainingError):
                raise
            raise TrainingError(f"{at} is damaged: {error}") from error


def whole(value: Any) -> Tensor:
    """A tensor of which this process may have a shard; then each process has to ask."""
    return value.full_tensor() if hasattr(value, "full_tensor") else value


def like(value: Tensor, other: Any) -> Tensor:
    """A whole tensor on another one's device, and sharded as that is."""
    value = value.to(other.device)
    if not hasattr(other, "full_tensor"):
        return value
    from torch.distributed.tensor import distribute_tensor

    return distribute_tensor(value, other.device_mesh, other.placements)


def _check_plan(folder: Path, known: dict[str, Any], plan: dict[str, Any]) -> None:
    other = sorted(key for key in {*known, *plan} if known.get(key) != plan.get(key))
    if other:
        was, now = known.get(other[0]), plan.get(other[0])
        raise TrainingError(
            f"{folder} was begun with another {other[0].replace('_', ' ')} ({was}, now {now}):"
            " give the same options, or another folder"
        )
