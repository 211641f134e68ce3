"""The soft shadow of a moved object on the ground: a layer between plate and objects.

The ground is a plane under the object's lowest Gaussians. What is h above it throws its shadow
h x length x (cos, sin) of the direction from its foot, on the ground: the object's own depth is in
it, so a thing that turns throws another shadow. The farther from the ground, the more blurred and
the weaker. Right below what stands on it lies a dark band, the contact. `fall` knows what the light
meets before the ground.

How steeply one looks down on the ground follows from the photo's horizon, where that is known;
else the artist says it. Nothing is known of the light: the artist says that, too, or the shadow
in the photo does (`shadow_fit`).

A shadow multiplies the light that is left. A power of 2.2 stands for sRGB's curve here, for then
it multiplies the encoded values, too, and a window that blends them shows what is exported.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64
from ...base.camera import Camera
from ...base.masks import box_of
from ...document.settings import Shadow
from ..blend import Box
from ..silhouette import SilhouetteGrid, box_around, sampled

GAMMA = 2.2  # of the encoded values
USUAL_GROUND = 15.0  # degrees, from which a ground is seen whose horizon is not known
FINE, COARSE = 176, 64  # cells, longer side of a shadow, and of a sketch of one
PER_CELL = 1.5  # Gaussians, so that no holes are left
SPRAY = 0.3  # %, of the Gaussians that may lie below what stands on the ground, or far above all
COLUMNS = 64  # across an object, in which its lower edge is looked for
LEVEL = 0.03  # x width, over which the ground's line is smooth
BLURS = (0.012, 0.07, 0.2)  # x height, at softness 1: near the ground, half up, at the top
HARDEST = 0.006  # x height, of the least blur
FADE = 0.5  # of the strength is lost from the ground to the top
LEAST_SLOPE = 0.05  # of a ground that is seen edge-on
LAST_BLURS = (0.008, 0.035)  # x height, of all of it, at softness 0 and 1
BAND = 0.07  # x height, of what touches the ground
BAND_BLUR = 0.03  # x height
BAND_DROP = 0.015  # x height that the contact lies below the object
FROM_ABOVE = 90.0  # degrees, at which a ground is seen: the shadow is the outline itself
FLAT_HEIGHT = 6.0  # x that height, the shorter side of what is seen from above
CRISP = 4  # x as fine is a sharp outline as the grid on which it is found
CELLS = 1.5  # of that grid, over which its points are counted: fewer leave holes
FARTHEST = 2.0  # x the photo's diagonal, of an object whose shadow is cast
DARKEST = 0.97  # of the light, at strength 1
FAINTEST = 1 / 255  # what is weaker is none: the footprint ends somewhere


@dataclass(frozen=True, eq=False)
class Shade:
    """A shadow as a picture over the photo: `colour` at the opacity `alpha`, sRGB."""

    alpha: F32  # (h, w) in [0, 1]; 0 along its border
    left: float  # photo px, its corner
    top: float
    pitch: float  # photo px per px of it
    colour: tuple[float, float, float]

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 photo px."""
        height, width = self.alpha.shape
        right, bottom = self.left + width * self.pitch, self.top + height * self.pitch
        return self.left, self.top, right, bottom

    def at(self, box: Box) -> F32:
        """Its opacity (h, w) at the pixels of a box of the photo."""
        return sampled(self.alpha, (self.left, self.top), self.pitch, box)


@dataclass(frozen=True, eq=False)
class FlatShadow:
    """A shadow on plain ground."""

    grid: SilhouetteGrid
    contact: F32  # (h, w) see `StandingObject.contact`
    alpha: F32  # (h, w)

    @staticmethod
    def of(shadow: Shadow, standing: StandingObject, cells: int) -> FlatShadow | None:
        """The shadow, of at most so many `cells`; None where there is none."""
        if shadow.strength <= 0 or (grid := standing.grid(shadow, cells)) is None:
            return None
        far, near = standing.far(shadow, grid), standing.contact(grid)
        return FlatShadow(grid, near, opacity(shadow, far, near))

    def shade(
        self, shadow: Shadow, standing: StandingObject, horizon: float | None
    ) -> Shade | None:
        """As a picture; it ends at the photo's `horizon`, px of its row, where that is known."""
        grid, alpha = self.grid, self.alpha
        if horizon is not None:
            if standing.is_above(horizon):  # it is in the air
                return None
            rows = grid.top + grid.pitch * (np.arange(grid.height) + 0.5)
            alpha = alpha * (rows > horizon + grid.pitch)[:, None].astype(np.float32)
        return trimmed(alpha, grid, shadow.colour)


