"""Text and pictures for Qwen2.5-VL without torchvision, which transformers' processor needs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

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
