"""The common part of every backend: check the prompt, keep what it points at, fill holes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from ..base.arrays import RGB, Mask, Selection
from ..base.masks import box_of
from ..document.model import BesidePrompt, Prompt

SMALLEST = 16  # px; less is no object
SMALL_HOLE = 0.002  # x area of the mask; smaller holes are specks, larger ones are meant
SMALL_ISLAND = 0.02  # x area of the largest piece; smaller pieces that no click touches are specks


class SelectionError(ValueError):
    """No sensible selection is possible. The message is one sentence for the user."""


def check_prompt(rgb: RGB, prompt: Prompt) -> None:
    """Raises SelectionError where the prompt says nothing, or points outside the photo (H, W)."""
    height, width = rgb.shape[:2]
    if prompt.is_empty:
        raise SelectionError("nothing is chosen: click the object, box it, or ask for the subject")
    for click in prompt.clicks:
        if not (0 <= click.x < width and 0 <= click.y < height):
            at = f"the click at {click.x:g}, {click.y:g}"
            raise SelectionError(f"{at} is outside the photo of {width} x {height} px")
    if prompt.box is not None:
        x0, y0, x1, y1 = prompt.box
        if not (x0 < x1 and y0 < y1 and x1 > 0 and y1 > 0 and x0 < width and y0 < height):
            corners = f"the box {x0:g}, {y0:g}, {x1:g}, {y1:g}"
            raise SelectionError(f"{corners} holds nothing of the photo of {width} x {height} px")
    elif not prompt.is_subject and not any(c.is_foreground for c in prompt.clicks):
        raise SelectionError("every click says what is not the object: click the object too")
    _check_contradiction(prompt)


def _check_contradiction(prompt: Prompt) -> None:
    """Raises SelectionError where one pixel is said to be the object and not to be it."""
    said: dict[tuple[int, int], bool] = {}
    for click in prompt.clicks:
        pixel = (int(click.x), int(click.y))
        if said.setdefault(pixel, click.is_foreground) != click.is_foreground:
            at = f"{click.x:g}, {click.y:g}"
            raise SelectionError(f"the clicks at {at} say both that it is the object and is not")


def free_mask(shape: tuple[int, ...], prompt: Prompt) -> Mask:
    """(H, W) True where what is meant may be: inside the prompt's box, beside other objects.

    A click on the object beside the box says that the box was drawn too small.
    """
    if isinstance(prompt, BesidePrompt) and prompt.taken is not None:
        return ~prompt.taken & free_mask(shape, _alone(prompt))
    if prompt.box is None:
        return np.ones(shape[:2], bool)
    x0, y0, x1, y1 = prompt.box
    if not all(x0 <= c.x <= x1 and y0 <= c.y <= y1 for c in prompt.clicks if c.is_foreground):
        return np.ones(shape[:2], bool)
    inside = np.zeros(shape[:2], bool)
    inside[max(int(y0), 0) : int(np.ceil(y1)), max(int(x0), 0) : int(np.ceil(x1))] = True
    return inside


def is_bounded(prompt: Prompt) -> bool:
    """Whether `free_mask` is not everywhere."""
    return prompt.box is not None or isinstance(prompt, BesidePrompt)


def cropped(prompt: Prompt, box: tuple[int, int, int, int]) -> Prompt:
    """The prompt, what other objects cover cut to a box left, top, right, bottom px of it."""
    if not isinstance(prompt, BesidePrompt) or prompt.taken is None:
        return prompt
    return replace(prompt, taken=prompt.taken[box[1] : box[3], box[0] : box[2]])


def _alone(prompt: Prompt) -> Prompt:
    """The prompt without what other objects cover."""
    return Prompt(prompt.clicks, prompt.box, prompt.is_subject, prompt.level)


def box_around(selection: Selection, px: float) -> tuple[slice, slice] | None:
    """The box around what is selected, `px` larger, inside the photo; None for nothing."""
    x0, y0, x1, y1 = box_of(selection, int(np.ceil(px)))
    return None if x0 == x1 else np.s_[y0:y1, x0:x1]


def keep_touched(mask: Mask, prompt: Prompt) -> Mask:
    """The pieces (H, W) that a positive click touches; of a group all that are sizeable, too."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if count <= 1:
        return mask
    clicks = [c for c in prompt.clicks if c.is_foreground]
    kept = {int(labels[int(c.y), int(c.x)]) for c in clicks} - {0}
    is_many = prompt.is_subject or prompt.level == "group"
    if not clicks or is_many or (not kept and prompt.box is not None):
        areas = stats[1:, cv2.CC_STAT_AREA]
        kept |= {int(k) + 1 for k in np.flatnonzero(areas >= SMALL_ISLAND * areas.max())}
    is_kept = np.zeros(count, bool)
    is_kept[sorted(kept)] = True
    return is_kept[np.asarray(labels, np.int32)]


def fill_small_holes(mask: Mask, prompt: Prompt) -> Mask:
    """`mask` without its small holes, except those that a negative click is in."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        (~mask).astype(np.uint8), connectivity=4
    )
    areas = stats[:, cv2.CC_STAT_AREA]
    small = areas < SMALL_HOLE * mask.sum()
    small[0] = False
    for click in prompt.clicks:
        if not click.is_foreground:
            small[labels[int(click.y), int(click.x)]] = False
    return mask | small[labels] if count > 1 else mask


def obey(mask: Mask, prompt: Prompt) -> Mask:
    """`mask` where the prompt lets what is meant be, with its clicks; see `check_mask`."""
    mask = mask & free_mask(mask.shape, prompt)
    for click in prompt.clicks:
        mask[int(click.y), int(click.x)] = click.is_foreground
    return check_mask(mask)


def check_mask(mask: Mask) -> Mask:
    """`mask`, or SelectionError where it is a speck or covers the whole photo."""
    if mask.all():
        raise SelectionError("the selection covers the whole photo: say what is not the object")
    if mask.sum() < SMALLEST:
        raise SelectionError("nothing stands out there: add a click or a box")
    return mask


# How much around a click is meant: a part lies in its object, and the object in its group.


def at_level(prompt: Prompt, find: Callable[[Prompt], Mask]) -> Mask:
    """Return `find`'s answer to a prompt (H, W), kept within or around its answer for the object.

    A part that is a speck and a group that is everything say nothing: then it is the object.
    """
    whole = find(replace(prompt, level="object"))
    if prompt.level == "object" or not any(c.is_foreground for c in prompt.clicks):
        return whole
    try:
        found = find(prompt)
    except SelectionError:
        return whole
    return nest(found, whole, prompt.level)


def nest(found: Mask, whole: Mask, level: str) -> Mask:
    """A part (H, W) within its object `whole`, or a group around it; see `at_level`."""
    nested = found & whole if level == "part" else found | whole
    return whole if nested.all() or nested.sum() < SMALLEST else nested
