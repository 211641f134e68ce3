"""The shadow that an object throws in the photo: where it is, and numbers of one that is alike.

Shadows of the object's own silhouette (`shadow`) are tried in all directions and lengths, each
together with a smooth ground, against the logarithm of the brightness around the object. What
explains it best, by a robust regression (Huber's loss, iteratively reweighted; Holland and Welsch
1977), is the shadow, if it is dark enough, if the ground is even enough to tell, and if it takes
light of all colours alike: another material begins with another colour. Its numbers are those of a
shadow that looks like it, for where the object goes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask, Pixels
from ...base.pixels import unit_pixels
from ...document.model import Matte
from ...document.settings import MOST_SHADOW, Shadow
from .old_shadow import BLACK, FROM_ABOVE, OldShadow
from .robust_fit import regressed
from .shadow import DARKEST, GAMMA
from .shadow_flat import Flat, lie
from .shadow_shear import Sheet, stand

SHEET_GROUND = 30.0  # degrees: a silhouette alone is told no ground
CELLS = 64  # along the object's longer side
AROUND = 1.0  # x that side, how far around the object one looks
NEAR = 0.6  # x that side, over which what is seen weighs less
LUMA = np.array([0.3, 0.5, 0.2], np.float32)
LOOKED = 6  # px of the photo across each of them are enough
FREE = 0.02  # of a cell, that the object may cover
DIRECTIONS = range(0, 360, 20)  # degrees
LENGTHS = (0.35, 0.8, 1.6)  # x the object's height
STEEP = 75.0  # degrees: from there on a thing hides its own foot
FLAT_LENGTHS = (0.1, 0.25, 0.5)  # x the shorter side of what is seen from above
# What lies is lifted to a body whose rim stands about so much of that side above the ground.
FLAT_HEIGHT = 6.0  # x that side's share, of a shadow's length in the rim's heights
LEAST_FLAT = 0.4  # of the loss without a shadow, that such a one must explain
SOFTNESS = 0.35
FINER = ((10.0, 1.3), (5.0, 1.15))  # degrees, and factor of the length
SOFTER = 0.2
FULL = 0.75  # of the light, that a full shadow is taken to leave out
LEAST_DARK = 0.25  # natural logarithm of light, that a shadow takes at its darkest
LEAST_GAIN = 0.04  # of the loss without a shadow
MOST_NOISE = 0.6  # natural logarithm: on a ground more varied than that nothing is told
COARSE = 4.0  # cells, over which unevenness is measured
STANDS_OUT = 4.0  # x that, for a shadow
EXPLAINED = 0.6  # x what it would explain where it is, if it were all of it
CUT_OFF = 0.15  # x its width, along the photo's lower edge
MOST_COLOUR = 0.4  # x its darkness, that a shadow changes colours by
DARKER = 0.12  # natural logarithm, from which a cell counts as dark
LEAST_CELLS = 200
MEASURED = 0.7  # least share of what is measured in what is taken off; the rest was fitted
EDGE = (0.02, 0.1)  # natural logarithm of what was fitted, over which what is measured counts
REACH = 2.0  # cells beyond that
SMOOTH = (1.0, 4.0)  # cells, and for each unit of noise: over which the dark is measured
SURE = 2.5  # x what is usual on lit ground
CORE = 0.3  # of the darkest that was fitted
LIT = 0.1  # of a shadow: what is less in it counts as lit
BRIGHTEST = 90  # percentile of lit ground: what it is at most where a shadow is taken off
GROWN = 2  # times
MOST_GROWN = 2.5  # x its area before
LEAST_LEFT = 0.2  # of the ground, that is lit
DEEPEST = 2.5  # natural logarithm of light that is ever given back


def find_old_shadow(
    pixels: Pixels, matte: Matte, others: Mask | None = None, seen_from: float | None = None
) -> OldShadow | None:
    """The shadow of what was cut out of the photo `pixels` (H, W, 3); None where none is sure.

    `others` (H, W): what else hides the ground. `seen_from`: how many degrees above it one looks
    from; None where nobody knows: then it is SHEET_GROUND, and the shadow found says so.
    """
    if not (matte.alpha > 0.5).any() or _leaves_below(pixels, matte):
        return None
    slope = float(np.sin(np.radians(SHEET_GROUND if seen_from is None else seen_from)))
    try:
        seen = _look(pixels, matte, others, slope)
    except ValueError:  # it is thinner than what is looked at
        return None
    told = _told(seen, LENGTHS) if seen_from is None or seen_from < STEEP else None
    if seen_from is None or seen_from >= STEEP:
        flat = replace(seen, standing=lie(seen.cover))
        lying = _told(flat, FLAT_LENGTHS)
        least = max(LEAST_FLAT, 0.0 if told is None else told[1].gain)
        if lying is not None and lying[1].gain > least:
            seen, told = flat, lying
    if told is None:
        return None
    ground, found = told
    depth = _missing(seen, ground, found)
    shadow = _imitated(found)
    if isinstance(seen.standing, Flat):
        length = min(FLAT_HEIGHT * shadow.length, MOST_SHADOW)
        shadow = replace(shadow, length=length, ground=FROM_ABOVE)
    elif seen_from is None:
        shadow = replace(shadow, ground=SHEET_GROUND)
    free = seen.free.astype(np.float32)
    return OldShadow(shadow, depth, seen.left, seen.top, seen.pitch, ground.scale, free)


def _told(seen: _Seen, lengths: tuple[float, ...]) -> tuple[_Ground, _Found] | None:
    """The ground and the shadow on it; None where none is sure."""
    ground = _ground(seen)
    found = None if ground is None else _searched(seen, ground, lengths)
    if ground is None or found is None:
        return None
    if isinstance(seen.standing, Flat):  # a large part of what one sees may lie in its shadow
        ground = replace(ground, scale=min(ground.scale, found.scale))
    if not _is_sure(seen, ground, found):
        return None
    return ground, found


def _leaves_below(pixels: Pixels, matte: Matte) -> bool:
    """Whether the photo's lower edge cuts it off: then it stands on no ground that one sees."""
    solid = matte.alpha > 0.5
    last = len(pixels) - 1 - matte.top  # row of the matte
    if last >= len(solid):
        return False
    return bool(solid[max(last - 1, 0) : last + 1].any(0).sum() > CUT_OFF * solid.any(0).sum())


