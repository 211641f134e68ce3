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
from .diffusion import INSTRUCTION, DiffusionRefiner, adapter_files
from .memory import PipelineNeed, PipelinePlan

STEPS, GUIDANCE = 40, 4.0  # the publishers' own
LIGHTNING = "lightning"
LIGHTNING_SCHEDULE = {  # what the adapters were distilled with (lightx2v/Qwen-Image-Lightning)
    "base_shift": math.log(3), "max_shift": math.log(3), "shift": 1.0, "shift_terminal": None,
    "use_dynamic_shifting": True, "time_shift_type": "exponential", "base_image_seq_len": 256,
    "max_image_seq_len": 8192, "num_train_timesteps": 1000,
}  # fmt: skip
TEXT_ENCODER, VAE = 8_290_000_000, 127_000_000  # parameters


class QwenRefiner(DiffusionRefiner):
    """See the module."""

    name = "qwen"
    families = ("qwen-image-edit",)
    adapters = "qwen-refine-lora"
    pipeline = "QwenImageEditPlusPipeline"
    parts = ("transformer", "text_encoder")
    work = 6_000_000_000

    def need(self) -> PipelineNeed:
        """See `DiffusionRefiner`."""
        model = self.model()
        assert model is not None
        transformer = model.parameters * 1_000_000 - TEXT_ENCODER - VAE
        return PipelineNeed((transformer, TEXT_ENCODER, VAE), self.work)

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

    def _load(self, folder: Path, options: dict[str, Any], plan: PipelinePlan) -> Any:
        from diffusers.pipelines.qwenimage.pipeline_qwenimage_edit_plus import (
            QwenImageEditPlusPipeline,
        )
        from diffusers.schedulers.scheduling_flow_match_euler_discrete import (
            FlowMatchEulerDiscreteScheduler,
        )

        from .qwen_processor import QwenProcessor

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
