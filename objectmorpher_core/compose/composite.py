"""Plate and object back into the photo, touching nothing else.

Everything is computed at the photo's own resolution on a crop around the edit, and blended into
the photo inside the footprint only. A pixel of the object that did not move is the photo's own.
The crop is worked off in strips of rows, whatever the size of the photo.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np

from ..base.arrays import F32, Mask, Pixels, crop, pixels_from_unit, unit_pixels
from ..base.camera import Camera
from ..base.masks import LARGE
from ..base.progress import Progress, silent
from ..deform.puppet import Puppet, puppet_of
from ..document.bounds import MULTIPLY, NORMAL, SCREEN
from ..document.model import Document, EditObject, LiftedObject, Matte, Placement, Plate
from ..document.settings import AS_IN_THE_PHOTO, Refined
from ..document.transparency import alpha_behind
from ..pictures.image import Picture
from ..raster import tiles
from ..raster.binning import TILE
from ..raster.posed import PosedSplats
from ..raster.reference import Picture3D
from ..raster.texture import TextureLevels, TextureRows
from .blend import FEATHER_START as FEATHER_START
from .blend import (
    NEAR,
    STILL_ALPHA,
    Blend,
    Box,
    Rows,
    differ,
    displacement,
    map_in_threads,
    with_touched,
)
from .blend import STILL as STILL
from .light.defocus import DETAIL, blurred, reach_of, sharpened
from .light.harmonize import lit, saturated
from .light.lighting import NOTHING, Lighting, Lit, texture_source
from .light.lighting import object_texture as object_texture
from .order import holes, leaves_a_hole, stack
from .paint import PaintedShare
from .plate.plate import hole_margin, overlap, plate_crop, plate_of_holes
from .shadow.shadow import Shade

STRIP = 1_500_000  # px of the crop that are drawn at a time; about 100 bytes each
OPAQUE = 1 - STILL_ALPHA
ELSEWHERE = 1e6  # px by which an object of another photo has moved, wherever it is
NOWHERE: Box = (0, 0, 0, 0)
PIECE = 2 * TILE  # rows that a thread works on: what it computes stays in the processor's cache


@dataclass(frozen=True, eq=False)
class Shares:
    """Origins of the changed pixels; the five sum to 1 (or are 0 where nothing changed)."""

    from_photo: float = 0.0
    from_lifter: float = 0.0
    from_inpainter: float = 0.0
    from_refiner: float = 0.0
    from_paint: float = 0.0  # by hand, on an object


@dataclass(frozen=True, eq=False)
class Moved:
    """An object of the edit, and where its Gaussians are now."""

    item: EditObject
    splats: PosedSplats | None  # None: it stays where it is, and was never lifted
    has_hole: bool = True  # nothing stands where it was
    look: Lit = NOTHING  # the light on it, and the shadow that it throws

    @property
    def matte(self) -> Matte:
        """Return the object's old place and look."""
        assert self.item.matte is not None, "what is drawn has a matte"
        return self.item.matte


@dataclass(frozen=True, eq=False)
class Composite:
    """The edited photo and how it came about."""

    pixels: Pixels  # (H, W, 3)
    footprint: Mask  # (H, W) True where the edit may have changed something
    changed: int  # px
    outside_footprint_changed: int  # px, 0 by construction; counted, not assumed
    shares: Shares
    camera: Camera  # the photo's
    stack: tuple[Moved, ...]  # back to front: what was drawn, also what rests near what moved
    box: Box | None = None  # of the photo, outside which nothing was looked at; None: all of it
    weights: F32 | None = None  # (h, w) of the box, how much of the edit is shown; if asked for
    shadow: int = 0  # px of `changed` that no object reaches: shadows and repairs
    alpha: np.ndarray | None = None  # (H, W) of the pixels, straight; None: the photo has none

    def picture(self, photo: Picture) -> Picture:
        """The edited `photo`, with everything of the file that the edit does not concern."""
        return replace(photo, pixels=self.pixels, alpha=self.alpha)

    @property
    def moved(self) -> tuple[Moved, ...]:
        """Back to front."""
        return tuple(thing for thing in self.stack if thing.item.is_moved)