@dataclass(frozen=True, eq=False)
class _Seen:
    """The object's surroundings on a small grid."""

    brightness: F32  # (h, w) natural logarithm of linear light
    colour: F32  # (h, w, 2) logarithms of ratios
    cover: F32  # (h, w) of the object
    free: Mask  # (h, w) ground, or whatever else is not the object
    standing: Sheet | Flat
    left: float
    top: float
    pitch: float


def _look(pixels: Pixels, matte: Matte, others: Mask | None, slope: float) -> _Seen:
    height, width = pixels.shape[:2]
    rows, columns = (np.flatnonzero((matte.alpha > 0.5).any(axis)) for axis in (1, 0))
    size = int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1
    pitch = max(max(size) / CELLS, 1.0)
    around = int(AROUND * max(size) / pitch)
    left = matte.left + columns[0] - around * pitch
    top = matte.top + rows[0] - around * pitch
    cells = tuple(int(np.ceil(s / pitch)) + 2 * around for s in size)

    step = max(int(pitch) // LOOKED, 1)  # of a large photo not every pixel is looked at

    def small(image: np.ndarray, x: float, y: float) -> F32:
        """Every `step`th px of an image whose corner is at photo px x, y, on the grid."""
        scale = pitch / step
        side = max(round(scale), 1)
        image = cv2.blur(np.asarray(image, np.float32), (side, side))
        shift = [(at + pitch / 2 - 0.5) / step for at in (left - x, top - y)]
        matrix = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpAffine(image, matrix, cells, flags=flags), np.float32)

    x0, y0 = max(int(left) - 1, 0), max(int(top) - 1, 0)
    x1, y1 = (
        min(int(left + cells[0] * pitch) + 2, width),
        min(int(top + cells[1] * pitch) + 2, height),
    )
    window = np.s_[y0:y1:step, x0:x1:step]
    light = small(unit_pixels(pixels[window]) ** np.float32(GAMMA), x0, y0)
    inside = small(np.ones(pixels[window].shape[:2]), x0, y0) > 0.999
    cover = small(matte.alpha[::step, ::step], matte.left, matte.top)
    hidden = cover
    if others is not None:
        hidden = np.maximum(hidden, small(others[window], x0, y0))
    free = inside & (cv2.dilate(hidden, np.ones((3, 3))) < FREE)
    logarithm = np.log(light + BLACK)
    colour = logarithm[..., [0, 2]] - logarithm[..., 1:2]
    return _Seen(
        logarithm @ LUMA, colour, cover, free, stand(cover, slope), float(left), float(top), pitch
    )


