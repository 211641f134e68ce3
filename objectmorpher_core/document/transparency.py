"""A photo's own transparency: what of it an object takes along, and what stays behind it.

Alpha is straight in files and in `Picture`. Here it is looked at where objects are cut out of a
photo, where the place is filled that they leave, and where such a photo is looked at. None of it
does anything for a photo without an alpha channel.
"""

from __future__ import annotations

from dataclasses import replace
from weakref import WeakKeyDictionary

import cv2
import numpy as np

from ..base.arrays import F32, Mask, Pixels, Selection, crop, frozen, unit_pixels
from ..base.masks import box_of
from ..pictures.image import Picture
from .model import SELECTED, Matte, Photo, Plate

CLEAR = 1 / 16  # alpha below which a pixel's colour is not relied on
EDGE = 0.004  # x the photo's diagonal: the edge beside clear ground where nothing else is behind
LEAST_EDGE = 2.0  # px
SOFT = 8.0  # x that, over which an edge may be soft
MOST_SOFT = 64.0  # px
STEP = 1.5 / 255  # of alpha, by which a coverage is rounded
SQUARES = 96  # of the checker, along a photo's longer side
LIGHT, DARK = 0.62, 0.50  # sRGB grey of the checker's squares


def within(selection: Selection | None, picture: Picture) -> Selection | None:
    """What of a selection (H, W) the photo shows, soft where it fades into clear ground.

    The soft edge that a photo has there is the object's, also where it was too faint to be
    selected. What is seen through throughout is selected as what is solid.
    """
    if selection is None or picture.alpha is None or selection.shape != picture.alpha.shape:
        return selection
    if not selection.any() or picture.alpha.all():  # no ground is clear
        return selection
    width, reach = _edges(selection.shape)
    x0, y0, x1, y1 = box_of(selection > 0, 3 * round(reach) + 3)  # nothing beyond matters
    part = np.s_[y0:y1, x0:x1]
    found = _within(selection[part], picture.alpha[part], width, reach)
    if found is None:
        return selection
    whole = np.zeros(selection.shape, found.dtype)
    whole[part] = found
    return frozen(whole)


def _within(selection: Selection, opacity: Pixels, width: float, reach: float) -> Selection | None:
    """What is left of a part of a selection (h, w); None where all of it is solid."""
    alpha = unit_pixels(opacity)
    away = _distance(alpha <= 0)
    share = _edge_shares(alpha, away, round(reach))
    if (share >= 1).all():
        return None
    is_soft = selection.dtype != np.bool_
    own = selection >= SELECTED if is_soft else selection
    coverage = np.rint(255 * share).astype(np.uint8)
    solid = coverage >= SELECTED
    beside = _distance(own)
    is_open = (share < 1) | (away <= width)  # the edge itself, and no other thing
    is_rim = ~own & solid & is_open & (beside <= width)  # selected a little short
    near = np.minimum(reach, _distance(solid & ~own & ~is_rim))
    is_fringe = ~own & (is_rim | (~solid & (beside < near)))
    most = selection if is_soft else own * np.uint8(255)
    found = np.where(is_fringe, coverage, np.minimum(coverage, most))
    is_hard = not is_soft and not ((found > 0) & (found < 255)).any()
    return found > 0 if is_hard else found


