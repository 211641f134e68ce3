"""Shadow, light, grain and focus of a moved object, from the document alone.

So they are the same for window and export.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ...base.arrays import F32, F64, crop
from ...base.camera import Camera
from ...document.bounds import NORMAL
from ...document.model import Document, EditObject, LiftedObject, Matte
from ...document.placement import down_at
from ...document.settings import AS_IN_THE_PHOTO, Shadow
from ...document.transparency import continued, is_seen
from ...raster.posed import PosedSplats
from ...raster.texture import TextureLevels, TextureSource
from ..blend import Box
from ..plate.plate import cut, overlap, plate_cover
from ..shadow.fall import Caster
from ..shadow.shadow import COARSE, FINE, USUAL_GROUND, Shade, StandingObject
from ..silhouette import SKETCHED, sketch, sketched
from .defocus import PhotoDefocus, StandingPlane, find_defocus
from .grain import Grain, find_grain, sketch_grain
from .harmonize import (
    LUMA,
    NEUTRAL,
    Gain,
    at_strength,
    light_around,
    light_gain,
    light_map,
    visitor_gain,
)
from .noise import Noise, find_noise
from .relight import Relit, relight

MARGIN = 16  # px around the cut-out that have its colours, not those of invented pictures
BESIDE = 0.01  # x the longer side of a depth map: from how far around it is filled in
CAST = 40_000  # Gaussians, of which a shadow is made


@dataclass(frozen=True, eq=False)
class Lit:
    """The changes to an object's colours, in this order, and its shadow."""

    gain: Gain = NEUTRAL
    shade: Shade | None = None
    relit: Relit | None = None
    grain: Grain | None = None
    blur: float = 0.0  # px of the photo, standard deviation; before all the others
    sharpness: float = 0.0  # x its fine detail; after the blur
    saturation: float = 1.0  # x as far from grey; after all the others
    opacity: float = 1.0  # of the whole
    mode: str = NORMAL  # of MODES
    is_shaded: bool = False  # by another object: `relit` says where


NOTHING = Lit()


def object_texture(matte: Matte, lifted: LiftedObject | None) -> TextureLevels:
    """Return the texture of the object's Gaussians: straight colour and alpha on its crop.

    Beside it lie the invented pictures of what was `lifted`, if there are any; over both, paint.
    """
    return texture_source(matte, lifted).levels()


def texture_source(matte: Matte, lifted: LiftedObject | None) -> TextureSource:
    """What `object_texture` is made of."""
    sides = None if lifted is None else lifted.sides
    if sides is None or not sides.pixels.size:
        box = matte.box

        def own(first: int, last: int) -> tuple[F32, F32]:
            colours, top = matte.foreground[first:last], box[1] + first
            return _painted(colours, matte, box[0], top), matte.alpha[first:last]

        return TextureSource(own, (box[3] - box[1], box[2] - box[0]), *box[:2])
    height, width = sides.pixels.shape[:2]
    other = sides.left, sides.top, sides.left + width, sides.top + height
    left, top = min(matte.left, sides.left), min(matte.top, sides.top)
    right, bottom = max(matte.box[2], other[2]), max(matte.box[3], other[3])
    picture = np.asarray(sides.pixels / np.float32(255), np.float32)
    # All around them their colours go on: no look-up ever meets what is not the object.
    near = min(MARGIN, max(sides.top - matte.box[3], 0))

    def rows(first: int, last: int) -> tuple[F32, F32]:
        box = left, top + first, right, top + last
        colours = _continued(picture, other, box)
        x0, y0, x1, y1 = matte.box
        around = overlap((x0 - near, y0 - near, x1 + near, y1 + near), box)
        if around is not None:
            cut(colours, box, around)[:] = _continued(matte.foreground, matte.box, around)
        return _painted(colours, matte, *box[:2]), crop(matte.alpha, matte.box, box)

    return TextureSource(rows, (bottom - top, right - left), left, top)


def _painted(colours: F32, matte: Matte, left: int, top: int) -> F32:
    """Colours (h, w, 3) whose corner is at these px, under the paint of a matte."""
    return colours if matte.paint is None else matte.paint.over(colours, left, top)


