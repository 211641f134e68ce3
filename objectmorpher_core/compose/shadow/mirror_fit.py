"""A fit of the strength and the exact place of an object's mirror image on the ground.

The ground's own texture is noise here. It is whitened, by scale and colour, as it is beside the
reflection; then the mirror image that explains most of what is seen is searched by least squares
(Gauss-Newton): how it leans, its height and place, its blur, and how fast it fades.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask, Pixels
from ...base.pixels import unit_pixels
from ...document.model import Matte
from .mirroring import KNOTS, Box, MirrorLine, knots, premultiplied
from .old_reflection import OldReflection, TakingOff
from .shadow import GAMMA

CELLS = 240  # along the object's longer side, about
LEVELS = 5  # bands, each of half the frequencies of the one before
WIDTH = 1.2  # px of a level, over which it is smoothed for the next
SEEN = 0.3  # of a cell's neighbours, that have to be seen
FREE = 0.02  # of a cell, that may be hidden
NOISE = 1.0 / 255  # linear light: what is less is grain
BLUR = 1.5  # cells, from where it is searched
STEPS = (0.2, 0.01, 0.3, 0.3, 0.15, 0.15)  # of each parameter, for its derivative
LARGEST = 4.0  # x those, a step of the search
DAMPING = 1e-3
SHORTER, TRIES = 0.35, 4  # a step that gains nothing
ITERATIONS = 15
COARSE_TO_FINE = (2, 1, 0)  # finest bands that are left out
ENOUGH = 1e-3  # x what is explained: gaining less is none
BLUR_RANGE = (0.2, 12.0)  # cells
FADES = (0.1, 5.0)  # x the height
STIFF = 0.1  # x what the data say: that the share fades evenly
EVEN = 1.0  # x that: that the ground's own light is what it takes
AGAIN = 4
CONTRASTS = np.linspace(0, 1, 11)
REACHES = (8.0, 16.0, 32.0, 64.0, 128.0)  # cells, over which the ground's colour is continued
WEAKER = 30.0  # x, each of those than the one before
LEAST = 0.004  # of the light: less is not seen
BESIDE = 0.15  # x the height, of ground whose contrast it should have
GRAIN = 1e-2  # of the usual energy
NEAR = 2.0  # cells: over so many it is told what is explained
LEFT_OVER = 99.5  # percentile of the bare ground's energy that is still usual
FULL = 0.99  # of the photo's range, from where light may be clipped


def fitted(
    pixels: Pixels, matte: Matte, free: tuple[Mask, Mask], start: MirrorLine, box: Box
) -> OldReflection | None:
    """`start` made exact; None where nothing is explained.

    `free` (h, w) of the box: where the ground is seen, and where it mirrors nothing for sure.
    """
    scene = _scene(pixels, matte, free, box)
    seen = scene.banded(scene.ground)
    found = _searched(scene, seen, replace(start, blur=BLUR * scene.pitch))
    if found is None:
        return None
    mirroring = _contrasted(scene, _ended(scene, seen, _shared(scene, seen, found)))
    for _ in range(AGAIN):  # now the ground is known better than from beside
        scene = replace(scene, smooth=_smoothed(scene, mirroring))
        mirroring = _contrasted(scene, _ended(scene, seen, _shared(scene, seen, found)))
    left, top = (float(v) for v in box[:2])
    cover, unexplained = _covers(scene, mirroring), _unexplained(scene, mirroring)
    known = TakingOff(mirroring, matte, scene.smooth, unexplained, left, top, scene.pitch)
    return OldReflection(cover, left, top, scene.pitch, known)


@dataclass(frozen=True, eq=False)
class _Scene:
    """Object and ground on a grid, in linear light."""

    ground: F32  # (h, w, 3)
    smooth: F32  # (h, w, 3) without texture, as it goes on from where it is bare
    free: F32  # (h, w) 1 where it is seen
    bare: F32  # (h, w) 1 where nothing is mirrored, either
    picture: F32  # (h', w', 4) the object's light x alpha, and alpha
    corner: tuple[float, float]  # photo px, of that
    box: Box  # photo px, of the ground's
    pitch: float
    white: tuple[F32, ...]  # (3, 3) for each band

    def bands(self, image: F32) -> list[F32]:
        """Return the whitened bands of (h, w, 3); 0 where the ground is not seen."""
        bands, free = [], self.free
        for white in self.white:
            weight = np.maximum(cv2.GaussianBlur(free, (0, 0), WIDTH), 1e-3)
            coarse = cv2.GaussianBlur(image * free[..., None], (0, 0), WIDTH) / weight[..., None]
            bands.append(((image - coarse) @ white) * free[..., None])
            image = np.asarray(coarse[::2, ::2], np.float32)
            free = (weight[::2, ::2] > SEEN).astype(np.float32)
        return bands

    def banded(self, image: F32) -> F32:
        """(n,) all bands of (h, w, 3)."""
        return np.concatenate([band.ravel() for band in self.bands(image)])

    def added(self, mirroring: MirrorLine) -> tuple[F32, F32, F32]:
        """Return the light (h, w, 3) that a share of 1 adds, its alpha, and px below the line."""
        laid = mirroring.laid(self.picture, self.corner, self.box, self.pitch)
        alpha, below = laid[..., 3], mirroring.below(self.box, self.pitch)
        added = np.asarray(laid[..., :3] - alpha[..., None] * self.smooth, np.float32)
        return added, alpha, below


def _scene(pixels: Pixels, matte: Matte, free: tuple[Mask, Mask], box: Box) -> _Scene:
    x0, y0, x1, y1 = box
    pitch = grid_pitch(matte)
    size = (round((x1 - x0) / pitch), round((y1 - y0) / pitch))

    def small(image: np.ndarray) -> F32:
        image = image.astype(np.float32)
        return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.float32)

    part = pixels[y0:y1, x0:x1]
    channels = [unit_pixels(part[..., n]) ** np.float32(GAMMA) for n in range(3)]
    ground = np.dstack([small(channel) for channel in channels])
    seen, bare = ((small(where) > 1 - FREE).astype(np.float32) for where in free)
    picture = premultiplied(matte, pitch)
    alike = (np.eye(3, dtype=np.float32),) * LEVELS
    scene = _Scene(
        ground, _continued(ground, bare), seen, bare, picture, (matte.left, matte.top), box, pitch,
        alike,
    )  # fmt: skip
    return replace(scene, white=tuple(_whitening(scene)))


def grid_pitch(matte: Matte) -> float:
    """Photo px per cell of the grid on which an object's mirror image is fitted."""
    solid = matte.alpha > 0.5
    longer = max(int(np.ptp(np.flatnonzero(solid.any(axis)))) + 1 for axis in (0, 1))
    return max(longer / CELLS, 1.0)


