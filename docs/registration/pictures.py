"""What a registration looks like: the photo with the outline found, and the object turned."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import solids
import truth

from objectmorpher_core.compose.light.lighting import object_texture
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import Placement
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.lift.registration.imported import lift_imported
from objectmorpher_core.lift.registration.placement import Registration
from objectmorpher_core.segment.matting.matte import build_matte

TURNS = (0.0, 20.0, 60.0, 120.0)  # degrees of yaw
MARGIN = 30  # px around the object
GREY = 0.5


def draw_sheet(path: Path, scene: truth.Scene, registration: Registration) -> None:
    """The photo, the outline on it, and the photo-textured object at TURNS."""
    best = registration.best
    alpha, _ = truth.draw(scene.solid, best.world_from_object, best.camera)
    outlined = scene.pixels.copy()
    contours, _ = cv2.findContours(
        (alpha > 0.5).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    cv2.drawContours(outlined, contours, -1, (255, 40, 200), 1)
    panels = [scene.pixels, outlined]
    matte = build_matte(scene.pixels, scene.mask, 24)
    lifted = lift_imported(solids.gaussians(scene.solid), best, matte)
    puppet, texture = Puppet(lifted, DeformSettings(), best.camera), object_texture(matte, lifted)
    for turn in TURNS:
        drawn = puppet.draw(None, Placement(turn=(turn, 0.0, 0.0)), texture, best.camera)
        shown = drawn.color + (1 - drawn.alpha[..., None]) * GREY
        panels.append(np.rint(255 * shown.clip(0, 1)).astype(np.uint8))
    rows, columns = np.flatnonzero(scene.mask.any(1)), np.flatnonzero(scene.mask.any(0))
    y0, y1 = max(rows[0] - MARGIN, 0), rows[-1] + MARGIN
    x0, x1 = max(columns[0] - MARGIN, 0), columns[-1] + MARGIN
    sheet = np.hstack([panel[y0:y1, x0:x1] for panel in panels])
    cv2.imwrite(str(path), sheet[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])