class StandingObject:
    """An object that stands on the ground, or hangs a little above it.

    The ground is where a point times `normal` is `depth`.
    """

    def __init__(self, points: F64, normal: F64, camera: Camera) -> None:
        """Of world points (N, 3) that are spread evenly over it.

        `normal` (3,): of the ground, unit, down; across the picture the ground is level. Raises
        ValueError without any point.
        """
        if not len(points):
            raise ValueError("an object without a single solid point throws no shadow")
        above = -(points @ normal)
        foot, top = np.percentile(above, (SPRAY, 100 - SPRAY))
        self.points, self.normal, self.depth = points, normal, -float(foot)
        self.height = max(float(top - foot), 1e-9)
        above = np.maximum(above - foot, 0.0)
        middle = np.median(points, 0)
        sine = float(middle @ normal / max(float(np.linalg.norm(middle)), 1e-9))
        self._above = np.maximum(above - _level(points, above, float(np.clip(sine, 0, 1))), 0.0)
        self._feet = points + self._above[:, None] * normal
        sides = np.ptp(np.percentile(points[:, :2], (SPRAY, 100 - SPRAY), 0), 0)
        self._side = max(float(sides.min()), 1e-9)  # the shorter one, seen from above
        self._is_low = self._above <= BAND * self.height
        self._right = np.array([1.0, 0.0, 0.0])
        self._nearer = np.cross(normal, self._right)  # on the ground, towards the viewer
        self.camera = camera
        size = self.height * camera.focal / max(float(middle[2]), 1e-9)
        self._size = min(size, float(FARTHEST * np.hypot(camera.width, camera.height)))  # photo px
        # Lengths on the ground, towards the viewer, look so much shorter.
        self._slope = float(np.clip(sine, LEAST_SLOPE, 1.0))

    def is_above(self, horizon: float) -> bool:
        """Whether its foot is seen above a row of the photo, px."""
        foot = self.foot
        return bool(foot[2] > 0 and self.camera.project(foot)[1] <= horizon)

    def grid(self, shadow: Shadow, cells: int = FINE) -> SilhouetteGrid | None:
        """About the whole shadow, at most so many `cells` long; None where none is seen."""
        points = np.concatenate([self._fallen(shadow), self._feet[self._is_low]])
        box = box_around(points, self.camera, 0.0)
        if box is None:
            return None
        (left, top), (right, bottom) = box
        evenly = float(np.sqrt(PER_CELL * (right - left) * (bottom - top) / len(points)))
        pitch = max((right - left) / cells, (bottom - top) / cells, evenly, 1.0)
        pitch = max(pitch / CRISP, 1.0) if shadow.ground == FROM_ABOVE else pitch
        room = self.room(shadow) * self._size + 4 * pitch
        width, height = (int(np.ceil((a + 2 * room) / pitch)) for a in (right - left, bottom - top))
        return SilhouetteGrid(left - room, top - room, pitch, width, height)

    def room(self, shadow: Shadow) -> float:
        """X its height, how far the blur of its shadow reaches."""
        if shadow.ground == FROM_ABOVE:
            return 3 * last_blur(shadow) * max(self._side / self.height, 1.0)
        return 3 * max(BLURS[-1] * shadow.softness, LAST_BLURS[1], BAND_BLUR)

    def far(self, shadow: Shadow, grid: SilhouetteGrid, level: float = 0.0) -> F32:
        """(h, w) of the light, what the whole object takes, in [0, 1].

        At a `level` above the ground, world units: there what is higher throws the same shadow,
        nearer. It is where its light would have met the ground.
        """
        above = self._heights(shadow)
        is_higher = above >= level
        high = (above[is_higher] - level) / self.height
        size = self._size / grid.pitch
        if shadow.ground == FROM_ABOVE:  # all of it is as far from the ground
            cover = _outline(self._fallen(shadow)[is_higher], grid, self.camera)
            blur = last_blur(shadow) - LAST_BLURS[0]  # of a hard one, a photo shows less
            return self._smooth(cover, blur * self._side / self.height * size)
        cover, share = _spread(self._fallen(shadow)[is_higher], high, grid, self.camera)
        share = np.clip(share, 0, 1)
        mixed = np.zeros_like(cover)
        for k, blur in enumerate(BLURS):
            weight = np.clip(1 - np.abs(share * (len(BLURS) - 1) - k), 0, 1) * (1 - FADE * share)
            mixed += self._smooth(
                np.asarray(cover * weight, np.float32), max(HARDEST, blur * shadow.softness) * size
            )
        return self._smooth(mixed, last_blur(shadow) * size)

    def contact(self, grid: SilhouetteGrid) -> F32:
        """(h, w) what touches the ground, blurred and a little lower, 1 at its darkest."""
        low = 1 - self._above[self._is_low] / (BAND * self.height)
        cover, share = _spread(self._feet[self._is_low], low, grid, self.camera)
        size = self._size / grid.pitch
        near = self._smooth(cover * share, BAND_BLUR * size)
        drop = round(BAND_DROP * size)
        near[drop:] = near[: len(near) - drop].copy()
        near[:drop] = 0
        return near / max(float(near.max()), 1e-6)

    def ray(self, shadow: Shadow) -> F64:
        """(3,) the way of the light, as long as it takes to come down by one world unit."""
        return np.asarray(self.normal + self._way(shadow), np.float64)

    def _way(self, shadow: Shadow) -> F64:
        angle = np.radians(shadow.direction)
        way = np.cos(angle) * self._right + np.sin(angle) * self._nearer
        return np.asarray(shadow.length * way, np.float64)

    @property
    def foot(self) -> F64:
        """(3,) amid where it touches the ground."""
        return np.asarray(np.median(self._feet[self._is_low], 0), np.float64)

    def lit(self, shadow: Shadow) -> F64:
        """(N, 3) its points, and where the light through them meets the ground."""
        return np.concatenate([self.points, self._fallen(shadow)])

    def _fallen(self, shadow: Shadow) -> F64:
        """(N, 3) where the shadow of each point is, on the ground."""
        way = self._way(shadow)
        return np.asarray(self._feet + self._heights(shadow)[:, None] * way, np.float64)

    def _heights(self, shadow: Shadow) -> F64:
        """(N,) world units from the ground to each point.

        Of a thing that one looks down on, a bowl or a plate, the rim throws the shadow: the
        outline, beside itself. How high it is does not show, and is said by how large it is.
        """
        if shadow.ground == FROM_ABOVE:
            return np.full(len(self._above), self._side / FLAT_HEIGHT)
        return self._above

    def _smooth(self, values: F32, sigma: float) -> F32:
        """Blurred alike in all directions on the ground."""
        return smooth(values, sigma, sigma * self._slope)


