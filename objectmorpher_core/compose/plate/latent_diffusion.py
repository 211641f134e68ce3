"""Holes filled by a latent diffusion: what PixelHacker and Moebius have in common.

Both come from one laboratory (Xu et al. 2025, arXiv 2504.20438; Duan, Xu et al. 2026, arXiv
2606.19195). A U-Net predicts the noise of latents; instead of a text it is told twenty learned
vectors: ten for what is to be filled in, ten for nothing. DDIM steps (Song et al. 2020) lead from
noise to a picture, guided by the masked photo. Settings and order are those of the published
pipelines, but for where the noise starts from: there it is the photo with what the hole hides,
which would shine through; here its hole is smooth.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from ...base.arrays import F32, Mask
from ...base.progress import Progress
from ...models import ModelError

IDS = 20  # half of them what is to be filled in, half of them nothing
OTHER = (  # what a config may say besides what is published
    "block_out_channels", "layers_per_block", "down_block_types", "up_block_types",
    "norm_num_groups",
)  # fmt: skip
CONFIG = "config.json"


class Denoiser(nn.Module):
    """Predicts the noise of latents. float32, but for the U-Net, which may be of less."""

    title: ClassVar[str]
    published: ClassVar[Mapping[str, Any]]  # of its U-Net, beside diffusers' defaults
    guidance: ClassVar[float]

    def __init__(self, config: Mapping[str, Any]) -> None:
        from diffusers.models.unets.unet_2d_condition import UNet2DConditionModel

        super().__init__()
        self.embedding_layer = nn.Embedding(IDS, int(config["encoder_hid_dim"]))
        self.diff_model: Any = UNet2DConditionModel(**config)
        self.replace_parts()

    def replace_parts(self) -> None:
        """Put its own parts in the place of diffusers'."""
        raise NotImplementedError

    def forward(self, latents: Tensor, time: Tensor, ids: Tensor) -> Tensor:
        """(B, 4, h, w) of latents (B, 9, h, w) at a `time`; ids (B, IDS / 2)."""
        told = self.embedding_layer(ids).to(latents.dtype)
        return self.diff_model(latents, time, told, return_dict=False)[0]


def read_config(kind: type[Denoiser], folder: Path) -> dict[str, Any]:
    """Read the U-Net's config.json; the published values where there is none.

    Raises ModelError.
    """
    at, published = folder / CONFIG, dict(kind.published)
    if not at.exists():
        return published
    try:
        said = json.loads(at.read_text(encoding="utf-8"))
        return published | {key: said[key] for key in (*published, *OTHER) if key in said}
    except (OSError, ValueError, TypeError) as error:
        raise ModelError(f"{folder.name}/{CONFIG} cannot be read") from error


def build(kind: type[Denoiser], config: Mapping[str, Any] | None = None) -> Denoiser:
    """The network with weights as torch makes them, as published by default. Raises ModelError."""
    try:
        return kind(kind.published if config is None else config)
    except (ValueError, TypeError, KeyError, RuntimeError) as error:
        raise ModelError(f"{kind.title}'s config describes no network") from error


def load(kind: type[Denoiser], at: Path, device: str, number: torch.dtype) -> Denoiser:
    """The network of a safetensors file; every key and shape has to be right. Raises ModelError."""
    from safetensors import SafetensorError, safe_open

    with torch.device("meta"):
        network = build(kind, read_config(kind, at.parent))
    wanted = network.state_dict()
    try:
        with safe_open(str(at), framework="pt") as file:
            shapes = {k: tuple(file.get_slice(k).get_shape()) for k in file.keys()}  # noqa: SIM118
            own = {key: tuple(tensor.shape) for key, tensor in wanted.items()}
            check_shapes(f"{at.name} is not {kind.title}'s", shapes, own)
            found = {
                key: file.get_tensor(key).to(device, number if t.is_floating_point() else t.dtype)
                for key, t in wanted.items()
            }
    except (SafetensorError, OSError) as error:
        raise ModelError(f"{at.name} is damaged or no safetensors file") from error
    network.load_state_dict(found, strict=True, assign=True)
    return network.eval().requires_grad_(False)


