"""The shadow that an object throws in the photo: where it is, and numbers of one that is alike.

Shadows of the object's own silhouette (`shadow`) are tried in all directions and lengths, each
together with a smooth ground, against the logarithm of the brightness around the object. What
explains it best, by a robust regression (Huber's loss, iteratively reweighted; Holland and Welsch
1977), is the shadow, if enough speaks for it. Its numbers are those of a shadow that looks like it,
for where the object goes.

A shadow begins where the object touches the ground, ends at an edge all around, takes light of
all colours alike, is darker than what else is beside the object, and the photo is explained by it
better than by none. Each of these is a number. A small network looks at the same surroundings
(`shadow_look`): where it sees shade says which of the shadows that were tried it is, and how sure
it is counts most. The weighted sum of all must exceed a margin. The weights are those of logistic
regressions on half of the scenes of tests/shadow_scenes.py; docs/compositing shows how often it is
right on the other half.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask, Pixels, unit_pixels
from ...base.masks import box_of, disc
from ...document.model import Matte
from ...document.settings import MOST_SHADOW, Shadow
from .old_shadow import BLACK, OldShadow, edge_blur
from .shadow import DARKEST, FLAT_HEIGHT, FROM_ABOVE, GAMMA, softness_of
from .shadow_look import CELLS, SeenShadow, look_for_shadow
from .shadow_shear import Flat, ShadowSheet, lie, stand

# Linear regression that outliers do not spoil (Huber's loss, iteratively reweighted).
#
# Holland and Welsch 1977, "Robust Regression Using Iteratively Reweighted Least-Squares".

ROUNDS = 5
HUBER = 1.3  # x the scale of what is usual
LEAST_SCALE = 0.02


def regressed(
    basis: F64, values: F64, weight: F64, scale: float | None = None
) -> tuple[F64, float, float]:
    """Coefficients, mean loss and scale of the robust fit of `values` (n,) by a basis (n, k)."""
    weights, found, used = weight, np.zeros(basis.shape[1]), 0.0
    rest = values
    for _ in range(ROUNDS):
        weighted = basis * weights[:, None]
        ridge = 1e-6 * len(values) * np.eye(basis.shape[1])
        found = np.linalg.solve(weighted.T @ basis + ridge, weighted.T @ values)
        rest = values - basis @ found
        used = 1.4826 * float(np.median(np.abs(rest))) + LEAST_SCALE
        weights = weight / np.maximum(np.abs(rest) / (HUBER * used), 1)
    off = np.abs(rest) / (used if scale is None else scale)
    loss = np.where(off < HUBER, off * off / 2, HUBER * off - HUBER**2 / 2)
    return np.asarray(found, np.float64), float((weight * loss).sum() / weight.sum()), used


FULL = 0.75  # of the light, that a full shadow is taken to leave out
CORE = 0.3  # of the darkest that was fitted: what is darker is the shadow's core
LIT = 0.1  # of it: what is lighter is lit ground
OVER = 2.0  # cells, over which the ground's own texture is evened
SIDE = 4.0  # cells, over which the two sides of an edge are compared
WIDE = 5.0  # cells from an edge that belong to its sides
FOOT = 0.2  # x the object's height, around the line on which it stands
TOUCHING = 4.0  # cells from the object
VICINITY = 25.0  # cells from it, where other dark things count
AS_DARK = 0.4  # x the shadow: what is darker beside it is as dark
LEAST_OTHERS = 0.02  # of what is beside it
WEIGHTS = {
    "gain": 2.62, "others": -1.47, "joined": 1.79, "whole": 1.97, "tint": -1.08, "behind": 2.77,
}  # fmt: skip
BIAS = -4.81
CERTAIN = 5.0  # of that sum, which is enough by itself: none of 437 scenes without a shadow has it
SHADED = (0.05, 0.25)  # natural logarithm of light that was fitted, over which it becomes a shade
MOST_TINT = 0.6  # x its darkness: what changes colours by more is another material
SURE = 1.8  # log odds: 2 of 263 scenes without a shadow have a higher score, of others 1 of 295
LIKELY = 1.0  # those where somebody has asked for the shadow, sees it outlined, and can refuse


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The object's surroundings on a small grid."""

    brightness: F32  # (h, w) natural logarithm of linear light
    colour: F32  # (h, w, 2) logarithms of ratios
    cover: F32  # (h, w) of the object
    free: Mask  # (h, w) ground, or whatever else is not the object
    standing: ShadowSheet | Flat
    left: float
    top: float
    pitch: float


