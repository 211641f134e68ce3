"""Plate and object back into the photo, touching nothing else (DESIGN section 5).

Everything is computed at the photo's own resolution on a crop around the edit, and blended into
the photo inside the footprint only. A pixel of the object that did not move is the photo's own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..arrays import F32, Mask, Pixels
from ..camera import Camera
from ..document import Document, EditObject, Matte
from ..pixels import crop, pixels_from_unit, unit_pixels
from ..progress import Progress, silent
from ..puppet import Puppet, puppet_of
from ..raster.posed import PosedSplats
from ..raster.reference import Picture3D
from ..raster.texture import TextureLevels, build_levels
from .plate import hole_margin, plate_crop

STILL = 0.05  # px: a surface that moved less is where it was
STILL_ALPHA = 1.5 / 255  # likewise for its alpha
NEAR = 7  # px, window in which a left pixel looks for the object's new edge
FEATHER_START = 0.6  # x hole margin: the edit is blended into the photo from here outwards


@dataclass(frozen=True, eq=False)
class Shares:
    """Where the changed pixels come from; the four sum to 1 (or are 0 where nothing changed)."""

    from_photo: float = 0.0
    from_lifter: float = 0.0
    from_inpainter: float = 0.0
    from_refiner: float = 0.0


@dataclass(frozen=True, eq=False)
class Composite:
    """The edited photo and how it came about."""

    pixels: Pixels  # (H, W, 3)
    footprint: Mask  # (H, W) True where the edit may have changed something
    changed: int  # px
    outside_footprint_changed: int  # px, 0 by construction; counted, not assumed
    shares: Shares
    layers: tuple[tuple[int, int, Picture3D], ...]  # x0, y0, each moved object's picture


def object_texture(matte: Matte) -> TextureLevels:
    """What the object's Gaussians carry: straight colour and alpha on the matte's crop."""
    return build_levels(matte.foreground, matte.alpha, matte.left, matte.top)


def composite(
    document: Document,
    puppets: dict[int, Puppet] | None = None,
    progress: Progress = silent,
) -> Composite:
    """The edited photo. `puppets` by object index save making them again."""
    photo = document.photo.pixels
    height, width = photo.shape[:2]
    moved = [k for k, item in enumerate(document.objects) if item.is_moved]
    if not moved:
        nothing = np.zeros((height, width), bool)
        return Composite(photo, nothing, 0, 0, Shares(), ())
    puppets = puppets or {}
    camera = document.photo.camera
    scenes = []
    for k in moved:
        item = document.objects[k]
        puppet = puppets.get(k) or puppet_of(item, camera)
        scenes.append((item, puppet.posed(item.pose, item.placement)))
    scenes.sort(key=lambda scene: -float(np.median(scene[1].means[:, 2])))  # far ones first
    box = _region([s for item, s in scenes if item.is_visible], moved, document)
    blend = _Blend(document, box)
    for n, (item, splats) in enumerate(scenes):
        progress(n / len(scenes), "Drawing the object")
        blend.add(item, splats, camera)
    progress(0.9, "Blending into the photo")
    return blend.finish()


def _region(
    drawn: list[PosedSplats], moved: list[int], document: Document
) -> tuple[int, int, int, int]:
    """x0, y0, x1, y1 px: everything the edit can touch."""
    camera = document.photo.camera
    margin = int(np.ceil(hole_margin(camera.width, camera.height))) + 2
    corners = []
    for k in moved:
        matte = document.objects[k].matte
        assert matte is not None, "a lifted object has a matte"
        x0, y0, x1, y1 = matte.box
        corners += [(x0, y0), (x1, y1)]
    for splats in drawn:
        seen = splats.means[splats.means[:, 2] > splats.gap]
        if len(seen):
            xy = camera.project(seen)
            reach = splats.gap * camera.focal / float(np.median(seen[:, 2]))
            corners += [tuple(xy.min(0) - reach), tuple(xy.max(0) + reach)]
    low, high = np.min(corners, axis=0) - margin, np.max(corners, axis=0) + margin
    size = np.array([camera.width, camera.height])
    low, high = np.clip(np.floor(low), 0, size - 1), np.clip(np.ceil(high), 1, size)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


class _Blend:
    """The crop on which the edit is put together."""

    def __init__(self, document: Document, box: tuple[int, int, int, int]) -> None:
        self.document, self.box = document, box
        x0, y0, x1, y1 = box
        photo = document.photo.pixels
        self.photo = unit_pixels(photo[y0:y1, x0:x1])
        self.invented = np.zeros((y1 - y0, x1 - x0), np.float32)
        self.colour = self.photo.copy()
        if document.plate is not None:
            self.invented = crop(document.plate.hole, document.plate.box, box).astype(np.float32)
            self.colour = unit_pixels(plate_crop(photo, document.plate, box))
        self.from_photo = 1 - self.invented
        self.from_lifter = np.zeros_like(self.invented)
        self.moved = np.zeros(self.invented.shape, np.float32)  # px, see `displacement`
        self.covered = np.zeros(self.invented.shape, bool)
        self.layers: list[tuple[int, int, Picture3D]] = []

    def add(self, item: EditObject, splats: PosedSplats, camera: Camera) -> None:
        """Draws one moved object over what is there."""
        assert item.matte is not None
        x0, y0, x1, y1 = self.box
        rest = crop(item.matte.alpha, item.matte.box, self.box)
        self.covered |= rest > 0
        if not item.is_visible:
            self.moved[rest > 0] = np.inf
            return
        texture = object_texture(item.matte)
        window = camera.windowed(x0, y0, x1 - x0, y1 - y0)
        picture = _drawn(splats, texture, window, camera)
        self.moved = np.maximum(self.moved, displacement(picture, rest))
        self.covered |= picture.alpha > 0
        through = 1 - picture.alpha
        self.colour = picture.color + through[..., None] * self.colour
        self.from_photo = picture.from_photo + through * self.from_photo
        self.from_lifter = picture.alpha - picture.from_photo + through * self.from_lifter
        self.invented = through * self.invented
        self.layers.append((x0, y0, picture))

    def finish(self) -> Composite:
        """Blends the crop into the photo around what was disturbed."""
        photo = self.document.photo.pixels
        height, width = photo.shape[:2]
        x0, y0, x1, y1 = self.box
        margin = hole_margin(width, height)
        blend = _blend_weights(self.moved, margin)
        mixed = self.photo + blend[..., None] * (self.colour - self.photo)
        crop = photo[y0:y1, x0:x1]
        # Where the blend is nothing, or changes nothing, the photo's own integers stay.
        new = np.where((blend > 0)[..., None], pixels_from_unit(mixed, photo.dtype), crop)
        pixels = photo.copy()
        pixels[y0:y1, x0:x1] = new
        changed = (new != crop).any(-1)
        footprint = np.zeros((height, width), bool)
        reach = cv2.distanceTransform((~self.covered).astype(np.uint8), cv2.DIST_L2, 5)
        footprint[y0:y1, x0:x1] = reach <= margin + 1
        outside = int(((pixels != photo).any(-1) & ~footprint).sum())
        shares = self._shares(changed, blend)
        return Composite(pixels, footprint, int(changed.sum()), outside, shares, tuple(self.layers))

    def _shares(self, changed: Mask, blend: F32) -> Shares:
        count = int(changed.sum())
        if count == 0:
            return Shares()
        f = blend[changed]
        photo = float((1 - f + f * self.from_photo[changed]).sum())
        lifter = float((f * self.from_lifter[changed]).sum())
        inpainter = float((f * self.invented[changed]).sum())
        total = photo + lifter + inpainter
        return Shares(photo / total, lifter / total, inpainter / total, 0.0)


def displacement(picture: Picture3D, rest_alpha: F32) -> F32:
    """(h, w) px by which what stands at a pixel is not where it was; 0 where nothing changed.

    A pixel that the object has left counts as far as its neighbours moved, or as infinitely far
    where none of the object is left near it.
    """
    stands = picture.alpha > 0
    shift = np.where(stands, np.sqrt((picture.shift**2).sum(-1)), 0).astype(np.float32)
    near = cv2.dilate(shift, np.ones((NEAR, NEAR), np.uint8))
    shift = np.where(stands, shift, np.where(near > 0, near, np.inf))
    is_invented = picture.from_photo < picture.alpha - STILL_ALPHA
    is_other = np.abs(picture.alpha - rest_alpha) > STILL_ALPHA
    shift[is_invented] = np.inf
    shift[is_other] = np.maximum(shift[is_other], STILL)
    is_still = (shift < STILL) | (~stands & ~is_other)
    return np.where(is_still, 0, shift).astype(np.float32)


def _blend_weights(moved: F32, margin: float) -> F32:
    """(h, w) in [0, 1]: how much of the edit to show.

    1 where something moved, and falling to 0 around it over a distance that grows with the
    move: the plate's invented ring is not shown around what has hardly moved.
    """
    blend = np.zeros(moved.shape, np.float32)
    for least, reach in ((STILL, 1.5), (0.5, 3.0), (2.0, 6.0), (6.0, margin)):
        there = moved >= least
        if there.any():
            distance = cv2.distanceTransform((~there).astype(np.uint8), cv2.DIST_L2, 5)
            reach = min(reach, margin)
            ramp = (reach - distance) / ((1 - FEATHER_START) * reach)
            blend = np.maximum(blend, np.clip(ramp, 0, 1))
    return blend


def straight_cutout(result: Composite, dtype: np.dtype, size: tuple[int, int]) -> np.ndarray:
    """The moved objects alone, (H, W, 4) straight alpha, on nothing; `size` is (width, height)."""
    width, height = size
    colour = np.zeros((height, width, 3), np.float32)
    alpha = np.zeros((height, width), np.float32)
    for x0, y0, picture in result.layers:
        h, w = picture.alpha.shape
        window = (slice(y0, y0 + h), slice(x0, x0 + w))
        through = 1 - picture.alpha
        colour[window] = picture.color + through[..., None] * colour[window]
        alpha[window] = picture.alpha + through * alpha[window]
    straight = colour / np.maximum(alpha, 1e-6)[..., None]
    straight[alpha <= 0] = 0
    return pixels_from_unit(np.dstack([straight, alpha]), dtype)


def _drawn(
    splats: PosedSplats, texture: TextureLevels, window: Camera, camera: Camera
) -> Picture3D:
    from ..raster import tiles

    picture = tiles.render(splats, texture, window, camera)
    return replace(picture, alpha=np.minimum(picture.alpha, 1.0))
