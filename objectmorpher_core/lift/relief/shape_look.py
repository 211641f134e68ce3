"""A look by the shape network at an object: the distance of its front and back, and its end.

The network is ours (`training.train_shape`) and comes with the program; DINOv2, whose tokens it
reads, is fetched. Without that there is no look, and the silhouette alone tells the shape.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ... import models
from ...base.arrays import F32, RGB, Mask, Pixels
from ...base.camera import Camera
from ...models import registry
from ...models.onnx_session import Looks, open_session
from ...segment import dino_tokens
from ..crop import Crop, planes_of

NO_EDGE = -12.0  # logit
NORMAL, SIDEWAYS = slice(3, 6), 3  # of what the network says: the normals, and their x


@dataclass(frozen=True, eq=False)
class SeenShape:
    """Fields (s, s) over the crop's pixels, meaningful where `mask` is, in crop units."""

    crop: Crop
    mask: Mask
    front: F32  # how much nearer than height 0 the visible surface is
    thickness: F32  # to where the ray leaves the part that it sees
    depth: F32  # to where it leaves the whole object
    normal: F32  # (s, s, 3) unit, camera axes, towards the camera
    edge: F32  # probability that the surface ends beside here, before a farther part
    front_error: F32  # expected
    depth_error: F32  # expected
    flatness: float = -math.inf  # log odds that the object is flat, as a leaf, a card or a sign

    @property
    def doubt(self) -> float:
        """Expected error of the front, and of half the depth behind it, x the object's size."""
        rows, columns = np.nonzero(self.mask)
        size = max(np.ptp(rows), np.ptp(columns), 1) / len(self.mask)
        error = self.front_error[self.mask].mean() + 0.5 * self.depth_error[self.mask].mean()
        return float(error / size)

    @staticmethod
    def of(raw: F32, mask: Mask, crop: Crop, flatness: float = -math.inf) -> SeenShape:
        """Read the network's output, (9, s, s); see `training.shape_net`."""
        return SeenShape(
            crop, mask, raw[0] - raw[0][mask].mean(), raw[1], np.maximum(raw[1], raw[2]),
            _unit(raw[NORMAL]).transpose(1, 2, 0), 1 / (1 + np.exp(-np.maximum(raw[6], NO_EDGE))),
            np.exp(raw[7]), np.exp(raw[8]), flatness,
        )  # fmt: skip


_looks: Looks[SeenShape] = Looks()


def look(pixels: Pixels, mask: Mask, camera: Camera) -> SeenShape | None:
    """Look at `mask` (H, W) of a photo.

    None where the network cannot run, or the object is too thin for its pixels.
    """
    if missing() is not None or not mask.any():
        return None
    crop = Crop.around(mask, camera)
    rgb, seen = crop.seen(pixels), crop.seen_mask(mask)
    if not seen.any():
        return None
    return _looks.get(
        lambda: _network().look(rgb, seen, crop), rgb, seen, crop.tangents, about=str(crop[:3])
    )


@cache
def _network() -> ShapeModel:
    return ShapeModel(registry.shape_network())


def _unit(vectors: F32) -> F32:
    """Vectors (3, ...) of length 1."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=0), 1e-6)


def missing() -> str | None:
    """Return what the look needs and does not find here, as one sentence."""
    if models.path(registry.TOKENS) is None:
        return f"the model {registry.TOKENS} is not here: `objectmorpher models get`"
    return None if registry.is_shipped() else "the shape network is missing from this installation"


class ShapeModel:
    """The network in an ONNX file."""

    def __init__(self, data: bytes) -> None:
        self._session: Any = open_session(data)

    def look(self, rgb: RGB, mask: Mask, crop: Crop) -> SeenShape:
        """Look at a crop (s, s, 3) and at its mirror image; what is seen is the mean of both.

        What the network gets wrong in one it seldom gets equally wrong in the other.
        """
        mirrored = crop.tangents * np.array([-1, 1, 1], np.float32)
        direct, one = self._raw(rgb, mask, crop.tangents)
        other, two = self._raw(rgb[:, ::-1], mask[:, ::-1], mirrored)
        other = other[:, :, ::-1]
        other[SIDEWAYS] *= -1
        return SeenShape.of(0.5 * (direct + other), mask, crop, 0.5 * (one + two))

    def _raw(self, rgb: RGB, mask: Mask, tangents: F32) -> tuple[F32, float]:
        """(9, s, s) what the network says, its normals unit vectors; log odds that it is flat."""
        rgb, mask = np.ascontiguousarray(rgb), np.ascontiguousarray(mask)
        tokens = dino_tokens.shared().inner_tokens(rgb)
        wanted = {"planes": planes_of(rgb, mask, tangents), "tokens": tokens.transpose(2, 0, 1)}
        whole = {name: np.ascontiguousarray(value[None]) for name, value in wanted.items()}
        shape, flat = self._session.run(None, whole)
        raw = np.array(shape[0], np.float32)
        raw[NORMAL] = _unit(raw[NORMAL])
        return raw, float(flat[0])
