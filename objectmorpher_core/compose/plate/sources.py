"""Sources of a fill's parts, chosen by more than their look."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

from ...base.arrays import F32, RGB, Mask
from ...document.settings import Hint
from ...segment.salience import SubjectNet
from .structure_lines import Line, draw_lines

# What is known about where the parts of a fill come from, besides what they look like.

MOST_HINTS = 23  # so many bits does a float32 hold exactly


@dataclass(frozen=True, eq=False)
class PatchTone:
    """What patches keep to beside their look: coarse colours, say, known or wanted of the hole."""

    values: F32  # (h, w, K) levels up to 255
    share: F32  # (h, w) in [0, 1], how much they count

    def resized(self, width: int, height: int) -> PatchTone:
        size = width, height
        values, share = (
            np.asarray(cv2.resize(field, size, interpolation=cv2.INTER_AREA), np.float32)
            for field in (self.values, self.share)
        )
        return PatchTone(values, share)


@dataclass(frozen=True, eq=False)
class Regions:
    """Of what a picture's parts are, and what it costs to fill each place from them."""

    number: F32  # (h, w) the region of a source, from 0 on
    cost: F32  # (h, w, K) squared levels of 255, of a source from each region


@dataclass(frozen=True, eq=False)
class Guide:
    """The guide of one picture (h, w)."""

    unlikely: F32  # (h, w) squared levels of 255 that taking a pixel costs
    lines: tuple[Line, ...] = ()
    hints: tuple[Hint, ...] = ()  # the last ones win
    tone: PatchTone | None = None
    regions: Regions | None = None


@dataclass(frozen=True, eq=False)
class PatchGuide:
    """A guide at one size, as `patch_search` reads it; the second layer is the mirror image."""

    wanted: F32  # (h, w, 3 + K)
    offered: F32  # (2, h, w, 4)
    unlikely: F32  # (2, h, w)
    tone: PatchTone  # of no values where none is asked for


def guidance(guide: Guide, hole: Mask) -> PatchGuide:
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
    number = np.zeros((height, width), np.float32)
    if guide.regions is not None:
        size, cost = (width, height), guide.regions.cost
        number = cv2.resize(guide.regions.number, size, interpolation=cv2.INTER_NEAREST)
        costs = [cv2.resize(c, size, interpolation=cv2.INTER_AREA) for c in cv2.split(cost)]
        wanted = np.asarray(np.dstack([wanted, *costs]), np.float32)
    offered = np.asarray(np.dstack([offered, number]), np.float32)
    mirrored = offered[:, ::-1].copy()
    mirrored[..., :2] = 0  # no line goes on mirrored
    if guide.tone is None:
        tone = PatchTone(np.empty((height, width, 0), np.float32), unlikely)
    else:
        tone = guide.tone.resized(width, height)
    unlikely = np.stack([unlikely, unlikely[:, ::-1]])
    return PatchGuide(wanted, np.stack([offered, mirrored]), unlikely, tone)


# How unlikely it is that the background behind a hole looks like this or that source.

REACH = 0.35  # x the root of the hole's area: what is so near is around it
LEAST_REACH = 8.0  # px
STRANGE_COST = 2000.0  # squared levels of 255 that a source of a strange colour costs
SUBJECT_COST = 6000.0  # squared levels of 255 that a source on the subject costs
MOST_SUBJECT = 0.5  # share of what is around the hole: more, and the hole is amid the subject
MOST_HOLE, RIM = 0.5, 9  # share of a subject that is the hole: of more, it is none; px around it
BINS = 12  # of each channel of CIE Lab
RARE = 0.002  # share of what is around the hole that a colour must have, or it is none of it
SMOOTHING = 2.0  # px, over which a source's colour is taken


def unlikely(rgb: F32, hole: Mask) -> F32:
    """(h, w) squared levels of 255 that it should cost to fill the hole from each pixel.

    `rgb` (h, w, 3) has levels up to 255, in the hole some smooth guess.
    """
    reach = max(LEAST_REACH, REACH * float(np.sqrt(hole.sum())))
    away = cv2.distanceTransform((~hole).astype(np.uint8), cv2.DIST_L2, 5)
    around = (away > 0) & (away <= reach)
    if not around.any():
        return np.zeros(hole.shape, np.float32)
    picture = np.clip(rgb, 0, 255).astype(np.uint8)
    if _network().missing() is None:
        return np.asarray(SUBJECT_COST * subject(picture, around, hole), np.float32)
    return np.asarray(STRANGE_COST * strange(picture, around), np.float32)


def subject(picture: RGB, around: Mask, hole: Mask) -> F32:
    """(h, w) in [0, 1] the subject as U^2-Net-p sees it; nothing where the hole is amid it."""
    height, width = around.shape
    salience = cv2.resize(_network().salience(picture), (width, height))
    if salience[around].mean() > MOST_SUBJECT:
        return np.zeros(around.shape, np.float32)
    return beside_hole(np.clip(np.asarray(salience, np.float32), 0, 1), hole)


def beside_hole(salience: F32, hole: Mask) -> F32:
    """`salience` (h, w) in [0, 1] without what is mostly a `hole` (h, w).

    The smooth guess in a meadow's hole strikes the network, and the grass around with it.
    """
    count, labels = cv2.connectedComponents((salience > 0.5).astype(np.uint8))
    labels = np.asarray(labels, np.int32)
    own, whole = (np.bincount(part, minlength=count) for part in (labels[hole], labels.ravel()))
    is_hole = own > MOST_HOLE * whole
    is_hole[0] = False
    near = cv2.dilate(is_hole[labels].astype(np.uint8), np.ones((RIM, RIM), np.uint8)) > 0
    return np.where(near, np.float32(0), salience)


@cache
def _network() -> SubjectNet:
    return SubjectNet()


def strange(picture: RGB, around: Mask) -> F32:
    """(h, w) in [0, 1], 1 where a colour does not occur `around` the hole (h, w)."""
    smooth = cv2.GaussianBlur(picture, (0, 0), SMOOTHING)
    lab = cv2.cvtColor(smooth, cv2.COLOR_RGB2LAB).astype(int) * BINS // 256
    number = (lab[..., 0] * BINS + lab[..., 1]) * BINS + lab[..., 2]
    shares = np.bincount(number[around], minlength=BINS**3).reshape(BINS, BINS, BINS)
    shares = shares / around.sum()
    near = cv2.dilate(shares.reshape(BINS, BINS * BINS), np.ones((3, 1)))
    near = near.reshape(BINS * BINS, BINS)  # a bin's neighbours in lightness and in b
    near = cv2.dilate(near, np.ones((1, 3))).ravel()
    found = np.exp(-near / RARE).astype(np.float32)[number]
    return np.where(around, np.float32(0), found)
