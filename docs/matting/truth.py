"""Composites whose alpha and colours are known: one photo's object over another photo.

The object's texture goes on beyond its outline, mirrored at it, so that its own colour is known at
every pixel that it has a share of. What a method is given is the composite and a hard mask, as
exact as a selection is; for glass the coverage that an artist would brush.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import skimage.data
import sklearn.datasets
from scipy.ndimage import gaussian_filter1d

from objectmorpher_core.base.arrays import F32, RGB, Mask, Selection, pixels_from_unit, unit_pixels
from objectmorpher_core.segment.mask_edit import enclosed, shrink, smooth
from objectmorpher_core.segment.matting.matte import signed_distance

PHOTOS = (
    Path(skimage.data.__file__).parent,
    Path(sklearn.datasets.__file__).parent / "images",
)
FINE = 4  # x finer grid on which strands and outlines are drawn
ROUGH = 2.0  # px: how far the given mask strays from the true outline
NOISE = 1.0  # 8-bit levels, of the sensor
BACKGROUNDS = ("white", "black", "a photo")  # that the cut-outs are put on


@dataclass(frozen=True, eq=False)
class Case:
    """A composite and all that went into it."""

    name: str
    kind: str  # "hair", "blur", "crisp", "glass"
    photo: RGB  # (H, W, 3)
    alpha: F32  # (H, W)
    foreground: F32  # (H, W, 3) the object's own colour, everywhere
    background: F32  # (H, W, 3)
    given: Selection  # what the methods get besides the photo

    def others(self) -> list[F32]:
        """(H, W, 3) what the cut-out is put on, see BACKGROUNDS."""
        other = np.ascontiguousarray(self.background[::-1, ::-1])
        white = np.ones_like(other)
        return [white, 0 * white, other]


@cache
def photo(name: str) -> F32:
    """(H, W, 3) a photo that comes with scikit-image or scikit-learn."""
    path = next(folder / name for folder in PHOTOS if (folder / name).is_file())
    bgr = cv2.imread(str(path), cv2.IMREAD_COLOR)
    assert bgr is not None
    return unit_pixels(np.ascontiguousarray(bgr[..., ::-1]))


def fitted(image: F32, shape: tuple[int, ...]) -> F32:
    """The middle of a photo, as large as the other."""
    height, width = shape[:2]
    scale = max(height / image.shape[0], width / image.shape[1])
    size = (int(np.ceil(image.shape[1] * scale)), int(np.ceil(image.shape[0] * scale)))
    method = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    large = np.clip(cv2.resize(image, size, interpolation=method), 0, 1)
    top, left = (large.shape[0] - height) // 2, (large.shape[1] - width) // 2
    return np.ascontiguousarray(large[top : top + height, left : left + width])


def continued(image: F32, inside: Mask) -> F32:
    """The colours inside a mask and, beyond it, their mirror image at the outline."""
    away, labels = cv2.distanceTransformWithLabels(
        (~inside).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    nearest = np.zeros((labels.max() + 1, 2), np.float32)
    nearest[labels[inside]] = np.argwhere(inside)
    y, x = np.indices(inside.shape, dtype=np.float32)
    at = 2 * nearest[labels] - np.dstack([y, x])
    at[inside] = np.dstack([y, x])[inside]
    mirrored = cv2.remap(image, at[..., 1], at[..., 0], cv2.INTER_LINEAR, None, cv2.BORDER_REFLECT)
    # A deep mirror image may leave the object on its other side: there its mean colour.
    lost = ~inside[np.clip(at[..., 0], 0, len(inside) - 1).astype(int),
                   np.clip(at[..., 1], 0, inside.shape[1] - 1).astype(int)]  # fmt: skip
    mirrored[lost & (away > 1)] = image[inside].mean(0)
    return mirrored


def strands(inside: Mask, length: float, count: int, seed: int) -> F32:
    """(H, W) coverage of `inside` with `count` hairs of about `length` px on its outline."""
    rng = np.random.default_rng(seed)
    height, width = inside.shape
    large = cv2.resize(inside.astype(np.uint8), (width * FINE, height * FINE))
    drawn = np.where(cv2.GaussianBlur(large.astype(np.float32), (0, 0), FINE) > 0.5, 255, 0)
    drawn = drawn.astype(np.uint8)
    contours, _ = cv2.findContours(large, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(contours, key=len)[:, 0].astype(np.float64)
    rows, columns = outline.astype(int)[:, ::-1].T
    depth = cv2.GaussianBlur(signed_distance(large > 0), (0, 0), 2 * FINE)
    outward = -np.stack([slope[rows, columns] for slope in np.gradient(depth)[::-1]], 1)
    clumps = gaussian_filter1d(rng.normal(size=len(outline)), 20 * FINE, mode="wrap")
    clumps /= clumps.std()
    for k in rng.integers(0, len(outline), count):
        angle = np.arctan2(*outward[k][::-1]) + 0.35 * clumps[k] + rng.normal() * 0.25
        bend = rng.normal() * 0.5
        steps = np.linspace(0, 1, 9)
        reach = length * FINE * rng.uniform(0.35, 1.25)
        angles = angle + bend * steps
        path = np.cumsum(np.column_stack([np.cos(angles), np.sin(angles)]) * reach / 9, 0)
        path = np.rint((outline[k] - 3 * np.array([np.cos(angle), np.sin(angle)]) + path) * 8)
        thick = rng.uniform(0.5, 1.7) * FINE
        for i, (a, b) in enumerate(zip(path[:-1].astype(int), path[1:].astype(int), strict=True)):
            wide = max(round(thick * (1 - 0.1 * i)), 1)
            cv2.line(drawn, a.tolist(), b.tolist(), (255,), wide, cv2.LINE_AA, 3)
    soft = cv2.GaussianBlur(drawn, (0, 0), 0.5 * FINE)
    return cv2.resize(soft, (width, height), interpolation=cv2.INTER_AREA) / np.float32(255)


def blurred(inside: Mask, low: float, high: float) -> F32:
    """(H, W) coverage of `inside` out of focus: by `low` px at the left, `high` px at the right."""
    columns = np.flatnonzero(inside.any(0))
    share = np.clip((np.arange(inside.shape[1]) - columns[0]) / np.ptp(columns), 0, 1)
    solid, levels = inside.astype(np.float32), np.linspace(low, high, 6)
    stack = [_disc_blurred(solid, radius) for radius in levels]
    at = share * (len(levels) - 1)
    first = np.minimum(at.astype(int), len(levels) - 2)
    rest, columns = (at - first).astype(np.float32), np.arange(len(share))
    volume = np.stack(stack)
    low_side, high_side = volume[first, :, columns], volume[first + 1, :, columns]
    return np.ascontiguousarray((low_side + rest[:, None] * (high_side - low_side)).T)


def _disc_blurred(solid: F32, radius: float) -> F32:
    reach = int(np.ceil(radius)) + 1
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = np.clip(radius + 0.5 - np.hypot(x, y), 0, 1).astype(np.float32)
    return cv2.filter2D(solid, -1, disc / disc.sum(), borderType=cv2.BORDER_REPLICATE)


def strayed(mask: Mask, seed: int) -> Mask:
    """`mask` as a selection has it: ROUGH px off, here outside and there inside."""
    noise = np.random.default_rng(seed).normal(size=mask.shape).astype(np.float32)
    noise = cv2.GaussianBlur(noise, (0, 0), 9)
    return signed_distance(mask) + noise * (ROUGH / (1.5 * noise.std())) > 0


def composed(name: str, kind: str, soft: F32, colours: F32, background: F32) -> Case:
    """The case of an object of `colours` and coverage `soft` over a background."""
    seed = sum(name.encode())
    rng = np.random.default_rng(seed)
    own = soft[..., None]
    mixed = own * colours + (1 - own) * background
    mixed += rng.normal(size=mixed.shape).astype(np.float32) * NOISE / 255
    given: Selection = strayed(smooth(soft > 0.5, 3) if kind == "hair" else soft > 0.5, seed)
    if kind == "glass":
        given = pixels_from_unit(soft, np.dtype(np.uint8))
    pixels = pixels_from_unit(mixed, np.dtype(np.uint8))
    return Case(name, kind, pixels, soft, colours, background, given)


def ellipse(
    shape: tuple[int, ...], centre: tuple[float, float], radii: tuple[float, float]
) -> Mask:
    y, x = np.indices(shape[:2]) + 0.5
    return ((x - centre[0]) / radii[0]) ** 2 + ((y - centre[1]) / radii[1]) ** 2 < 1


# fmt: off
HEAD = (
    (203, 24), (228, 18), (260, 25), (285, 47), (297, 80), (294, 110), (281, 122), (268, 150),
    (250, 178), (222, 182), (198, 162), (184, 132), (168, 112), (160, 80), (172, 48),
)
SUIT = (
    (118, 215), (150, 240), (200, 280), (262, 290), (300, 245), (345, 262), (362, 330),
    (330, 360), (290, 420), (282, 505), (60, 505), (30, 440), (36, 330), (60, 262),
)
# fmt: on


def _head() -> tuple[F32, Mask]:
    image = photo("astronaut.png")
    return image, enclosed(np.array(HEAD, float), (image.shape[1], image.shape[0]))


def _suit() -> tuple[F32, Mask]:
    image = photo("astronaut.png")
    return image, enclosed(np.array(SUIT, float), (image.shape[1], image.shape[0]))


def _face() -> tuple[F32, Mask]:
    image = photo("chelsea.png")
    return image, ellipse(image.shape, (205, 152), (120, 112))


def _flower() -> tuple[F32, Mask]:
    image = photo("flower.jpg")
    return image, ellipse(image.shape, (308, 223), (128, 124))


def _saucer() -> tuple[F32, Mask]:
    image = photo("coffee.png")
    return image, ellipse(image.shape, (277, 215), (197, 160))


Objects = Callable[[], tuple[F32, Mask]]
HAIR: tuple[tuple[str, Objects, str, float, int], ...] = (
    ("fur over a pagoda", _face, "china.jpg", 14, 1500),
    ("fur over leaves", _face, "flower.jpg", 9, 2500),
    ("hair over a motorcycle", _head, "motorcycle_left.png", 18, 900),
    ("hair over a dusk sky", _head, "rocket.jpg", 24, 500),
)
BLUR: tuple[tuple[str, Objects, str, float, float], ...] = (
    ("flower out of focus", _flower, "china.jpg", 1, 9),
    ("suit out of focus", _suit, "coffee.png", 2, 6),
)
CRISP: tuple[tuple[str, Objects, str, float, float], ...] = (
    ("saucer, sharp", _saucer, "astronaut.png", 0.6, 0.6),
    ("suit, sharp", _suit, "china.jpg", 0.7, 0.7),
    ("flower, sharp", _flower, "motorcycle_left.png", 0.8, 0.8),
)


REFERENCES = Path(__file__).resolve().parents[2] / "tests/core/segment/truth"
OUTLINED = (  # objects that are outlined by hand in their photos, and what they are put on
    ("dahlia", "flower.jpg", "astronaut.png"), ("coffee", "coffee.png", "china.jpg"),
    ("helmet", "astronaut.png", "flower.jpg"), ("shuttle", "astronaut.png", "coffee.png"),
)  # fmt: skip


def _outlined() -> Iterator[Case]:
    """Real objects along their own outlines, where the reference masks of selection are at hand."""
    for name, of, behind in OUTLINED:
        mask = cv2.imread(str(REFERENCES / f"{name}.png"), cv2.IMREAD_GRAYSCALE)
        if mask is None:
            continue
        image, inside = photo(of), mask > 127
        # A px within the outline no background is mixed in, which the object would take along.
        whole = continued(image, shrink(inside, 1.5))
        back = fitted(photo(behind), image.shape)
        yield composed(f"{name}, outlined", "crisp", blurred(inside, 0.7, 0.7), whole, back)


def _glass(shape: tuple[int, ...], low: float, high: float) -> tuple[F32, F32]:
    """Coverage and colours of a goblet: clear in the middle, denser to the rim, with lights."""
    height, width = shape[:2]
    inside = ellipse(shape, (width / 2, height * 0.48), (width * 0.27, height * 0.36))
    deep = np.clip(signed_distance(inside) / (0.2 * height), 0, 1)
    soft = np.where(inside, high + (low - high) * np.sqrt(deep), 0)
    soft = cv2.GaussianBlur(soft.astype(np.float32), (0, 0), 0.8)
    tint = np.array([0.55, 0.72, 0.68], np.float32) * (1 - 0.35 * deep[..., None])
    lights = ellipse(shape, (width * 0.41, height * 0.33), (width * 0.025, height * 0.12))
    lights |= ellipse(shape, (width * 0.6, height * 0.6), (width * 0.012, height * 0.09))
    shine = cv2.GaussianBlur(lights.astype(np.float32), (0, 0), 2.5)[..., None]
    return soft, (tint + shine * (0.98 - tint)).astype(np.float32)


def cases() -> Iterator[Case]:
    """Every composite of the page."""
    for name, thing, behind, length, count in HAIR:
        image, inside = thing()
        soft = strands(inside, length, count, len(name))
        whole = continued(image, inside)
        yield composed(name, "hair", soft, whole, fitted(photo(behind), image.shape))
    for kind, table in (("blur", BLUR), ("crisp", CRISP)):
        for name, thing, behind, low, high in table:
            image, inside = thing()
            whole = continued(image, inside)
            soft = blurred(inside, low, high)
            yield composed(name, kind, soft, whole, fitted(photo(behind), image.shape))
    yield from _outlined()
    for behind, low, high in (("china.jpg", 0.3, 0.7), ("coffee.png", 0.4, 0.6)):
        back = photo(behind)
        soft, tint = _glass(back.shape, low, high)
        yield composed(f"glass over {Path(behind).stem}", "glass", soft, tint, back)