def _edge_shares(alpha: F32, away: F32, reach: int) -> F32:
    """(h, w) in [0, 1]: how solid each place is beside what it borders, near clear ground.

    `away` (h, w): px from that; beyond `reach` it is 1. So a pane of glass ends as sharply as it
    does, and a blurred edge softly.
    """
    around = cv2.dilate(alpha, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    share = np.where(away <= reach, alpha / np.maximum(around, 1e-6), 1)
    return np.asarray(share, np.float32)


def _edges(shape: tuple[int, int]) -> tuple[float, float]:
    """Px from clear ground, in a photo (H, W): nothing else is behind an object; edges may be soft.

    As many as `LEAST_EDGE` and `MOST_SOFT` allow.
    """
    width = max(LEAST_EDGE, EDGE * float(np.hypot(*shape)))
    return width, min(SOFT * width, MOST_SOFT)


def with_opacity(matte: Matte, picture: Picture, mask: Mask | None) -> Matte:
    """The `matte` of a `mask` (H, W), no more opaque than the photo is there.

    It is `matte` itself where that changes nothing. Where the photo is not opaque its colours are
    the object's own: what is behind it is not mixed in.
    """
    if picture.alpha is None:
        return matte
    width, _ = _edges(picture.alpha.shape)
    x0, y0, x1, y1 = matte.box
    more = round(width) + 2  # px farther than where the distance from clear ground counts
    left, top = max(x0 - more, 0), max(y0 - more, 0)
    part = unit_pixels(picture.alpha[top : y1 + more, left : x1 + more])
    box = x0 - left, y0 - top, x1 - left, y1 - top
    there, away = (_around(image, box) for image in (part, _distance(part <= 0)))
    alpha = np.minimum(there, matte.alpha)
    own = matte.alpha > 0
    if mask is not None:
        own |= crop(mask, (0, 0, *mask.shape[::-1]), matte.box)
    is_edge = own & (away <= width)  # nothing else can be behind it
    alpha = np.where(is_edge | (there - alpha < STEP), there, alpha)
    if np.array_equal(alpha, matte.alpha):
        return matte
    is_own = (is_edge | (there < 1)) & (there > CLEAR)
    colours = unit_pixels(_around(picture.pixels, matte.box))
    foreground = np.where(is_own[..., None], colours, matte.foreground)
    return replace(matte, alpha=alpha.astype(np.float32), foreground=foreground)


def _around(image: np.ndarray, box: tuple[int, int, int, int]) -> np.ndarray:
    """The part `box` of an image (H, W, ...), which is mirrored at its frame."""
    height, width = image.shape[:2]
    x0, y0, x1, y1 = box
    inner = image[max(y0, 0) : y1, max(x0, 0) : x1]
    pads = max(-y0, 0), max(y1 - height, 0), max(-x0, 0), max(x1 - width, 0)
    return cv2.copyMakeBorder(inner, *pads, cv2.BORDER_REFLECT_101) if any(pads) else inner


def _distance(there: Mask) -> F32:
    """(h, w) px to the nearest pixel that is `there`; very far where there is none."""
    away = cv2.distanceTransform((~there).astype(np.uint8), cv2.DIST_L2, 5)
    return np.asarray(away, np.float32)


def alpha_behind(alpha: np.ndarray, plate: Plate, gone: tuple[Matte, ...]) -> np.ndarray:
    """A photo's `alpha` (H, W), u8 or u16, where the objects with these mattes are gone.

    What lies around the plate's hole goes on in it. Beside the objects nothing becomes more
    opaque than it is.
    """
    height, width = alpha.shape
    x0, y0, x1, y1 = plate.box
    box = max(x0 - 1, 0), max(y0 - 1, 0), min(x1 + 1, width), min(y1 + 1, height)
    hole = crop(plate.hole, plate.box, box)
    old = alpha[box[1] : box[3], box[0] : box[2]]
    covered = np.zeros(hole.shape, bool)
    for matte in gone:
        covered |= crop(matte.alpha, matte.box, box) > 0
    new = _nearest(old, ~hole)
    result = alpha.copy()
    result[box[1] : box[3], box[0] : box[2]] = np.where(
        hole, np.where(covered, new, np.minimum(old, new)), old
    )
    return frozen(result)


def continued(picture: Picture, covered: Mask) -> Pixels:
    """The pixels (H, W, 3) for what is to be filled in where they are `covered` (H, W).

    Whatever colour lies under clear ground is none that could be copied: the colours of what is
    seen go on there.
    """
    if picture.alpha is None:
        return picture.pixels
    seen = is_seen(picture.alpha)
    known = seen & ~covered
    if seen.all():
        return picture.pixels
    if not known.any():  # nothing will be seen there either; whatever is hidden has no say in it
        return colours_of(picture)
    return frozen(np.where((seen | covered)[..., None], picture.pixels,
                           _nearest(picture.pixels, known)))  # fmt: skip


_colours: WeakKeyDictionary[Picture, Pixels] = WeakKeyDictionary()


def colours_of(picture: Picture) -> Pixels:
    """The pixels (H, W, 3) for what looks at the colours of things, and around them.

    They are `continued` under clear ground. They are found once, and those of an opaque picture
    are its own.
    """
    if picture.alpha is None:
        return picture.pixels
    if (known := _colours.get(picture)) is None:
        seen = is_seen(picture.alpha)
        known = picture.pixels
        if not seen.all():
            known = frozen(_nearest(known, seen if seen.any() else picture.alpha > 0))
        _colours[picture] = known
    return known


def is_seen(alpha: np.ndarray) -> Mask:
    """(h, w) where a photo's alpha (h, w) is enough for its colours to be relied on."""
    return alpha > CLEAR * np.iinfo(alpha.dtype).max


def _nearest(image: np.ndarray, known: Mask) -> np.ndarray:
    """`image` (h, w, ...) where it is `known` (h, w); elsewhere as at the nearest such place."""
    from ..base.poisson_disk import nearest_in  # it needs the compiler

    if not known.any():
        return image
    return image.reshape(-1, *image.shape[2:])[nearest_in(known)]


def on_checker(
    pixels: Pixels, alpha: np.ndarray, size: tuple[int, int], left: int = 0, top: int = 0
) -> Pixels:
    """Straight `pixels` (h, w, 3) over a checker, as far as they are transparent.

    They are at `left`, `top` px in a photo of `size` (w, h), and so is the checker.
    """
    side = max(round(max(size) / SQUARES), 1)
    rows, columns = (np.arange(first, first + n) // side
                     for first, n in zip((top, left), alpha.shape, strict=True))  # fmt: skip
    ground = np.where((rows[:, None] + columns) % 2 == 0, np.float32(LIGHT), np.float32(DARK))
    own = unit_pixels(alpha)
    most = np.float32(np.iinfo(pixels.dtype).max)
    mixed = pixels * own[..., None] + (most * (1 - own) * ground)[..., None]
    return frozen(np.rint(mixed).astype(pixels.dtype))


def seen_plate(photo: Photo, plate: Plate | None, gone: tuple[Matte, ...]) -> Plate | None:
    """`plate` as it is shown where the objects with the mattes `gone` are not, as `seen`."""
    alpha = photo.picture.alpha
    if alpha is None or plate is None:
        return plate
    x0, y0, x1, y1 = plate.box
    behind = alpha_behind(alpha, plate, gone)[y0:y1, x0:x1]
    own = np.where(plate.hole[..., None], plate.pixels, photo.pixels[y0:y1, x0:x1])
    return replace(plate, pixels=on_checker(own, behind, photo.size, x0, y0))


_seen: WeakKeyDictionary[Picture, Pixels] = WeakKeyDictionary()


def seen(photo: Photo) -> Pixels:
    """(H, W, 3) a photo as it is shown: on a checker where it is transparent.

    That is also what objects are selected in. It is made once.
    """
    picture = photo.picture
    if picture.alpha is None:
        return picture.pixels
    if (known := _seen.get(picture)) is None:
        known = _seen[picture] = on_checker(picture.pixels, picture.alpha, photo.size)
    return known