def _whitening(scene: _Scene) -> list[F32]:
    """(3, 3) for each band, so that the bare ground's has unit covariance."""
    whites, bare = [], scene.bare
    for band in scene.bands(scene.ground):
        values = band[bare > 0].astype(np.float64)
        covariance = values.T @ values / max(len(values), 1) + NOISE**2 * np.eye(3)
        whites.append(np.linalg.inv(np.linalg.cholesky(covariance)).T.astype(np.float32))
        bare = bare[::2, ::2]
    return whites


def _continued(ground: F32, bare: F32) -> F32:
    """(h, w, 3) the ground's colour where it is bare, smoothly everywhere."""
    total, mean = np.zeros_like(bare), np.zeros_like(ground)
    for n, sigma in enumerate(REACHES):
        share = WEAKER**-n
        total += share * cv2.GaussianBlur(bare, (0, 0), sigma)
        mean += share * cv2.GaussianBlur(ground * bare[..., None], (0, 0), sigma)
    return np.asarray(mean / np.maximum(total, 1e-12)[..., None], np.float32)


def _searched(scene: _Scene, seen: F32, start: MirrorLine) -> MirrorLine | None:
    """The mirror image near `start` that explains most; None where none explains anything."""
    here = start
    for skipped in COARSE_TO_FINE:
        here = _climbed(scene, seen, here, skipped)
    added, _, below = scene.added(here)
    is_seen = scene.banded(added * here.faded(below)[..., None]) @ seen > 0
    return here if is_seen else None


