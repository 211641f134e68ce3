"""Fills holes by PixelHacker, the paper's own inpainter (3.3), by PyTorch."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ... import models
from ...base.arrays import F32, Mask, Pixels
from ...base.progress import Progress, part
from ...models import ModelError, device, ledger
from ...models.plans import Need, Plan
from ...models.weight_folder import count_parameters
from .. import InpaintError
from .hole_squares import fill_squares

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
        from .pixelhacker import sample

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

        from .pixelhacker import load, load_codec

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
    from .pixelhacker import read_config

    try:
        said = json.loads((codec / "config.json").read_text(encoding="utf-8"))
        shrink = 2 ** (len(said["block_out_channels"]) - 1)
        return int(read_config(weights.parent)["sample_size"]) * shrink
    except (ValueError, KeyError, TypeError) as error:
        raise ModelError(f"{codec.name}/config.json does not describe an autoencoder") from error
