"""Old reflections found and taken off, against grounds that are known without them."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from skimage import data

from objectmorpher_core.base.arrays import F64, Mask, Pixels
from objectmorpher_core.compose import load
from objectmorpher_core.compose.shadow.old_reflection import OldReflection
from objectmorpher_core.compose.shadow.old_shadow import traceless_plate
from objectmorpher_core.compose.shadow.reflection_fit import find_old_reflection
from objectmorpher_core.compose.shadow.shadow import GAMMA
from objectmorpher_core.segment.matting.matte import build_matte

sys.path.append(str(Path(__file__).resolve().parents[2]))
from tests.core.segment.truth_masks import TRUTHS, truth_mask
from tests.photos import photo

SIDE, TALL = 512, 220  # px, and the longer side of a thing
FOOT = 270  # px, its lowest row
GROUNDS = ("plain", "wood", "water", "brick", "grass")
THINGS = ("dahlia", "coffee", "rocket", "motorcycle", "cat", "shuttle")
KINDS = (  # strength, blur px, tilt degrees
    (0.15, 0.0, 0.0), (0.15, 3.0, 1.0), (0.3, 1.0, 2.0), (0.3, 3.0, 0.0), (0.6, 0.0, 1.0),
    (0.6, 3.0, 2.0),
)  # fmt: skip
FADES = 0.8  # x its height
STRONG = 0.05  # of the mirrored picture, from which a place counts as mirroring
AROUND = 9  # px about the thing, that is filled in any case
MARGIN = 20  # px of the matte


@dataclass(frozen=True, eq=False)
class Mirrored:
    """One case; errors are mean differences of levels from the ground alone."""

    thing: str
    ground: str
    strength: float
    blur: float
    tilt: float
    is_found: bool
    is_imagined: bool  # found where there is none
    covered: float  # share of the true reflection
    before: float  # levels
    after: float
    filled: float  # where all of it is invented
    ghost: tuple[float, float]  # correlation of what is there with the thing mirrored
    pictures: tuple[Pixels, Pixels, Pixels]  # the photo, without thing and reflection, the ground


def measured() -> list[Mirrored]:
    cases = []
    for number, thing in enumerate(THINGS):
        for k, kind in enumerate(KINDS):
            cases.append(_measured(thing, GROUNDS[(number + k) % len(GROUNDS)], *kind))
    return cases


def imagined() -> dict[str, bool]:
    """Whether a reflection is found of each outlined object in its photo."""
    found = {}
    for truth in TRUTHS:
        pixels, mask = photo(truth.photo), truth_mask(truth.name)
        found[truth.name] = (
            find_old_reflection(pixels, build_matte(pixels, mask, MARGIN)) is not None
        )
    return found


def _measured(thing: str, ground: str, strength: float, blur: float, tilt: float) -> Mirrored:
    bare = _ground(ground)
    colour, alpha = _placed(thing)
    light = np.clip(colour, 0, 1) ** GAMMA
    mirror = _mirror(np.dstack([light * alpha[..., None], alpha]), tilt)
    if blur:
        mirror = np.asarray(cv2.GaussianBlur(mirror, (0, 0), blur), np.float64)
    y = np.arange(SIDE)[:, None]
    share = strength * np.exp(
        -np.maximum(y - FOOT, 0) / (FADES * np.ptp(np.flatnonzero(alpha.any(1))))
    )
    kept = np.clip(bare, 0, 1) ** GAMMA * (1 - share * mirror[..., 3])[..., None]
    seen = (kept + share[..., None] * mirror[..., :3]) ** (1 / GAMMA)

    def with_thing(under: F64) -> Pixels:
        return _bytes(under * (1 - alpha[..., None]) + colour * alpha[..., None])

    pixels, without = with_thing(seen), with_thing(bare)
    mask = alpha > 0.5
    old = find_old_reflection(pixels, build_matte(pixels, mask, MARGIN))
    none = find_old_reflection(without, build_matte(without, mask, MARGIN))
    covered = cv2.dilate(mask.astype(np.uint8), np.ones((AROUND, AROUND))) > 0
    true = (share * mirror[..., 3] > STRONG) & ~covered
    results, caught = (pixels, pixels), 0.0
    if old is not None:
        results = tuple(_without(pixels, covered, o) for o in (old, replace(old, known=None)))
        caught = float(old.covers((0, 0, SIDE, SIDE))[true].mean())
    before, after, filled = (
        float(np.abs(p.astype(float) - _bytes(bare))[true].mean()) for p in (pixels, *results)
    )
    ghost = _alike(pixels, mirror, true), _alike(results[0], mirror, true)
    return Mirrored(thing, ground, strength, blur, tilt, old is not None, none is not None, caught,
                    before, after, filled, ghost, (pixels, results[0], _bytes(bare)))  # fmt: skip


def _without(pixels: Pixels, covered: Mask, old: OldReflection) -> Pixels:
    """The photo without the thing and its reflection."""
    plate, result = traceless_plate(pixels, covered, (old,), load("patchmatch")), pixels.copy()
    x0, y0, x1, y1 = plate.box
    np.copyto(result[y0:y1, x0:x1], plate.pixels, where=plate.hole[..., None])
    return result


def _alike(pixels: Pixels, mirror: F64, where: Mask) -> float:
    fine = [
        (p - cv2.GaussianBlur(p, (0, 0), 8))[where].ravel()
        for p in (pixels.astype(np.float64), 255 * np.clip(mirror[..., :3], 0, 1) ** (1 / GAMMA))
    ]
    return float(np.corrcoef(fine[0], fine[1])[0, 1])


def _bytes(picture: F64) -> Pixels:
    return np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)


def _placed(thing: str) -> tuple[F64, F64]:
    """A photographed thing (SIDE, SIDE, 3) that stands on FOOT, and its alpha."""
    mask = truth_mask(thing)
    source = next(t.photo for t in TRUTHS if t.name == thing)
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    scale = TALL / max(mask[part].shape)
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    colour = cv2.resize(photo(source)[part] / 255.0, None, fx=scale, fy=scale, interpolation=way)
    alpha = cv2.resize(mask[part].astype(np.float64), None, fx=scale, fy=scale, interpolation=way)
    high, wide = alpha.shape
    top, left = FOOT - high, (SIDE - wide) // 2
    canvas, cover = np.zeros((SIDE, SIDE, 3)), np.zeros((SIDE, SIDE))
    canvas[top:FOOT, left : left + wide] = colour
    cover[top:FOOT, left : left + wide] = alpha
    return canvas, cover


def _mirror(picture: F64, tilt: float) -> F64:
    """About a line through the middle of FOOT."""
    angle = np.radians(tilt)
    normal, foot = np.array([-np.sin(angle), np.cos(angle)]), np.array([SIDE / 2, FOOT - 0.5])
    matrix = np.column_stack(
        [np.eye(2) - 2 * np.outer(normal, normal), 2 * (foot @ normal) * normal]
    )
    laid = cv2.warpAffine(
        picture, matrix, (SIDE, SIDE), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    )
    return np.asarray(laid, np.float64)


def _ground(kind: str) -> F64:
    """(SIDE, SIDE, 3) encoded; water is gravel, drawn out sideways and softened."""
    x, y = np.meshgrid(np.linspace(-1, 1, SIDE), np.linspace(-1, 1, SIDE))
    if kind == "plain":
        grain = np.random.default_rng(0).normal(size=(SIDE, SIDE)) * 1.5 / 255
        return (0.55 + 0.08 * x + 0.1 * y + grain)[..., None] * [1.0, 0.95, 0.85]
    if kind == "wood":
        plank = data.coffee()[80:390, 490:598] / 255.0
        return np.asarray(cv2.resize(plank, (SIDE, SIDE), interpolation=cv2.INTER_CUBIC))
    if kind == "water":
        drawn = cv2.resize(data.gravel()[:, :128] / 255.0, (SIDE, SIDE))
        return 0.2 + 0.5 * cv2.GaussianBlur(drawn, (0, 0), 1.5)[..., None] * [0.7, 0.9, 1.0]
    return np.repeat(getattr(data, kind)()[..., None] / 255.0, 3, 2) * [1.0, 0.95, 0.85]
