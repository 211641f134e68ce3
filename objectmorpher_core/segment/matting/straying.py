"""Where a mask's edge is farther off than it is thought to be.

An outline lies beside the edge: pieces of a photo may hold ground as well, ripples about a head, or
grass between two legs. The outline is moved to the edge where colours and the edge itself speak
for it (`settle_outline`).

Or there is no line: a selection goes around hair, fur and manes in one, and takes in what shows
between and beside the strands.
Alpha is solved for once more on a small picture, with the edge free to be anywhere in a wide band.
That leaks as well into a white sleeve before a white wall; so it is believed only where colours
alone say the same, those of the object well inside that band and of the background well outside,
and where the mask's outline lies on no edge of the picture; within such an edge all is the
object's (`strays`). But for gaps between strands that reach that edge: what is there is unlike all
of the object, like the background, a mixture of both, not the same from strand to strand, and not
deep inside.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from scipy.spatial import KDTree

from ...base.arrays import F32, RGB, Mask, Pixels
from ...base.masks import dilated
from ...base.threads import in_threads
from ..selection import box_around
from .closed_form import Expected, solve_alpha
from .edges import core, sharpen_band
from .soft_edge import WHOLE, WHOLE_PICTURE, CropSize, clearness_of, signed_distance, whole_band

STRAY = 3.0  # x band: how far an edge may be off where hair is
CHANGED = 0.1  # alpha, by which the two are at odds
AGREED = 0.1  # how surely, in the mean, colours must say the same
CLEAR = 6.0  # variances that colours are apart, at least: before a busy ground none is sure
EDGES = 0.35, 0.7  # x the way from background to object: a step that is no edge, and that is one
BESIDE = 0.5, 3.0  # x band from the outline: where that step is looked for
GATHERED, DEEP = 2.0, 8.0  # x band: over so much, deviation; and well inside
KNOWN = 3.0  # x the wide reach: so far colours are gathered that are of one side
NEAR = 0.04  # sRGB for one wide reach: how much rather a colour is looked for nearby
MOST = 2000  # colours of each side
NEIGHBOURS = 3
ALIKE = 0.02  # sRGB: a colour so far from one that is known may be of it
LEAST = 11.0  # x band^2: area of what must have changed to be looked at
FAINT, SEEN_THROUGH = 0.05, 0.3  # alpha that a gap lacks: in each place, and in the mean
FOREIGN, GROUND = 0.1, 0.25  # sRGB, by which a gap is unlike the object, and like the background
UNMIXED = 0.07  # sRGB, by which a gap in the mean is no mixture of both
NEAR_EDGE = 3.3  # x band: how deep inside the outline it is in the mean, at most
FINE = 0.115  # alpha, by which it changes over a band's width between strands, in the mean
AROUND = 2.0  # x band: looked at with it


def strays(pixels: Pixels, mask: Mask, band: float, reach: float) -> Mask | None:
    """Where (h, w) the edge of `mask` in a crop (h, w, 3) is to be looked for in `STRAY` x `reach`.

    `band` and `reach`: see `find_alpha`. None where there is no such place.
    """
    size = CropSize.of(pixels, mask, np.zeros_like(mask), STRAY * band)
    times = 1
    while size.band > WHOLE and min(size.mask.shape) > 32:
        size, times = size.half(), 2 * times
    band, reach = band / times, STRAY * reach / times
    distance, rgb = signed_distance(size.mask), size.rgb(WHOLE_PICTURE)
    is_clear = clearness_of(rgb, distance, reach) > CLEAR
    if not (is_clear & (np.abs(distance) < reach)).any():
        return None
    outline = _Outline(rgb, distance, band, reach)
    change = whole_band(size, reach, None) - size.mask
    change[np.abs(distance) < band] = 0
    found = _beside_hair(outline, change, is_clear) | _gaps(outline, change, is_clear)
    if not found.any():
        return None
    wide = 2 * round(AROUND * band) + 1
    found = cv2.dilate(found.view(np.uint8), np.ones((wide, wide), np.uint8))
    height, width = mask.shape
    return np.repeat(np.repeat(found, times, 0), times, 1)[:height, :width] > 0


class _Outline(NamedTuple):
    """A picture with the outline of a mask."""

    rgb: F32  # (h, w, 3)
    distance: F32  # (h, w) px within it
    band: float
    reach: float  # px: how far from it alpha is solved for

    @property
    def sides(self) -> tuple[Mask, Mask]:
        """(h, w) what is surely the object's and the background's, near by."""
        far = KNOWN * self.reach
        inside, outside = self.distance, -self.distance
        return (inside > self.reach) & (inside < far), (outside > self.reach) & (outside < far)


def _beside_hair(outline: _Outline, change: F32, is_clear: Mask) -> Mask:
    """(h, w) where the mask lies on no edge, and colours say that alpha does `change` (h, w)."""
    rgb, distance, band, reach = outline
    change = np.where(np.abs(change) < CHANGED, 0, change)
    if np.abs(change).sum() < LEAST * band**2:
        return np.zeros(change.shape, np.bool_)
    step = _step(rgb, distance, band, reach)
    is_open = (step < EDGES[0]) & is_clear
    own = (step > EDGES[1]) & (distance > BESIDE[0] * band) & (distance < BESIDE[1] * band)
    sure = 2 * _likeness(outline, change != 0, own) - 1
    change[(change > 0) & (sure < 0)] = 0  # a hair before the background is more like that
    share, total = (
        cv2.GaussianBlur(part, (0, 0), GATHERED * band) for part in (sure * change, abs(change))
    )
    found = is_open & (share > AGREED * total) & (total > 0.01)
    return _large(found, np.abs(change), LEAST * band**2)


def _gaps(outline: _Outline, change: F32, is_clear: Mask) -> Mask:
    """(h, w) where the background shows between strands, so that alpha does `change` (h, w)."""
    least, over = LEAST * outline.band**2, GATHERED * outline.band
    is_gap = is_clear & (outline.distance < outline.reach) & (change < -FAINT)
    lost = np.where(is_gap, -change, 0).astype(np.float32)
    found = np.zeros(lost.shape, np.bool_)
    apart = _apart(outline, is_gap, outline.sides) if lost.sum() >= least else None
    if apart is None:
        return found

    wide = (outline.distance > 0) + change
    fine = np.abs(wide - cv2.GaussianBlur(wide, (0, 0), outline.band))[is_gap]

    def mean(values: F32 | float) -> F32:
        weighed = np.zeros(lost.shape, np.float32)
        weighed[is_gap] = values * lost[is_gap]
        return np.asarray(cv2.GaussianBlur(weighed, (0, 0), over), np.float32)[is_gap]

    total = np.maximum(mean(1.0), 1e-6)
    foreign, ground, through = (mean(values) / total for values in (*apart.far, lost[is_gap]))
    found[is_gap] = (foreign > FOREIGN) & (ground < GROUND) & (through > SEEN_THROUGH)
    near = dilated(found, int(outline.band)).view(np.uint8)
    _, joined = cv2.connectedComponents(near)
    pieces, share = np.asarray(joined, np.int32)[is_gap], lost[is_gap]
    pieces = np.where(found[is_gap], pieces, 0)
    deep = outline.distance[is_gap] / outline.band
    all_in, *sums = (np.bincount(pieces, share * v) for v in (1.0, fine, apart.unmixed, deep))
    varied, unmixed, away = (part / np.maximum(all_in, 1e-6) for part in sums)
    is_strands = (all_in >= least) & (varied > FINE) & (unmixed < UNMIXED) & (away < NEAR_EDGE)
    found[is_gap] = is_strands[pieces] & (pieces > 0)
    return found


def _likeness(outline: _Outline, where: Mask, own: Mask) -> F32:
    """(h, w) alpha by the colours alone `where` asked; one half where they do not tell.

    What is `own` (h, w) is the object's, and so is what is `reach` px within the mask's outline.
    """
    likely = np.full(where.shape, 0.5, np.float32)
    inside, outside = outline.sides
    apart = _apart(outline, where, (inside | own, outside))
    if apart is not None:
        near, off = (apart.far + ALIKE) ** 2
        likely[where] = off / (near + off)
    return likely


class _Apart(NamedTuple):
    """Colours of a picture beside those nearby of the object and of the background."""

    far: F32  # (2, n) from each
    unmixed: F32  # (n,) from all mixtures of both


def _apart(outline: _Outline, where: Mask, sides: tuple[Mask, Mask]) -> _Apart | None:
    """How far the colours `where` (h, w) are from those of each of the `sides` (h, w).

    None where too few are known of one.
    """
    rgb, distance, _, reach = outline
    place = np.indices(distance.shape, dtype=np.float32).transpose(1, 2, 0) * (NEAR / reach)
    features = np.concatenate([rgb, place], -1)
    asked = features[where]
    far = np.empty((2, len(asked)), np.float32)
    alike = np.empty((2, len(asked), 3), np.float32)
    for side, there in enumerate(sides):
        known = features[there]
        if len(known) < NEIGHBOURS:
            return None
        known = known[:: -(-len(known) // MOST)]
        tree = KDTree(known)

        def look(
            first: int, last: int, tree: KDTree = tree, side: int = side, known: F32 = known
        ) -> None:
            found, which = tree.query(asked[first:last], k=NEIGHBOURS)
            far[side, first:last] = found[:, -1]
            alike[side, first:last] = known[np.asarray(which)[:, -1], :3]

        in_threads(look, len(asked))
    line, own = alike[0] - alike[1], asked[:, :3] - alike[1]
    share = (own * line).sum(1) / np.maximum((line * line).sum(1), 1e-4)
    off = own - share.clip(0, 1)[:, None] * line
    return _Apart(far, np.asarray(np.linalg.norm(off, axis=1), np.float32))


def _step(rgb: F32, distance: F32, band: float, reach: float) -> F32:
    """(h, w) how far the colours (h, w, 3) on both sides of the outline nearby are apart.

    1 is as far as those of the object well inside are from the background's.
    """
    near, far = (k * band for k in BESIDE)
    outside = _mean(rgb, (distance < -near) & (distance > -far), GATHERED * band)
    inside = _mean(rgb, (distance > near) & (distance < far), GATHERED * band)
    deep = _mean(rgb, distance > reach, DEEP * band)
    step, apart = (np.linalg.norm(outside - other, axis=2) for other in (inside, deep))
    return np.asarray(step / np.maximum(apart, 1e-3), np.float32)


def _mean(rgb: F32, where: Mask, over: float) -> F32:
    """(h, w, 3) the colours near by of what is `where` (h, w)."""
    there = where.astype(np.float32)[..., None]
    total = cv2.GaussianBlur(there, (0, 0), over)[..., None]
    mean = cv2.GaussianBlur(rgb * there, (0, 0), over) / np.maximum(total, 1e-4)
    return np.asarray(mean, np.float32)


def _large(found: Mask, change: F32, least: float) -> Mask:
    """The pieces of `found` (h, w) in which `change` (h, w) sums up to `least`."""
    count, pieces = cv2.connectedComponents(found.view(np.uint8), connectivity=8)
    total = np.bincount(pieces.ravel(), weights=change.ravel(), minlength=count)
    total[0] = 0
    return (total >= least)[np.asarray(pieces, np.int32)]


LOOKED = 200.0  # px: the root of the object's area, to which a larger picture of it is reduced
OFF, SEEN = 0.08, 0.35  # x that root: how far its outline may be off; what is seen around it
LIMB = 0.45  # x depth of the middle of a thin thing: deeper is surely inside
OUTLINE, OUTLINE_ROUNDS = 3e-4, 150  # weight of the outline as it is; rounds of the solver
SMALLEST = 8e-4  # x the object's area, of what is moved to the other side
OTHER = 0.62  # how likely, in the mean, its colours are the other side's
CLEARER = 1.4  # x the contrast of the edge on which the outline was
BESIDE_PIECE = 2.0  # x how far the outline may be off: so far away colours are compared
FEW, ENOUGH = 20, 1500  # px of a side: fewer say nothing, more are not looked at
PLACE = 0.15  # of CIELAB / 100 for that whole way: how much rather a colour is looked for nearby
EVEN = 1.0  # px, over which contrast is measured


class _Side(NamedTuple):
    """What is moved to the other side of the outline, in a window of the picture."""

    piece: Mask  # (h, w)
    is_lost: bool  # to the background
    object: Mask  # (h, w) what is the object's before and after
    ground: Mask  # (h, w) what is not


def settle_outline(rgb: RGB, mask: Mask, kept: Mask | None = None) -> Mask:
    """A mask (H, W) of a picture (H, W, 3), its outline on the edge where it lay beside it.

    Wide-band matting (Levin et al. 2008) says where else the outline may be. What lies between goes
    to the other side if its colours are more like those there, near by, and if the outline lies
    on a clearer edge then. Nothing is changed that has a px in common with `kept` (H, W).
    """
    root = float(np.sqrt(np.count_nonzero(mask)))
    around = box_around(mask, SEEN * root)
    if around is None or mask.all():
        return mask
    own, scale = mask[around], min(LOOKED / root, 1.0)
    size = (max(round(own.shape[1] * scale), 3), max(round(own.shape[0] * scale), 3))
    small = np.asarray(cv2.resize(rgb[around], size, interpolation=cv2.INTER_AREA), np.uint8)
    moved = np.zeros_like(own)
    for piece in _beside_edge(small, _sized(own, size), OFF * root * scale):
        there = _sized(piece, own.shape[::-1])
        if kept is None or not (there & kept[around]).any():
            moved |= there
    if not moved.any():
        return mask
    settled, near = mask.copy(), np.zeros_like(mask)
    settled[around] ^= moved
    near[around] = dilated(moved, round(1 / scale) + 1)
    return sharpen_band(rgb, settled, near)


def _sized(mask: Mask, size: tuple[int, ...]) -> Mask:
    """A mask (H, W) at another size (width, height)."""
    how = cv2.INTER_AREA if size[0] < mask.shape[1] else cv2.INTER_LINEAR
    return cv2.resize(mask.astype(np.float32), (size[0], size[1]), interpolation=how) > 0.5


def _beside_edge(rgb: RGB, mask: Mask, off: float) -> list[Mask]:
    """The pieces (h, w) between a mask's outline and the edge, at most `off` px away."""
    picture = rgb.astype(np.float32) / np.float32(255)
    found = _wide(picture, mask, off)
    lab = np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2LAB), np.float32) / np.float32(100)
    contrast, far = _contrast(lab), max(int(BESIDE_PIECE * off), 1)
    differs = cv2.morphologyEx(
        (found != mask).astype(np.uint8), cv2.MORPH_OPEN, np.ones((2, 2), np.uint8)
    )
    _, labels, stats, _ = cv2.connectedComponentsWithStats(differs, connectivity=4)
    large = stats[:, cv2.CC_STAT_AREA] >= SMALLEST * np.count_nonzero(mask)
    pieces = []
    for k in np.flatnonzero(large[1:]) + 1:
        x, y, width, height = (int(v) for v in stats[k, :4])
        window = np.s_[max(y - far, 0) : y + height + far, max(x - far, 0) : x + width + far]
        piece = labels[window] == k
        near = dilated(piece, far) & ~piece & (mask[window] == found[window])
        is_lost = bool(mask[window][piece][0])
        side = _Side(piece, is_lost, near & mask[window], near & ~mask[window])
        if _is_clearer(contrast[window], side) and _is_others(lab[window], side, far):
            pieces.append(labels == k)
    return pieces