def _continued(picture: F32, own: Box, box: Box) -> F32:
    """The part `box` of a picture (h, w, 3) that covers the box `own`, and goes on beyond it."""
    height, width = picture.shape[:2]
    rows = np.arange(box[1] - own[1], box[3] - own[1]).clip(0, height - 1)
    before, after = max(own[0] - box[0], 0), max(box[2] - own[2], 0)
    part = picture[rows[0] : rows[-1] + 1, max(box[0] - own[0], 0) : min(box[2] - own[0], width)]
    above = int(np.count_nonzero(rows == rows[0])) - 1
    below = len(rows) - above - len(part)
    bordered = cv2.copyMakeBorder(part, above, below, before, after, cv2.BORDER_REPLICATE)
    return np.asarray(bordered, np.float32)


class Lighting:
    """Lighting of one photo with its plate; what several objects share is computed once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._lights: dict[int, tuple[LiftedObject, F64]] = {}  # by the id of what was lifted

    @cached_property
    def light(self) -> F32:
        """The background's light, see `harmonize.light_map`."""
        return light_map(self._document)

    @cached_property
    def noise(self) -> Noise | None:
        """The photo's grain, where it is not clear."""
        picture = self._document.photo.picture
        if picture.alpha is None:
            return find_noise(picture.pixels)
        # What touches black, which has no noise, is not asked.
        return find_noise(np.where(is_seen(picture.alpha)[..., None], picture.pixels, 0))

    @cached_property
    def focus(self) -> PhotoDefocus:
        """Return the blur of the photo, where it is not clear."""
        picture, covered = self._document.photo.picture, plate_cover(self._document)
        if picture.alpha is None:
            return PhotoDefocus(picture.pixels, covered)
        seen = is_seen(picture.alpha)
        return PhotoDefocus(continued(picture, np.zeros_like(seen)), covered | ~seen)

    @cached_property
    def _depth(self) -> F32 | None:
        """The document's depth map, as if nothing stood where objects can be taken away."""
        if (depth := self._document.depth) is None:
            return None
        taken = np.zeros(depth.shape, np.uint8)
        for item in self._document.objects:
            if item.lifted is not None and item.mask is not None:
                own = item.mask.astype(np.float32)
                there = cv2.resize(own, depth.shape[::-1], interpolation=cv2.INTER_AREA) > 0
                taken[cv2.dilate(there.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0] = 1
        low, span = float(depth.min()), max(float(np.ptp(depth)), 1e-9)
        unit = np.asarray((depth - low) / span, np.float32)
        reach = BESIDE * max(depth.shape)
        filled = cv2.inpaint(unit, taken, reach, cv2.INPAINT_NS)
        return np.asarray(filled * span + low, np.float32)

    def of(
        self,
        item: EditObject,
        splats: PosedSplats,
        rest: Callable[[], PosedSplats],
        horizon: float | None,
        texture: TextureLevels | None = None,
        is_sketch: bool = False,
        casters: Sequence[tuple[int, Caster]] = (),
        number: int = -1,
    ) -> Lit:
        """Return the lighting of an object with Gaussians `splats` now and `rest` before.

        `horizon`: the photo's, px, where it is known. `is_sketch`: the shadow is a coarse one, in
        the time that a frame of a drag has. `casters`: of the document, with the number of the
        object that throws it; this one has that `number`. What has not moved only takes their
        shadows.
        """
        others = [caster for k, caster in casters if k != number]
        if others and not is_sketch:  # a frame's are near already
            few = splats.means[sketched(splats)]
            others = [caster for caster in others if caster.reaches(few)]
        if not item.is_moved:
            fallen = relight(splats, ABOVE, 0.0, self._document.photo.camera, is_sketch, others)
            return NOTHING if fallen is None else Lit(relit=fallen, is_shaded=True)
        has_shadow, has_light = item.shadow.strength > 0, item.harmony > 0
        has_any = has_shadow or has_light or item.relight or item.grain or item.defocus or others
        if not item.is_visible or not (has_any or item.finish != AS_IN_THE_PHOTO):
            return NOTHING
        assert item.matte is not None, "a lifted object has a matte"
        camera = self._document.photo.camera
        shade, gain, relit, grain, blur = None, NEUTRAL, None, None, 0.0
        if item.defocus > 0:
            blur = item.defocus * self._defocus(item, splats, rest(), horizon)
        if has_shadow:
            shade = next((caster.shade for k, caster in casters if k == number), None)
        if has_light:
            gain = at_strength(self._gain(item, splats, rest), item.harmony)
        if item.relight > 0 or others:
            light = self._light_of(item) if item.relight > 0 else ABOVE
            relit = relight(splats, light, item.relight, camera, is_sketch, others)
        if item.grain > 0 and self.noise is not None:
            if is_sketch:
                grain = sketch_grain(splats, self.noise, item.grain, camera, blur)
            else:
                carried = texture or object_texture(item.matte, item.lifted)
                grain = find_grain(splats, carried, self.noise, item.grain, camera, blur)
        r, g, b = (a * own for a, own in zip(gain, item.finish.gain, strict=True))
        own = item.finish
        return Lit(
            (r, g, b), shade, relit, grain, math.hypot(blur, own.blur), own.sharpness,
            own.saturation, own.opacity, own.blend_mode, relit is not None and bool(others),
        )  # fmt: skip

    def caster(
        self, item: EditObject, splats: PosedSplats, horizon: float | None, is_sketch: bool = False
    ) -> Caster | None:
        """Return the shadow that a moved object throws; None where it throws none.

        What is half transparent takes half of the light.
        """
        strength = item.shadow.strength * item.finish.opacity
        if not item.is_moved or not item.is_visible or strength <= 0:
            return None
        shadow = replace(item.shadow, strength=strength)
        camera = self._document.photo.camera
        most, cells = (SKETCHED, COARSE) if is_sketch else (CAST, FINE)
        standing = stand(splats, camera, horizon, item.grounded_shadow, most)
        if standing is None:
            return None
        return Caster(shadow, standing, horizon, cells, self._depth)

    def _gain(self, item: EditObject, splats: PosedSplats, rest: Callable[[], PosedSplats]) -> Gain:
        """The factors of an object's colours in the light of where it is now."""
        camera, width = self._document.photo.camera, self._document.photo.camera.width
        now = sketch(splats, camera)
        if now is None:
            return NEUTRAL
        origin = None if item.lifted is None else item.lifted.origin
        if origin is not None:
            return visitor_gain(origin.light, light_around(self.light, width, now))
        before = sketch(rest(), camera)
        return NEUTRAL if before is None else light_gain(self.light, width, before, now)

    def around(self, splats: PosedSplats) -> tuple[float, float, float] | None:
        """Linear RGB of the background around an object; None where too little of it is seen."""
        now = sketch(splats, self._document.photo.camera)
        return None if now is None else light_around(self.light, self._document.photo.size[0], now)

    def _defocus(
        self, item: EditObject, splats: PosedSplats, rest: PosedSplats, horizon: float | None
    ) -> float:
        """Px by which the object is too sharp for where it is now; 0 of one of another photo.

        Where that one stood, and how blurred it was there, only its own photo shows.
        """
        if item.is_visitor:
            return 0.0
        assert item.lifted is not None and item.matte is not None
        camera, shadow = self._document.photo.camera, item.grounded_shadow
        normal = _normal_under(item.lifted, camera, horizon, shadow)
        ground = StandingPlane(normal, horizon is not None or shadow.ground is not None)
        return find_defocus(splats, rest, item.matte, ground, self.focus, camera)

    def _light_of(self, item: EditObject) -> F64:
        """b (3,), see `light_estimate`; estimated once."""
        lifted, matte = item.lifted, item.matte
        assert lifted is not None and matte is not None
        kept = self._lights.get(id(lifted))
        if kept is None:
            kept = self._lights[id(lifted)] = (lifted, estimate_light(lifted, matte))
        return kept[1]


def stand(
    splats: PosedSplats,
    camera: Camera,
    horizon: float | None = None,
    shadow: Shadow | None = None,
    most: int = SKETCHED,
) -> StandingObject | None:
    """Return the stance of an object with the Gaussians `splats`; None where none of them is solid.

    The ground is as `shadow` and `horizon` say; of about `most` of the Gaussians.
    """
    few = sketched(splats, most)
    if not len(few):
        return None
    normal = _normal_under(splats.rest.lifted, camera, horizon, shadow or Shadow())
    return StandingObject(splats.means[few], normal, camera)


def ground_seen_from(
    lifted: LiftedObject, camera: Camera, horizon: float | None, shadow: Shadow
) -> float:
    """Return the angle, degrees above the ground, at which the camera sees an object on it."""
    centre = lifted.centre
    normal = _normal_under(lifted, camera, horizon, shadow)
    sine = float(normal @ centre / np.linalg.norm(centre))
    return float(np.degrees(np.arcsin(np.clip(sine, 0, 1))))


def _normal_under(
    lifted: LiftedObject, camera: Camera, horizon: float | None, shadow: Shadow
) -> F64:
    """(3,) of the ground where the object was at rest: it stays where it is."""
    down = down_at(lifted, camera, horizon, shadow.ground)
    if down is None:
        down = down_at(lifted, camera, None, USUAL_GROUND)
    assert down is not None, "one looks down on it by some degrees"
    return down


# Where the light on an object comes from, found in the photo without any weights.

CELLS = 22  # along the longer side of an object: what the light is estimated from
LOOKED = 8  # px of the photo for each of them are enough
FULL = 0.4  # of a cell, from which it is asked
LEAST_CELLS = 12
DARK = 0.02  # encoded luminance: below it nothing is known
PATCH = 0.3  # x the object's longer side, over which its colours are alike
GRAIN = 0.4  # share of their variance that is a cell's own
COLOURS = 0.3  # standard deviation of them that is expected, logarithm
BELIEF = 40.0  # cells that it would take to change that expectation's mind by half
ABOVE = np.array([0.0, -0.1, -0.05])  # b before anything is seen: from above and from the viewer
SPREAD = 0.13  # standard deviation of that, each coordinate
ROUNDS = 3


def estimate_light(lifted: LiftedObject, matte: Matte) -> F64:
    """b (3,) world, how the logarithm of an object's encoded colours follows its normals.

    Of an object of which too little is seen it is what is expected of any.
    """
    found = _cells(lifted, matte)
    if found is None:
        return ABOVE
    places, normals, brightness = found
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    alike = (1 - GRAIN) * np.exp(-apart / PATCH) + GRAIN * np.eye(len(places))
    factor = cho_factor(alike + 1e4)  # its mean is not known at all
    by_normals, by_one = cho_solve(factor, normals), cho_solve(factor, brightness)
    precision, seen = normals.T @ by_normals, normals.T @ by_one
    variance, light = COLOURS**2, ABOVE
    for _ in range(ROUNDS):
        light = np.linalg.solve(
            precision / variance + np.eye(3) / SPREAD**2, seen / variance + ABOVE / SPREAD**2
        )
        rest = brightness - normals @ light
        own = float(rest @ cho_solve(factor, rest))
        variance = (own + BELIEF * COLOURS**2) / (len(places) + BELIEF)
    return np.asarray(light, np.float64)


def _cells(lifted: LiftedObject, matte: Matte) -> tuple[F64, F64, F64] | None:
    """Places (n, 2) in object sizes, normals (n, 3) world, log brightness (n,) of what is seen."""
    height, width = matte.alpha.shape
    pitch = max(height, width) / CELLS
    shape = (max(round(height / pitch), 1), max(round(width / pitch), 1))
    brightness, inside = _brightness(matte, shape)
    texture = lifted.texture
    turn = lifted.world_from_object[:3, :3] / lifted.scale
    seen = (texture.visibility > 0.5) & (texture.solidity > 0.5)
    at = (texture.u0[seen] - (matte.left, matte.top)) / (width, height) * shape[::-1]
    column, row = at.astype(np.int64).T
    is_there = (at >= 0).all(1) & (column < shape[1]) & (row < shape[0])
    normals = (lifted.gaussians.normals[seen] @ turn.T)[is_there]
    index = row[is_there] * shape[1] + column[is_there]
    size = shape[0] * shape[1]
    count = np.bincount(index, minlength=size)
    sums = [np.bincount(index, normals[:, a], size) for a in range(3)]
    mean = np.stack(sums, 1) / np.maximum(count, 1)[:, None]
    use = np.flatnonzero((count > 0) & (inside.ravel() > FULL))
    if len(use) < LEAST_CELLS:
        return None
    places = np.column_stack([use % shape[1], use // shape[1]]) / max(shape)
    return places, mean[use], brightness.ravel()[use].astype(np.float64)


def _brightness(matte: Matte, shape: tuple[int, int]) -> tuple[F32, F32]:
    """(h, w) mean logarithm of the luminance in each cell, and the share of it that is opaque."""
    step = max(min(matte.alpha.shape[0] // shape[0], matte.alpha.shape[1] // shape[1]) // LOOKED, 1)
    luminance = matte.foreground[::step, ::step] @ LUMA
    solid = (matte.alpha[::step, ::step] > 0.95).astype(np.float32)
    logarithm = np.log(np.maximum(luminance, DARK)) * solid
    share = cv2.resize(solid, shape[::-1], interpolation=cv2.INTER_AREA)
    summed = cv2.resize(logarithm, shape[::-1], interpolation=cv2.INTER_AREA)
    return np.asarray(summed / np.maximum(share, 1e-6), np.float32), np.asarray(share, np.float32)
