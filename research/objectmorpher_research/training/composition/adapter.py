"""The LoRA itself (Hu et al. 2021): where it sits, how fast its two halves learn, how it is saved.

LoRA+ (Hayou et al. 2024): the half that begins as zero, B, learns at a multiple of A's rate.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from objectmorpher_core.base.files import write_all

from . import TrainingError
from .edit_models import EditModel

if TYPE_CHECKING:
    from torch import Tensor, nn

SECOND = "lora_B"  # peft's name of what begins as zero
NAME = "objectmorpher-{}.safetensors"
FILE = "lora.safetensors"  # until it has that name


def with_adapter(transformer: nn.Module, model: EditModel, rank: int, seed: int) -> nn.Module:
    """The transformer frozen but for a new LoRA on the model's attention, in single precision.

    Raises TrainingError.
    """
    import torch
    from peft import LoraConfig

    transformer.requires_grad_(False)
    kept = torch.random.get_rng_state()
    torch.manual_seed(seed)
    try:
        how = LoraConfig(
            r=rank,
            lora_alpha=rank,
            init_lora_weights="gaussian",
            target_modules=list(model.targets),
        )
        whole: Any = transformer
        whole.add_adapter(how)
    except ValueError as error:
        raise TrainingError(f"this transformer cannot get a LoRA: {error}") from error
    finally:
        torch.random.set_rng_state(kept)
    for value in parameters(transformer).values():
        value.data = value.data.float()
    return transformer


def parameters(transformer: nn.Module) -> dict[str, nn.Parameter]:
    """Return the trained parameters by name."""
    return {name: p for name, p in transformer.named_parameters() if p.requires_grad}


def groups(transformer: nn.Module, rate: float, ratio: float) -> list[dict[str, Any]]:
    """Return an optimiser's groups: A at `rate`, B at `ratio` times that."""
    own = parameters(transformer)
    first = [p for name, p in own.items() if SECOND not in name]
    second = [p for name, p in own.items() if SECOND in name]
    return [
        {"params": first, "lr": rate, "full_rate": rate},
        {"params": second, "lr": rate * ratio, "full_rate": rate * ratio},
    ]


def save_adapter(
    folder: Path, transformer: nn.Module, model: EditModel, number: str = "float32",
    values: dict[str, Tensor] | None = None,
) -> Path:  # fmt: skip
    """A file as diffusers' pipelines load it, whole or not at all; `values` instead of its own."""
    import diffusers
    import torch
    from peft import get_peft_model_state_dict

    state = get_peft_model_state_dict(
        transformer,  # type: ignore[arg-type]  # also takes plain modules
        state_dict=values or parameters(transformer),
    )
    kind = getattr(torch, number)
    state = {name: value.detach().to("cpu", kind).contiguous() for name, value in state.items()}
    with tempfile.TemporaryDirectory() as at:
        pipeline = getattr(diffusers, model.pipeline)
        pipeline.save_lora_weights(at, transformer_lora_layers=state, weight_name=FILE)
        data = (Path(at) / FILE).read_bytes()
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / NAME.format(model.name)
    write_all({file: data})
    return file