def check_shapes(
    told: str, found: Mapping[str, tuple[int, ...]], wanted: Mapping[str, tuple[int, ...]]
) -> None:
    """Raises ModelError where weights have other keys or shapes than the network."""
    absent, more = sorted(wanted.keys() - found.keys()), sorted(found.keys() - wanted.keys())
    if absent:
        raise ModelError(f"{told}: it lacks {absent[0]}")
    if more:
        raise ModelError(f"{told}: it has {more[0]}")
    for key, shape in wanted.items():
        if found[key] != shape:
            raise ModelError(f"{told}, or of another config: {key} is {found[key]}, not {shape}")


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
        from ...models.device import is_out_of_memory

        if is_out_of_memory(error):
            raise
        raise ModelError(f"{folder.name} cannot be opened as an autoencoder") from error
    finally:
        logging.set_verbosity(level)
    codec, told = loaded
    if told["missing_keys"] or told["mismatched_keys"]:
        raise ModelError(f"{folder.name} lacks some of its weights")
    return codec.eval().requires_grad_(False).to(device)


STEPS = 20
STRENGTH = 0.999  # of the noise: one of the steps is left out
NOISE_OFFSET = 0.0357  # x a number for each channel of all the noise
SCHEDULE = {
    "beta_start": 0.00085, "beta_end": 0.012, "beta_schedule": "scaled_linear",
    "num_train_timesteps": 1000, "clip_sample": False,
}  # fmt: skip


def sample(
    network: Denoiser, codec: Any, picture: F32, hole: Mask, progress: Progress, seed: int
) -> F32:
    """(n, n, 3) in [0, 1]: the picture (n, n, 3) with its hole (n, n) filled, and nearly as it was.

    n is a multiple of what the autoencoder shrinks by. The same seed gives the same numbers on
    one device. Of what is in the hole only how bright and colourful it is on the whole matters.
    """
    from diffusers.schedulers.scheduling_ddim import DDIMScheduler

    number = next(network.diff_model.parameters()).dtype
    device = next(codec.parameters()).device
    shrink = 2 ** (len(codec.config.block_out_channels) - 1)
    # On the CPU, so that a seed means the same on every device.
    random = torch.Generator().manual_seed(seed)
    with torch.inference_mode():
        given = torch.from_numpy(picture).permute(2, 0, 1)[None].to(device) * 2 - 1
        mask = in_cells(torch.from_numpy(hole)[None, None].float(), shrink).to(device)
        start = _encode(codec, given, random)
        known = _encode(codec, given * (1 - mask), random)
        small = functional.interpolate(mask, scale_factor=1 / shrink)  # nearest
        noise = torch.randn(start.shape, generator=random)
        offset = torch.randn((*start.shape[:2], 1, 1), generator=random)
        noise = (noise + NOISE_OFFSET * offset).to(device)
        scheduler: Any = DDIMScheduler(**SCHEDULE)
        scheduler.set_timesteps(STEPS)
        times = scheduler.timesteps[STEPS - int(STEPS * STRENGTH) :]
        latents = scheduler.add_noise(start, noise, times[:1])
        ids = torch.arange(IDS, device=device).view(2, -1).flip(0)  # nothing, what is filled in
        for k, time in enumerate(times):
            progress(k / len(times), f"inventing what is behind: step {k + 1} of {len(times)}")
            one = torch.cat([latents, small, known], 1).to(number)
            nothing, wanted = network(one.expand(2, -1, -1, -1), time.to(device), ids).float()
            guided = (nothing + network.guidance * (wanted - nothing))[None]
            latents = scheduler.step(guided, time, latents, return_dict=False)[0]
        progress(1.0, "developing what was invented")
        decoded = codec.decode(latents / codec.config.scaling_factor, return_dict=False)[0]
    filled = (decoded[0].permute(1, 2, 0).float().cpu().numpy() + 1) / 2
    return np.clip(np.nan_to_num(filled, nan=0.5), 0, 1).astype(np.float32)


def in_cells(mask: Tensor, shrink: int) -> Tensor:
    """A mask (1, 1, h, w) that holds whole cells of the latents: all that it touched.

    The latents' mask is every `shrink`th pixel of it, which would miss what lies between.
    """
    cells = functional.max_pool2d(mask, shrink)
    return functional.interpolate(cells, scale_factor=float(shrink))


def _encode(codec: Any, picture: Tensor, random: torch.Generator) -> Tensor:
    found = codec.encode(picture, return_dict=False)[0].sample(random)
    return found * codec.config.scaling_factor
