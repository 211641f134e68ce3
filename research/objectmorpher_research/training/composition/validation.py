"""The model's output for held-out triplets: B, coarse edit, output, A side by side."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from objectmorpher_core.base.arrays import RGB
from objectmorpher_core.base.files import write_all
from objectmorpher_core.pictures.image import Picture, encode_picture

from .edit_models import EditModel, Latents
from .randomness import drawn

if TYPE_CHECKING:
    from .train_lora import Trainer

FOLDER = "validation"
SAMPLE = 1 << 41  # the first number of the draws


def write_pictures(trainer: Trainer, steps: int) -> None:
    """`validation/NAME-STEP.png` for each, with the same noise every time.

    Each process calls it: it may hold a shard of the transformer.
    """
    import torch

    weights, number = trainer.places.weights, trainer.plan.number
    folder = trainer.places.out / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    is_first = trainer.accelerator.is_main_process
    decoder = _decoder(trainer.model, weights, trainer.device, number) if is_first else None
    trainer.transformer.eval()
    for k, triplet in enumerate(trainer.held_out):
        at = trainer.cache.read(triplet, trainer.device)
        with torch.no_grad():
            tokens = sampled(trainer, at, steps, k)
            if not is_first:
                continue
            made = trainer.model.decode(decoder, tokens, at.grids[0])
        b, coarse, a = triplet.read()
        row = np.hstack([_as_large(p, made) for p in (b, coarse, made, a)])
        name = f"{triplet.name}-{trainer.step:06d}.png"
        write_all({folder / name: encode_picture(Picture(row), ".png")})
    trainer.transformer.train()


def sampled(trainer: Trainer, at: Latents, steps: int, number: int) -> Any:
    """(1, n, c) tokens, by the pipeline's own scheduler in so many steps, without guidance."""
    scheduler = type(trainer.scheduler).from_config(trainer.scheduler.config)
    mu = trainer.model.shift(scheduler, at.target.shape[1], steps)
    how = {"mu": mu} if scheduler.config.use_dynamic_shifting else {}
    scheduler.set_timesteps(sigmas=np.linspace(1.0, 1 / steps, steps).tolist(), **how)
    _, noise = drawn(trainer.plan.seed, SAMPLE + number, tuple(at.target.shape))
    tokens = noise.to(trainer.device, at.target.dtype)
    for t in scheduler.timesteps:
        sigma = (t / 1000).reshape(1).to(trainer.device, tokens.dtype)
        with trainer.accelerator.autocast():
            found = trainer.model.velocity(trainer.transformer, tokens, sigma, at)
        tokens = scheduler.step(found.to(tokens.dtype), t, tokens, return_dict=False)[0]
    return tokens


def _as_large(picture: RGB, other: RGB) -> RGB:
    size = (other.shape[1], other.shape[0])
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


@cache
def _decoder(model: EditModel, weights: Path, device: str, number: str) -> Any:
    return model.decoder(weights, device, number)
