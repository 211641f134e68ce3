"""Defocus of an object that came nearer or went farther, matched to the photo's blur there.

The photo tells it by its ground: in the row where the ground is as far away as the object is now,
beside the object, edges are so and so wide; and likewise where the object was. The object brings
its own blur along, enlarged as it is. What is missing is added, to colour and alpha alike, where
all of this is sure: both places have edges enough, and the object is as sharp as the ground that
it stood on. Nothing is sharpened. What stays where it was, if only in part, keeps its focus.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64, U8, Mask, Pixels, crop, unit_pixels
from ...base.camera import Camera
from ...document.model import Matte
from ...raster.posed import PosedSplats
from ..plate.plate import hole_margin

LEAST_CHANGE = 0.04  # natural logarithm of depth: less is no other depth
FIRST = 10  # percentile of an object's points that must have changed so much
BANDS = 40  # of the photo's height, in which blur is measured: so many rows of them
BESIDE = 1.5  # x the object's width, how far beside it the ground is asked
LEAST_BESIDE = 0.08  # x the photo's width
ALIKE = 1.6  # x: blurs farther apart are not of the same depth
UNSURE = 0.7  # px that a blur may be off by, whatever it is
LEAST = 0.5  # px of blur: less is not seen
MOST = 0.02  # x the photo's longer side
RIM = 3  # px around an object in which its outline's edges are
REACH = 3.0  # x the blur, where it ends
DETAIL = 1.5  # px of the photo, standard deviation: what is finer is sharpened
GUESSED_ROWS = 2.0  # bands that two ways to find the ground may be apart where no horizon is known


@dataclass(frozen=True, eq=False)
class StandingPlane:
    """The plane that an object stands on."""

    normal: F64  # (3,) world, unit, down
    is_known: bool  # by the horizon, or by the artist


class PhotoDefocus:
    """The blur of one photo, place by place; each is measured once."""

    def __init__(self, photo: Pixels, covered: Mask) -> None:
        """`covered` (H, W): objects, which do not belong to the ground."""
        height, width = covered.shape
        self._photo = photo
        self.pitch = max(height / BANDS, 1.0)  # rows of a band, px
        rim = 2 * round(hole_margin(width, height) / 4) + 3
        self._free = cv2.erode((~covered).astype(np.uint8), np.ones((rim, rim), np.uint8)) > 0
        self._found: dict[tuple[int, int, int], float | None] = {}
        self._objects: dict[int, tuple[Matte, float | None]] = {}  # by its id

    def beside(self, row: float, left: float, right: float) -> float | None:
        """Return the photo's blur, px, around a `row`, beside the columns left..right of an object.

        None where it does not tell.
        """
        height, width = self._free.shape
        if not 0 <= row < height:
            return None
        reach = max(BESIDE * (right - left), LEAST_BESIDE * width)
        step = LEAST_BESIDE * width / 2  # so that a drag asks for the same place again
        x0, x1 = (round(x / step) for x in (left - reach, right + reach))
        key = (int(row / self.pitch), x0, x1)
        if key not in self._found:
            first, last = (int((key[0] + d) * self.pitch) for d in (-0.5, 1.5))
            rows = slice(max(first, 0), min(last + 1, height))
            columns = slice(max(int(x0 * step), 0), min(int(x1 * step) + 1, width))
            self._found[key] = self._measured(rows, columns)
        return self._found[key]

    def of_object(self, matte: Matte) -> float | None:
        """Px, the blur of an object as the photo shows it, its outline's among it."""
        kept = self._objects.get(id(matte))
        if kept is None:
            x0, y0, x1, y1 = matte.box
            height, width = self._free.shape
            box = max(x0 - RIM, 0), max(y0 - RIM, 0), min(x1 + RIM, width), min(y1 + RIM, height)
            own = (crop(matte.alpha, matte.box, box) > 0.5).astype(np.uint8)
            near = cv2.dilate(own, np.ones((2 * RIM - 1, 2 * RIM - 1), np.uint8)) > 0
            part = self._photo[box[1] : box[3], box[0] : box[2]]
            kept = self._objects[id(matte)] = (matte, measure_blur(part, near))
        return kept[1]

    def _measured(self, rows: slice, columns: slice) -> float | None:
        """The sharper half's, where both halves tell."""
        middle = (columns.start + columns.stop) // 2
        halves = slice(columns.start, middle), slice(middle, columns.stop)
        blurs = [measure_blur(self._photo[rows, h], self._free[rows, h]) for h in halves]
        told = [blur for blur in blurs if blur is not None]
        return min(told) if told else None