@dataclass(frozen=True, eq=False)
class ShadowGround:
    """The ground around an object, and its variation without a shadow."""

    index: np.ndarray  # (n,) of the cells
    weight: F64  # (n,)
    basis: F64  # (n, 6)
    everywhere: F64  # (h, w, 6) the same of all cells
    brightness: F64  # (n,)
    contact: F64  # (n,) natural logarithm of the light that a contact takes
    alone: F64  # (6,) its brightness where there is no shadow
    loss: float
    scale: float  # of what is not explained


@dataclass(frozen=True, eq=False)
class TriedShadow:
    """A shadow that was tried."""

    shadow: Shadow
    gain: float  # of the loss
    thrown: F32  # (h, w) natural logarithm of the light that it takes at strength 1
    ground: F64  # (6,)
    dark: float  # how much of it there is
    contact: float
    scale: float  # of what is not explained


def taken(shadow: F32) -> F32:
    """Natural logarithm of the light that a shadow of opacity (h, w) takes."""
    return np.asarray(-np.log(1 - FULL * np.clip(shadow, 0, 1)), np.float32)


def fitted(seen: Surroundings, found: TriedShadow) -> F32:
    """(h, w) natural logarithm of the light that the shadow takes which was found."""
    contact = taken(seen.standing.contact())
    return np.asarray(found.dark * found.thrown + found.contact * contact, np.float32)


def score(
    seen: Surroundings, ground: ShadowGround, found: TriedShadow, looked: SeenShadow
) -> float:
    """Return the evidence for the shadow against other dark things (see SURE); -inf for none."""
    numbers = evidence(seen, ground, found)
    if numbers["tint"] > MOST_TINT:
        return -np.inf
    fit = sum(weight * numbers[name] for name, weight in WEIGHTS.items()) + BIAS
    return max(looked.odds, SURE + fit - CERTAIN)


def overlap(seen: Surroundings, found: TriedShadow, looked: SeenShadow) -> float:
    """Return the intersection over union of the fitted shade and the one that the network sees."""
    low, high = SHADED
    shade = np.clip((fitted(seen, found) - low) / (high - low), 0, 1) * seen.free
    other = looked.shade * seen.free
    both, either = float(np.minimum(shade, other).sum()), float(np.maximum(shade, other).sum())
    return both / max(either, 1e-3)


def evidence(seen: Surroundings, ground: ShadowGround, found: TriedShadow) -> dict[str, float]:
    """Return the evidence for the shadow by the names of WEIGHTS."""
    thrown = fitted(seen, found)
    lacking = (ground.everywhere @ found.ground).astype(np.float32) - seen.brightness
    unlike = seen.brightness - (ground.everywhere @ ground.alone).astype(np.float32)
    even, told, without = (_evened(v, seen.free) for v in (lacking, thrown, unlike))
    weight = np.zeros(seen.cover.size)
    weight[ground.index] = ground.weight
    weight = weight.reshape(seen.cover.shape)
    asked = weight > 0
    most = float(thrown[asked].max())
    away = cv2.distanceTransform((seen.cover < 0.5).astype(np.uint8), cv2.DIST_L2, 5)
    beside = asked & (thrown < LIT * most) & (away < VICINITY)
    others = float((even[beside] > AS_DARK * most).mean()) if beside.any() else 1.0
    near = asked & (thrown > CORE * most) & (away < TOUCHING)
    rest = float((weight * np.abs(even - told)).sum())
    is_flat = isinstance(seen.standing, Flat)
    return {
        "gain": float(np.log((weight * np.abs(without)).sum() / max(rest, 1e-6))),
        "others": float(np.log(others + LEAST_OTHERS)),
        "joined": _joined(seen, even, told, near),
        "whole": _whole(lacking, thrown, asked, most),
        "tint": min(_tint(seen, ground, found), 1.5),
        "behind": 0.0 if is_flat else min(float(np.sin(np.radians(found.shadow.direction))), 0.0),
    }


