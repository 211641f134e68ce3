"""How turned solids look, beside how near they are: outline, pieces, newly shown sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from outlines import Outline, outline_of
from smear import Smear, smear_of
from turning import CAMERA, EDITS, SEEN, Scene, Score, Shot, middle_of, score

from objectmorpher_core.compose.composite import object_texture
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import Placement
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.raster.reference import Picture3D

SHOWN = tuple(key for key in EDITS if key.startswith(("yaw", "pitch")))


@dataclass(frozen=True)
class Look:
    """One turned picture beside the true one."""

    score: Score
    drawn: Outline
    true: Outline
    smear: Smear

    @property
    def wobble(self) -> float:
        """Total absolute curvature of the outline, over the true one's."""
        return self.drawn.curvature / self.true.curvature

    def __str__(self) -> str:
        pieces, holes = self.drawn.pieces - self.true.pieces, self.drawn.holes - self.true.holes
        return (
            f"iou {self.score.iou:.3f} psnr {self.score.psnr:.2f} wobble {self.wobble:.2f} "
            f"pieces {pieces:+d} holes {holes:+d} new {self.smear.area:.3f} "
            f"streaks {self.smear.streaks:.3f} flat {self.smear.flat:.3f}"
        )


def looks(scene: Scene) -> dict[str, Look]:
    """Of the product's own lift, by the name of the turn."""
    matte, lifted = lift_mask(scene.pixels, CAMERA, scene.mask, settings=SEEN)
    puppet, texture = Puppet(lifted, DeformSettings(), CAMERA), object_texture(matte, lifted)

    def drawn(place: Placement) -> Picture3D:
        return puppet.draw(None, place, texture, CAMERA)

    rest, found = drawn(Placement()), {}
    for key in SHOWN:
        edit, truth = EDITS[key], scene.edited[key]
        turn = (edit.yaw, edit.pitch, 0.0)
        first = np.asarray(drawn(Placement(turn=turn)).alpha, np.float64)
        shift = middle_of(truth.alpha) - middle_of(first)
        picture = drawn(Placement(turn=turn, move=(float(shift[0]), float(shift[1]))))
        alpha = np.asarray(picture.alpha, np.float64)
        shot = Shot(np.asarray(picture.color) / np.maximum(alpha, 1e-6)[..., None], alpha)
        found[key] = Look(
            score(shot, truth), outline_of(alpha), outline_of(truth.alpha), smear_of(picture, rest)
        )
    return found
