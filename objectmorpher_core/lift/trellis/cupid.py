"""CUPID (Huang et al. 2025): TRELLIS that also says how the picture shows what it makes.

Its first flow makes two latents: where the object is, and where each cell is seen in the picture.
The second gets the picture's own tokens and colours at those places.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ...base.arrays import F64
from ...models.plans import Plan
from .camera import view
from .generator import LATENT, STRUCTURE, Extras, Folders, Generator, Placed, occupied
from .latent import looked_up
from .picture import ConditionPicture
from .voxels import Voxels

PLACES = "sparse_structure_uv_decoder"
TOKENS = "slat_encoder"  # TRELLIS's own, which CUPID takes from there
TOKENS_PATH = "microsoft/TRELLIS-image-large/ckpts/slat_enc_swin8_B_64l8_fp16"
REGISTERS = 5  # tokens before those of the patches: one of the whole, four registers
LEAST_CELLS = 10  # whose places tell the camera; where fewer are occupied, the likeliest


class CupidGenerator(Generator):
    """A `Generator` whose objects know how they are seen."""

    def __init__(self, folders: Folders, plan: Plan) -> None:
        super().__init__(folders, plan)
        self.pipeline.parts.setdefault(TOKENS, TOKENS_PATH)

    def _placed(self, latents: Tensor) -> Placed:
        decoder = self.part(STRUCTURE)
        own = decoder.form.latent_channels
        logits = decoder(latents[:, :own])[0, 0]
        voxels = occupied(logits)
        places = self.part(PLACES)(latents[:, own:])[0, 1:3]
        telling = voxels if len(voxels) >= LEAST_CELLS else _likeliest(logits)
        uv = torch.sigmoid(places[:, *telling.cells.T].T)
        return Placed(voxels, view(centres(telling), uv.cpu().double().numpy()))

    def _extras(self, picture: ConditionPicture, seen: Tensor, placed: Placed) -> Extras | None:
        assert placed.view is not None
        xy = placed.view.project(centres(placed.voxels)).clip(0, 1)
        uv = torch.from_numpy(xy.astype(np.float32)).to(seen.device)
        side = round((seen.shape[1] - REGISTERS) ** 0.5)
        patches = seen[:, REGISTERS:].transpose(1, 2).unflatten(2, (side, side))
        tokens = self.part(TOKENS).mean(looked_up(patches, uv), placed.voxels)
        flow = self.part(LATENT)
        rgb = torch.from_numpy(picture.on_black(flow.visual_side)).permute(2, 0, 1)[None]
        rgb = rgb.to(seen.device)
        return Extras(
            torch.cat([tokens, flow.colours(rgb, uv)], 2),
            torch.cat([torch.zeros_like(tokens), flow.colours(torch.zeros_like(rgb), uv)], 2),
        )


def centres(voxels: Voxels) -> F64:
    """(N, 3) f64 of cells, in the cube of side 1 around the origin."""
    return (voxels.cells.cpu().double().numpy() + 0.5) / voxels.resolution - 0.5


def _likeliest(logits: Tensor) -> Voxels:
    """The few cells that are most likely occupied."""
    least = logits.flatten().topk(LEAST_CELLS).values[-1]
    return Voxels.of(logits >= least)
