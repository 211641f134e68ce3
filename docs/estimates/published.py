"""The published networks at their real sizes; on PyTorch's meta device shapes without numbers."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import diffusers
import torch
import transformers
from torch import Tensor, nn
from torch.utils.flop_counter import FlopCounterMode

from objectmorpher_core.compose.plate.latent_diffusion import build as build_latent
from objectmorpher_core.compose.plate.moebius import Moebius
from objectmorpher_core.compose.plate.pixelhacker import PixelHacker
from objectmorpher_core.lift.trellis.parts import build as build_part
from objectmorpher_core.lift.triposplat.generator import DINO_FORM
from objectmorpher_core.lift.triposplat.networks import FORM, Decoder, Flow

d: Any = diffusers  # whose names are lazy
t: Any = transformers
KEYS = Path(__file__).parents[2] / "tests" / "core" / "lift" / "trellis"
SAM = {  # of facebook/sam-vit-*: config.json's vision_config, beside transformers' defaults
    "sam-vit-base": {},
    "sam-vit-large": {
        "hidden_size": 1024, "num_hidden_layers": 24, "num_attention_heads": 16,
        "global_attn_indexes": [5, 11, 17, 23], "mlp_dim": 4096,
    },
    "sam-vit-huge": {
        "hidden_size": 1280, "num_hidden_layers": 32, "num_attention_heads": 16,
        "global_attn_indexes": [7, 15, 23, 31], "mlp_dim": 5120,
    },
}  # fmt: skip
SAM2 = {  # of facebook/sam2.1-hiera-*: the backbone's
    "sam2.1-tiny": {},
    "sam2.1-small": {"blocks_per_stage": [1, 2, 11, 2], "global_attention_blocks": [7, 10, 13]},
    "sam2.1-base-plus": {
        "hidden_size": 112, "embed_dim_per_stage": [112, 224, 448, 896],
        "num_attention_heads_per_stage": [2, 4, 8, 16], "blocks_per_stage": [2, 3, 16, 3],
        "global_attention_blocks": [12, 16, 20],
        "window_positional_embedding_background_size": [14, 14],
    },
    "sam2.1-large": {
        "hidden_size": 144, "embed_dim_per_stage": [144, 288, 576, 1152],
        "num_attention_heads_per_stage": [2, 4, 8, 16], "blocks_per_stage": [2, 6, 36, 4],
        "global_attention_blocks": [23, 33, 43], "window_size_per_stage": [8, 4, 16, 8],
    },
}  # fmt: skip
QWEN_VL = {  # Qwen2.5-VL-7B, the text encoder of Qwen-Image-Edit
    "text_config": {
        "hidden_size": 3584, "num_hidden_layers": 28, "num_attention_heads": 28,
        "num_key_value_heads": 4, "intermediate_size": 18944, "vocab_size": 152064,
        "tie_word_embeddings": False,
    },
    "vision_config": {
        "depth": 32, "hidden_size": 1280, "num_heads": 16, "intermediate_size": 3420,
        "out_hidden_size": 3584, "fullatt_block_indexes": [7, 15, 23, 31],
    },
}  # fmt: skip
QWEN3_4B = {  # the text encoder of FLUX.2-klein-4B
    "hidden_size": 2560, "num_hidden_layers": 36, "num_attention_heads": 32,
    "num_key_value_heads": 8, "head_dim": 128, "intermediate_size": 9728, "vocab_size": 151936,
    "tie_word_embeddings": True,
}  # fmt: skip
KLEIN = {
    "in_channels": 128, "num_layers": 5, "num_single_layers": 20, "attention_head_dim": 128,
    "num_attention_heads": 24, "joint_attention_dim": 7680, "guidance_embeds": False,
}  # fmt: skip
DINO = {  # facebook/dinov2-with-registers-large
    "hidden_size": 1024, "num_hidden_layers": 24, "num_attention_heads": 16, "image_size": 518,
    "patch_size": 14, "num_register_tokens": 4,
}  # fmt: skip
DEPTH_BACKBONE = {
    "hidden_size": 384, "num_attention_heads": 6, "num_hidden_layers": 12, "image_size": 518,
    "patch_size": 14, "out_features": ["stage3", "stage6", "stage9", "stage12"],
    "reshape_hidden_states": False, "apply_layernorm": True,
}  # fmt: skip
LORA = {  # what the adapters of rank 16 sit on
    "qwen": ("to_q", "to_k", "to_v", "to_out.0", "add_q_proj", "add_k_proj", "add_v_proj",
             "to_add_out"),
}  # fmt: skip
RANK = 16


def build(name: str, device: str = "meta") -> nn.Module:
    """The network called `name`; on another device than "meta" with the numbers it starts with."""
    with torch.device(device):
        return _networks()[name]().eval().requires_grad_(False)


def parameters(network: nn.Module) -> int:
    """Counted."""
    return sum(p.numel() for p in network.parameters())


def operations(network: nn.Module, run: Callable[[Any], Any]) -> int:
    """Of `run(network)`: multiplications and additions, attention's too; nothing is computed."""
    with FlopCounterMode(display=False) as counter, torch.no_grad(), torch.device("meta"):
        run(network)
    return counter.get_total_flops()


