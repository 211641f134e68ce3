"""The layers of the picture's specification: steps 5 to 7 of `reference`, which see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import F32, F64
from ..base.camera import Camera
from .rules import RULES, Splatting
from .texture import TextureLevels, sample_texture

MEDIAN = 0.5  # of alpha: where the object is


@dataclass(frozen=True, eq=False)
class Picture3D:
    """A rendered object."""

    color: F32  # (h, w, 3) sRGB in [0, 1], premultiplied
    alpha: F32  # (h, w)
    # (h, w) world units: of the layer with which alpha, from the front, reaches a half; else of the
    # first that is visible; inf where there is none
    depth: F32
    from_photo: F32  # (h, w) share of the pixel that shows the photo at its own pixels' detail
    shift: F32  # (h, w, 2) photo px from where the pixel is to where it looks, the same layer


@dataclass(frozen=True, eq=False)
class Projected:
    """Gaussians on the screen, in the order of their depth."""

    centre: F64  # (N, 2) view px
    conic: F64  # (N, 3) inverse of the filtered screen covariance: xx, xy, yy
    extent: F64  # (N, 2) view px, half-size of the box outside which alpha is 0
    depth: F64  # (N,) world units
    slope: F64  # (N, 2) depth per view px, within the Gaussian
    shift: F64  # (N, 2) photo px: u0 minus the photo point at `centre`
    shift_slope: F64  # (N, 2, 2) per view px: A minus that of the unmoved photo
    magnified: F64  # (N,) photo px per view px, the larger
    weight: F64  # (N,) alpha's, see step 1
    photo: F64  # (N,) share of alpha that shows the photo
    body: F64  # (N,) share that shows the Gaussian's own colour
    matted: F64  # (N,) how much the matte's edge is to be trusted
    solidity: F64  # (N,) alpha of the photo part where it is not
    edged: F64  # (N,) share of the photo part that ends with the surface, as bodies do
    seen: F64  # (N,) 1 = the photo part was visible in the photo
    aside: F64  # (N,) 1 = the photo part is an invented picture
    color: F64  # (N, 3)


@dataclass(frozen=True, eq=False)
class GaussianSamples:
    """A Gaussian at the pixels of its box."""

    window: tuple[slice, slice]
    alpha: F64  # (h, w)
    gradient: F64  # (h, w, 2) of alpha, per px
    depth: F64  # (h, w)
    shift: F64  # (h, w, 2)


class Sums:
    """Over the samples of one layer, per pixel."""

    def __init__(self, height: int, width: int) -> None:
        self.total = np.zeros((height, width))  # of alpha
        self.body = np.zeros((height, width))  # of it, what the photo does not give
        self.slope = np.zeros((height, width, 2))  # gradient of `total`
        self.ended = np.zeros((height, width))  # of it, what ends with the surface
        self.ended_slope = np.zeros((height, width, 2))
        self.clear = np.ones((height, width))  # product of 1 - alpha
        self.body_clear = np.ones((height, width))
        self.depth = np.zeros((height, width))
        self.shift = np.zeros((height, width, 2))
        self.side = np.zeros((height, width))  # of the photo part, what is invented
        self.side_shift = np.zeros((height, width, 2))
        self.matted = np.zeros((height, width))
        self.unmatted = np.zeros((height, width))  # solidity of the part that is not matted
        self.magnified = np.zeros((height, width))
        self.seen = np.zeros((height, width))
        self.color = np.zeros((height, width, 3))

    def add(self, p: Projected, i: int, s: GaussianSamples, member: F64) -> None:
        """Adds a Gaussian's samples; `member` (h, w) is how much of them belongs here."""
        at, alpha = s.window, member * s.alpha
        gradient = member[..., None] * s.gradient
        photo, body = alpha * p.photo[i], alpha * p.body[i]
        both = p.photo[i] + p.body[i]
        self.total[at] += alpha * both
        self.body[at] += body
        self.slope[at] += gradient * both
        ended = p.body[i] + p.photo[i] * p.edged[i]
        self.ended[at] += alpha * ended
        self.ended_slope[at] += gradient * ended
        self.clear[at] *= 1 - np.minimum(alpha * both, 1)
        self.body_clear[at] *= 1 - np.minimum(body, 1)
        self.depth[at] += alpha * both * s.depth
        aside = photo * p.aside[i]
        self.shift[at] += (photo - aside)[..., None] * s.shift
        self.side[at] += aside
        self.side_shift[at] += aside[..., None] * s.shift
        self.matted[at] += photo * p.matted[i]
        self.unmatted[at] += photo * (1 - p.matted[i]) * p.solidity[i]
        self.magnified[at] += photo * max(p.magnified[i] / RULES.sharp, 1.0)
        self.seen[at] += photo * p.seen[i]
        self.color[at] += body[..., None] * p.color[i]


