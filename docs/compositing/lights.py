"""Harmonised turns against the true light: a solid turns, the lamp stays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import worlds
from turning import middle_of
from worlds import CAMERA, LIGHTS, Lamp

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.rotations import turn_matrix
from objectmorpher_core.compose.light.lighting import estimate_light, object_texture
from objectmorpher_core.compose.light.relight import relight
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import LiftSettings, Placement
from objectmorpher_core.document.settings import USUAL_SHARES, DeformSettings
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.raster import tiles

TURNS = {
    "yaw -35": (-35.0, 0.0), "yaw -20": (-20.0, 0.0), "yaw 20": (20.0, 0.0), "yaw 35": (35.0, 0.0),
    "pitch -25": (0.0, -25.0), "pitch 25": (0.0, 25.0),
}  # fmt: skip
PLATE = 0.45  # encoded grey, over which all is compared
FAINT = 0.02  # alpha, from which a pixel counts
SETTINGS = LiftSettings(uses_depth=False)


@dataclass(frozen=True, eq=False)
class Turned:
    """One case: root mean square errors against the true picture, encoded."""

    name: str
    lamp: str
    turn: str
    plain: float
    relit: float
    pictures: tuple[F64, F64, F64, F64]  # the photo, plain, relit, true

    @property
    def ratio(self) -> float:
        return self.relit / self.plain


def measured(name: str, meshes: Path) -> list[Turned]:
    """All turns of a solid under all lamps."""
    return [case for lamp in LIGHTS for case in _under(name, meshes, lamp)]


def _under(name: str, meshes: Path, lamp: Lamp) -> list[Turned]:
    stood = worlds.stand(name, meshes)
    view = worlds.draw(stood, lamp, np.eye(3))
    photo = _over(view.color, view.alpha)
    pixels = np.rint(photo * 255).astype(np.uint8)
    matte, lifted = lift_mask(pixels, CAMERA, view.alpha > 0.5, settings=SETTINGS)
    puppet, texture = Puppet(lifted, DeformSettings(), CAMERA), object_texture(matte, lifted)
    light = estimate_light(lifted, matte)
    cases = []
    for turn, (yaw, pitch) in TURNS.items():
        truth = worlds.draw(stood, lamp, turn_matrix(yaw, pitch, 0))
        true = _over(truth.color, truth.alpha)

        def drawn(shift: F64, is_relit: bool, angles=(yaw, pitch, 0.0)) -> tuple[F64, F64]:
            place = Placement(move=(float(shift[0]), float(shift[1])), turn=angles)
            splats = puppet.posed(None, place)
            picture = tiles.draw(tiles.prepare(splats, CAMERA, CAMERA), texture)
            colour = picture.color
            relit = relight(splats, light, USUAL_SHARES["relight"], CAMERA) if is_relit else None
            if relit is not None:
                colour = relit.lit(colour, picture.alpha, 0, 0)
            alpha = np.asarray(picture.alpha, np.float64)
            return np.asarray(colour, np.float64) + (1 - alpha[..., None]) * PLATE, alpha

        # From one photo nobody knows about which depth a thing turns: for both a shift is free.
        shift = middle_of(truth.alpha) - middle_of(drawn(np.zeros(2), False)[1])
        found = [drawn(shift, is_relit) for is_relit in (False, True)]
        counts = np.maximum(truth.alpha, found[0][1]) > FAINT
        errors = [float(np.sqrt(((own - true)[counts] ** 2).mean())) for own, _ in found]
        pictures = (photo, found[0][0], found[1][0], true)
        cases.append(Turned(name, lamp.name, turn, errors[0], errors[1], pictures))
    return cases


def _over(colour: F64, alpha: F64) -> F64:
    return colour * alpha[..., None] + PLATE * (1 - alpha[..., None])