def _evened(values: F32, free: Mask) -> F32:
    """(h, w) means over some cells of what is seen."""
    weight = free.astype(np.float32)
    spread = np.maximum(cv2.GaussianBlur(weight, (0, 0), OVER), 0.05)
    return np.asarray(cv2.GaussianBlur(values * weight, (0, 0), OVER) / spread, np.float32)


def _joined(seen: Surroundings, even: F32, told: F32, near: Mask) -> float:
    """The share of where the object touches the ground, in shadow, that is dark indeed."""
    standing = seen.standing
    if isinstance(standing, ShadowSheet):
        rows = np.arange(len(near))[:, None] + 0.5
        near = near & (np.abs(rows - standing.ground) < FOOT * standing.height)
    return float((even[near] > 0.5 * told[near]).mean()) if near.any() else 0.0


def _whole(lacking: F32, thrown: F32, asked: Mask, most: float) -> float:
    """The share of the shadow's edge at which the photo has a step of light, too."""
    is_shade = thrown > 0.5 * most
    inside, outside = (
        cv2.distanceTransform(part.astype(np.uint8), cv2.DIST_L2, 5)
        for part in (is_shade, ~is_shade)
    )
    is_lit = ~is_shade & (thrown < AS_DARK * most)
    sides = asked & is_shade & (inside < WIDE), asked & is_lit & (outside < WIDE)
    weights = [cv2.GaussianBlur(side.astype(np.float32), (0, 0), SIDE) for side in sides]
    edge = ~is_shade & (outside < 1.5) & (weights[0] > 0.03) & (weights[1] > 0.03)
    if not edge.any():
        return 0.0
    steps = []
    for values in (lacking, thrown):
        inner, outer = (
            cv2.GaussianBlur(values * side, (0, 0), SIDE)[edge] / weight[edge]
            for side, weight in zip(sides, weights, strict=True)
        )
        steps.append(inner - outer)
    return float((steps[0] > AS_DARK * steps[1]).mean())


def _tint(seen: Surroundings, ground: ShadowGround, found: TriedShadow) -> float:
    """How much it changes colours, x its darkness: another material begins with another colour."""
    column = found.thrown.ravel()[ground.index].astype(np.float64)
    basis = np.column_stack([ground.basis, -column])
    channels = seen.colour.reshape(-1, 2)[ground.index].T.astype(np.float64)
    changes = [abs(float(regressed(basis, c, ground.weight)[0][6])) for c in channels]
    return max(changes) / max(found.dark, 1e-6)


SHEET_GROUND = 30.0  # degrees: a silhouette alone shows no ground
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
LEAST_FLAT = 0.4  # of the loss without a shadow, that such a one must explain
SOFTNESS = 0.35
FINER = ((10.0, 1.3), (5.0, 1.15))  # degrees, and factor of the length
SOFTER = 0.2
CUT_OFF = 0.15  # x its width, along the photo's lower edge
MOST_COLOUR = (0.4, 3.0)  # natural logarithm, and x what is usual, by which ground may differ
SHOWS = 0.08  # of linear light: darker ground has no colour to speak of
DARKER = 0.12  # natural logarithm, from which a cell counts as dark
LEAST_CELLS = 200
MEASURED = 0.7  # least share of what is measured in what is taken off; the rest was fitted
EDGE = (0.02, 0.1)  # natural logarithm of what was fitted, over which what is measured counts
REACH = 2.0  # cells beyond that
SMOOTH = (1.0, 4.0)  # cells, and for each unit of noise: over which the dark is measured
USUAL = 2.5  # x what is usual on lit ground
BRIGHTEST = 90  # percentile of lit ground: what it is at most where a shadow is taken off
GROWN = 2  # times
MOST_GROWN = 2.5  # x its area before
LEAST_LEFT = 0.2  # of the ground, that is lit
DEEPEST = 2.5  # natural logarithm of light that is ever given back


