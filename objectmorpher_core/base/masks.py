"""What is in a mask: its box, its largest piece, what is near it; and pictures made smaller."""

from __future__ import annotations

import cv2
import numpy as np

from .arrays import F32, U8, Mask

Box = tuple[int, int, int, int]  # x0, y0, x1, y1 px


def box_of(mask: np.ndarray, margin: int = 0) -> Box:
    """The box around what is not 0 in `mask` (H, W), `margin` px larger, inside it.

    All of it is 0 where nothing is.
    """
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    if not len(rows):
        return 0, 0, 0, 0
    height, width = mask.shape
    return (
        max(int(columns[0]) - margin, 0), max(int(rows[0]) - margin, 0),
        min(int(columns[-1]) + 1 + margin, width), min(int(rows[-1]) + 1 + margin, height),
    )  # fmt: skip


def largest_piece(mask: Mask) -> Mask:
    """The largest of the connected pieces of `mask` (H, W); corners connect."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if count <= 2:
        return mask
    return np.asarray(labels) == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))


def disc(radius: int) -> U8:
    """(2 radius + 1, 2 radius + 1) the disc as OpenCV's morphology takes it."""
    size = 2 * radius + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)), np.uint8)


def dilated(mask: Mask, radius: int) -> Mask:
    """`mask` (H, W) and what is `radius` px from it at most."""
    return cv2.dilate(mask.astype(np.uint8), disc(radius)) > 0


def opened(mask: Mask) -> Mask:
    """The squares of 2 x 2 px in `mask` (H, W): no thinner line, and nothing beside it.

    OpenCV's own opening with an even kernel moves it by a pixel.
    """
    square = np.ones((2, 2), np.uint8)
    inner = cv2.erode(mask.astype(np.uint8), square, borderValue=0)
    return cv2.dilate(inner, square, anchor=(0, 0)) > 0


# Pictures of tens of megapixels, and the smaller ones in which something of them is decided.
#
# What is decided for a whole object, as its shape, is the same in a picture of a few megapixels;
# there it takes a second or two and hardly any memory.

LARGE = 30_000_000  # px, from which on a picture is worked on by parts
ENOUGH = 4_000_000  # px, of what a picture of more than twice as many is reduced to, at most
STRIP = 128  # rows of the smaller picture that are made at a time

Pads = tuple[tuple[int, int], tuple[int, int]]  # px above and below, left and right


def reduction(shape: tuple[int, ...]) -> int:
    """By how much the sides of a picture (H, W, ...) are divided; 1 for what is not large."""
    size, times = shape[0] * shape[1], 1
    if size > 2 * ENOUGH:
        while size > ENOUGH * times**2:
            times *= 2
    return times


def reduced(image: np.ndarray, times: int, pads: Pads = ((0, 0), (0, 0))) -> np.ndarray:
    """The means of `times` x `times` px of an image (H, W, ...), of its own type.

    `pads` are added before, copies of the image's rim, and so is what the last means lack.
    """
    (above, below), (left, right) = pads
    height, width = above + image.shape[0] + below, left + image.shape[1] + right
    size = -(-height // times), -(-width // times)
    small = np.empty((*size, *image.shape[2:]), image.dtype)
    for first in range(0, size[0], STRIP):
        count = min(STRIP, size[0] - first)
        start = times * first - above  # row of the image
        top, bottom = max(start, 0), min(start + times * count, image.shape[0])
        top, bottom = min(top, image.shape[0] - 1), max(bottom, 1)  # all of it may be a pad
        part = cv2.copyMakeBorder(
            image[top:bottom], max(top - start, 0), 0, left, 0, cv2.BORDER_REPLICATE
        )[: times * count]
        lacks = times * count - len(part), times * size[1] - part.shape[1]
        if any(lacks):
            part = cv2.copyMakeBorder(part, 0, lacks[0], 0, lacks[1], cv2.BORDER_REPLICATE)
        where = (size[1], count)
        cv2.resize(part, where, dst=small[first : first + count], interpolation=cv2.INTER_AREA)
    return small


def reduced_mask(mask: Mask, times: int) -> Mask:
    """A mask (H, W): what at least half of `times` x `times` px are in."""
    return reduced(mask.view(np.uint8) * np.uint8(255), times) >= 128


def smaller(picture: F32, scale: float) -> F32:
    """A picture (h, w) or (h, w, 3) so much smaller."""
    height, width = picture.shape[:2]
    size = max(round(width * scale), 1), max(round(height * scale), 1)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)


def widely_blurred(picture: F32, sigma: float, most: float = 12.0) -> F32:
    """(h, w) or (h, w, 3) blurred by `sigma` px; by more than `most` in a smaller picture."""
    scale = min(most / sigma, 1.0)
    blurred = cv2.GaussianBlur(smaller(picture, scale), (0, 0), sigma * scale)
    return np.asarray(cv2.resize(blurred, picture.shape[1::-1]), np.float32)


def bounds(picture: F32, where: Mask) -> tuple[F32, F32]:
    """(3,) the least and the greatest values of a picture (h, w, 3) `where` (h, w) one is."""
    part = where.astype(np.uint8)
    ends = [cv2.minMaxLoc(channel, part)[:2] for channel in cv2.split(picture)]
    least, greatest = np.array(ends, np.float32).T
    return least, greatest