def _climbed(scene: _Scene, seen: F32, start: MirrorLine, skipped: int) -> MirrorLine:
    """The same without the `skipped` finest bands."""
    first = sum(3 * scene.free[:: 2**n, :: 2**n].size for n in range(skipped))
    data = seen[first:]

    def column(mirroring: MirrorLine) -> F32:
        added, _, below = scene.added(mirroring)
        return scene.banded(added * mirroring.faded(below)[..., None])[first:]

    def explained(column: F32) -> float:
        return float(max(column @ data, 0) ** 2 / max(column @ column, 1e-9))

    steps = np.array(STEPS)
    steps[2:4] *= scene.pitch
    here, own = start, column(start)
    for _ in range(ITERATIONS):
        nearby = [column(_moved(here, step, scene.pitch)) - own for step in np.diag(steps)]
        change, most = _change(np.stack([own, *nearby]), data), explained(own)
        for _ in range(TRIES):
            there = _moved(here, change * steps, scene.pitch)
            other = column(there)
            if explained(other) > most:
                here, own = there, other
                break
            change *= SHORTER
        if explained(own) < (1 + ENOUGH) * most:
            break
    return here


def _change(columns: F32, seen: F32) -> F64:
    """How far to go, in steps: what is seen, as the image and its derivatives explain it."""
    square, product = (columns @ columns.T).astype(np.float64), columns @ seen
    square += np.diag(DAMPING * np.diag(square) + 1e-9)
    solved = np.linalg.solve(square, product)
    if solved[0] <= 0:
        return np.zeros(len(solved) - 1)
    return np.clip(solved[1:] / solved[0], -LARGEST, LARGEST)


def _moved(mirroring: MirrorLine, change: F64, pitch: float) -> MirrorLine:
    tilt, scale, aside, down, blur, fade = change.tolist()
    blurs, fades = np.array(BLUR_RANGE) * pitch, np.array(FADES) * mirroring.height
    return replace(
        mirroring,
        tilt=mirroring.tilt + tilt,
        scale=mirroring.scale * float(np.exp(scale)),
        aside=mirroring.aside + aside,
        foot=(mirroring.foot[0], mirroring.foot[1] + down),
        blur=float(np.clip(mirroring.blur * np.exp(blur), blurs[0], blurs[1])),
        fade=float(np.clip(mirroring.fade * np.exp(fade), fades[0], fades[1])),
    )


def _shared(scene: _Scene, seen: F32, mirroring: MirrorLine) -> MirrorLine:
    """Its share along its height, and what light that takes besides the ground's."""
    added, alpha, below = scene.added(mirroring)
    faded, weights = mirroring.faded(below), knots(below, mirroring.height)
    shares = [added * (faded * weights[..., k])[..., None] for k in range(KNOTS)]
    colours = [(alpha * faded)[..., None] * -unit for unit in np.eye(3, dtype=np.float32)]
    columns = [scene.banded(np.asarray(image, np.float32)) for image in shares + colours]
    stacked = np.stack(columns)
    square, product = (stacked @ stacked.T).astype(np.float64), stacked @ seen
    own, bend = np.trace(square[:KNOTS, :KNOTS]) / KNOTS, np.diff(np.eye(KNOTS), axis=0)
    square[:KNOTS, :KNOTS] += STIFF * own * bend.T @ bend
    square[KNOTS:, KNOTS:] += EVEN * np.diag(np.diag(square)[KNOTS:])
    solved = np.linalg.solve(square + 1e-9 * max(own, 1e-9) * np.eye(len(square)), product)
    shares = np.clip(solved[:KNOTS], 0, 1)
    taken = solved[KNOTS:] / max(float(shares.mean()), 1e-3)
    return replace(mirroring, shares=tuple(shares.tolist()), taken=tuple(taken.tolist()))


