"""Qwen-Image-Edit-Plus (2509, 2511) as it is trained: pictures go in as its pipeline sends them in.

Both conditions have about 1024 x 1024 px whatever A has, and 384 x 384 for the text encoder, which
sees them: the pipeline's own constants. Everything else goes through the transformer's forward, so
that 2511's conditions are modulated as they are at work (`zero_cond_t`).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from objectmorpher_core.base.arrays import RGB
from objectmorpher_core.compose.refine.diffusion import INSTRUCTION

from .edit_models import Grid, Latents, open_pipeline, rgb_of

if TYPE_CHECKING:
    from torch import Tensor, nn

PATCH = 2  # latents' pixels of a token, each way
PIXELS = 16  # of the picture, of a token
CHANNELS, WIDTH = 64, 3584  # of a token, of the text encoder
WORDS = 700  # tokens of instruction and two pictures, about


class QwenEdit:
    """See the module."""

    name = "qwen"
    families = ("qwen-image-edit",)
    pipeline = "QwenImageEditPlusPipeline"
    sees_pictures = True
    targets = (
        "to_q", "to_k", "to_v", "to_out.0", "add_q_proj", "add_k_proj", "add_v_proj", "to_add_out",
    )  # fmt: skip
    size = {"zero_cond_t": True}  # noqa: RUF012  2511's; the class's defaults are the published ones

    def encoders(self, folder: Path, device: str, number: str) -> Any:
        """See `EditModel`."""
        from objectmorpher_core.compose.refine.qwen import QwenProcessor

        processor = QwenProcessor.from_folder(folder)
        pipeline = open_pipeline(
            self._class(), folder, number,
            transformer=None, processor=None, tokenizer=processor.tokenizer,
        )  # fmt: skip
        pipeline.register_modules(processor=processor)
        return pipeline.to(device)

    def decoder(self, folder: Path, device: str, number: str) -> Any:
        """See `EditModel`."""
        return open_pipeline(
            self._class(), folder, number,
            transformer=None, processor=None, tokenizer=None, text_encoder=None,
        ).to(device)  # fmt: skip

    def encode(self, pipeline: Any, pictures: tuple[RGB, RGB, RGB], side: int) -> Latents:
        """See `EditModel`."""
        import torch
        from diffusers.pipelines.qwenimage import pipeline_qwenimage_edit_plus as plus
        from PIL import Image

        b, coarse, a = (Image.fromarray(p) for p in pictures)
        seen, tokens, grids = [], [], []
        for picture in (a, b, coarse):
            area = side * side if picture is a else plus.VAE_IMAGE_SIZE
            ratio = picture.width / picture.height
            width, height = plus.calculate_dimensions(area, ratio)
            found, grid = self._tokens(pipeline, picture, width, height)
            tokens.append(found)
            grids.append(grid)
            if picture is not a:
                small = plus.calculate_dimensions(plus.CONDITION_IMAGE_SIZE, ratio)
                seen.append(pipeline.image_processor.resize(picture, small[1], small[0]))
        embedding, mask = pipeline.encode_prompt(
            image=seen, prompt=[INSTRUCTION], device=pipeline.text_encoder.device
        )
        conditions = torch.cat(tokens[1:], 1)
        return Latents(tokens[0], conditions, embedding, (grids[0], grids[1], grids[2]), mask)

    def _tokens(self, pipeline: Any, picture: Any, width: int, height: int) -> tuple[Tensor, Grid]:
        """(1, n, c) the picture's, and their grid."""
        vae = pipeline.vae
        pixels = pipeline.image_processor.preprocess(picture, height, width).unsqueeze(2)
        latents = pipeline._encode_vae_image(pixels.to(vae.device, vae.dtype), None)
        rows, columns = latents.shape[3:]
        packed = pipeline._pack_latents(latents, 1, latents.shape[1], rows, columns)
        return packed, (rows // PATCH, columns // PATCH)

    def decode(self, pipeline: Any, tokens: Tensor, grid: Grid) -> RGB:
        """See `EditModel`."""
        import torch

        scale = pipeline.vae_scale_factor
        rows, columns = (PATCH * scale * side for side in grid)
        latents = pipeline._unpack_latents(tokens, rows, columns, scale).to(pipeline.vae.dtype)
        config = pipeline.vae.config
        mean, deviation = (
            torch.tensor(v).view(1, -1, 1, 1, 1).to(latents)
            for v in (config.latents_mean, config.latents_std)
        )
        made = pipeline.vae.decode(latents * deviation + mean, return_dict=False)[0][:, :, 0]
        return rgb_of(pipeline, made)

    def transformer_class(self) -> Any:
        """See `EditModel`."""
        from diffusers.models.transformers.transformer_qwenimage import QwenImageTransformer2DModel

        return QwenImageTransformer2DModel

    def velocity(self, transformer: nn.Module, noisy: Tensor, sigma: Tensor, at: Latents) -> Tensor:
        """See `EditModel`."""
        import torch

        found = transformer(
            hidden_states=torch.cat([noisy, at.conditions], 1), timestep=sigma, guidance=None,
            encoder_hidden_states=at.embedding, encoder_hidden_states_mask=at.mask,
            img_shapes=[[(1, *grid) for grid in at.grids]], return_dict=False,
        )[0]  # fmt: skip
        return found[:, : noisy.shape[1]]

    def shift(self, scheduler: Any, tokens: int, steps: int) -> float:
        """See `EditModel`."""
        from diffusers.pipelines.qwenimage.pipeline_qwenimage_edit_plus import calculate_shift

        told = scheduler.config
        return calculate_shift(
            tokens, told.get("base_image_seq_len", 256), told.get("max_image_seq_len", 4096),
            told.get("base_shift", 0.5), told.get("max_shift", 1.15),
        )  # fmt: skip

    def made_up(self, side: int, number: str, device: str) -> Latents:
        """See `EditModel`."""
        import torch

        grid = (side // PIXELS, side // PIXELS)
        large = (1024 // PIXELS, 1024 // PIXELS)
        how: dict[str, Any] = {"device": device, "dtype": getattr(torch, number)}
        count = 2 * large[0] * large[1]
        return Latents(
            torch.randn(1, grid[0] * grid[1], CHANNELS, **how),
            torch.randn(1, count, CHANNELS, **how), torch.randn(1, WORDS, WIDTH, **how),
            (grid, large, large),
        )  # fmt: skip

    def _class(self) -> Any:
        from diffusers.pipelines.qwenimage.pipeline_qwenimage_edit_plus import (
            QwenImageEditPlusPipeline,
        )

        return QwenImageEditPlusPipeline