@dataclass(frozen=True, eq=False)
class _Ground:
    """Where it is asked for, and how it varies without a shadow."""

    index: np.ndarray  # (n,) of the cells
    weight: F64  # (n,)
    basis: F64  # (n, 6)
    everywhere: F64  # (h, w, 6) the same of all cells
    brightness: F64  # (n,)
    contact: F64  # (n,) natural logarithm of the light that a contact takes
    loss: float
    scale: float  # of what is not explained


def _ground(seen: _Seen) -> _Ground | None:
    """None where too little of it is seen."""
    rows, columns = seen.cover.shape
    base, height = seen.standing.base, seen.standing.height
    y, x = np.mgrid[:rows, :columns]
    x, y = (x + 0.5 - columns / 2) / CELLS, (y + 0.5 - base) / CELLS
    away = cv2.distanceTransform((seen.cover < 0.5).astype(np.uint8), cv2.DIST_L2, 5) / CELLS
    is_asked = seen.free & (y > -seen.standing.above / CELLS) & (away < AROUND)
    index = np.flatnonzero(is_asked)
    if len(index) < LEAST_CELLS or height < 2:
        return None
    everywhere = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], -1)
    weight = np.exp(-((away.ravel()[index] / NEAR) ** 2)).astype(np.float64)
    basis, brightness = everywhere.reshape(-1, 6)[index], seen.brightness.ravel()[index]
    contact = _taken(seen.standing.contact()).ravel()[index].astype(np.float64)
    brightness = brightness.astype(np.float64)
    _, loss, scale = regressed(basis, brightness, weight)
    return _Ground(index, weight, basis, everywhere, brightness, contact, loss, scale)


def _taken(shadow: F32) -> F32:
    """Natural logarithm of the light that a shadow of opacity (h, w) takes."""
    return np.asarray(-np.log(1 - FULL * np.clip(shadow, 0, 1)), np.float32)


@dataclass(frozen=True, eq=False)
class _Found:
    """A shadow that was tried."""

    shadow: Shadow
    gain: float  # of the loss
    thrown: F32  # (h, w) natural logarithm of the light that it takes at strength 1
    ground: F64  # (6,)
    dark: float  # how much of it there is
    contact: float
    scale: float  # of what is not explained


def _tried(seen: _Seen, ground: _Ground, shadow: Shadow) -> _Found | None:
    """None where it would be no shadow but a light."""
    taken = _taken(seen.standing.thrown(shadow))
    column = taken.ravel()[ground.index].astype(np.float64)
    if column.max() < DARKER:
        return None
    basis = np.column_stack([ground.basis, -column, -ground.contact])
    found, loss, scale = regressed(basis, ground.brightness, ground.weight, ground.scale)
    if found[7] < 0:
        basis = basis[:, :7]
        found, loss, scale = regressed(basis, ground.brightness, ground.weight, ground.scale)
        found = np.append(found, 0.0)
    if found[6] <= 0:
        return None
    gain = 1 - loss / max(ground.loss, 1e-12)
    return _Found(shadow, gain, taken, found[:6], float(found[6]), float(found[7]), scale)