def lora_parameters(network: nn.Module, targets: tuple[str, ...]) -> int:
    """Of adapters of RANK on the linear layers whose names end so."""
    linear = [
        module
        for name, module in network.named_modules()
        if isinstance(module, nn.Linear) and name.endswith(targets)
    ]
    return sum(RANK * (layer.in_features + layer.out_features) for layer in linear)


def trellis_parts(model: str) -> Mapping[str, dict[str, Any]]:
    """Part -> its published description: of "trellis" or "cupid"."""
    told = json.loads((KEYS / f"{model}_keys.json").read_text(encoding="utf-8"))
    return {name: part["config"] for name, part in told["parts"].items()}


def normal(*shape: int) -> Tensor:
    """Numbers that are none."""
    return torch.empty(shape, device="meta")


def _networks() -> dict[str, Callable[[], nn.Module]]:
    found: dict[str, Callable[[], Any]] = {
        "sam3": lambda: t.Sam3TrackerModel(t.Sam3TrackerConfig()),
        "dino": lambda: t.Dinov2WithRegistersModel(t.Dinov2WithRegistersConfig(**DINO)),
        "depth": _depth,
        "dino3": lambda: t.DINOv3ViTModel(t.DINOv3ViTConfig(**DINO_FORM)),
        "triposplat-flow": lambda: Flow(FORM),
        "triposplat-decoder": lambda: Decoder(FORM),
        "pixelhacker": lambda: build_latent(PixelHacker),
        "moebius": lambda: build_latent(Moebius),
        "pixelhacker-vae": _codec,
        "qwen": d.QwenImageTransformer2DModel,
        "qwen-vae": d.AutoencoderKLQwenImage,
        "qwen-text": lambda: t.Qwen2_5_VLForConditionalGeneration(t.Qwen2_5_VLConfig(**QWEN_VL)),
        "klein": lambda: d.Flux2Transformer2DModel(**KLEIN),
        "klein-vae": d.AutoencoderKLFlux2,
        "klein-text": lambda: t.Qwen3ForCausalLM(t.Qwen3Config(**QWEN3_4B)),
    }
    for name, vision in SAM.items():
        found[name] = lambda vision=vision: _sam(vision)
    for name, backbone in SAM2.items():
        found[name] = lambda backbone=backbone: _sam2(backbone)
    for model in ("trellis", "cupid"):
        for name, told in trellis_parts(model).items():
            found[name] = lambda told=told: build_part(told)
    return found


def _sam(vision: dict[str, Any]) -> nn.Module:
    return t.SamModel(t.SamConfig(vision_config=t.SamVisionConfig(**vision)))


def _sam2(backbone: dict[str, Any]) -> nn.Module:
    trunk = t.Sam2HieraDetConfig(**backbone)
    widths = list(reversed(trunk.embed_dim_per_stage))
    vision = t.Sam2VisionConfig(backbone_config=trunk, backbone_channel_list=widths)
    return t.Sam2Model(t.Sam2Config(vision_config=vision))


def _depth() -> nn.Module:
    config = t.DepthAnythingConfig(
        backbone_config=t.Dinov2Config(**DEPTH_BACKBONE), neck_hidden_sizes=[48, 96, 192, 384],
        fusion_hidden_size=64, reassemble_hidden_size=384,
    )  # fmt: skip
    return t.DepthAnythingForDepthEstimation(config)


def _codec() -> nn.Module:
    return d.AutoencoderKL(
        block_out_channels=(128, 256, 512, 512), latent_channels=4, layers_per_block=2,
        down_block_types=("DownEncoderBlock2D",) * 4, up_block_types=("UpDecoderBlock2D",) * 4,
    )  # fmt: skip