def find_old_shadow(
    pixels: Pixels,
    matte: Matte,
    others: Mask | None = None,
    seen_from: float | None = None,
    margin: float = SURE,
) -> OldShadow | None:
    """The shadow of what was cut out of the photo `pixels` (H, W, 3); None where none is sure.

    `others` (H, W): what else hides the ground. `seen_from`: how many degrees above it one looks
    from; None where nobody knows: then it is SHEET_GROUND, and the shadow found says so.
    `margin`: how much must speak for it, see `score`.
    """
    if not (matte.alpha > 0.5).any() or _leaves_below(pixels, matte):
        return None
    slope = float(np.sin(np.radians(SHEET_GROUND if seen_from is None else seen_from)))
    try:
        seen = surroundings(pixels, matte, others, slope)
    except ValueError:  # it is thinner than what is looked at
        return None
    looked = look_for_shadow(seen.brightness, seen.colour, seen.cover, seen.free)
    told = _told(seen, looked, LENGTHS, margin) if seen_from is None or seen_from < STEEP else None
    if seen_from is None or seen_from >= STEEP:
        flat = replace(seen, standing=lie(seen.cover))
        lying = _told(flat, looked, FLAT_LENGTHS, margin)
        least = max(LEAST_FLAT, 0.0 if told is None else told[1].gain)
        if lying is not None and lying[1].gain > least:
            seen, told = flat, lying
    if told is None:
        return None
    ground, found = told
    depth = _missing(seen, ground, found) * _of_one_colour(seen, ground, found)
    shadow = _imitated(found)
    if isinstance(seen.standing, Flat):
        length = min(FLAT_HEIGHT * shadow.length, MOST_SHADOW)
        shadow = replace(shadow, length=length, ground=FROM_ABOVE)
    elif seen_from is None:
        shadow = replace(shadow, ground=SHEET_GROUND)
    free = seen.free.astype(np.float32)
    old = OldShadow(shadow, depth, seen.left, seen.top, seen.pitch, ground.scale, free)
    if (blur := edge_blur(pixels, old)) is None:
        return old
    softness = softness_of(blur / (seen.standing.height * seen.pitch))
    return replace(old, shadow=replace(shadow, softness=softness))


def _told(
    seen: Surroundings, looked: SeenShadow, lengths: tuple[float, ...], margin: float
) -> tuple[ShadowGround, TriedShadow] | None:
    """The ground and the shadow on it; None where none is sure."""
    ground = _ground(seen)
    found = None if ground is None else _searched(seen, looked, ground, lengths)
    if ground is None or found is None:
        return None
    if isinstance(seen.standing, Flat):  # a large part of what one sees may lie in its shadow
        ground = replace(ground, scale=min(ground.scale, found.scale))
    if score(seen, ground, found, looked) <= margin:
        return None
    return ground, found


def _leaves_below(pixels: Pixels, matte: Matte) -> bool:
    """Whether the photo's lower edge cuts it off: then it stands on no ground that one sees."""
    solid = matte.alpha > 0.5
    last = len(pixels) - 1 - matte.top  # row of the matte
    if last >= len(solid):
        return False
    return bool(solid[max(last - 1, 0) : last + 1].any(0).sum() > CUT_OFF * solid.any(0).sum())


