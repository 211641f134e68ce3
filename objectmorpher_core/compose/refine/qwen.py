"""Qwen-Image-Edit 2511 or 2509 with a rank-16 LoRA (paper 3.3): [photo, coarse edit] -> edit.

Where a Lightning adapter of the same version is there, it makes the picture in 4 or 8 steps without
guidance; else it takes 40 with guidance.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from ... import models
from ...models import HubModel
from . import diffusion
from .diffusion import INSTRUCTION, DiffusionRefiner, Size, adapter_files

# Text and pictures for Qwen2.5-VL without torchvision, which transformers' processor needs.

PAD = "<|image_pad|>"


class QwenProcessor:
    """Called as a `Qwen2VLProcessor` is: each picture is as many tokens as it has patches."""

    def __init__(self, pictures: Any, tokenizer: Any) -> None:
        """`pictures`: a Qwen2VLImageProcessorPil."""
        self.image_processor, self.tokenizer = pictures, tokenizer

    @classmethod
    def from_folder(cls, folder: Path) -> QwenProcessor:
        """Load it from a pipeline's folder."""
        from transformers import AutoTokenizer
        from transformers.models.qwen2_vl.image_processing_pil_qwen2_vl import (
            Qwen2VLImageProcessorPil,
        )

        pictures = Qwen2VLImageProcessorPil.from_pretrained(
            folder / "processor", local_files_only=True
        )
        tokenizer = AutoTokenizer.from_pretrained(folder / "tokenizer", local_files_only=True)
        return cls(pictures, tokenizer)

    def __call__(
        self, text: list[str], images: Any, padding: bool = True, return_tensors: str = "pt"
    ) -> Any:
        """Token ids, attention mask, pixel values and image grids."""
        from transformers import BatchFeature

        seen = self.image_processor(images=images, return_tensors=return_tensors)
        counts = seen["image_grid_thw"].prod(-1) // self.image_processor.merge_size**2
        remaining = iter(counts.tolist())
        # Cut apart first, so that a pad that was put in is not found again.
        expanded = []
        for line in text:
            pieces = line.split(PAD)
            line = pieces[0]
            for piece in pieces[1:]:
                line += PAD * next(remaining) + piece
            expanded.append(line)
        told = self.tokenizer(expanded, padding=padding, return_tensors=return_tensors)
        return BatchFeature({**told, **seen})


STEPS, GUIDANCE = 40, 4.0  # the publishers' own
LIGHTNING = "lightning"
LIGHTNING_SCHEDULE = {  # what the adapters were distilled with (lightx2v/Qwen-Image-Lightning)
    "base_shift": math.log(3), "max_shift": math.log(3), "shift": 1.0, "shift_terminal": None,
    "use_dynamic_shifting": True, "time_shift_type": "exponential", "base_image_seq_len": 256,
    "max_image_seq_len": 8192, "num_train_timesteps": 1000,
}  # fmt: skip
MULTIPLE = 32  # px of the sides of what the network is shown


class QwenRefiner(DiffusionRefiner):
    """See the module."""

    name = "qwen"
    families = ("qwen-image-edit",)
    adapters = "qwen-refine-lora"
    pipeline = "QwenImageEditPlusPipeline"
    transformer = "QwenImageTransformer2DModel"
    parts = ("transformer", "text_encoder")
    work = {  # noqa: RUF012
        "transformer": 2_500_000_000, "text_encoder": 1_500_000_000, "vae": 6_000_000_000,
    }  # fmt: skip
    step = MULTIPLE

    def sees(self, size: Size) -> Size:
        """Of the published pipeline's area, each side rounded by itself."""
        ratio = size[0] / size[1]
        width = math.sqrt(diffusion.AREA * ratio)
        return round(width / MULTIPLE) * MULTIPLE, round(width / ratio / MULTIPLE) * MULTIPLE

    def lightning(self) -> HubModel | None:
        """The few-step adapter of the model's own version, if it is there; four steps first."""
        model = self.model()
        if model is None:
            return None
        family = f"{model.id}-lightning"
        return next(iter(models.installed(family)), None)

    def _steps(self) -> int:
        quick = self.lightning()
        return STEPS if quick is None else int(quick.id.rsplit("-", 1)[1])

    def _sources(self) -> tuple[tuple[str, Path], ...]:
        quick = self.lightning()
        first = () if quick is None else adapter_files((LIGHTNING, quick.family))
        return (*first, *super()._sources())

    def _load(self, folder: Path, options: dict[str, Any]) -> Any:
        from diffusers.pipelines.qwenimage.pipeline_qwenimage_edit_plus import (
            QwenImageEditPlusPipeline,
        )
        from diffusers.schedulers.scheduling_flow_match_euler_discrete import (
            FlowMatchEulerDiscreteScheduler,
        )

        # transformers' own processor of pictures needs torchvision.
        processor = QwenProcessor.from_folder(folder)
        pipeline = QwenImageEditPlusPipeline.from_pretrained(
            folder, processor=None, tokenizer=processor.tokenizer, **options
        )
        pipeline.register_modules(processor=processor)
        if self.lightning() is not None:
            scheduler = FlowMatchEulerDiscreteScheduler.from_config(LIGHTNING_SCHEDULE)
            pipeline.scheduler = scheduler
        return pipeline

    def _call(self, pipeline: Any, pictures: list[Any], given: dict[str, Any]) -> Any:
        guided: dict[str, Any] = {"negative_prompt": " ", "true_cfg_scale": GUIDANCE}
        how = {"true_cfg_scale": 1.0} if self.lightning() is not None else guided
        return pipeline(image=pictures, prompt=INSTRUCTION, **how, **given)