def find_defocus(
    splats: PosedSplats, rest: PosedSplats, matte: Matte, ground: StandingPlane,
    focus: PhotoDefocus, camera: Camera,
) -> float:  # fmt: skip
    """Return the blur that a moved object is to get: standard deviation, px of the photo.

    0 where it has kept its depth, where it is at least as blurred as the photo there, and where
    the photo does not tell. `rest`: its Gaussians as they were.
    """
    if len(rest.means) != len(splats.means):
        return 0.0
    seen = (rest.means[:, 2] > 0) & (splats.means[:, 2] > 0)
    solid = seen & (rest.rest.lifted.texture.solidity > 0.5)
    if not solid.any():
        return 0.0
    before, now = rest.means[solid], splats.means[solid]
    ratio = np.log(now[:, 2] / before[:, 2])
    middle = float(np.median(ratio))
    if np.percentile(ratio * np.sign(middle), FIRST) < LEAST_CHANGE:
        return 0.0
    was = _shown(before, camera)
    is_now = _shown(now, camera)
    old = focus.beside(was.foot, was.left, was.right)
    own = focus.of_object(matte)
    if old is None or (own is not None and not _are_alike(own, old)):
        return 0.0
    size = splats.scale / rest.scale * float(np.exp(-middle))
    brought = size * max(own or 0.0, old)
    wanted = _blur_there(before, middle, was, is_now, ground, focus, camera)
    if wanted is None or wanted < max(ALIKE * brought, brought + UNSURE):
        return 0.0
    missing = float(np.sqrt(wanted**2 - brought**2))
    most = MOST * max(camera.width, camera.height)
    return 0.0 if missing < LEAST else min(missing, most)


def _are_alike(one: float, other: float) -> bool:
    return max(one, other) <= ALIKE * min(one, other) + UNSURE


@dataclass(frozen=True)
class _Shown:
    """Where an object is seen, px of the photo."""

    foot: float  # row of its lowest part
    left: float
    right: float


def _shown(means: F64, camera: Camera) -> _Shown:
    x, y = camera.project(means).T
    left, right = np.percentile(x, (1, 99))
    return _Shown(float(np.percentile(y, 99.5)), float(left), float(right))


def _blur_there(
    before: F64, change: float, was: _Shown, now: _Shown, ground: StandingPlane,
    focus: PhotoDefocus, camera: Camera,
) -> float | None:  # fmt: skip
    """The photo's blur at the depth where the object is now; the lesser where there is doubt."""
    rows = camera.project(before)[:, 1]
    foot = before[np.argmin(np.abs(rows - was.foot))]
    depth = float(foot[2]) * float(np.exp(change))
    nx, ny, nz = (float(v) for v in ground.normal)
    if abs(ny) < 1e-6:
        return None
    middle = ((now.left + now.right) / 2 - camera.cx) / camera.focal
    slope = (float(ground.normal @ foot) / depth - nz - nx * middle) / ny
    row = camera.cy + slope * camera.focal
    found = focus.beside(row, now.left, now.right)
    if ground.is_known or found is None:
        return found
    if abs(row - now.foot) > GUESSED_ROWS * focus.pitch:
        return None  # where the ground is is a guess, and the object is not on it
    other = focus.beside(now.foot, now.left, now.right)
    return None if other is None else min(found, other)


def attenuation(blur: float, frequency: np.ndarray) -> np.ndarray:
    """Return the share of the power that a blur, px, leaves at frequencies, per px."""
    return np.exp(-((2 * np.pi * blur * frequency) ** 2))


def reach_of(blur: float) -> int:
    """Px that a blur reaches."""
    return int(np.ceil(REACH * blur))


def blurred(picture: F32, blur: float) -> F32:
    """A premultiplied picture (h, w) or (h, w, c), out of focus by so many of its px."""
    if blur <= 0:
        return picture
    side = 2 * reach_of(blur) + 1
    border = cv2.BORDER_REPLICATE
    soft = cv2.GaussianBlur(picture, (side, side), blur, borderType=border)
    return np.asarray(soft, np.float32)


def sharpened(colour: F32, alpha: F32, sharpness: float, radius: float) -> F32:
    """Premultiplied colours (h, w, 3) with so many times their detail finer than `radius` px more.

    Their edge is compared with the object alone: nothing from beside it makes a halo there.
    """
    if sharpness <= 0:
        return colour
    coarse, cover = blurred(colour, radius), blurred(alpha, radius)
    coarse *= (alpha / np.maximum(cover, 1e-6))[..., None]
    sharp = colour + np.float32(sharpness) * (colour - coarse)
    return np.minimum(np.maximum(sharp, 0), alpha[..., None])


def sharpened_rgba(rgba: U8, sharpness: float, zoom: float) -> U8:
    """Sharpen a picture (h, w, 4) u8 with so many of its px for one of the photo."""
    whole = rgba.astype(np.float32)
    whole[..., :3] = sharpened(whole[..., :3], whole[..., 3], sharpness, DETAIL * zoom)
    return (whole + 0.5).astype(np.uint8)


def blurred_rgba(rgba: U8, blur: float) -> U8:
    """Blur a picture (h, w, 4) u8."""
    return (blurred(rgba.astype(np.float32), blur) + 0.5).astype(np.uint8)


