"""Hair at the new outline of what turns: strands on the sides that the photo does not show.

Where hair ends at the photo's own outline, the matte has it, strand by strand. A side that turns
into view is a smooth surface, and would end as clay does. So strands are rooted on it, as long and
as dense as the photo's own hair is soft and ragged: thin Gaussians, mostly in plain colours. What
the photo has not seen is nowhere shown at rest (`raster.rules`), and so they are not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from ...base.arrays import F32, F64
from ...base.camera import Camera
from ...base.poisson_disk import nearest_in
from ...base.rotations import quats_from_matrices
from ...document.gaussians import Gaussians
from ...document.model import HAIR, LiftedObject, Matte, PhotoTexture
from ...raster.posed import RestSplats
from .canvas import bilinear

LARGEST = 1000  # px, root of the area of the object as its edge is looked at
COARSE = 4  # of these px to one of the grid on which that is summed up
MIXED, CRISP = (0.03, 0.97), 1.0  # alpha of what is soft; px of that across an edge as crisp as any
AROUND = 0.03  # x the root of the area, along the outline: what is alike
ALONG = 0.006  # x the root of the area: an edge without its strands
# Root mean square slope of alpha along the outline over that across it: of cloth, leather and
# plastic 0.1 to 0.25, of plush and fur 0.2 to 0.7.
SMOOTH, RAGGED = 0.26, 0.5
HAIRY = 0.2  # mean of that over an outline, below which it is nicked here and there, and not hairy
SOFTEST = 0.004  # x the root of the area: what is less soft has no hair that one sees
LENGTH, LONGEST = 3.0, 0.02  # of a strand: x what is soft; x the root of the area, at most
VARIED = 0.6, 1.3  # x that
THICKNESS, THINNEST = 0.02, 0.4  # standard deviation: x its length; px, at least
TAPERED = 2.2  # standard deviations in a strand
AREA = 0.025  # x its length squared, of surface for each
MOST = 6_000  # strands
TURNED = -0.65, 0.0  # cosines at rest, between which the outline of a turned object lies
LEANING = 48.0, 78.0  # degrees to the normal
DOWN, WAVY, LOOSE = 0.4, 0.35, 0.35  # what their directions are made of
WAVE = 6.0  # radians per object unit
ROOT = 0.25  # x a strand's length, from its root to its middle: the rest is in the surface
FACING = 0.6  # of the way to the camera, x the normal: they are seen when the outline is theirs
UNEVEN = 0.12  # of the logarithm of a strand's colour


class Hair(NamedTuple):
    """Of the outline nearest to each cell of a grid over a matte."""

    soft: F32  # (h, w) px of the photo, by which it is softer than a crisp edge
    ragged: F32  # (h, w) in [0, 1], how surely it ends in hair
    scale: float  # cells per px of the photo
    root: float  # px of the photo, of the object's area
    mean: float  # of `ragged`, over the outline

    def at(self, xy: F64) -> tuple[F64, F64]:
        """Softness and raggedness (n,) at px (n, 2) of the matte."""
        own = xy * self.scale - 0.5
        return bilinear(self.soft, own), bilinear(self.ragged, own)


def hair_of(alpha: F32) -> Hair | None:
    """The hair at the outline of a matte (h, w); None where there is no outline.

    Across a smooth edge alpha changes along its normal alone, however soft it is; where hair ends,
    it changes from strand to strand.
    """
    area = float(np.count_nonzero(alpha > 0.5)) ** 0.5
    scale = min(1.0, LARGEST / max(area, 1.0))
    size = max(1, round(alpha.shape[1] * scale)), max(1, round(alpha.shape[0] * scale))
    small = np.asarray(cv2.resize(alpha, size, interpolation=cv2.INTER_AREA), np.float32)
    broad = cv2.GaussianBlur(small, (0, 0), max(ALONG * scale * area, 1e-3))
    solid = (broad > 0.5).astype(np.uint8)
    edge = cv2.morphologyEx(solid, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    if not edge.any():
        return None
    soft = (small > MIXED[0]) & (small < MIXED[1])
    slope, way = (
        np.stack([cv2.Scharr(field, cv2.CV_32F, 1, 0), cv2.Scharr(field, cv2.CV_32F, 0, 1)])
        for field in (small, broad)
    )
    way = way / np.maximum(np.hypot(*way), 1e-6)
    across, along = slope[0] * way[0] + slope[1] * way[1], slope[0] * way[1] - slope[1] * way[0]
    is_edge = (broad > MIXED[0]) & (broad < MIXED[1])
    fields = soft, 0.5 * edge, is_edge * along**2, is_edge * across**2  # both sides are in `edge`
    size = max(1, size[0] // COARSE), max(1, size[1] // COARSE)
    coarse = [
        cv2.resize(np.asarray(field, np.float32), size, interpolation=cv2.INTER_AREA)
        for field in fields
    ]
    sigma = max(AROUND * scale * area / COARSE, 1e-3)
    width, length, uneven, even = (cv2.GaussianBlur(field, (0, 0), sigma) for field in coarse)
    softness = np.asarray((width / np.maximum(length, 1e-3) - CRISP) / scale, np.float32)
    ratio = np.sqrt(uneven / np.maximum(even, 1e-9))
    ragged = ((ratio - SMOOTH) / (RAGGED - SMOOTH)).clip(0, 1)
    outline = coarse[1] > 0
    nearest, mean = nearest_in(outline), float(ragged[outline].mean())
    coarser = size[0] / alpha.shape[1]
    return Hair(softness.ravel()[nearest], ragged.ravel()[nearest], coarser, area, mean)


def with_strands(lifted: LiftedObject, matte: Matte, camera: Camera, seed: int = 0) -> LiftedObject:
    """`lifted` with strands of hair where the `matte` of the photo's `camera` has some.

    The same object where there is none. Where its other side shows the photo, so do they.
    """
    if (hair := hair_of(matte.alpha)) is None or hair.mean < HAIRY:
        return lifted
    rest, rng = RestSplats(lifted, camera), np.random.default_rng(seed)
    soft, ragged = hair.at(np.asarray(lifted.texture.u0 - [matte.left, matte.top], np.float64))
    px = 1 / (rest.zoom * lifted.scale)  # object units
    length = np.minimum(LENGTH * soft, LONGEST * hair.root) * px
    is_turned = (rest.cosines > TURNED[0]) & (rest.cosines < TURNED[1])
    roots = np.flatnonzero(lifted.is_body & is_turned & (soft > SOFTEST * hair.root) & (ragged > 0))
    if not len(roots):
        return lifted
    wanted = ragged[roots] * lifted.spacing**2 / (AREA * length[roots] ** 2)
    wanted *= min(1.0, MOST / wanted.sum())
    roots = np.repeat(roots, np.floor(wanted + rng.random(len(roots))).astype(int))
    return _Growth(lifted, rest, roots, length[roots], px[roots]).grown(rng)


@dataclass(frozen=True, eq=False)
class _Growth:
    """Strands to be."""

    lifted: LiftedObject
    rest: RestSplats
    roots: np.ndarray  # (n,) the Gaussians that they grow from
    length: F64  # (n,) object units
    px: F64  # (n,) object units in a px of the photo there

    def grown(self, rng: np.random.Generator) -> LiftedObject:
        """The object with its strands after its Gaussians."""
        count, seen = len(self.roots), self.lifted.texture
        texture = PhotoTexture(
            seen.u0[self.roots], np.zeros(count, np.float32), np.ones(count, np.float32)
        )
        return appended(self.lifted, self._strands(rng), texture, self.roots)

    def _strands(self, rng: np.random.Generator) -> Gaussians:
        lifted, roots, count = self.lifted, self.roots, len(self.roots)
        axes = lifted.world_from_object[:3, :3] / lifted.scale  # of the object, in the world
        normal, root = self.rest.normals[roots] @ axes, self.rest.means[roots]
        lying = DOWN * axes[1] + LOOSE * rng.normal(size=(count, 3))
        lying += WAVY * np.sin(WAVE * root @ rng.normal(size=(3, 3))) @ rng.normal(size=(3, 3))
        lying = _unit(lying - (lying * normal).sum(1, keepdims=True) * normal)
        lean = np.radians(rng.uniform(*LEANING, count))[:, None]
        way = np.cos(lean) * normal + np.sin(lean) * lying
        length = self.length * rng.uniform(*VARIED, count)
        beside = lifted.spacing * rng.uniform(-0.5, 0.5, (count, 2))
        means = root + beside[:, :1] * np.cross(normal, lying) + beside[:, 1:] * lying
        means += ROOT * length[:, None] * way
        facing = normal + FACING * _unit(lifted.object_points(np.zeros(3)) - root)
        facing = _unit(facing - (facing * way).sum(1, keepdims=True) * way)
        thick = np.maximum(THICKNESS * length, THINNEST * self.px)
        return Gaussians(
            means.astype(np.float32),
            quats_from_matrices(np.stack([way, np.cross(facing, way), facing], -1)),
            np.column_stack([length / TAPERED, thick, 0.8 * thick]).astype(np.float32),
            np.full(count, HAIR, np.float32),
            self._colours(rng),
        )

    def _colours(self, rng: np.random.Generator) -> F32:
        """(n, 3) about those of what a strand grows from."""
        shown, sides = self.lifted.gaussians.colors[self.roots], self.lifted.sides
        if sides is not None:
            most = np.array(sides.pixels.shape[1::-1]) - 1
            at = np.floor(sides.at[self.roots] - [sides.left, sides.top]).astype(int).clip(0, most)
            own = sides.pixels[at[:, 1], at[:, 0]] / 255
            shown = np.where(sides.zoom[self.roots, None] != 0, own, shown)
        light = np.exp(rng.normal(0, UNEVEN, (len(shown), 1)))
        return np.asarray((shown * light).clip(0, 1), np.float32)


def appended(
    lifted: LiftedObject, gaussians: Gaussians, texture: PhotoTexture, like: np.ndarray
) -> LiftedObject:
    """An object with further `gaussians` (n,), each as deep as the one that it is `like` (n,)."""
    sides, own, seen = lifted.sides, lifted.gaussians, lifted.texture
    if sides is not None:
        nothing = np.zeros(len(like))
        none = np.zeros((len(like), 2)), np.zeros((len(like), 2, 3)), nothing
        at, slopes, zoom = map(_joined, (sides.at, sides.slopes, sides.zoom), none)
        real = None if sides.real is None else np.append(sides.real, nothing > 0)
        sides = replace(sides, at=at, slopes=slopes, zoom=zoom, real=real)
    return replace(
        lifted, sides=sides, gaussians=Gaussians(*map(_joined, vars(own).values(),
                                                      vars(gaussians).values())),
        texture=PhotoTexture(*map(_joined, vars(seen).values(), vars(texture).values())),
        middle=None if lifted.middle is None else _joined(lifted.middle, lifted.middle[like]),
    )  # fmt: skip


def _unit(vectors: F64) -> F64:
    """(n, 3) of length 1."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)


def _joined(first: np.ndarray, second: np.ndarray) -> F32:
    return np.concatenate([first, second]).astype(np.float32)
