"""A generator's picture of an object: alone on black in a square, with DINOv2's tokens."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from ...base.arrays import F32, F64
from ...base.masks import box_of
from ...document.model import Matte
from ...models.depth_net import open_net
from ...models.registry import ModelError
from .. import LiftError

if TYPE_CHECKING:
    import torch

ROOM = 1.2  # the square's side over the object's longer side, as in training
SOLID = 0.8  # alpha from which on a pixel counts to the object's box
# Of the encoder's training.
MEAN = np.array([0.485, 0.456, 0.406], np.float32)
STD = np.array([0.229, 0.224, 0.225], np.float32)


@dataclass(frozen=True, eq=False)
class ConditionPicture:
    """The object in a square of the photo, part of which may lie beyond its frame."""

    image: Image.Image  # RGBA, straight colours, at the photo's resolution
    left: int  # px of the photo
    top: int

    @staticmethod
    def of(matte: Matte) -> ConditionPicture:
        """Around what `matte` cuts out. Raises LiftError where that is nothing."""
        solid = matte.alpha > SOLID
        if not solid.any():  # glass
            solid = matte.alpha > 0.5 * matte.alpha.max(initial=0.0)
        if not solid.any():
            raise LiftError("nothing is selected that could be lifted")
        box = box_of(solid)
        low, high = np.array(box[:2]), np.array(box[2:]) - 1
        half = max(int(ROOM * (high - low).max()) // 2, 1)
        left, top = np.rint(0.5 * (low + high) - half).astype(int)
        rgba = np.dstack([matte.foreground, matte.alpha])
        whole = Image.fromarray(np.rint(255 * rgba.clip(0, 1)).astype(np.uint8), "RGBA")
        image = whole.crop((int(left), int(top), int(left) + 2 * half, int(top) + 2 * half))
        return ConditionPicture(image, int(left) + matte.left, int(top) + matte.top)

    @property
    def side(self) -> int:
        """Px of the photo."""
        return self.image.width

    def on_black(self, side: int) -> F32:
        """(side, side, 3) in [0, 1], resampled."""
        small = self.image.resize((side, side), Image.Resampling.LANCZOS)
        rgba = np.asarray(small, np.float32) / 255
        return np.asarray(rgba[..., :3] * rgba[..., 3:], np.float32)

    def photo_xy(self, uv: F64) -> F64:
        """Photo px (..., 2) of places (..., 2) in the square, whose side is 1."""
        return uv * self.side + [self.left, self.top]


class Encoder:
    """DINOv2 with registers, in transformers' own layout."""

    def __init__(self, folder: Path, device: torch.device, dtype: torch.dtype) -> None:
        """Raises LiftError: one sentence."""
        from transformers import Dinov2WithRegistersModel

        # Through transformers, which knows the names that older files give to the weights.
        try:
            net = open_net(
                Dinov2WithRegistersModel, folder, "does not hold DINOv2 with registers",
                "DINOv2's", dtype=dtype,
            )  # fmt: skip
        except ModelError as error:
            raise LiftError(str(error)) from error
        self._net = net.to(device)
        self.side = int(net.config.image_size)  # px

    def tokens(self, rgb: F32) -> torch.Tensor:
        """(1, 1 + registers + patches, D) f32 of a picture (side, side, 3) in [0, 1].

        Before the network's last norm, then normed without parameters.
        """
        import torch

        from .blocks import unit_layer_norm

        own = next(self._net.parameters())
        pixels = torch.from_numpy((rgb - MEAN) / STD).permute(2, 0, 1)
        h = self._net.embeddings(pixels[None].to(own.device, own.dtype))
        h = self._net.encoder(h).last_hidden_state
        return unit_layer_norm(h.float())
