"""FLUX.2-klein-4B: four steps, and no text encoder, because an instruction is always the same.

What the text encoder says of the instruction is computed once and kept in the models folder. From
then on the encoder, half of the pipeline, is neither loaded nor needed.
"""

from __future__ import annotations

import gc
import hashlib
from pathlib import Path
from typing import Any

from ... import models
from ...models import ModelError, device
from ...models.weight_folder import check_safetensors
from . import diffusion
from .diffusion import INSTRUCTION, DiffusionRefiner, Size, adapter_files

STEPS = 4
MULTIPLE = 16  # px of the sides of what the network is shown
LEAST = 64  # px of its shorter side
LONGEST = 8  # x the shorter side
KEY = "prompt_embeds"
ADAPTERS = {"klein": "klein-refine-lora", "removal": "klein-remove-lora"}  # name -> family


class KleinRefiner(DiffusionRefiner):
    """See the module."""

    name = "klein"
    families = ("flux2-klein",)
    adapters = ADAPTERS[name]
    adapter, strength = name, 1.0  # of all adapters, the one that is used
    instruction = INSTRUCTION
    pipeline = "Flux2KleinPipeline"
    transformer = "Flux2Transformer2DModel"
    parts = ("transformer",)
    work = {"transformer": 3_000_000_000, "vae": 3_000_000_000}  # noqa: RUF012
    step = MULTIPLE

    def missing(self) -> str | None:
        """See `Refiner`."""
        sentence = super().missing()
        if sentence is not None:
            return sentence
        folder, kept = self.folder(), prompt_file(self.folder(), self.instruction)
        if kept.exists() or (folder / "text_encoder").is_dir():
            return None
        return (
            f"{folder.name} has no text_encoder, and what it says is not kept in {kept.name}:"
            " get the model again"
        )

    def sees(self, size: Size) -> Size:
        """As it is, unless it is larger, smaller or longer than the published pipeline takes."""
        short, long = sorted(size)
        is_taken = short >= LEAST and long <= LONGEST * short
        return size if is_taken and short * long <= diffusion.AREA else (0, 0)

    def _steps(self) -> int:
        return STEPS

    def _sources(self) -> tuple[tuple[str, Path], ...]:
        """Those of both uses: one pipeline is opened for them."""
        return adapter_files(*ADAPTERS.items())

    def _load(self, folder: Path, options: dict[str, Any]) -> Any:
        from diffusers.pipelines.flux2.pipeline_flux2_klein import Flux2KleinPipeline

        prompt_of(folder, self.instruction)
        return Flux2KleinPipeline.from_pretrained(
            folder, text_encoder=None, tokenizer=None, **options
        )

    def _call(self, pipeline: Any, pictures: list[Any], given: dict[str, Any]) -> Any:
        from safetensors.torch import load_file

        names = [name for name, _ in self._sources()]
        if self.adapter in names:
            pipeline.enable_lora()
            pipeline.set_adapters([self.adapter], [self.strength])
        elif names:
            pipeline.disable_lora()
        file = prompt_of(self.folder(), self.instruction)
        check_safetensors(file)
        embedding = load_file(file)[KEY].to(pipeline._execution_device, pipeline.transformer.dtype)
        return pipeline(image=pictures, prompt_embeds=embedding, guidance_scale=1.0, **given)


def prompt_file(folder: Path, instruction: str = INSTRUCTION) -> Path:
    """Return the file of the instruction's embedding, which depends on instruction and model."""
    config = folder / "text_encoder" / "config.json"
    kind = config.read_bytes() if config.exists() else folder.name.encode()
    told = hashlib.sha256(instruction.encode() + kind).hexdigest()[:12]
    return models.folder() / f"klein-prompt-{told}.safetensors"


def prompt_of(folder: Path, instruction: str = INSTRUCTION) -> Path:
    """That file, made where it is not there. Raises ModelError."""
    file = prompt_file(folder, instruction)
    return file if file.exists() else encode_instruction(folder, instruction)


def encode_instruction(folder: Path, instruction: str = INSTRUCTION) -> Path:
    """Runs the text encoder of a pipeline's folder once; the file that keeps its answer.

    On the CPU: it takes seconds, and the GPU may be too small for it. Raises ModelError.
    """
    import torch
    from diffusers.pipelines.flux2.pipeline_flux2_klein import Flux2KleinPipeline
    from safetensors.torch import save
    from transformers import AutoTokenizer, Qwen3ForCausalLM

    from ...base.files import write_all

    try:
        tokenizer = AutoTokenizer.from_pretrained(folder / "tokenizer", local_files_only=True)
        # bfloat16 on the CPU, too: that is how it was published, and half the memory.
        encoder = Qwen3ForCausalLM.from_pretrained(
            folder / "text_encoder", local_files_only=True, use_safetensors=True,
            dtype=torch.bfloat16,
        )  # fmt: skip
        layers = layers_told(int(encoder.config.num_hidden_layers))
        with torch.inference_mode():
            embedding = Flux2KleinPipeline._get_qwen3_prompt_embeds(
                encoder, tokenizer, instruction, hidden_states_layers=list(layers)
            )
        data = save({KEY: embedding.contiguous()})
        models.folder().mkdir(parents=True, exist_ok=True)
        write_all({prompt_file(folder, instruction): data})
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ModelError(f"{folder.name}'s text encoder cannot be opened: {error}") from error
    except RuntimeError as error:
        if device.is_out_of_memory(error):
            raise ModelError("there is not enough memory for the text encoder") from error
        raise ModelError(f"{folder.name}'s text encoder does not fit its configuration") from error
    del encoder
    gc.collect()
    return prompt_file(folder, instruction)


def layers_told(count: int) -> tuple[int, int, int]:
    """Return the layers that are read of `count`: 9, 18, 27 of the published encoder's 36."""
    return count // 4, count // 2, 3 * count // 4