def _wide(picture: F32, mask: Mask, off: float) -> Mask:
    """(h, w) where the matte of a band of `off` px about a mask's outline is above half."""
    unknown = ~(core(mask, off, LIMB) | core(~mask, off, LIMB))
    known = mask.astype(np.float32)
    start = np.where(unknown, cv2.GaussianBlur(known, (0, 0), off / 2), known)
    expected = Expected(known, np.full(mask.shape, OUTLINE, np.float32))
    alpha = solve_alpha(picture, unknown, expected, start.astype(np.float32), OUTLINE_ROUNDS)
    return np.asarray(alpha > 0.5, np.bool_)


def _contrast(lab: F32) -> F32:
    """(h, w) the slope of the colours (h, w, 3)."""
    even = cv2.GaussianBlur(lab, (0, 0), EVEN)
    across, down = (cv2.Sobel(even, cv2.CV_32F, *way) for way in ((1, 0), (0, 1)))
    return np.asarray(np.sqrt((across**2 + down**2).sum(-1)), np.float32)


def _is_clearer(contrast: F32, side: _Side) -> bool:
    """Whether the outline beyond what is moved has more `contrast` (h, w) than before it."""
    ring = dilated(side.piece, 1)
    old, new = (side.ground, side.object) if side.is_lost else (side.object, side.ground)
    before, after = (dilated(ring & beyond, 1) for beyond in (old, new))
    if not after.any():
        return False
    usual = float(contrast[before].mean()) if before.any() else 0.0
    return bool(contrast[after].mean() > CLEARER * usual)


def _is_others(lab: F32, side: _Side, far: int) -> bool:
    """Whether what is moved looks like the side that it goes to."""
    if min(np.count_nonzero(side.object), np.count_nonzero(side.ground)) < FEW:
        return False
    place = np.indices(side.piece.shape, dtype=np.float32).transpose(1, 2, 0) * (PLACE / far)
    features = np.concatenate([lab, place], -1)
    asked, apart = features[side.piece], []
    for there in (side.object, side.ground):
        known = features[there]
        found, _ = KDTree(known[:: -(-len(known) // ENOUGH)]).query(asked, k=NEIGHBOURS)
        apart.append((found[:, -1] + ALIKE) ** 2)
    likely = apart[0] / (apart[0] + apart[1])
    return bool((likely if side.is_lost else 1 - likely).mean() > OTHER)
