"""A lifted object whose mask was refined: its cut-out and its shape follow, in place.

What the refinement does not concern stays as it is, so that nothing moves that the artist did not
touch: see `lift.refit` for the shape, and `compose.repair` for the background.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from .. import compose
from ..base.arrays import F32, Mask, Selection
from ..base.pixels import crop
from ..base.progress import Progress, part, silent
from ..compose.plate.plate import plate_cover
from ..compose.plate.repair import Uncovering, refitted_plate
from ..document.model import Document, LiftedObject, LiftSettings, Matte, Plate
from ..segment.mask_edit import as_coverage, is_selected
from ..segment.matting.matte import REACH, band_width, cut_out
from . import LiftSubject, load
from .refit import refitted_shape
from .registration.imported import rematted
from .registration.importing import ImportTarget
from .relief.spreading import BRIM

BLEND = 2.0  # x band: over so much the old cut-out goes over into the new one


@dataclass(frozen=True, eq=False)
class Lifted:
    """A lifted object, and the selection (H, W) that it is of."""

    selection: Selection
    matte: Matte
    lifted: LiftedObject
    shape: LiftSettings


@dataclass(frozen=True, eq=False)
class Background:
    """The background of a lifted object."""

    plate: Plate
    others: Mask  # (H, W) what other objects hide of it
    inpaint: str  # backend that fills in what is missing


@dataclass(frozen=True, eq=False)
class Refitted:
    """An object in the shape of its refined selection, and what is behind it then."""

    matte: Matte
    lifted: LiftedObject
    plate: Plate | None


def refit(
    was: Lifted,
    scene: ImportTarget,
    behind: Background | None,
    progress: Progress = silent,
    seed: int = 0,
) -> Refitted:
    """Refit an object when the selection of a lifted object is refined to `scene.mask`.

    Raises LiftError, InpaintError.
    """
    matte, lifted = refit_object(was, scene, part(progress, 0.0, 0.9), seed)
    if behind is None:
        return Refitted(matte, lifted, None)
    size = scene.mask.shape[::-1]
    before, after = (behind.others | _covered(one, size) for one in (was.matte, matte))
    change = Uncovering(scene.pixels, behind.plate, before, after)
    rest = part(progress, 0.9, 1.0)
    plate = refitted_plate(change, compose.load(behind.inpaint), rest, seed + 1)
    return Refitted(matte, lifted, plate)


def background_of(document: Document, k: int, inpaint: str) -> Background | None:
    """Return the background of object `k` and its copies; None before it is filled in."""
    if document.plate is None:
        return None
    matte = document.objects[k].matte
    others = tuple(o for o in document.objects if o.matte is not matte)
    return Background(document.plate, plate_cover(replace(document, objects=others)), inpaint)


def _covered(matte: Matte, size: tuple[int, ...]) -> Mask:
    """(H, W) what a cut-out hides of a photo of `size` (width, height)."""
    return crop(matte.alpha, matte.box, (0, 0, size[0], size[1])) > 0


def refit_object(
    was: Lifted, scene: ImportTarget, progress: Progress = silent, seed: int = 0
) -> tuple[Matte, LiftedObject]:
    """Cut-out and shape of `scene.mask`, a refined selection of what was lifted.

    An object that came out of a file, or was generated, keeps its shape. Raises LiftError.
    """
    progress(0.0, "Cutting out the object")
    changed = as_coverage(scene.mask) != as_coverage(was.selection)
    if not changed.any():
        return was.matte, was.lifted
    away = cv2.distanceTransform((~changed).astype(np.uint8), cv2.DIST_L2, 5)
    matte = _blended(was.matte, cut_out(scene.pixels, scene.mask, scene.mixed), away)
    camera, lifted = scene.camera, was.lifted
    if lifted.middle is None:
        shown = rematted(lifted, matte, camera, seed)
        return matte, replace(shown, backend=lifted.backend)
    lifter = load("relief")  # the only one that knows a middle sheet
    subject = LiftSubject(scene.pixels, camera, is_selected(scene.mask), matte)
    fresh = lifter.lift(subject, was.shape, part(progress, 0.3, 1.0), seed)
    spacing = lifted.spacing * lifted.scale * camera.focal / float(lifted.centre[2])
    reach = band_width(camera.width, camera.height) + BRIM * spacing
    return matte, refitted_shape(lifted, fresh, changed, reach)


def _blended(old: Matte, new: Matte, away: F32) -> Matte:
    """`new` near the change and `old` elsewhere; `away` (H, W) px of the photo from the change."""
    height, width = away.shape
    x0, y0, x1, y1 = new.box
    band = band_width(width, height)
    # Beyond the photo's frame it is as far from the change as at the frame.
    rows, columns = np.arange(y0, y1).clip(0, height - 1), np.arange(x0, x1).clip(0, width - 1)
    far = away[np.ix_(rows, columns)]
    share = np.clip((far - REACH * band) / (BLEND * band), 0, 1).astype(np.float32)
    share *= crop(np.ones(old.alpha.shape, np.float32), old.box, new.box)
    alpha = np.asarray(
        new.alpha + share * (crop(old.alpha, old.box, new.box) - new.alpha), np.float32
    )
    own = crop(old.foreground, old.box, new.box)
    foreground = new.foreground + share[..., None] * (own - new.foreground)
    return Matte(new.left, new.top, alpha, np.asarray(foreground, np.float32))
