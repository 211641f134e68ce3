"""A TripoSplat of random weights, in a folder laid out as the published one is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import torch

from objectmorpher_core.lift.triposplat import generator, networks

FORM = networks.Form(
    width=48, heads=2, tokens=6, channels=4, camera=3, seen=16, drawn=8, blocks=2,
    octree_blocks=2, gaussian_blocks=2,
)  # fmt: skip
DINO = {
    "hidden_size": FORM.seen, "num_hidden_layers": 2, "num_attention_heads": 2,
    "intermediate_size": 24, "use_gated_mlp": True, "hidden_act": "silu", "num_register_tokens": 4,
}  # fmt: skip
CODEC = {
    "block_out_channels": (8, 8, 8, 8), "layers_per_block": 1, "norm_num_groups": 4,
    "latent_channels": 2,
}  # fmt: skip


def bring(folder: Path, patch: pytest.MonkeyPatch, seed: int = 0) -> Path:
    """Its files, and sizes that are read as they are."""
    from diffusers.models.autoencoders.autoencoder_kl_flux2 import AutoencoderKLFlux2
    from safetensors.torch import save_file
    from transformers import DINOv3ViTConfig, DINOv3ViTModel

    patch.setattr(networks, "FORM", FORM)
    patch.setattr(generator, "DINO_FORM", DINO)
    patch.setattr(generator, "CODEC_FORM", CODEC)
    patch.setattr(generator, "SIDE", 64)
    torch.manual_seed(seed)
    codec: Any = AutoencoderKLFlux2(**CODEC)
    dino = DINOv3ViTModel(DINOv3ViTConfig(**DINO)).state_dict()
    for name, found in (
        (generator.FLOW, networks.Flow(FORM).state_dict()),
        (generator.DECODER, networks.Decoder(FORM).state_dict()),
        (generator.CODEC, codec.state_dict()),
        (generator.DINO, {key.removeprefix("model."): t for key, t in dino.items()}),
    ):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        save_file(found, str(folder / name))
    return folder
