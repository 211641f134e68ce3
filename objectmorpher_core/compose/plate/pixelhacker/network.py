"""PixelHacker's network: a latent diffusion U-Net whose self-attention is gated and linear.

Instead of a text it is told twenty numbers: ten for what is to be filled in, ten for nothing.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from ....models import ModelError
from .linear_attention import GatedLinearAttention

IDS = 20  # half of them what is to be filled in, half of them nothing
PUBLISHED: Mapping[str, Any] = {  # beside diffusers' defaults
    "sample_size": 64, "in_channels": 9, "out_channels": 4, "attention_head_dim": 8,
    "cross_attention_dim": 768, "encoder_hid_dim": 3072,
}  # fmt: skip
OTHER = (  # what a config may say besides
    "block_out_channels", "layers_per_block", "down_block_types", "up_block_types",
    "norm_num_groups",
)  # fmt: skip
CONFIG = "config.json"


class PixelHacker(nn.Module):
    """Predicts the noise of latents. float32, but for the U-Net, which may be of less."""

    def __init__(self, config: Mapping[str, Any]) -> None:
        from diffusers.models.unets.unet_2d_condition import UNet2DConditionModel

        super().__init__()
        self.embedding_layer = nn.Embedding(IDS, int(config["encoder_hid_dim"]))
        self.diff_model: Any = UNet2DConditionModel(**config)
        for block in self.diff_model.modules():
            if type(block).__name__ == "BasicTransformerBlock":
                old = block.attn1
                block.attn1 = GatedLinearAttention(old.to_q.in_features, old.heads)

    def forward(self, latents: Tensor, time: Tensor, ids: Tensor) -> Tensor:
        """(B, 4, h, w) of latents (B, 9, h, w) at a `time`; ids (B, IDS / 2)."""
        told = self.embedding_layer(ids).to(latents.dtype)
        return self.diff_model(latents, time, told, return_dict=False)[0]


def read_config(folder: Path) -> dict[str, Any]:
    """What the U-Net beside a config.json is like; the published one's, where there is none.

    Raises ModelError.
    """
    at = folder / CONFIG
    if not at.exists():
        return dict(PUBLISHED)
    try:
        said = json.loads(at.read_text(encoding="utf-8"))
        return dict(PUBLISHED) | {key: said[key] for key in (*PUBLISHED, *OTHER) if key in said}
    except (OSError, ValueError, TypeError) as error:
        raise ModelError(f"{folder.name}/{CONFIG} cannot be read") from error


def build(config: Mapping[str, Any]) -> PixelHacker:
    """The network with weights as torch makes them. Raises ModelError."""
    try:
        return PixelHacker(config)
    except (ValueError, TypeError, KeyError, RuntimeError) as error:
        raise ModelError("PixelHacker's config describes no network") from error


def load(at: Path, device: str, number: torch.dtype) -> PixelHacker:
    """The network of a safetensors file; every key and shape has to be right. Raises ModelError."""
    from safetensors import SafetensorError, safe_open

    with torch.device("meta"):
        network = build(read_config(at.parent))
    wanted = {key: tuple(t.shape) for key, t in network.state_dict().items()}
    try:
        with safe_open(str(at), framework="pt") as file:
            shapes = {k: tuple(file.get_slice(k).get_shape()) for k in file.keys()}  # noqa: SIM118
            check_shapes(at.name, shapes, wanted)
            found = {key: file.get_tensor(key).to(device, number) for key in wanted}
    except (SafetensorError, OSError) as error:
        raise ModelError(f"{at.name} is damaged or no safetensors file") from error
    network.load_state_dict(found, strict=True, assign=True)
    return network.eval().requires_grad_(False)


def check_shapes(
    name: str, found: Mapping[str, tuple[int, ...]], wanted: Mapping[str, tuple[int, ...]]
) -> None:
    """Raises ModelError where weights have other keys or shapes than the network."""
    absent, more = sorted(wanted.keys() - found.keys()), sorted(found.keys() - wanted.keys())
    if absent:
        raise ModelError(f"{name} is not PixelHacker's: it lacks {absent[0]}")
    if more:
        raise ModelError(f"{name} is not PixelHacker's: it has {more[0]}")
    for key, shape in wanted.items():
        if found[key] != shape:
            raise ModelError(f"{name} does not fit its config: {key} is {found[key]}, not {shape}")


def load_codec(folder: Path, device: str) -> Any:
    """The autoencoder of a folder, in float32: its decoder shows bands with less.

    Raises ModelError.
    """
    from diffusers.models.autoencoders.autoencoder_kl import AutoencoderKL
    from diffusers.utils import logging

    level = logging.get_verbosity()
    logging.set_verbosity_error()
    try:
        loaded: Any = AutoencoderKL.from_pretrained(
            folder, local_files_only=True, use_safetensors=True, torch_dtype=torch.float32,
            output_loading_info=True,
        )  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RuntimeError) as error:
        from ....models.device import is_out_of_memory

        if is_out_of_memory(error):
            raise
        raise ModelError(f"{folder.name} cannot be opened as an autoencoder") from error
    finally:
        logging.set_verbosity(level)
    codec, told = loaded
    if told["missing_keys"] or told["mismatched_keys"]:
        raise ModelError(f"{folder.name} lacks some of its weights")
    return codec.eval().requires_grad_(False).to(device)