def surroundings(pixels: Pixels, matte: Matte, others: Mask | None, slope: float) -> Surroundings:
    """Look around what was cut out. Raises ValueError where it is thinner than a cell."""
    height, width = pixels.shape[:2]
    x0, y0, x1, y1 = box_of(matte.alpha > 0.5)
    size = x1 - x0, y1 - y0
    if min(size) == 0:
        raise ValueError("nothing of it is solid")
    pitch = max(max(size) / CELLS, 1.0)
    around = int(AROUND * max(size) / pitch)
    left, top = matte.left + x0 - around * pitch, matte.top + y0 - around * pitch
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
    return Surroundings(
        logarithm @ LUMA, colour, cover, free, stand(cover, slope), float(left), float(top), pitch
    )


def _ground(seen: Surroundings) -> ShadowGround | None:
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
    contact = taken(seen.standing.contact()).ravel()[index].astype(np.float64)
    brightness = brightness.astype(np.float64)
    alone, loss, scale = regressed(basis, brightness, weight)
    return ShadowGround(index, weight, basis, everywhere, brightness, contact, alone, loss, scale)


def _tried(seen: Surroundings, ground: ShadowGround, shadow: Shadow) -> TriedShadow | None:
    """None where it would be no shadow but a light."""
    thrown = taken(seen.standing.thrown(shadow))
    column = thrown.ravel()[ground.index].astype(np.float64)
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
    return TriedShadow(shadow, gain, thrown, found[:6], float(found[6]), float(found[7]), scale)


def _searched(
    seen: Surroundings, looked: SeenShadow, ground: ShadowGround, lengths: tuple[float, ...]
) -> TriedShadow | None:
    """The shadow that explains most where the network sees shade, then the best that is near it."""
    few = _thinned(ground, seen.cover.shape[1])
    tried = [_tried(seen, few, shadow) for shadow in _coarsely(lengths)]
    gained = [f for f in tried if f is not None]
    if not gained:
        return None
    best = max(gained, key=lambda f: f.gain + overlap(seen, f, looked))
    for step, factor in FINER:
        for shadow in _around(best.shadow, step, factor):
            other = _tried(seen, few, shadow)
            if other is not None and other.gain > best.gain:
                best = other
    return _tried(seen, ground, best.shadow)


def _thinned(ground: ShadowGround, columns: int) -> ShadowGround:
    """Every other cell of every other row: enough to compare shadows by."""
    row, column = np.divmod(ground.index, columns)
    kept = (row % 2 == 0) & (column % 2 == 0)
    parts = {
        name: getattr(ground, name)[kept]
        for name in ("index", "weight", "basis", "brightness", "contact")
    }
    few = replace(ground, **parts)
    return replace(few, loss=regressed(few.basis, few.brightness, few.weight)[1])


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


def _missing(seen: Surroundings, ground: ShadowGround, found: TriedShadow) -> F32:
    """(h, w) natural logarithm of the light that is missing: mostly as it is measured.

    What was tried is only about where the shadow is. It grows over all that is as dark beside it,
    and the ground is told once more from what is left.
    """
    thrown = fitted(seen, found)
    low, high = EDGE
    member = np.clip((thrown - low) / (high - low), 0, 1).astype(np.float32)
    coefficients, free = found.ground, seen.free.astype(np.float32)
    blur = SMOOTH[0] + SMOOTH[1] * ground.scale
    spread = cv2.GaussianBlur(free, (0, 0), blur)
    smooth = np.zeros_like(thrown)
    for _ in range(GROWN):
        measured = (ground.everywhere @ coefficients).astype(np.float32) - seen.brightness
        blurred = cv2.GaussianBlur(measured * free, (0, 0), blur)
        smooth = np.asarray(blurred / np.maximum(spread, 1e-3), np.float32)
        lit = smooth.ravel()[ground.index][member.ravel()[ground.index] < LIT]
        usual = 1.4826 * float(np.median(np.abs(lit))) if len(lit) else 0.0
        member = _spread(member, smooth, thrown, max(DARKER, USUAL * usual), seen.free)
        weight = ground.weight * (1 - member.ravel()[ground.index])
        if weight.sum() > LEAST_LEFT * ground.weight.sum():
            coefficients, *_ = regressed(ground.basis, ground.brightness, weight)
    share = max(1 - ground.scale, MEASURED) * np.clip(spread, 0, 1)
    depth = thrown + share * (np.clip(smooth, 0, DEEPEST) - thrown)
    depth = np.clip(depth, 0, np.minimum(_room(seen, ground, member, blur), DEEPEST)) * member
    depth[[0, -1]] = 0
    depth[:, [0, -1]] = 0
    return np.asarray(depth, np.float32)