def _level(points: F64, above: F64, sine: float) -> F64:
    """(N,) how far above the lowest point the ground is taken to be, beside each point.

    One photo does not show of what lies flat or is round below that its sides are as far down as
    its front: the lower edge of what one sees stands on the ground, as far as it would rise of
    something round that lies there. `sine`: of the angle at which the ground is seen.
    """
    most = 0.5 * float(np.ptp(points[:, 0])) * sine * np.sqrt(1 - sine**2)
    across = points[:, 0] / np.maximum(points[:, 2], 1e-9)
    low, high = float(across.min()), float(across.max())
    column = ((across - low) / max(high - low, 1e-9) * (COLUMNS - 1)).astype(np.int64)
    lower = np.full(COLUMNS, np.inf)
    np.minimum.at(lower, column, above)
    there = np.flatnonzero(np.isfinite(lower))
    held = np.interp(np.arange(COLUMNS), there, np.minimum(lower[there], most))
    level = cv2.GaussianBlur(held[None], (0, 0), LEVEL * COLUMNS)[0]
    return np.asarray(level[column], np.float64)


def last_blur(shadow: Shadow) -> float:
    """x the object's height, standard deviation of the blur of the whole shadow."""
    hard, soft = LAST_BLURS
    return hard + (soft - hard) * shadow.softness


def softness_of(blur: float) -> float:
    """Return the softness of an outline's shadow, blurred by so much x its shorter side."""
    hard, soft = LAST_BLURS
    return float(np.clip(blur / (soft - hard), 0, 1))