def composite(
    document: Document,
    puppets: dict[int, Puppet] | None = None,
    progress: Progress = silent,
    rows: int | None = None,
    keeps_weights: bool = False,
) -> Composite:
    """The edited photo. `puppets` by object index save making them again.

    At least `rows` are blended at a time, by default a few times as many as they look around
    them. It changes no pixel how many that are. `keeps_weights`: for `layers`.
    """
    photo, camera = document.photo.pixels, document.photo.camera
    alpha = document.photo.picture.alpha
    things = _stack(document, puppets or {})
    if not any(thing.item.is_moved for thing in things):
        nothing = np.zeros(photo.shape[:2], bool)
        return Composite(photo, nothing, 0, 0, Shares(), camera, (), alpha=alpha)
    margin = document.feather * hole_margin(camera.width, camera.height)
    gone = holes(document)
    plate = plate_of_holes(document, gone)
    drawing = _Drawing(things, camera, margin, plate)
    behind = alpha if alpha is None or plate is None else alpha_behind(alpha, plate, gone)
    _, y0, _, y1 = drawing.box
    blend = Blend(photo, margin, drawing.box, rows, document.feather, keeps_weights, alpha)
    for top, bottom in drawing.strips():
        progress((top - y0) / (y1 - y0), "Drawing the object")
        for drawn in drawing.over_plate(photo, behind, top, bottom):
            blend.add(drawn)
    pixels, footprint, share = blend.pixels, blend.footprint, 0.0
    if document.refined is not None:
        pixels, share = with_refined(photo, pixels, document.refined, blend.alpha)
    changed, outside = _count_changes((photo, alpha), (pixels, blend.alpha), footprint)
    from_photo, from_lifter, from_inpainter, paint = ((1 - share) * own for own in blend.shares())
    shares = Shares(from_photo, from_lifter, from_inpainter, share, paint)
    weights = blend.weights
    return Composite(
        pixels, footprint, changed, outside, shares, camera, things, drawing.box, weights,
        blend.beside, blend.alpha,
    )  # fmt: skip


def _stack(document: Document, puppets: dict[int, Puppet]) -> tuple[Moved, ...]:
    """What is drawn over the plate, back to front."""
    objects, camera = document.objects, document.photo.camera

    own: dict[int, Puppet] = {}

    def posed(k: int) -> PosedSplats:
        own[k] = puppets.get(k) or puppet_of(objects[k], camera)
        return own[k].posed(objects[k].pose, objects[k].placement)

    lighting, things, horizon = Lighting(document), [], document.horizon
    there = stack(document, posed)
    casters = [
        (k, caster)
        for k, splats in there.items()
        if splats is not None and (caster := lighting.caster(objects[k], splats, horizon))
    ]
    for k, splats in there.items():
        item, look = objects[k], NOTHING
        if splats is not None and (item.is_moved or casters):
            rest = partial(own[k].posed, None, Placement())
            look = lighting.of(item, splats, rest, horizon, casters=casters, number=k)
        has_hole = leaves_a_hole(objects, k)
        things.append(Moved(item, splats, has_hole, look))
    return tuple(things)