def _of_one_colour(seen: Surroundings, ground: ShadowGround, found: TriedShadow) -> F32:
    """(h, w) in [0, 1] where it is as coloured as the ground around the shadow.

    What is not is another material, or stands upright on the ground: no shadow is taken off it.
    """
    lit = fitted(seen, found).ravel()[ground.index] < DARKER
    green = seen.brightness - seen.colour @ LUMA[[0, 2]]
    lightest = green + np.maximum(seen.colour.max(-1), 0)  # of the three, natural logarithm
    is_told = lightest > np.log(SHOWS)
    is_ground = np.ones(seen.cover.shape, np.uint8)
    if lit.sum() > LEAST_CELLS:
        basis = ground.basis[lit, :3]  # a plane: what is curved runs away where nothing is seen
        for channel in np.moveaxis(seen.colour, -1, 0):
            values = channel.ravel()[ground.index].astype(np.float64)
            usual, _, spread = regressed(basis, values[lit], ground.weight[lit])
            off = cv2.blur(np.abs(channel - ground.everywhere[..., :3] @ usual), (3, 3))
            is_other = is_told & (off > max(MOST_COLOUR[0], MOST_COLOUR[1] * spread))
            is_ground &= (~is_other).astype(np.uint8)
    opened = cv2.morphologyEx(is_ground, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    return np.asarray(cv2.GaussianBlur(opened.astype(np.float32), (0, 0), 0.7), np.float32)


def _room(seen: Surroundings, ground: ShadowGround, member: F32, blur: float) -> F32:
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


def _spread(member: F32, dark: F32, thrown: F32, least: float, free: Mask) -> F32:
    """(h, w) what belongs to the shadow: what is at least so dark and hangs together with it."""
    core = (thrown > CORE * thrown.max()) & (dark > least)
    _, labels = cv2.connectedComponents(((dark > least) & free).astype(np.uint8))
    own = np.isin(labels, np.setdiff1d(np.unique(labels[core & free]), [0]))
    if own.sum() > MOST_GROWN * (member > 0.5).sum():  # it has run out over something dark
        return member
    ramp = np.where(own, np.clip((dark - 0.5 * least) / (0.5 * least), 0, 1), 0)
    near = disc(int(np.ceil(REACH)))
    grown = cv2.dilate(np.maximum(ramp.astype(np.float32), member), near)
    return np.asarray(cv2.GaussianBlur(grown, (0, 0), REACH / 2), np.float32)


def _imitated(found: TriedShadow) -> Shadow:
    """The numbers of a shadow that takes as much light (see `shadow`).

    Its strength is that of what is thrown: a contact is continued beneath the object, where none
    of it is seen, and may be told far darker. All of the shadow would then be as dark.
    """
    darkest = 1 - np.exp(-found.dark * float(found.thrown.max()))
    below = 1 - np.exp(-found.contact * float(taken(np.ones((1, 1), np.float32)).max()))
    strength = float(np.clip(darkest / DARKEST, 0, 1))
    contact = float(np.clip(below / max(strength * DARKEST, 1e-6), 0, 1))
    return replace(found.shadow, strength=strength, contact=contact)
