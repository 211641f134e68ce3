"""A user who knows the truth: clicks where most is wrong, and the measures of what comes of it.

The first click is on the inmost point of the object; each further one on the inmost point of the
largest connected error, positive where something is missing, negative where something is too much.
Who wants a part may instead click the same place again, which asks for another level, once, as
the second click; of the two the better is kept, as the user sees both and can undo one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from objectmorpher_core.base.arrays import Mask
from objectmorpher_core.document.model import Click, Prompt

TOLERANCE = 2.0  # px, of the boundary measure


@dataclass(frozen=True, eq=False)
class Step:
    """What a click gave."""

    prompt: Prompt
    mask: Mask
    iou: float
    boundary: float  # F measure at TOLERANCE


def overlap(a: Mask, b: Mask) -> float:
    """Intersection over union."""
    return float((a & b).sum() / max((a | b).sum(), 1))


def boundary_f(found: Mask, truth: Mask) -> float:
    """F measure of the outlines within TOLERANCE; the photo's frame is no outline."""
    ours, theirs = _outline(found), _outline(truth)
    if not ours.any() or not theirs.any():
        return 0.0
    precision = (_distance(theirs)[ours] <= TOLERANCE).mean()
    recall = (_distance(ours)[theirs] <= TOLERANCE).mean()
    return float(2 * precision * recall / max(precision + recall, 1e-9))


def inmost(mask: Mask) -> tuple[float, float]:
    """x, y px (pixel centre) of the point of a mask (H, W) farthest from its edge."""
    framed = np.pad(mask, 1).astype(np.uint8)  # the frame is an edge, too
    depth = cv2.distanceTransform(framed, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    y, x = np.unravel_index(int(depth.argmax()), depth.shape)
    return float(x) - 0.5, float(y) - 0.5


def around(mask: Mask) -> tuple[float, float, float, float]:
    """The box that just holds a mask (H, W): left, top, right, bottom px."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    return float(columns[0]), float(rows[0]), float(columns[-1] + 1), float(rows[-1] + 1)


def use(segment: Callable[[Prompt], Mask], truth: Mask, clicks: int, is_part: bool) -> list[Step]:
    """What each of so many clicks gives; fewer steps where nothing is wrong any more."""
    steps = [_ask(segment, Prompt((Click(*inmost(truth)),)), truth)]
    while len(steps) < clicks and steps[-1].iou < 1:
        last = steps[-1]
        prompt = replace(last.prompt, clicks=(*last.prompt.clicks, worst_click(last.mask, truth)))
        step = _ask(segment, prompt, truth)
        if is_part and len(steps) == 1:
            part = _ask(segment, replace(last.prompt, level="part"), truth)
            step = max(step, part, key=lambda each: each.iou)
        steps.append(step)
    return steps


def worst_click(found: Mask, truth: Mask) -> Click:
    """A click in the middle of the largest error."""
    largest, click = 0, Click(0, 0)
    for wrong, is_foreground in ((truth & ~found, True), (found & ~truth, False)):
        _, labels, stats, _ = cv2.connectedComponentsWithStats(wrong.astype(np.uint8))
        areas = stats[1:, cv2.CC_STAT_AREA]
        if areas.size and areas.max() > largest:
            largest = areas.max()
            click = Click(*inmost(labels == 1 + int(areas.argmax())), is_foreground)
    return click


def _ask(segment: Callable[[Prompt], Mask], prompt: Prompt, truth: Mask) -> Step:
    mask = segment(prompt)
    return Step(prompt, mask, overlap(mask, truth), boundary_f(mask, truth))


def _outline(mask: Mask) -> Mask:
    """(H, W) the mask's pixels that touch what is not in it."""
    inner = cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1)
    return mask & (inner == 0)


def _distance(outline: Mask) -> np.ndarray:
    return cv2.distanceTransform((~outline).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