class _Drawing:
    """The objects of an edit as the photo's camera sees them."""

    def __init__(
        self, things: tuple[Moved, ...], camera: Camera, margin: float, plate: Plate | None = None
    ) -> None:
        """`margin`: px of the photo around what is disturbed."""
        self._things, self._plate, self._margin = things, plate, margin
        self._shades = [t.look.shade for t in things if t.look.shade is not None]
        self._drawables = {
            k: tiles.prepare(thing.splats, camera, camera)
            for k, thing in enumerate(things)
            if thing.item.is_moved and thing.item.is_visible and thing.splats is not None
        }
        self._paint = {
            k: (paint, paint.prepare(shown.splats, camera, camera))
            for k, shown in self._drawables.items()
            if (paint := PaintedShare.of(things[k].matte, shown.splats.rest.lifted)) is not None
        }
        self._textures = {
            k: CarriedTexture(things[k].matte, things[k].item.lifted, shown)
            for k, shown in self._drawables.items()
        }
        self.box = self._region(camera)

    def _region(self, camera: Camera) -> Box:
        """Everything the edit can touch."""
        margin = int(np.ceil(self._margin)) + 2
        boxes = [
            thing.item.matte_here.box
            for thing in self._things
            if thing.item.matte_here is not None and (thing.item.is_moved or thing.look.is_shaded)
        ]
        for k, shown in self._drawables.items():
            if (box := shown.box()) is not None:
                rim = reach_of(self._things[k].look.blur)
                boxes.append((box[0] - rim, box[1] - rim, box[2] + rim, box[3] + rim))
        boxes += [whole_box(shade.bounds) for shade in self._shades]
        if self._plate is not None and self._plate.painted is not None:
            boxes.append(self._plate.box)
        if not boxes:  # what came in from another photo is hidden, or nowhere in this one
            return NOWHERE
        x0, y0 = (int(low) - margin for low in np.min(boxes, axis=0)[:2])
        x1, y1 = (int(high) + margin for high in np.max(boxes, axis=0)[2:])
        return overlap((x0, y0, x1, y1), (0, 0, camera.width, camera.height)) or NOWHERE

    def strips(self) -> Iterator[tuple[int, int]]:
        """First and last row of the strips that are drawn at a time.

        They follow from the box alone, and so does the picture: a last bit may depend on which
        part of the view the rasteriser is asked for.
        """
        x0, y0, x1, y1 = self.box
        rows = max(STRIP // max(x1 - x0, 1) // PIECE, 1) * PIECE
        for top in range(y0, y1, rows):
            yield top, min(top + rows, y1)

    def over_plate(
        self, photo: Pixels, behind: np.ndarray | None, top: int, bottom: int
    ) -> list[Rows]:
        """The edit on the rows `top`..`bottom` of the box, a piece for each thread.

        `behind` (H, W): the alpha of what lies behind the objects; None: the photo has none.
        """
        x0, y0, x1, y1 = self.box
        pieces = [(x0, a, x1, b) for a, b in _pieces(top, bottom)]
        rows = map_in_threads(partial(_plate_rows, photo, self._plate), pieces)
        if behind is not None:
            rows = map_in_threads(partial(_as_opaque, behind), rows)
        for shade in self._shades:
            rows = map_in_threads(partial(_shaded, shade), rows)
        # `displacement` looks around each pixel. A whole row of tiles more above, and the tiles
        # stay where they are: what the rasteriser rounds, it rounds tile by tile.
        above, below = max(top - TILE, y0), min(bottom + NEAR // 2, y1)
        for k, thing in enumerate(self._things):
            picture = self._draw(k, above, below)
            if picture is not None:
                paint = self._draw_paint(k, (x0, above, x1, below))
                rows = map_in_threads(partial(_with, thing, picture, above, paint), rows)
            elif not thing.item.is_moved:
                rows = map_in_threads(partial(_at_rest, thing), rows)
            elif thing.has_hole:
                rows = map_in_threads(partial(_without, thing.matte), rows)
        return map_in_threads(with_touched, rows)

    def alone(self, top: int, bottom: int) -> F32:
        """The moved objects on nothing (bottom - top, w, 4), premultiplied."""
        x0, _, x1, _ = self.box
        result = np.zeros((bottom - top, x1 - x0, 4), np.float32)
        for k in range(len(self._things)):
            if (drawn := self._draw(k, top, bottom)) is not None:
                picture = _part(drawn, 0, bottom - top)
                own = np.dstack([picture.color, picture.alpha])
                result = over(result, own, self._things[k].look.mode)
        return result

    def _draw_paint(self, k: int, box: Box) -> F32 | None:
        """How much of an object's picture in `box` is paint; None where nothing is painted."""
        if k not in self._paint:
            return None
        paint, prepared = self._paint[k]
        return np.float32(self._things[k].look.opacity) * paint.draw(prepared, box)

    def _draw(self, k: int, top: int, bottom: int) -> Picture3D | None:
        """The rows `top`..`bottom` of an object's picture; None where it is hidden, or at rest."""
        if k not in self._drawables:
            return None
        look = self._things[k].look
        picture = self._focussed(k, top, bottom, look)
        color = lit(picture.color, picture.alpha, look.gain)
        if look.relit is not None:
            color = look.relit.lit(color, picture.alpha, self.box[0], top)
        if look.grain is not None:
            color = look.grain.grained(color, picture.alpha, self.box[0], top)
        color = saturated(color, picture.alpha, look.saturation)
        if (share := np.float32(look.opacity)) == 1:
            return replace(picture, color=color)
        return replace(
            picture, color=share * color, alpha=share * picture.alpha,
            from_photo=share * picture.from_photo,
        )  # fmt: skip

    def _focussed(self, k: int, top: int, bottom: int, look: Lit) -> Picture3D:
        """The rows of an object's picture, as much out of focus or sharper as it is to be."""
        x0, y0, x1, y1 = self.box
        if look.blur <= 0 and look.sharpness <= 0:
            return self._textures[k].draw((x0, top, x1, bottom))
        # By whole tiles more: what the rasteriser rounds, it rounds tile by tile.
        reach = reach_of(look.blur) + (reach_of(DETAIL) if look.sharpness > 0 else 0)
        rim = -(-reach // TILE) * TILE
        above, below = max(top - rim, y0), min(bottom + rim, y1)
        picture = self._textures[k].draw((x0, above, x1, below))
        picture = _part(picture, 0, below - above)
        color, alpha = blurred(picture.color, look.blur), blurred(picture.alpha, look.blur)
        soft = replace(
            picture, color=sharpened(color, alpha, look.sharpness, DETAIL), alpha=alpha,
            from_photo=blurred(picture.from_photo, look.blur),
        )  # fmt: skip
        return _part(soft, top - above, bottom - above)


class CarriedTexture:
    """The texture of a drawable object, of which a large one is there only by rows."""

    def __init__(self, matte: Matte, lifted: LiftedObject | None, shown: tiles.Drawable) -> None:
        source, self._shown = texture_source(matte, lifted), shown
        is_large = source.shape[0] * source.shape[1] > LARGE
        self._texture = TextureRows(source) if is_large else source.levels()

    def seen_in(self, box: Box) -> TextureLevels:
        """The texture, to be looked at in a part `box` of the view only, until the next call."""
        texture = self._texture
        if isinstance(texture, TextureRows):
            return texture.looked_at(*self._shown.rows_looked_at(box))
        return texture

    def draw(self, box: Box) -> Picture3D:
        """The part `box` of the view."""
        return tiles.draw(self._shown, self.seen_in(box), box)


def _pieces(top: int, bottom: int) -> list[tuple[int, int]]:
    return [(first, min(first + PIECE, bottom)) for first in range(top, bottom, PIECE)]


def _part(picture: Picture3D, first: int, last: int) -> Picture3D:
    """Its rows first..last; none of them is more than opaque."""
    part = Picture3D(*(getattr(picture, field.name)[first:last] for field in fields(picture)))
    return replace(part, alpha=np.minimum(part.alpha, 1.0))


def whole_box(bounds: tuple[float, float, float, float]) -> Box:
    """The pixels that a box touches."""
    x0, y0, x1, y1 = bounds
    return int(np.floor(x0)), int(np.floor(y0)), int(np.ceil(x1)), int(np.ceil(y1))


def _plate_rows(photo: Pixels, plate: Plate | None, box: Box) -> Rows:
    """What is seen in `box` without the objects that were moved."""
    x0, y0, x1, y1 = box
    touched = None
    nothing = np.zeros((y1 - y0, x1 - x0), np.float32)
    if plate is None:
        colour, invented = unit_pixels(photo[y0:y1, x0:x1]), nothing
    else:
        colour = unit_pixels(plate_crop(photo, plate, box))
        invented = crop(plate.hole, plate.box, box).astype(np.float32)
        if plate.painted is not None:
            touched = crop(plate.painted, plate.box, box).astype(np.float32)
    return Rows(x0, y0, colour, 1 - invented, nothing, invented, nothing, nothing > 0, touched)


def _as_opaque(alpha: np.ndarray, rows: Rows) -> Rows:
    """`rows` no more opaque than `alpha` (H, W) is there."""
    x0, y0, x1, y1 = rows.box
    cover = unit_pixels(alpha[y0:y1, x0:x1])
    return replace(rows, colour=rows.colour * cover[..., None], cover=cover)


def _shaded(shade: Shade, rows: Rows) -> Rows:
    """`rows` under a shadow, which also falls on clear ground."""
    there = shade.at(rows.box)
    if not there.any():
        return rows
    ink = np.array(shade.colour, np.float32)
    colour = rows.colour + there[..., None] * (ink - rows.colour)
    touched = there if rows.touched is None else np.maximum(rows.touched, there)
    return replace(rows, colour=colour, touched=touched, cover=rows.cover_under(there))


def _without(matte: Matte, rows: Rows) -> Rows:
    """`rows` from which an object was taken."""
    was_there = crop(matte.alpha, matte.box, rows.box) > 0
    moved = np.where(was_there, np.float32(np.inf), rows.moved)
    return replace(rows, moved=moved, is_covered=rows.is_covered | was_there)


def _at_rest(thing: Moved, rows: Rows) -> Rows:
    """`rows` with an object over them that is where it was: what it hides may move as it likes."""
    matte = thing.matte
    alpha = np.minimum(crop(matte.alpha, matte.box, rows.box), 1.0)
    own, through = alpha[..., None], 1 - alpha
    colour = own * crop(matte.foreground, matte.box, rows.box)
    touched = None if rows.touched is None else rows.touched * through
    if (relit := thing.look.relit) is not None:
        shaded = relit.lit(colour, alpha, rows.left, rows.top)
        taken = np.abs(shaded - colour).max(-1)
        colour, touched = shaded, taken if touched is None else np.maximum(touched, taken)
    return replace(
        rows,
        colour=colour + (1 - own) * rows.colour,
        from_photo=alpha + through * rows.from_photo,
        from_lifter=through * rows.from_lifter,
        from_inpainter=through * rows.from_inpainter,
        moved=np.where(alpha >= OPAQUE, np.float32(0), rows.moved),
        touched=touched,
        from_paint=None if rows.from_paint is None else through * rows.from_paint,
        cover=rows.cover_under(alpha),
    )


def _with(thing: Moved, drawn: Picture3D, above: int, paint: F32 | None, rows: Rows) -> Rows:
    """`rows` with an object over them whose picture `drawn` begins at row `above`.

    `paint` (h, w) is how much of that was painted.
    """
    matte = thing.matte
    x0, y0, x1, y1 = rows.box
    top, bottom = max(y0 - NEAR // 2, above), min(y1 + NEAR // 2, above + len(drawn.alpha))
    around = _part(drawn, top - above, bottom - above)
    rest = crop(matte.alpha, matte.box, (x0, top, x1, bottom))
    if not thing.has_hole:
        rest = np.zeros_like(rest)
    inner = slice(y0 - top, y1 - top)
    if thing.item.is_visitor:  # nothing of it was ever there
        around = replace(around, shift=np.full_like(around.shift, ELSEWHERE))
    moved = displacement(around, rest)[inner]
    if thing.item.is_only_painted:  # whatever its shape says: there the photo shows it
        moved = np.zeros_like(moved)
    picture = _part(around, inner.start, inner.stop)
    through = 1 - picture.alpha
    touched = None if rows.touched is None else rows.touched * through
    # Also where it has not moved.
    if thing.item.finish != AS_IN_THE_PHOTO or thing.look.is_shaded:
        own = np.maximum(picture.alpha, rest[inner])
        touched = own if touched is None else np.maximum(touched, own)
    from_photo, from_lifter = picture.from_photo, picture.alpha - picture.from_photo
    from_paint = None if rows.from_paint is None else through * rows.from_paint
    if paint is not None:
        own = np.minimum(paint[y0 - above : y1 - above], picture.alpha)
        touched = own if touched is None else np.maximum(touched, own)
        bare = 1 - own / np.maximum(picture.alpha, 1e-6)
        from_photo, from_lifter = bare * from_photo, bare * from_lifter
        from_paint = own if from_paint is None else own + from_paint
    return replace(
        rows,
        colour=_mixed_over(rows, picture, thing.look.mode),
        from_photo=from_photo + through * rows.from_photo,
        from_lifter=from_lifter + through * rows.from_lifter,
        from_inpainter=through * rows.from_inpainter,
        moved=np.maximum(rows.moved, moved),
        is_covered=rows.is_covered | (rest[inner] > 0) | (picture.alpha > 0),
        touched=touched,
        from_paint=from_paint,
        cover=rows.cover_under(picture.alpha),
    )


def _mixed_over(rows: Rows, picture: Picture3D, mode: str) -> F32:
    """The colours of `rows` (h, w, 3) under an object's `picture`."""
    if rows.cover is None or mode == NORMAL:
        return mixed(rows.colour, picture.color, picture.alpha, mode)
    below = np.dstack([rows.colour, rows.cover])
    return over(below, np.dstack([picture.color, picture.alpha]), mode)[..., :3]


def _count_changes(
    photo: tuple[Pixels, np.ndarray | None], result: tuple[Pixels, np.ndarray | None],
    footprint: Mask,
) -> tuple[int, int]:  # fmt: skip
    """How many pixels differ, in colour or alpha, in all and outside the footprint."""

    def count(rows: tuple[int, int]) -> tuple[int, int]:
        part = slice(*rows)
        is_changed = differ(result[0][part], photo[0][part])
        if photo[1] is not None and result[1] is not None:
            is_changed |= result[1][part] != photo[1][part]
        return int(is_changed.sum()), int((is_changed & ~footprint[part]).sum())

    counts = map_in_threads(count, _pieces(0, len(footprint)))
    return sum(changed for changed, _ in counts), sum(outside for _, outside in counts)


def straight_cutout(result: Composite, dtype: np.dtype, size: tuple[int, int]) -> np.ndarray:
    """The moved objects alone, (H, W, 4) straight alpha, on nothing; `size` is (width, height).

    They are drawn again, strip by strip: a composite does not keep what it has drawn.
    """
    return _on_nothing(result.moved, result.camera, dtype, size)


def lit_cutout(document: Document, k: int, progress: Progress = silent) -> np.ndarray:
    """The moved object `k` alone, likewise, in the light that it has among the others."""
    item, photo = document.objects[k], document.photo
    things = tuple(thing for thing in _stack(document, {}) if thing.item is item)
    return _on_nothing(things, photo.camera, photo.pixels.dtype, photo.size, progress)


def _on_nothing(
    things: tuple[Moved, ...], camera: Camera, dtype: np.dtype, size: tuple[int, int],
    progress: Progress = silent,
) -> np.ndarray:  # fmt: skip
    width, height = size
    if not things:
        return np.zeros((height, width, 4), dtype)
    cutout, box = drawn_alone(things, camera, dtype, progress)
    return crop(cutout, box, (0, 0, width, height))


def drawn_alone(
    things: tuple[Moved, ...], camera: Camera, dtype: np.dtype, progress: Progress = silent
) -> tuple[np.ndarray, Box]:
    """Some moved objects alone on nothing, (h, w, 4) straight alpha, and their box in the photo."""
    drawing = _Drawing(things, camera, hole_margin(camera.width, camera.height))
    x0, y0, x1, y1 = drawing.box
    cutout = np.zeros((y1 - y0, x1 - x0, 4), dtype)
    for top, bottom in drawing.strips():
        progress((top - y0) / (y1 - y0), "Drawing the object")
        drawn = drawing.alone(top, bottom)
        drawn[..., :3] /= np.maximum(drawn[..., 3:], 1e-6)
        drawn[drawn[..., 3] <= 0] = 0
        cutout[top - y0 : bottom - y0] = pixels_from_unit(drawn, dtype)
    return cutout, drawing.box


# The refinement over the composite: seen inside the footprint only, as strongly as is wanted.


def with_refined(
    photo: Pixels, pixels: Pixels, refined: Refined, alpha: np.ndarray | None = None
) -> tuple[Pixels, float]:
    """`pixels` (H, W, 3), an edited `photo`, refined; and the refiner's share of what changed.

    Where the refinement's alpha is 0, or the edit's `alpha` (H, W), the integers stay as they are.
    """
    x0, y0, x1, y1 = refined.box
    weights = refined.weights
    old = pixels[y0:y1, x0:x1]
    base = unit_pixels(old)
    mixed = base + weights[..., None] * (unit_pixels(refined.pixels) - base)
    result = pixels.copy()
    shown = weights > 0
    if alpha is not None:
        shown &= alpha[y0:y1, x0:x1] > 0
    new = pixels_from_unit(mixed, old.dtype)
    result[y0:y1, x0:x1] = np.where(shown[..., None], new, old)
    whole = int(differ(result, photo).sum())
    is_changed = differ(result[y0:y1, x0:x1], photo[y0:y1, x0:x1])
    total = float(weights[is_changed].sum(dtype=np.float64))
    return result, total / whole if whole else 0.0


# How an object's colours are mixed with what lies behind it, as the layers of a paint program.
#
# The formulas are those of the W3C's Compositing and Blending, which OpenRaster's `svg:` names
# mean, for an opaque backdrop and a premultiplied picture; `shaders/blend_modes.glsl` is their
# twin. Adobe's soft light differs from this one a little on backdrops darker than a quarter.

DARK = np.float32(0.25)  # from which on soft light brightens by the square root


def mixed(below: F32, colour: F32, alpha: F32, mode: str) -> F32:
    """Premultiplied `colour` (h, w, 3) of `alpha` (h, w) over the opaque `below` (h, w, 3)."""
    through = (1 - alpha)[..., None]
    if mode == NORMAL:
        result = colour + through * below
    elif mode == MULTIPLY:
        result = below * (through + colour)
    elif mode == SCREEN:
        result = below + colour * (1 - below)
    else:
        tilt = 2 * colour - alpha[..., None]  # of the colour from middle grey, times alpha
        bright = np.where(below <= DARK, ((16 * below - 12) * below + 4) * below, np.sqrt(below))
        result = below + tilt * np.where(tilt <= 0, below - below * below, bright - below)
    return np.asarray(result, np.float32)


def over(below: F32, above: F32, mode: str) -> F32:
    """Two premultiplied pictures (h, w, 4), `above` mixed with what of `below` is there."""
    cover, alpha = below[..., 3:], above[..., 3]
    covering = above + (1 - alpha)[..., None] * below
    if mode != NORMAL:
        straight = np.asarray(below[..., :3] / np.maximum(cover, 1e-6), np.float32)
        colour = mixed(straight, above[..., :3], alpha, mode)
        covering[..., :3] = cover * colour + (1 - cover) * above[..., :3]
    return np.asarray(covering, np.float32)
