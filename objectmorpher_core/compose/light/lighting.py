"""Shadow, light, grain and focus of a moved object, from the document alone.

So they are the same for window and export.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.arrays import F32, F64
from ...base.camera import Camera
from ...document.joining import Shadow
from ...document.model import Document, EditObject, LiftedObject, Matte
from ...raster.posed import PosedSplats
from ...raster.texture import TextureLevels, build_levels
from ..plate.plate import plate_cover
from ..shadow.shadow import COARSE, FINE, Shade, Standing, cast, ground_normal
from ..silhouette import SKETCHED, sketch, sketched
from .defocus import Focus, Ground, find_defocus
from .grain import Grain, find_grain, sketch_grain
from .harmonize import NEUTRAL, Gain, at_strength, light_gain, light_map
from .light_estimate import estimate_light
from .noise import Noise, find_noise
from .relight import Relit, relight

CAST = 40_000  # Gaussians, of which a shadow is made


@dataclass(frozen=True, eq=False)
class Lit:
    """What is done to an object's colours, in this order, and the shadow that it throws."""

    gain: Gain = NEUTRAL
    shade: Shade | None = None
    relit: Relit | None = None
    grain: Grain | None = None
    blur: float = 0.0  # px of the photo, standard deviation; before all the others


NOTHING = Lit()


def object_texture(matte: Matte) -> TextureLevels:
    """What the object's Gaussians carry: straight colour and alpha on the matte's crop."""
    return build_levels(matte.foreground, matte.alpha, matte.left, matte.top)


class Lighting:
    """Of one photo with its plate; what several objects share is computed once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._lights: dict[int, tuple[LiftedObject, F64]] = {}  # by the id of what was lifted

    @cached_property
    def light(self) -> F32:
        """The background's light, see `harmonize.light_map`."""
        return light_map(self._document)

    @cached_property
    def noise(self) -> Noise | None:
        """The photo's grain."""
        return find_noise(self._document.photo.pixels)

    @cached_property
    def focus(self) -> Focus:
        """How blurred the photo is."""
        return Focus(self._document.photo.pixels, plate_cover(self._document))

    def of(
        self,
        item: EditObject,
        splats: PosedSplats,
        rest: Callable[[], PosedSplats],
        horizon: float | None,
        texture: TextureLevels | None = None,
        is_sketch: bool = False,
    ) -> Lit:
        """Of a moved object whose Gaussians are `splats` now and were at `rest`.

        `horizon`: the photo's, px, where it is known. `is_sketch`: the shadow is a coarse one, in
        the time that a frame of a drag has.
        """
        has_shadow, has_light = item.shadow.strength > 0, item.harmony > 0
        has_any = has_shadow or has_light or item.relight or item.grain or item.defocus
        if not item.is_visible or not has_any:
            return NOTHING
        assert item.matte is not None, "a lifted object has a matte"
        camera = self._document.photo.camera
        shade, gain, relit, grain, blur = None, NEUTRAL, None, None, 0.0
        if item.defocus > 0:
            blur = item.defocus * self._defocus(item, splats, rest(), horizon)
        if has_shadow:
            most, cells = (SKETCHED, COARSE) if is_sketch else (CAST, FINE)
            standing = stand(splats, camera, horizon, item.shadow, most)
            shade = None if standing is None else cast(item.shadow, standing, cells)
        if has_light:
            before, now = sketch(rest(), camera), sketch(splats, camera)
            if before is not None and now is not None:
                gain = at_strength(light_gain(self.light, camera.width, before, now), item.harmony)
        if item.relight > 0:
            relit = relight(splats, self._light_of(item), item.relight, camera, is_sketch)
        if item.grain > 0 and self.noise is not None:
            if is_sketch:
                grain = sketch_grain(splats, self.noise, item.grain, camera, blur)
            else:
                carried = texture or object_texture(item.matte)
                grain = find_grain(splats, carried, self.noise, item.grain, camera, blur)
        return Lit(gain, shade, relit, grain, blur)

    def _defocus(
        self, item: EditObject, splats: PosedSplats, rest: PosedSplats, horizon: float | None
    ) -> float:
        """Px by which the object is too sharp for where it is now."""
        assert item.lifted is not None and item.matte is not None
        camera, shadow = self._document.photo.camera, item.shadow
        normal = _normal_under(item.lifted, camera, horizon, shadow)
        ground = Ground(normal, horizon is not None or shadow.ground is not None)
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
) -> Standing | None:
    """How an object whose Gaussians are `splats` stands; None where none of it is solid.

    The ground is as `shadow` and `horizon` say; of about `most` of the Gaussians.
    """
    few = sketched(splats, most)
    if not len(few):
        return None
    normal = _normal_under(splats.rest.lifted, camera, horizon, shadow or Shadow())
    return Standing(splats.means[few], normal, camera)


def ground_seen_from(
    lifted: LiftedObject, camera: Camera, horizon: float | None, shadow: Shadow
) -> float:
    """From how many degrees above the ground the camera looks at an object on it."""
    centre = lifted.centre
    normal = _normal_under(lifted, camera, horizon, shadow)
    sine = float(normal @ centre / np.linalg.norm(centre))
    return float(np.degrees(np.arcsin(np.clip(sine, 0, 1))))


def _normal_under(
    lifted: LiftedObject, camera: Camera, horizon: float | None, shadow: Shadow
) -> F64:
    """(3,) of the ground where the object was at rest: it stays where it is."""
    row = float(camera.project(lifted.centre)[1])
    return ground_normal(camera, horizon, shadow, row)