# How blurred a photo is, from the widths of its edges.

NARROW, WIDE = 1.0, 2.0  # px, the two blurs
MOST_LEVELS = 4  # pictures, each half as large as the one before
WIDEST = 2.2  # px of a level: a wider edge is looked at in the next one
STRONGEST = 0.5  # x the strongest gradients of a level: weaker ones are shading and texture
FAINTEST = 0.008  # encoded light per px, a gradient that is an edge
NOISY = 6.0  # x the noise's own gradient, likewise
ENOUGH, FEWEST = 30, 10  # edges that say something together: px of them, and in small pictures
SHARPER = 45  # percentile of their widths that counts
STEPS = np.array([[0, 1], [1, 1], [1, 0], [1, -1]])  # rows and columns, by the gradient's direction


@dataclass(frozen=True, eq=False)
class BlurredEdges:
    """The edges of a picture, and how blurred each is."""

    blur: F64  # (n,) px, standard deviation

    scale: int  # px of the picture per px of the one they were found in

    def typical(self) -> float | None:
        """Return the blur of the sharper edges; None where they are few, or too widely spread."""
        if len(self.blur) < max(ENOUGH / self.scale, FEWEST):
            return None
        blur = float(np.percentile(self.blur, SHARPER))
        return blur if blur < WIDEST * self.scale else None


def measure_blur(pixels: Pixels, asked: Mask) -> float | None:
    """Measure the blur, standard deviation in px, of a picture (h, w, 3) at `asked` (h, w).

    None where too few edges tell.
    """
    for edges in find_edges(pixels, asked):
        if (found := edges.typical()) is not None:
            return found
    return None


def find_edges(pixels: Pixels, asked: Mask) -> list[BlurredEdges]:
    """The edges of a picture (h, w, 3) that lie where it is `asked`, of each size of it."""
    light = unit_pixels(pixels).mean(-1)
    found, scale = [], 1
    for _ in range(MOST_LEVELS):
        if min(light.shape) < 8 or not asked.any():
            break
        found.append(_edges(light, asked, scale))
        size = (max(light.shape[1] // 2, 1), max(light.shape[0] // 2, 1))
        light = np.asarray(cv2.resize(light, size, interpolation=cv2.INTER_AREA), np.float32)
        shown = asked.astype(np.float32)
        asked = np.asarray(cv2.resize(shown, size, interpolation=cv2.INTER_AREA) > 0.99)
        scale *= 2
    return found


def _edges(light: F32, asked: Mask, scale: int) -> BlurredEdges:
    """Of one level (h, w), `scale` px of the picture per px of it."""
    across, down, narrow = _gradient(light, NARROW)
    wide = _gradient(light, WIDE)[2]
    some = narrow[asked]
    least = max(FAINTEST, NOISY * _noise(light, asked), STRONGEST * np.percentile(some, 98))
    ys, xs = np.nonzero(asked & (narrow > least))
    step = STEPS[np.rint(np.arctan2(down, across)[ys, xs] / (np.pi / 4)).astype(int) % 4]
    at = narrow[ys, xs]
    top = at >= np.maximum(_beside(narrow, ys, xs, step), _beside(narrow, ys, xs, -step))
    ys, xs = ys[top], xs[top]
    square = (narrow[ys, xs] / np.maximum(wide[ys, xs], 1e-9)) ** 2
    blur = np.sqrt(
        np.maximum(WIDE**2 - square * NARROW**2, 0) / np.maximum(square - 1, 1e-6)
    ).astype(np.float64)
    blur = np.minimum(blur, 2 * WIDEST)
    # A px of a smaller picture is the mean of several, which blurs it, too.
    own = np.sqrt(np.maximum(blur**2 * scale**2 - (scale**2 - 1) / 12, 0))
    return BlurredEdges(own, scale)


def _gradient(light: F32, sigma: float) -> tuple[F32, F32, F32]:
    """To the right, down, and its length, of a picture blurred by so much; per px."""
    smooth = cv2.GaussianBlur(light, (0, 0), sigma)
    across = np.asarray(cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8), np.float32)
    down = np.asarray(cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8), np.float32)
    return across, down, np.hypot(across, down)


def _beside(values: F32, ys: np.ndarray, xs: np.ndarray, step: np.ndarray) -> F32:
    """A picture's values one step from some of its pixels; its border's beyond it."""
    height, width = values.shape
    return values[(ys + step[:, 0]).clip(0, height - 1), (xs + step[:, 1]).clip(0, width - 1)]


def _noise(light: F32, asked: Mask) -> float:
    """Standard deviation of the gradient that noise alone has in the narrowly blurred picture."""
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6
    fine = cv2.filter2D(light, cv2.CV_32F, kernel)
    deviation = float(np.median(np.abs(fine[asked]))) / 0.6745
    return deviation / (np.sqrt(8 * np.pi) * NARROW**2)
