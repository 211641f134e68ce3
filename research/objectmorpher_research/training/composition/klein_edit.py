"""FLUX.2-klein-base-4B as it is trained; the LoRA then works on the four-step model, too.

Its text encoder never sees a picture: what it says of the instruction is the refiner's own file.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from objectmorpher_core.arrays import RGB
from objectmorpher_core.compose.refine import klein

from . import TrainingError
from .edit_models import Grid, Latents, open_pipeline, rgb_of

if TYPE_CHECKING:
    from torch import Tensor, nn

STEP = 32  # px of which both sides are multiples
PIXELS = 16  # of the picture, of a token
CHANNELS, WIDTH, WORDS = 128, 7680, 512  # of a token; of the text encoder, and its tokens


class KleinEdit:
    """See the module."""

    name = "klein"
    families = ("flux2-klein-base",)
    pipeline = "Flux2KleinPipeline"
    sees_pictures = False
    targets = (
        "to_q", "to_k", "to_v", "to_out.0", "add_q_proj", "add_k_proj", "add_v_proj", "to_add_out",
        "to_qkv_mlp_proj",
    )  # fmt: skip
    size = {  # noqa: RUF012
        "num_layers": 5, "num_single_layers": 20, "num_attention_heads": 24,
        "joint_attention_dim": WIDTH, "guidance_embeds": False,
    }  # fmt: skip

    def encoders(self, folder: Path, device: str, number: str) -> Any:
        """See `EditModel`."""
        if not klein.prompt_file(folder).exists():
            klein.encode_instruction(folder)
        pipeline = self.decoder(folder, device, number)
        pipeline.instruction = _instruction(folder).to(pipeline.vae.dtype)
        return pipeline

    def decoder(self, folder: Path, device: str, number: str) -> Any:
        """See `EditModel`."""
        from diffusers.pipelines.flux2.pipeline_flux2_klein import Flux2KleinPipeline

        return open_pipeline(
            Flux2KleinPipeline, folder, number, transformer=None, text_encoder=None, tokenizer=None
        ).to(device)

    def encode(self, pipeline: Any, pictures: tuple[RGB, RGB, RGB], side: int) -> Latents:
        """See `EditModel`."""
        import torch

        b, coarse, a = pictures
        found = [self._tokens(pipeline, picture, side) for picture in (a, b, coarse)]
        grids = (found[0][1], found[1][1], found[2][1])
        conditions = torch.cat([found[1][0], found[2][0]], 1)
        return Latents(found[0][0], conditions, pipeline.instruction, grids)

    def _tokens(self, pipeline: Any, picture: RGB, side: int) -> tuple[Tensor, Grid]:
        """(1, n, c) the picture's, and their grid."""
        from PIL import Image

        height, width = picture.shape[:2]
        factor = side / np.sqrt(width * height)
        size = [max(STEP, round(s * factor / STEP) * STEP) for s in (width, height)]
        way = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
        shown = Image.fromarray(np.asarray(cv2.resize(picture, size, interpolation=way), np.uint8))
        pixels = pipeline.image_processor.preprocess(shown, height=size[1], width=size[0])
        pixels = pixels.to(pipeline.vae.device, pipeline.vae.dtype)
        latents = pipeline._encode_vae_image(pixels, None)
        return pipeline._pack_latents(latents), (latents.shape[2], latents.shape[3])

    def decode(self, pipeline: Any, tokens: Tensor, grid: Grid) -> RGB:
        """See `EditModel`."""
        import torch

        vae = pipeline.vae
        latents = tokens.permute(0, 2, 1).reshape(1, -1, *grid).to(vae.dtype)
        mean = vae.bn.running_mean.view(1, -1, 1, 1).to(latents)
        variance = vae.bn.running_var.view(1, -1, 1, 1).to(latents)
        latents = latents * torch.sqrt(variance + vae.config.batch_norm_eps) + mean
        made = vae.decode(pipeline._unpatchify_latents(latents), return_dict=False)[0]
        return rgb_of(pipeline, made)

    def transformer_class(self) -> Any:
        """See `EditModel`."""
        from diffusers.models.transformers.transformer_flux2 import Flux2Transformer2DModel

        return Flux2Transformer2DModel

    def velocity(self, transformer: nn.Module, noisy: Tensor, sigma: Tensor, at: Latents) -> Tensor:
        """See `EditModel`."""
        import torch
        from diffusers.pipelines.flux2.pipeline_flux2_klein import Flux2KleinPipeline as Pipeline

        own, *others = (torch.empty(1, 1, *grid) for grid in at.grids)
        places = [Pipeline._prepare_latent_ids(own), Pipeline._prepare_image_ids(others)]
        words = Pipeline._prepare_text_ids(at.embedding)
        found = transformer(
            hidden_states=torch.cat([noisy, at.conditions], 1), timestep=sigma, guidance=None,
            encoder_hidden_states=at.embedding, txt_ids=words.to(noisy.device),
            img_ids=torch.cat(places, 1).to(noisy.device), return_dict=False,
        )[0]  # fmt: skip
        return found[:, : noisy.shape[1]]

    def shift(self, scheduler: Any, tokens: int, steps: int) -> float:
        """See `EditModel`."""
        from diffusers.pipelines.flux2.pipeline_flux2_klein import compute_empirical_mu

        return compute_empirical_mu(tokens, steps)

    def made_up(self, side: int, number: str, device: str) -> Latents:
        """See `EditModel`."""
        import torch

        grid = (side // PIXELS, side // PIXELS)
        how: dict[str, Any] = {"device": device, "dtype": getattr(torch, number)}
        count = grid[0] * grid[1]
        return Latents(
            torch.randn(1, count, CHANNELS, **how), torch.randn(1, 2 * count, CHANNELS, **how),
            torch.randn(1, WORDS, WIDTH, **how), (grid, grid, grid),
        )  # fmt: skip


def _instruction(folder: Path) -> Tensor:
    """(1, l, d) what the text encoder says of it. Raises TrainingError."""
    from safetensors import SafetensorError
    from safetensors.torch import load_file

    at = klein.prompt_file(folder)
    try:
        return load_file(at)[klein.KEY]
    except (OSError, KeyError, SafetensorError) as error:
        raise TrainingError(f"{at} cannot be read: {error}") from error
