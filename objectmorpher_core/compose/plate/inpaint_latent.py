"""Fills holes by PixelHacker, the paper's own inpainter (3.3), or by Moebius, by PyTorch."""

from __future__ import annotations

import json
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ... import models
from ...base.arrays import F32, Mask, Pixels
from ...base.progress import Progress, part
from ...models import ModelError, device, ledger
from ...models.plans import Need, Plan
from ...models.weight_folder import CODEC, count_parameters
from .. import InpaintError
from .hole_squares import Filler, fill_squares

TITLES = {"pixelhacker": "PixelHacker", "moebius": "Moebius"}
CODECS = ("pixelhacker", "pixelhacker-vae")  # models that have the autoencoder of both
PACKAGES = ("torch", "diffusers", "safetensors")
WORK = 1_800_000_000  # bytes beside the weights; the decoder needs most of it
CODEC_PARAMETERS = 84_000_000  # always in float32
# float32 is what they were published in; bfloat16 where that does not fit.
NUMBERS: tuple[device.Number, ...] = ("float32", "bfloat16")


class LatentInpainter:
    """Nineteen steps of a diffusion in each square; another seed invents something else."""

    is_random = True
    context = 512  # px around a hole that it looks at where the photo has them

    def __init__(self, name: str) -> None:
        self.name = name

    def missing(self) -> str | None:
        """See `Inpainter`."""
        try:
            wanted = [] if models.place(self.name) is not None else [self.name]
            if _codec(self.name) is None and self.name not in CODECS:
                wanted.append(CODECS[-1])
        except ModelError as error:
            return str(error)
        lacks = [] if all(find_spec(name) for name in PACKAGES) else [f"`{models.EXTRA}`"]
        lacks += [f"`objectmorpher models get {id}`" for id in wanted]
        return f"{TITLES[self.name]} is not here: {', then '.join(lacks)}" if lacks else None

    def is_slow(self) -> bool:
        """Whether a fill takes minutes here. Imports torch."""
        return not device.has_gpu()

    def inpaint(self, rgb: Pixels, hole: Mask, progress: Progress, seed: int = 0) -> Pixels:
        """See `Inpainter`. The same bytes on one device; raises InpaintError, too, if it fails."""
        from .latent_diffusion import sample

        progress(0.0, "opening the model")
        try:
            weights, codec = self._files()
            side = self._side(weights, codec)

            def attempt(networks: tuple[Any, Any], plan: Plan) -> Pixels:
                def fill(picture: F32, inside: Mask, step: Progress, seed: int) -> F32:
                    return sample(*networks, picture, inside, step, seed)

                rest = part(progress, 0.05, 1.0)
                return fill_squares(rgb, hole, Filler(side, fill), rest, seed)

            return ledger.SHARED.run(self._model(weights, codec), attempt)
        except ModelError as error:
            raise InpaintError(str(error)) from error
        except OSError as error:
            reason = error.strerror or error
            raise InpaintError(f"{TITLES[self.name]} cannot be read: {reason}") from error

    def _model(self, weights: Path, codec: Path) -> ledger.Model[tuple[Any, Any]]:
        """The network and the autoencoder, for the ledger. Raises ModelError or OSError."""

        def opened(plan: Plan) -> tuple[Any, Any]:
            import torch

            from .latent_diffusion import load, load_codec

            network = load(self.kind(), weights, plan.device, getattr(torch, plan.number))
            return network, load_codec(codec, plan.device)

        made_of = weights, weights.stat().st_mtime_ns
        asked = need(count_parameters(weights.parent) + CODEC_PARAMETERS)
        return ledger.Model(TITLES[self.name], made_of, asked, opened)

    def kind(self) -> Any:
        """The network's class. Imports torch."""
        return getattr(import_module(f".{self.name}", __package__), TITLES[self.name])

    def _files(self) -> tuple[Path, Path]:
        """The network's weights, and the folder of the autoencoder. Raises ModelError."""
        at, codec = models.place(self.name), _codec(self.name)
        if at is None or codec is None:
            raise ModelError(self.missing() or f"{self.name} vanished")
        found = [p for p in models.files(self.name) if p.suffix == ".safetensors"]
        found = [p for p in found if p.parent.name != CODEC]
        if len(found) != 1:
            title = TITLES[self.name]
            raise ModelError(f"{at.name} holds {len(found)} networks, not one of {title}'s")
        return found[0], codec

    def _side(self, weights: Path, codec: Path) -> int:
        """px of the square that it sees. Raises ModelError."""
        from .latent_diffusion import read_config

        try:
            said = json.loads((codec / "config.json").read_text(encoding="utf-8"))
            shrink = 2 ** (len(said["block_out_channels"]) - 1)
            return int(read_config(self.kind(), weights.parent)["sample_size"]) * shrink
        except (ValueError, KeyError, TypeError) as error:
            raise ModelError(f"{codec.name}/config.json is no autoencoder's") from error


def pixelhacker() -> LatentInpainter:
    """PixelHacker: the paper's."""
    return LatentInpainter("pixelhacker")


def moebius() -> LatentInpainter:
    """Moebius: a quarter of PixelHacker's numbers."""
    return LatentInpainter("moebius")


def need(parameters: int) -> Need:
    """What a network of so many, and its autoencoder, ask of memory."""
    return Need(parameters + CODEC_PARAMETERS, WORK, numbers=NUMBERS)


def _codec(name: str) -> Path | None:
    """The folder of the autoencoder, the network's own first. Raises ModelError."""
    places = (models.place(id) for id in (name, *CODECS))
    found = (at / CODEC for at in places if at is not None)
    return next((at for at in found if (at / "config.json").is_file()), None)
