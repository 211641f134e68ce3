"""Pipelines as the published ones are, of a few thousand random weights, saved to a folder."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from diffusers import (
    AutoencoderKLFlux2,
    AutoencoderKLQwenImage,
    FlowMatchEulerDiscreteScheduler,
    Flux2Transformer2DModel,
    QwenImageTransformer2DModel,
)
from diffusers.pipelines.qwenimage import pipeline_qwenimage_edit_plus
from transformers import (
    Qwen2_5_VLConfig,
    Qwen2_5_VLForConditionalGeneration,
    Qwen2Tokenizer,
    Qwen3Config,
    Qwen3ForCausalLM,
)
from transformers.models.qwen2_vl.image_processing_pil_qwen2_vl import Qwen2VLImageProcessorPil

from objectmorpher_core.compose.refine import diffusion, klein, qwen
from objectmorpher_core.models import device

SPECIAL = [
    "<|endoftext|>", "<|im_start|>", "<|im_end|>", "<|vision_start|>", "<|vision_end|>",
    "<|image_pad|>", "<|video_pad|>",
]  # fmt: skip


def byte_letters() -> list[str]:
    """The 256 letters by which byte-level tokenizers write bytes."""
    plain = [*range(33, 127), *range(161, 173), *range(174, 256)]
    rest = [b for b in range(256) if b not in plain]
    return [chr(b) for b in plain] + [chr(256 + k) for k in range(len(rest))]


def tokenizer() -> Qwen2Tokenizer:
    letters = {letter: k for k, letter in enumerate(byte_letters())}
    made = Qwen2Tokenizer(vocab=letters, merges=[], additional_special_tokens=SPECIAL)
    made.chat_template = (
        "{% for m in messages %}<|im_start|>{{ m['content'] }}<|im_end|>{% endfor %}"
    )
    return made


def write_both(at: Path) -> dict[str, Path]:
    """A pipeline for each refiner, by its name."""
    return {"qwen": write_qwen(at / "qwen"), "klein": write_klein(at / "klein")}


def make_small(patch: pytest.MonkeyPatch, side: int) -> None:
    """The CPU, two steps, and conditions of `side` x `side` px, as small as the networks."""
    patch.setenv(device.DEVICE, "cpu")
    patch.setattr(pipeline_qwenimage_edit_plus, "VAE_IMAGE_SIZE", side * side)
    patch.setattr(pipeline_qwenimage_edit_plus, "CONDITION_IMAGE_SIZE", 56 * 56)
    patch.setattr(diffusion, "AREA", side * side)
    for refiner in (qwen.QwenRefiner, klein.KleinRefiner):
        patch.setattr(refiner, "work", dict.fromkeys(refiner.work, 1 << 20))
    patch.setattr(qwen, "STEPS", 2)
    patch.setattr(klein, "STEPS", 2)


def write_qwen(at: Path) -> Path:
    """A Qwen-Image-Edit-Plus."""
    torch.manual_seed(0)
    words = tokenizer()
    image, start, end = (
        words.convert_tokens_to_ids(t)
        for t in ("<|image_pad|>", "<|vision_start|>", "<|vision_end|>")
    )
    config = Qwen2_5_VLConfig(
        text_config={
            "vocab_size": 300, "hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 2,
            "num_attention_heads": 2, "num_key_value_heads": 2, "max_position_embeddings": 4096,
            "rope_scaling": {"mrope_section": [1, 1, 2], "rope_type": "default", "type": "default"},
        },
        vision_config={
            "depth": 2, "hidden_size": 16, "intermediate_size": 16, "num_heads": 2,
            "out_hidden_size": 16, "fullatt_block_indexes": [1],
        },
        image_token_id=image, vision_start_token_id=start, vision_end_token_id=end,
    )  # fmt: skip
    networks = {
        "transformer": QwenImageTransformer2DModel(
            patch_size=2, in_channels=16, out_channels=4, num_layers=2, attention_head_dim=16,
            num_attention_heads=3, joint_attention_dim=16, axes_dims_rope=(8, 4, 4),
        ),
        "vae": AutoencoderKLQwenImage(
            base_dim=24, z_dim=4, dim_mult=[1, 2, 4], num_res_blocks=1,
            temperal_downsample=[False, True], latents_mean=[0.0] * 4, latents_std=[1.0] * 4,
        ),
        "text_encoder": Qwen2_5_VLForConditionalGeneration(config),
        "scheduler": FlowMatchEulerDiscreteScheduler(),
        "tokenizer": words, "processor": Qwen2VLImageProcessorPil(),
    }  # fmt: skip
    kinds = {"processor": ["transformers", "Qwen2VLProcessor"]}
    return _write(at, "QwenImageEditPlusPipeline", networks, kinds)


def write_klein(at: Path) -> Path:
    """A FLUX.2-klein, with the text encoder, whose states are three layers of 16."""
    torch.manual_seed(0)
    words = tokenizer()
    config = Qwen3Config(
        vocab_size=300, hidden_size=16, intermediate_size=16, num_hidden_layers=4, head_dim=8,
        num_attention_heads=2, num_key_value_heads=2, max_position_embeddings=1024,
    )  # fmt: skip
    networks = {
        "transformer": Flux2Transformer2DModel(
            in_channels=4, num_layers=1, num_single_layers=1, attention_head_dim=16,
            num_attention_heads=2, joint_attention_dim=48, axes_dims_rope=[4] * 4,
            timestep_guidance_channels=16, guidance_embeds=False,
        ),
        "vae": AutoencoderKLFlux2(  # eight pixels a side in one, as the published: of a megapixel
            block_out_channels=(4,) * 4, down_block_types=("DownEncoderBlock2D",) * 4,
            up_block_types=("UpDecoderBlock2D",) * 4, layers_per_block=1, latent_channels=1,
            norm_num_groups=1, use_quant_conv=False, use_post_quant_conv=False,
        ),
        "text_encoder": Qwen3ForCausalLM(config),
        "scheduler": FlowMatchEulerDiscreteScheduler(),
        "tokenizer": words,
    }  # fmt: skip
    return _write(at, "Flux2KleinPipeline", networks, {})


def write_lora(at: Path, transformer: Path, kind: str, seed: int, size: float = 0.5) -> Path:
    """A rank-16 LoRA of random numbers on a transformer's attention, as diffusers saves one."""
    import diffusers
    from peft import LoraConfig, get_peft_model_state_dict

    network_class = (
        QwenImageTransformer2DModel if kind.startswith("Qwen") else Flux2Transformer2DModel
    )
    network = network_class.from_pretrained(transformer)
    network.add_adapter(LoraConfig(r=16, lora_alpha=16, target_modules=["to_q", "to_k", "to_v"]))
    torch.manual_seed(seed)
    state = {k: size * torch.randn_like(v) for k, v in get_peft_model_state_dict(network).items()}
    getattr(diffusers, kind).save_lora_weights(at, transformer_lora_layers=state)
    return at


def _write(at: Path, kind: str, networks: dict, kinds: dict) -> Path:
    index: dict = {"_class_name": kind, "_diffusers_version": "0.42.1"}
    for name, network in networks.items():
        network.save_pretrained(at / name)
        library = (
            "diffusers" if type(network).__module__.startswith("diffusers") else "transformers"
        )
        index[name] = kinds.get(name, [library, type(network).__name__])
    (at / "model_index.json").write_text(json.dumps(index))
    return at
