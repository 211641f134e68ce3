"""The generator: what the picture looks like, a flow to latents, Gaussians out of these."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional

from ...base.progress import Progress, part, silent
from ...document.gaussians import Gaussians
from ...models.plans import Plan
from .. import LiftError
from ..trellis.blocks import unit_layer_norm
from ..trellis.configs import Sampling
from ..trellis.generator import InParts, sample
from ..trellis.parts import filled, opened, refuse_differences
from ..trellis.picture import MEAN, STD, ConditionPicture
from . import networks

log = logging.getLogger(__name__)
FLOW = "diffusion_models/triposplat_fp16.safetensors"
DECODER = "vae/triposplat_vae_decoder_fp16.safetensors"
DINO, CODEC = "clip_vision/dino_v3_vit_h.safetensors", "vae/flux2-vae.safetensors"
SIDE = 1024  # px of the picture that it sees
SAMPLING = Sampling(steps=20, guidance=2.0, rescale_t=3.0)  # published: 3.0 of a sum of 1
DINO_FORM: Mapping[str, Any] = {  # DINOv3 ViT-H/16+, beside transformers' defaults
    "hidden_size": 1280, "num_hidden_layers": 32, "num_attention_heads": 20,
    "intermediate_size": 5120, "use_gated_mlp": True, "hidden_act": "silu",
    "num_register_tokens": 4,
}  # fmt: skip
CODEC_FORM: Mapping[str, Any] = {}  # FLUX.2's, diffusers' defaults
EPSILON = 1e-5  # of the codec's norm


class TripoSplatGenerator(InParts):
    """Each network's weights are read when it is needed."""

    def __init__(self, folder: Path, plan: Plan) -> None:
        super().__init__(plan)
        self.folder = folder

    def make(
        self, picture: ConditionPicture, count: int, progress: Progress = silent, seed: int = 0
    ) -> Gaussians:
        """About `count` Gaussians of a picture, in the cube of side 1 round the origin, z up.

        The same seed gives the same object on one device. Raises LiftError; Cancelled passes.
        """
        noise = torch.Generator().manual_seed(seed)  # of the host: the same on every device
        try:
            with torch.inference_mode():
                progress(0.0, "Looking at the object")
                rgb = torch.from_numpy(picture.on_black(SIDE)).permute(2, 0, 1)[None]
                condition = self.condition(rgb.to(self.device), noise)
                latents = self._latents(condition, noise, part(progress, 0.05, 0.95))
                progress(0.95, "Making Gaussians")
                decoder = self.held("decoder", lambda: self._part(networks.Decoder, DECODER))
                return decoder.decode(latents, count, noise)
        except ValueError as error:  # weights that are not numbers, or overflowed
            if isinstance(error, LiftError):
                raise
            raise LiftError(
                f"what the network made of the picture is of no use: {error}"
            ) from error
        finally:
            if not self.plan.keeps:
                self.release()

    def condition(self, rgb: Tensor, noise: torch.Generator) -> Tensor:
        """(1, M, seen + drawn) of a picture (1, 3, SIDE, SIDE) in [0, 1]: the flow's condition."""
        mean, std = (rgb.new_tensor(v)[:, None, None] for v in (MEAN, STD))
        dino = self.held("dino", self._dino)
        seen = unit_layer_norm(dino(pixel_values=(rgb - mean) / std).last_hidden_state)
        codec = self.held("codec", self._codec)
        found = codec.encode(2 * rgb - 1).latent_dist
        drawn = torch.randn(found.mean.shape, generator=noise).to(rgb.device)
        drawn = functional.pixel_unshuffle(found.mean + found.std * drawn, 2)
        norm = codec.bn
        drawn = drawn - norm.running_mean[:, None, None]
        drawn = drawn / (norm.running_var[:, None, None] + EPSILON).sqrt()
        drawn = drawn.flatten(2).transpose(1, 2)
        before = seen.shape[1] - drawn.shape[1]  # tokens that are not of the picture's patches
        return torch.cat([seen, functional.pad(drawn, (0, 0, before, 0))], 2)

    def _latents(self, condition: Tensor, noise: torch.Generator, progress: Progress) -> Tensor:
        flow = self.held("flow", lambda: self._part(networks.Flow, FLOW))
        form, nothing = flow.form, torch.zeros_like(condition)
        start = torch.randn(1, form.tokens, form.channels, generator=noise)
        camera = torch.randn(1, 1, form.camera, generator=noise)
        camera = functional.pad(camera, (0, form.channels - form.camera))

        def velocity(x: Tensor, time: Tensor, is_shown: bool) -> Tensor:
            return flow(x, time, condition if is_shown else nothing)

        packed = torch.cat([start, camera], 1).to(self.device)
        return sample(velocity, packed, SAMPLING, progress, "Making the object")[:, :-1]

    def _part(self, kind: type[Any], name: str) -> Any:
        log.info("Loading %s", name)
        with torch.device("meta"):
            network = kind(networks.FORM)
        return filled(network, self.folder / name, self.device, self.dtype)

    # The encoders in single precision: they run once, and everything follows from them.

    def _dino(self) -> Any:
        from transformers import DINOv3ViTConfig, DINOv3ViTModel
        from transformers.utils import logging

        logging.disable_progress_bar()
        config = DINOv3ViTConfig(**DINO_FORM)
        with torch.device("meta"):
            wanted = {key: t.shape for key, t in DINOv3ViTModel(config).state_dict().items()}
        # Newer versions of transformers have its layers one name deeper.
        found = self._tensors(DINO, {key.removeprefix("model."): key for key in wanted}, wanted)
        network: Any = DINOv3ViTModel.from_pretrained(
            None, config=config, state_dict=found, dtype=torch.float32
        )
        return network.eval().requires_grad_(False).to(self.device)

    def _codec(self) -> Any:
        from diffusers.models.autoencoders.autoencoder_kl_flux2 import AutoencoderKLFlux2

        with torch.device("meta"):
            codec: Any = AutoencoderKLFlux2(**CODEC_FORM)
        wanted = {key: t.shape for key, t in codec.state_dict().items()}
        found = self._tensors(CODEC, {key: key for key in wanted}, wanted)
        codec.load_state_dict(found, strict=True, assign=True)
        del codec.decoder
        return codec.eval().requires_grad_(False).to(self.device)

    def _tensors(
        self, name: str, names: Mapping[str, str], wanted: Mapping[str, Any]
    ) -> dict[str, Tensor]:
        """A file's tensors in single precision, by the names that ours have. Raises LiftError."""
        log.info("Loading %s", name)
        with opened(self.folder / name) as file:
            shapes = {k: tuple(file.get_slice(k).get_shape()) for k in file.keys()}  # noqa: SIM118
            refuse_differences(name, shapes, {k: tuple(wanted[to]) for k, to in names.items()})
            return {to: file.get_tensor(k).float() for k, to in names.items()}
