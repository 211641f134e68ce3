"""Fills holes by PixelHacker, the paper's own inpainter (3.3), by PyTorch."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ... import models
from ...base.arrays import F32, Mask, Pixels
from ...base.progress import Progress, part
from ...models import ModelError, device, ledger
from ...models.plans import Need, Plan
from ...models.weight_folder import count_parameters
from .. import InpaintError
from .hole_squares import fill_squares
from .pixelhacker.network import IDS, PixelHacker

# The sampler: DDIM steps (Song et al. 2020) from noise to a picture, guided by the masked photo.
#
# Settings and order are those of the published pipeline, but for where the noise starts from: there
# it is the photo with what the hole hides, which would shine through; here its hole is smooth.

STEPS = 20
STRENGTH = 0.999  # of the noise: one of the steps is left out
GUIDANCE = 4.5
NOISE_OFFSET = 0.0357  # x a number for each channel of all the noise
SCHEDULE = {
    "beta_start": 0.00085, "beta_end": 0.012, "beta_schedule": "scaled_linear",
    "num_train_timesteps": 1000, "clip_sample": False,
}  # fmt: skip


def sample(
    network: PixelHacker, codec: Any, picture: F32, hole: Mask, progress: Progress, seed: int
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
            guided = (nothing + GUIDANCE * (wanted - nothing))[None]
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


ID = "pixelhacker"
PACKAGES = ("torch", "diffusers", "safetensors")
CODEC = "vae"  # folder of the autoencoder
WORK = 1_800_000_000  # bytes beside the weights; the decoder needs most of it
CODEC_PARAMETERS = 84_000_000  # always in float32
# float32 is what it was published in; bfloat16 where that does not fit.
NUMBERS: tuple[device.Number, ...] = ("float32", "bfloat16")


class PixelHackerInpainter:
    """Nineteen steps of a diffusion in each square; another seed invents something else."""

    name = "pixelhacker"
    is_random = True
    context = 512  # px around a hole that it looks at where the photo has them

    def missing(self) -> str | None:
        """See `Inpainter`."""
        try:
            is_here = models.place(ID) is not None
        except ModelError as error:
            return str(error)
        lacks = [] if all(find_spec(name) for name in PACKAGES) else [f"`{models.EXTRA}`"]
        lacks += [] if is_here else [f"`objectmorpher models get {ID}`"]
        return f"PixelHacker is not here: {', then '.join(lacks)}" if lacks else None

    def is_slow(self) -> bool:
        """Whether a fill takes minutes here. Imports torch."""
        try:
            return device.devices()[0] == "cpu"
        except ModelError:
            return True

    def inpaint(self, rgb: Pixels, hole: Mask, progress: Progress, seed: int = 0) -> Pixels:
        """See `Inpainter`. The same bytes on one device; raises InpaintError, too, if it fails."""

        progress(0.0, "opening the model")
        try:
            weights, codec = _files()
            side = _side(weights, codec)

            def attempt(networks: tuple[Any, Any], plan: Plan) -> Pixels:
                def fill(picture: F32, inside: Mask, step: Progress, seed: int) -> F32:
                    return sample(*networks, picture, inside, step, seed)

                return fill_squares(rgb, hole, side, fill, part(progress, 0.05, 1.0), seed)

            return ledger.SHARED.run(_model(weights, codec), attempt)
        except ModelError as error:
            raise InpaintError(str(error)) from error
        except OSError as error:
            raise InpaintError(f"PixelHacker cannot be read: {error.strerror or error}") from error


def need(parameters: int) -> Need:
    """What a network of so many, and its autoencoder, ask of memory."""
    return Need(parameters + CODEC_PARAMETERS, WORK, numbers=NUMBERS)


def _model(weights: Path, codec: Path) -> ledger.Model[tuple[Any, Any]]:
    """The network and the autoencoder, for the ledger. Raises ModelError or OSError."""

    def opened(plan: Plan) -> tuple[Any, Any]:
        import torch

        from .pixelhacker.network import load, load_codec

        network = load(weights, plan.device, getattr(torch, plan.number))
        return network, load_codec(codec, plan.device)

    made_of = weights, weights.stat().st_mtime_ns
    asked = need(count_parameters(weights.parent) + CODEC_PARAMETERS)
    return ledger.Model("PixelHacker", made_of, asked, opened)


def _files() -> tuple[Path, Path]:
    """The network's weights, and the folder of the autoencoder. Raises ModelError."""
    at = models.place(ID)
    if at is None:
        raise ModelError(f"PixelHacker is not here: `objectmorpher models get {ID}`")
    found = [p for p in models.files(ID) if p.suffix == ".safetensors" and p.parent.name != CODEC]
    if len(found) != 1:
        raise ModelError(f"{at.name} holds {len(found)} networks, not one of PixelHacker's")
    return found[0], at / CODEC


def _side(weights: Path, codec: Path) -> int:
    """px of the square that it sees. Raises ModelError."""
    from .pixelhacker.network import read_config

    try:
        said = json.loads((codec / "config.json").read_text(encoding="utf-8"))
        shrink = 2 ** (len(said["block_out_channels"]) - 1)
        return int(read_config(weights.parent)["sample_size"]) * shrink
    except (ValueError, KeyError, TypeError) as error:
        raise ModelError(f"{codec.name}/config.json does not describe an autoencoder") from error