class ReferenceComposite:
    """Layers over one another, front to back (steps 5 to 7)."""

    def __init__(
        self, texture: TextureLevels, camera: Camera, photo_camera: Camera, kind: Splatting
    ) -> None:
        self.texture, self.camera, self.photo_camera = texture, camera, photo_camera
        self.kind = kind
        shape = (camera.height, camera.width)
        self.color = np.zeros((*shape, 3))
        self.alpha = np.zeros(shape)
        self.depth = np.full(shape, np.inf)
        self.from_photo = np.zeros(shape)
        self.shift = np.zeros((*shape, 2))
        self.last_shift = np.zeros((*shape, 2))  # of the previous layer
        self.last_share = np.zeros(shape)  # of it, that shows the photo itself
        self.last_through = np.ones(shape)  # transmittance before it
        self.last_whole = np.zeros(shape)  # its coverage

    def add(self, layer: Sums) -> None:
        """Composites the next layer."""
        at = np.nonzero(layer.total > 0)
        total, body = layer.total[at], layer.body[at]
        photo = np.maximum(total - body, 0)
        is_photo = photo > 1e-6 * total
        weight = np.maximum(photo, 1e-30)
        side = np.where(is_photo, layer.side[at] / weight, 0)
        own = np.maximum(photo - layer.side[at], 0)
        is_own, is_side = own > 1e-6 * total, side > 1e-6
        shift = layer.shift[at] / np.maximum(own, 1e-30)[:, None]
        aside = layer.side_shift[at] / np.maximum(layer.side[at], 1e-30)[:, None]
        lod = np.log2(np.maximum(layer.magnified[at] / weight, 1.0))
        look = self._looks(at, shift, is_own)
        sample = sample_texture(self.texture, look, lod)
        sample[~is_own, 3] = 0.0
        invented = sample_texture(self.texture, self._looks(at, aside, is_side), lod)[:, :3]
        matte = (sample[:, 3] * layer.matted[at] + layer.unmatted[at]) / weight
        if self.kind.is_edged:
            turned = 1 - (layer.matted[at] + layer.unmatted[at]) / weight
            closed = np.clip(turned / RULES.closing_share, 0, 1)
            closed *= smoothstep(sample[:, 3], RULES.closed_start, RULES.closed_end)
            matte += (1 - matte) * closed
        matte = np.where(is_photo, matte, 0.0)
        # The photo counts as far as the matte has something of it, invented pictures are whole.
        share = np.where(is_own, np.minimum(side * is_side / np.maximum(matte, 1e-30), 1), is_side)
        sample[:, :3] += share[:, None] * (invented - sample[:, :3])
        shift = np.where(is_own[:, None], shift, aside)
        visible = np.minimum((1 - share) / np.maximum(1 - side, 1e-6), 1) * layer.seen[at]
        if self.kind.is_surface:
            whole = _coverage(total, np.linalg.norm(layer.slope[at], axis=1))
            slope = np.linalg.norm(layer.ended_slope[at], axis=1)
            solid = _coverage(layer.ended[at], slope)
        else:
            whole, solid = 1 - layer.clear[at], 1 - layer.body_clear[at]
        alpha = matte * whole + (1 - matte) * solid
        shown = photo * matte
        mixed = (shown[:, None] * sample[:, :3] + layer.color[at]) / np.maximum(
            shown + body, 1e-30
        )[:, None]
        size = np.array([self.photo_camera.width, self.photo_camera.height])
        within = is_own & ((look > 0) & (look < size)).all(1)  # elsewhere the texture is made up
        seen = within * visible / weight * shown / np.maximum(shown + body, 1e-30)
        distance = np.linalg.norm(shift - self.last_shift[at], axis=1)
        same = smoothstep(distance, RULES.apart, RULES.same_point)
        share = np.where(is_photo, np.maximum(1 - side, 0) * photo / total, 0.0)
        same = same * share * self.last_share[at]
        clear = 1 - self.alpha[at]
        apart, split = clear * alpha, self.last_through[at] * (1 - self.last_whole[at]) * alpha
        through = np.minimum(apart + same * (split - apart), clear)
        self.last_through[at] = clear + same * (self.last_through[at] - clear)
        covered = same * self.last_whole[at]
        self.last_whole[at] = 1 - (1 - covered) * (1 - whole)
        self.last_shift[at], self.last_share[at] = shift, share
        first = np.isinf(self.depth[at]) & (alpha > RULES.visible)
        first |= (self.alpha[at] < MEDIAN) & (self.alpha[at] + through >= MEDIAN)
        self.depth[at] = np.where(first, layer.depth[at] / total, self.depth[at])
        self.shift[at] = np.where((first & is_photo)[:, None], shift, self.shift[at])
        self.color[at] += through[:, None] * mixed
        self.from_photo[at] += through * seen
        self.alpha[at] += through

    def _looks(self, at: tuple[np.ndarray, ...], shift: F64, is_there: np.ndarray) -> F64:
        """(n, 2) px of the photo that is shown at pixels `at` with a `shift` (n, 2), else 0."""
        ratio = self.photo_camera.focal / self.camera.focal
        xy = np.stack([at[1], at[0]], 1) + 0.5 - [self.camera.cx, self.camera.cy]
        look = xy * ratio + [self.photo_camera.cx, self.photo_camera.cy] + shift
        return np.where(is_there[:, None], look, 0)

    def picture(self) -> Picture3D:
        """Return the picture of all layers so far."""
        arrays = (self.color, self.alpha, self.depth, self.from_photo, self.shift)
        return Picture3D(*(a.astype(np.float32) for a in arrays))


def smoothstep(value: np.ndarray, zero: float, one: float) -> np.ndarray:
    """Rise smoothly from 0 at `zero` to 1 at `one`."""
    t = np.clip((value - zero) / (one - zero), 0, 1)
    return t * t * (3 - 2 * t)


def _coverage(total: np.ndarray, slope: np.ndarray) -> np.ndarray:
    edge = (total - RULES.surface_level) / (RULES.edge_width * slope + 1e-6)
    return np.clip(0.5 + edge, 0, 1)
