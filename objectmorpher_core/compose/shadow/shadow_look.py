"""A look by the shadow network at a thing's surroundings: where its shadow lies, and how surely.

The network is ours (`objectmorpher train shadow`) and comes with the program.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numpy as np

from ...base.arrays import F32, Mask
from ...models import registry
from ...models.onnx_session import open_session

SIDE, THING = 96, 32  # cells of what the network sees, and of the thing's longer side in it
CELLS = 2 * THING  # of that side on the grid that it is given
PLANES = 5
SEEN = 0.02  # of a cell, that the thing covers where it is looked at
MOSTLY = 0.75  # of a cell that is ground
CLOSER = 1.6  # x as large as that, the thing is looked at again
BRIGHT, COLOUR = 3.0, 1.5  # natural logarithms, beyond which nothing is told apart


@dataclass(frozen=True, eq=False)
class SeenShadow:
    """What the network finds."""

    shade: F32  # (h, w) probability that the thing takes light from the ground there
    odds: float  # log odds that it throws a shadow that one sees


def planes_of(brightness: F32, colour: F32, cover: F32, free: Mask) -> F32:
    """(PLANES, h, w) what the network sees, from natural logarithms of linear light.

    `brightness` (h, w), `colour` (h, w, 2) ratios of red and blue to green, `cover` (h, w) of the
    thing, `free` (h, w) where the ground is seen. Brightness and colour count from the ground's
    medians, so that exposure and white balance change nothing.
    """
    middle = float(np.median(brightness[free])) if free.any() else 0.0
    tone = np.median(colour[free], 0) if free.any() else np.zeros(2)
    is_seen = free | (cover > SEEN)
    light = np.clip(brightness - middle, -BRIGHT, BRIGHT) * is_seen
    tints = np.clip(colour - tone, -COLOUR, COLOUR) * is_seen[..., None]
    planes = [light, tints[..., 0], tints[..., 1], cover, free.astype(np.float32)]
    return np.stack(planes).astype(np.float32)


def look_for_shadow(brightness: F32, colour: F32, cover: F32, free: Mask) -> SeenShadow:
    """Look at surroundings (h, w) on a grid in whose middle the thing is, CELLS long.

    The fields are those of `planes_of`. The answer is on the same grid: the mean of what is seen
    in them and in their mirror image, the odds also of what is seen of both from nearer.
    """
    fields = brightness, colour, cover, free.astype(np.float32)
    mirrored = tuple(np.ascontiguousarray(field[:, ::-1]) for field in fields)
    own, other = _look(fields), _look(mirrored)
    nearer = [_look(enlarged(view, CLOSER)) for view in (fields, mirrored)]
    odds = np.mean([seen.odds for seen in (own, other, *nearer)])
    return SeenShadow(0.5 * (own.shade + other.shade[:, ::-1]), float(odds))


def _look(fields: tuple[F32, ...]) -> SeenShadow:
    """One look at the fields of `look_for_shadow`."""
    shade, odds = _session().run(None, {"planes": seen_planes(fields)[None]})
    chance = 1 / (1 + np.exp(-np.asarray(shade[0], np.float32)))
    whole = cv2.resize(chance, (2 * SIDE, 2 * SIDE), interpolation=cv2.INTER_LINEAR)
    shade_there = _middle(np.asarray(whole, np.float32), *fields[0].shape)
    return SeenShadow(shade_there, float(odds[0]))


def seen_planes(fields: tuple[F32, ...]) -> F32:
    """(PLANES, SIDE, SIDE) what the network sees in the fields of `look_for_shadow`."""
    light, colour, cover, free = (shrunk(field) for field in fields)
    return planes_of(light, colour, cover, free > MOSTLY)


def enlarged(fields: tuple[F32, ...], closer: float) -> tuple[F32, ...]:
    """Fields (h, w) or (h, w, n) as they are seen from so much nearer."""
    height, width = fields[0].shape[:2]
    size = round(closer * width), round(closer * height)
    larger = (cv2.resize(field, size, interpolation=cv2.INTER_LINEAR) for field in fields)
    return tuple(np.asarray(field, np.float32) for field in larger)


@cache
def _session() -> Any:
    return open_session(registry.shadow_network())


def shrunk(field: F32) -> F32:
    """A field (h, w) or (h, w, n) as the network sees it: SIDE cells, at half the resolution."""
    whole = _middle(np.asarray(field, np.float32), 2 * SIDE, 2 * SIDE)
    return np.asarray(cv2.resize(whole, (SIDE, SIDE), interpolation=cv2.INTER_AREA), np.float32)


def _middle(field: F32, height: int, width: int) -> F32:
    """The middle (height, width) of a field, 0 beyond it."""
    found = np.zeros((height, width, *field.shape[2:]), np.float32)
    rows, columns = (
        _overlap(has, wanted) for has, wanted in zip(field.shape[:2], (height, width), strict=True)
    )
    found[rows[1], columns[1]] = field[rows[0], columns[0]]
    return found


def _overlap(has: int, wanted: int) -> tuple[slice, slice]:
    """Where a row of `has` cells and one of `wanted`, in whose middle it is, meet: in each."""
    start, offset = max((has - wanted) // 2, 0), max((wanted - has) // 2, 0)
    count = min(has, wanted)
    return slice(start, start + count), slice(offset, offset + count)