def _searched(seen: _Seen, ground: _Ground, lengths: tuple[float, ...]) -> _Found | None:
    """The best of all directions and lengths, then of some that lie around it."""
    best: _Found | None = None
    for shadow in _coarsely(lengths):
        tried = _tried(seen, ground, shadow)
        if tried is not None and (best is None or tried.gain > best.gain):
            best = tried
    if best is None:
        return None
    for step, factor in FINER:
        for shadow in _around(best.shadow, step, factor):
            tried = _tried(seen, ground, shadow)
            if tried is not None and tried.gain > best.gain:
                best = tried
    return best


def _coarsely(lengths: tuple[float, ...]) -> Iterator[Shadow]:
    for direction in DIRECTIONS:
        for length in lengths:
            yield Shadow(1.0, float(direction), length, SOFTNESS, 0.0)


def _around(shadow: Shadow, step: float, factor: float) -> Iterator[Shadow]:
    for turn in (-step, 0.0, step):
        for longer in (1 / factor, 1.0, factor):
            for softer in (-SOFTER, 0.0, SOFTER):
                yield replace(
                    shadow, direction=(shadow.direction + turn) % 360,
                    length=min(shadow.length * longer, MOST_SHADOW),
                    softness=float(np.clip(shadow.softness + softer, 0.05, 1)),
                )  # fmt: skip


def _is_sure(seen: _Seen, ground: _Ground, found: _Found) -> bool:
    """Whether it is darker than the ground is uneven, tells something, and has no colour."""
    darkest = found.dark * float(found.thrown.max())
    if darkest < LEAST_DARK or found.gain < LEAST_GAIN or ground.scale > MOST_NOISE:
        return False
    if darkest < STANDS_OUT * _unevenness(seen, ground, found):
        return False
    if not _is_where_it_is_dark(seen, ground, found):
        return False
    column = found.thrown.ravel()[ground.index].astype(np.float64)
    basis = np.column_stack([ground.basis, -column])
    changes = [
        abs(float(regressed(basis, channel, ground.weight)[0][6]))
        for channel in seen.colour.reshape(-1, 2)[ground.index].T.astype(np.float64)
    ]
    return max(changes) < MOST_COLOUR * found.dark


def _is_where_it_is_dark(seen: _Seen, ground: _Ground, found: _Found) -> bool:
    """Whether it explains of its own cells what one as dark would on a ground as varied."""
    fitted = _fitted(seen, found).ravel()[ground.index].astype(np.float64)
    without = ground.brightness - ground.basis @ found.ground
    core = fitted > CORE * fitted.max()
    explained = 1 - float(((without + fitted)[core] ** 2).mean() / (without[core] ** 2).mean())
    dark = float(without[core].mean()) ** 2
    return explained > EXPLAINED * dark / (dark + ground.scale**2)


def _unevenness(seen: _Seen, ground: _Ground, found: _Found) -> float:
    """How much the ground varies besides, over lengths as large as shadows."""
    free = seen.free.astype(np.float32)
    fitted = ground.everywhere @ found.ground - _fitted(seen, found)
    rest = (seen.brightness - fitted).astype(np.float32) * free
    spread = cv2.GaussianBlur(free, (0, 0), COARSE)
    blurred = cv2.GaussianBlur(rest, (0, 0), COARSE) / np.maximum(spread, FREE)
    squares = np.asarray(blurred, np.float64).ravel()[ground.index] ** 2
    return float(np.sqrt(np.average(squares, weights=ground.weight)))


def _fitted(seen: _Seen, found: _Found) -> F32:
    """(h, w) natural logarithm of the light that the shadow takes which was found."""
    contact = _taken(seen.standing.contact())
    return np.asarray(found.dark * found.thrown + found.contact * contact, np.float32)


