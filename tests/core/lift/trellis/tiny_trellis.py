"""A TRELLIS of a few thousand random weights, in a folder laid out as the published ones are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import save_file
from transformers import Dinov2WithRegistersConfig, Dinov2WithRegistersModel

from objectmorpher_core.lift.trellis.generator import Folders
from objectmorpher_core.lift.trellis.parts import NetworkPart, build
from objectmorpher_core.models.plans import Plan

WIDTH = 24  # channels of the picture's tokens
LATENTS, CELLS = 4, 16  # resolution of both stages
CPU = Plan("cpu", "float32", "cpu")
SAMPLER = {
    "name": "FlowEulerGuidanceIntervalSampler",
    "args": {"sigma_min": 1e-5},
    "params": {"steps": 3, "cfg_strength": 2.0, "cfg_interval": [0.5, 1.0], "rescale_t": 3.0},
}
FLOW = {
    "in_channels": 8, "out_channels": 8, "model_channels": 36, "cond_channels": WIDTH,
    "num_blocks": 2, "num_heads": 2, "mlp_ratio": 2, "pe_mode": "ape", "qk_rms_norm": True,
    "use_fp16": True,
}  # fmt: skip
GAUSSIANS = {
    "lr": {"_xyz": 1.0, "_features_dc": 1.0, "_opacity": 1.0, "_scaling": 1.0, "_rotation": 0.1},
    "perturb_offset": True, "voxel_size": 1.5, "num_gaussians": 4, "2d_filter_kernel_size": 0.1,
    "3d_filter_kernel_size": 9e-4, "scaling_bias": 2e-2, "opacity_bias": 0.6,
    "scaling_activation": "softplus",
}  # fmt: skip
PARTS: dict[str, tuple[str, dict[str, Any]]] = {  # role -> class, arguments
    "sparse_structure_flow_model": (
        "SparseStructureFlowModel", {**FLOW, "resolution": LATENTS, "patch_size": 1},
    ),
    "sparse_structure_decoder": (
        "SparseStructureDecoder",
        {
            "out_channels": 1, "latent_channels": 8, "num_res_blocks": 1,
            "num_res_blocks_middle": 1, "channels": [16, 8, 8], "use_fp16": True,
        },
    ),
    "slat_flow_model": (
        "ElasticSLatFlowModel",
        {
            **FLOW, "resolution": CELLS, "patch_size": 2, "num_io_res_blocks": 2,
            "io_block_channels": [16],
        },
    ),
    "slat_decoder_gs": (
        "ElasticSLatGaussianDecoder",
        {
            "resolution": CELLS, "model_channels": 24, "latent_channels": 8, "num_blocks": 2,
            "num_heads": 2, "mlp_ratio": 2, "attn_mode": "swin", "window_size": 8,
            "use_fp16": True, "representation_config": GAUSSIANS,
        },
    ),
}  # fmt: skip


def description(role: str) -> dict[str, Any]:
    """A part's json."""
    name, args = PARTS[role]
    return {"name": name, "args": args}


def write_encoder(folder: Path) -> Path:
    """DINOv2 with registers for pictures of 28 px."""
    torch.manual_seed(5)
    config = Dinov2WithRegistersConfig(
        hidden_size=WIDTH, num_hidden_layers=2, num_attention_heads=2, mlp_ratio=2, image_size=28,
        patch_size=14,
    )  # fmt: skip
    Dinov2WithRegistersModel(config).save_pretrained(folder)
    return folder


def write_model(folder: Path, parts: dict[str, tuple[str, dict[str, Any]]] | None = None) -> Path:
    """The pipeline and its parts."""
    parts = parts or PARTS
    for number, (role, (name, args)) in enumerate(parts.items()):
        torch.manual_seed(number)
        part = build({"name": name, "args": args})
        if role == "sparse_structure_decoder":  # a quarter of the cells, not half of them
            torch.nn.init.constant_(part.out_layer[2].bias, -0.15)
        save_part(part, {"name": name, "args": args}, folder / "ckpts" / role)
    said = {
        "name": "TrellisImageTo3DPipeline",
        "args": {
            "models": {role: f"ckpts/{role}" for role in parts},
            "sparse_structure_sampler": SAMPLER,
            "slat_sampler": SAMPLER,
            "slat_normalization": {"mean": [0.1] * 8, "std": [1.5] * 8},
            "image_cond_model": "dinov2_vitl14_reg",
        },
    }
    (folder / "pipeline.json").write_text(json.dumps(said), encoding="utf-8")
    return folder


def write(folder: Path) -> Folders:
    """Both, where the generator looks for them."""
    return Folders(
        write_model(folder / "trellis-image-large"),
        write_encoder(folder / "dinov2-with-registers-large"),
    )


def save_part(part: NetworkPart, description: dict[str, Any], path: Path) -> None:
    """Writes what `load_part` reads."""
    path.parent.mkdir(parents=True, exist_ok=True)
    tensors = {name: values.contiguous() for name, values in part.state_dict().items()}
    save_file(tensors, str(path.with_name(path.name + ".safetensors")))
    path.with_name(path.name + ".json").write_text(json.dumps(description), encoding="utf-8")