def _ended(scene: _Scene, seen: F32, mirroring: MirrorLine) -> MirrorLine:
    """To where it explains what is seen: below, it would only be drawn."""
    added, alpha, below = scene.added(mirroring)
    taken = np.array(mirroring.taken, np.float32)
    share = mirroring.share(below)[..., None]
    added = np.asarray((added - alpha[..., None] * taken) * share, np.float32)
    rows = np.clip(np.rint(below / scene.pitch), 0, None).astype(np.int64)
    gained, start = np.zeros(int(rows.max()) + 1), 0
    for band in scene.bands(added):
        own = seen[start : start + band.size].reshape(band.shape)
        start += band.size
        gain = ((2 * own - band) * band).sum(-1)
        gained += np.bincount(rows.ravel(), gain.ravel(), len(gained))
        rows = rows[::2, ::2]
    ends = (int(np.cumsum(gained).argmax()) + 1) * scene.pitch
    return replace(mirroring, ends=float(ends))


def _contrasted(scene: _Scene, mirroring: MirrorLine) -> MirrorLine:
    """As much of the ground's contrast is lost as makes it what it is beside the reflection."""
    laid = mirroring.laid(scene.picture, scene.corner, scene.box, scene.pitch)
    below = mirroring.below(scene.box, scene.pitch)
    weight = mirroring.share(below) * laid[..., 3] * scene.free
    beside = scene.bare * cv2.GaussianBlur(weight, (0, 0), BESIDE * mirroring.height / scene.pitch)
    errors = []
    for contrast in CONTRASTS:
        tried = replace(mirroring, contrast=float(contrast))
        energy = _log_energy(scene, tried.without(scene.ground, laid, below, scene.smooth))
        errors.append(abs(_mean(energy, weight) - _mean(energy, beside)))
    return replace(mirroring, contrast=float(CONTRASTS[int(np.argmin(errors))]))


def _mean(values: F32, weight: F32) -> float:
    return float((values * weight).sum() / max(float(weight.sum()), 1e-9))


def _energy(scene: _Scene, light: F32) -> F32:
    """(h, w) of the two finest bands, whitened."""
    fine, coarse = scene.bands(light)[:2]
    size = (scene.free.shape[1], scene.free.shape[0])
    return np.asarray((fine**2).sum(-1) + cv2.resize((coarse**2).sum(-1), size), np.float32)


def _covers(scene: _Scene, mirroring: MirrorLine) -> F32:
    """(h, w) 1 where it is seen."""
    laid = mirroring.laid(scene.picture, scene.corner, scene.box, scene.pitch)
    share = mirroring.share(mirroring.below(scene.box, scene.pitch))
    cover = (share * laid[..., 3] > LEAST).astype(np.float32)
    cover[[0, -1]] = 0
    cover[:, [0, -1]] = 0
    return cover


def _smoothed(scene: _Scene, mirroring: MirrorLine) -> F32:
    """(h, w, 3) the ground without texture, as it is where the mirror image is taken off."""
    laid = mirroring.laid(scene.picture, scene.corner, scene.box, scene.pitch)
    below = mirroring.below(scene.box, scene.pitch)
    light = np.clip(mirroring.without(scene.ground, laid, below, scene.smooth), 0, 1)
    return _continued(light, scene.free)


def _log_energy(scene: _Scene, light: F32) -> F32:
    """(h, w) natural logarithm of what is about: few edges that are left over count little."""
    return np.log(_near(scene, _energy(scene, light)) + np.float32(GRAIN))


def _near(scene: _Scene, image: F32) -> F32:
    """(h, w) its mean about each cell that is seen."""
    weight = np.maximum(cv2.GaussianBlur(scene.free, (0, 0), NEAR), 1e-3)
    return np.asarray(cv2.GaussianBlur(image * scene.free, (0, 0), NEAR) / weight, np.float32)


def _unexplained(scene: _Scene, mirroring: MirrorLine) -> F32:
    """(h, w) 1 where more is left over than the bare ground's texture, or too little was seen."""
    laid = mirroring.laid(scene.picture, scene.corner, scene.box, scene.pitch)
    below = mirroring.below(scene.box, scene.pitch)
    energy = _energy(scene, mirroring.without(scene.ground, laid, below, scene.smooth))
    energy, bare = _near(scene, energy), scene.bare > 0
    usual = float(np.percentile(energy[bare], LEFT_OVER)) if bare.any() else np.inf
    is_seen = mirroring.share(below) * laid[..., 3] > 0
    is_clipped = scene.ground.max(-1) > FULL
    return ((is_seen & (energy > usual)) | (is_seen & is_clipped)).astype(np.float32)