def _missing(seen: _Seen, ground: _Ground, found: _Found) -> F32:
    """(h, w) natural logarithm of the light that is missing: mostly as it is measured.

    What was tried is only about where the shadow is. It grows over all that is as dark beside it,
    and the ground is told once more from what is left.
    """
    fitted = _fitted(seen, found)
    low, high = EDGE
    member = np.clip((fitted - low) / (high - low), 0, 1).astype(np.float32)
    coefficients, free = found.ground, seen.free.astype(np.float32)
    blur = SMOOTH[0] + SMOOTH[1] * ground.scale
    spread = cv2.GaussianBlur(free, (0, 0), blur)
    smooth = np.zeros_like(fitted)
    for _ in range(GROWN):
        measured = (ground.everywhere @ coefficients).astype(np.float32) - seen.brightness
        blurred = cv2.GaussianBlur(measured * free, (0, 0), blur)
        smooth = np.asarray(blurred / np.maximum(spread, 1e-3), np.float32)
        lit = smooth.ravel()[ground.index][member.ravel()[ground.index] < LIT]
        usual = 1.4826 * float(np.median(np.abs(lit))) if len(lit) else 0.0
        member = _spread(member, smooth, fitted, max(DARKER, SURE * usual), seen.free)
        weight = ground.weight * (1 - member.ravel()[ground.index])
        if weight.sum() > LEAST_LEFT * ground.weight.sum():
            coefficients, *_ = regressed(ground.basis, ground.brightness, weight)
    share = max(1 - ground.scale, MEASURED) * np.clip(spread, 0, 1)
    depth = fitted + share * (np.clip(smooth, 0, DEEPEST) - fitted)
    depth = np.clip(depth, 0, np.minimum(_room(seen, ground, member, blur), DEEPEST)) * member
    depth[[0, -1]] = 0
    depth[:, [0, -1]] = 0
    return np.asarray(depth, np.float32)


def _room(seen: _Seen, ground: _Ground, member: F32, blur: float) -> F32:
    """(h, w) natural logarithm of the light that lacks until a cell is as bright as lit ground.

    Beneath the object, and beyond what is lit, the ground is only continued: it may be told too
    bright, but no shadow leaves more light than falls beside it.
    """
    free = seen.free.astype(np.float32)
    spread = cv2.GaussianBlur(free, (0, 0), blur)
    bright = cv2.GaussianBlur(seen.brightness * free, (0, 0), blur) / np.maximum(spread, 1e-3)
    is_lit = member.ravel()[ground.index] < LIT
    if not is_lit.any():
        return np.full(spread.shape, DEEPEST, np.float32)
    most = np.percentile(ground.brightness[is_lit], BRIGHTEST)
    room = np.where(spread > FREE, np.maximum(most - bright, 0), DEEPEST)
    return np.asarray(room, np.float32)


def _spread(member: F32, dark: F32, fitted: F32, least: float, free: Mask) -> F32:
    """(h, w) what belongs to the shadow: what is at least so dark and hangs together with it."""
    core = (fitted > CORE * fitted.max()) & (dark > least)
    _, labels = cv2.connectedComponents(((dark > least) & free).astype(np.uint8))
    own = np.isin(labels, np.setdiff1d(np.unique(labels[core & free]), [0]))
    if own.sum() > MOST_GROWN * (member > 0.5).sum():  # it has run out over something dark
        return member
    ramp = np.where(own, np.clip((dark - 0.5 * least) / (0.5 * least), 0, 1), 0)
    side = 2 * int(np.ceil(REACH)) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    grown = cv2.dilate(np.maximum(ramp.astype(np.float32), member), kernel)
    return np.asarray(cv2.GaussianBlur(grown, (0, 0), REACH / 2), np.float32)


def _imitated(found: _Found) -> Shadow:
    """The numbers of a shadow that takes as much light (see `shadow`)."""
    darkest = 1 - np.exp(-found.dark * float(found.thrown.max()))
    below = 1 - np.exp(-found.contact * float(_taken(np.ones((1, 1), np.float32)).max()))
    strength = float(np.clip(max(darkest, below) / DARKEST, 0, 1))
    contact = float(np.clip(below / max(strength * DARKEST, 1e-6), 0, 1))
    return replace(found.shadow, strength=strength, contact=contact)
