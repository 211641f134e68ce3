"""The sampler: DDIM steps (Song et al. 2020) from noise to a picture, guided by the masked photo.

Settings and order are those of the published pipeline, but for where the noise starts from: there
it is the photo with what the hole hides, which would shine through; here its hole is smooth.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ....base.arrays import F32, Mask
from ....base.progress import Progress
from .network import IDS, PixelHacker

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