def smooth(values: F32, across: float, down: float | None = None) -> F32:
    """Three boxes one after the other: nearly a bell, and as quick for any width.

    `across`, `down`: standard deviations, px; both the same where one is given.
    """
    return _boxes(_boxes(values, across, 1, 0), across if down is None else down, 0, 1)


def _boxes(values: F32, sigma: float, across: int, down: int) -> F32:
    """Three boxes along one direction that together have that standard deviation, px.

    Each is the mean of the next smaller and the next larger of odd width that has the variance
    of a third, for a width of whole pixels would let the blur go in steps.
    """
    least = max(int((np.sqrt(4 * sigma**2 + 1) - 1) / 2), 0)
    narrow, wide = 2 * least + 1, 2 * least + 3
    share = (4 * sigma**2 + 1 - narrow**2) / (wide**2 - narrow**2)
    for _ in range(3):
        less, more = (
            cv2.blur(
                values, (1 + across * (n - 1), 1 + down * (n - 1)), borderType=cv2.BORDER_CONSTANT
            )
            for n in (narrow, wide)
        )
        values = np.asarray(cv2.addWeighted(less, 1 - share, more, share, 0), np.float32)
    return values


def _spread(points: F64, values: F64, grid: SilhouetteGrid, camera: Camera) -> tuple[F32, F32]:
    """What world points (N, 3) cover of a grid (h, w) in [0, 1], and the mean of their values.

    Holes between them are closed; what is thin stays thin.
    """
    index, is_there = grid.cells(points, camera)
    shape, cells = (grid.height, grid.width), grid.width * grid.height
    count, total = (
        np.bincount(index, weight, cells).reshape(shape).astype(np.float32)
        for weight in (None, values[is_there])
    )
    near, total = (cv2.blur(a, (3, 3), borderType=cv2.BORDER_CONSTANT) for a in (count, total))
    usual = float(np.median(near.ravel()[index])) if len(index) else 1.0
    cover = cv2.morphologyEx(
        np.clip(2 * count / usual, 0, 1), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8),
        borderType=cv2.BORDER_CONSTANT, borderValue=0,
    )  # fmt: skip
    return np.asarray(cover, np.float32), np.asarray(total / np.maximum(near, 1e-6), np.float32)


def _outline(points: F64, grid: SilhouetteGrid, camera: Camera) -> F32:
    """(h, w) in [0, 1] what world points (N, 3), spread evenly, cover of a grid; its edge is sharp.

    Where half as many are as amid them, there the edge is, between cells that hold a few.
    """
    height, width = (-(-side // CRISP) for side in (grid.height, grid.width))
    coarse = SilhouetteGrid(grid.left, grid.top, CRISP * grid.pitch, width, height)
    index, _ = coarse.cells(points, camera)
    count = np.bincount(index, minlength=width * height).reshape(height, width)
    near = cv2.GaussianBlur(count.astype(np.float32), (0, 0), CELLS)
    usual = float(np.median(near[count > 0])) if len(index) else 1.0
    fine = cv2.resize(near, (CRISP * width, CRISP * height), interpolation=cv2.INTER_CUBIC)
    steep = np.sqrt(2 * np.pi) * CELLS * CRISP  # from 0 to 1 over a cell of the grid
    cover = np.clip((fine[: grid.height, : grid.width] / usual - 0.5) * steep + 0.5, 0, 1)
    return np.asarray(cover, np.float32)


def opacity(shadow: Shadow, far: F32, near: F32 | float) -> F32:
    """How opaque a shadow is (h, w), of what the whole object takes and of what touches."""
    light = np.asarray((1 - far) * (1 - np.float32(shadow.contact) * near), np.float32)
    left = 1 - DARKEST * shadow.strength * (1 - light)
    alpha = 1 - np.maximum(left, 0) ** (1 / GAMMA)  # blurs of several widths may take over all
    return np.clip((alpha - FAINTEST) / (1 - FAINTEST), 0, 1).astype(np.float32)


def trimmed(alpha: F32, grid: SilhouetteGrid, colour: tuple[float, float, float]) -> Shade | None:
    """A shadow (h, w) as a picture that ends clear; None where all of it is."""
    x0, y0, x1, y1 = box_of(alpha)
    if x0 == x1:
        return None
    left, top = grid.left + grid.pitch * (x0 - 1), grid.top + grid.pitch * (y0 - 1)
    return Shade(np.pad(alpha[y0:y1, x0:x1], 1), left, top, grid.pitch, colour)
