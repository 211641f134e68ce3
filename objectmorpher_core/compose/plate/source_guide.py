"""What is known about where the parts of a fill come from, besides what they look like.

Some sources are unlikely, straight lines go on, and the user may have said from where to take
what. Everything is in px of the picture at its finest and drawn anew for each level of a pyramid.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, Mask
from ...document.hint import Hint
from .structure_lines import Line, draw_lines

MOST_HINTS = 23  # so many bits does a float32 hold exactly


@dataclass(frozen=True, eq=False)
class Guide:
    """Of one picture (h, w)."""

    unlikely: F32  # (h, w) squared levels of 255 that taking a pixel costs
    lines: tuple[Line, ...] = ()
    hints: tuple[Hint, ...] = ()  # the last ones win


@dataclass(frozen=True, eq=False)
class Guidance:
    """A guide at one size, as `patch_search` reads it; the second layer is the mirror image."""

    wanted: F32  # (h, w, 3)
    offered: F32  # (2, h, w, 3)
    unlikely: F32  # (2, h, w)


def guidance(guide: Guide, hole: Mask) -> Guidance:
    """The guide for a picture with this `hole` (h, w)."""
    height, width = hole.shape
    scale = width / guide.unlikely.shape[1], height / guide.unlikely.shape[0]
    wanted, offered = draw_lines(guide.lines, scale, hole)
    y, x = np.mgrid[:height, :width]
    for k, hint in enumerate(guide.hints[-MOST_HINTS:]):
        radius = max(hint.radius * min(scale), 1.0)
        for way, numbers in ((hint.to, wanted), (hint.source, offered)):
            away = np.hypot(x - way[0] * scale[0], y - way[1] * scale[1])
            inside = away <= radius
            if numbers is wanted:  # one place wants one thing, but is offered to any
                numbers[inside & hole, 2] = 1 << k
            else:
                numbers[inside, 2] += 1 << k
    resized = cv2.resize(guide.unlikely, (width, height), interpolation=cv2.INTER_AREA)
    unlikely = np.asarray(resized, np.float32)
    mirrored = offered[:, ::-1].copy()
    mirrored[..., :2] = 0  # no line goes on mirrored
    return Guidance(wanted, np.stack([offered, mirrored]), np.stack([unlikely, unlikely[:, ::-1]]))
