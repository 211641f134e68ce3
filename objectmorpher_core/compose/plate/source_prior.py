"""How unlikely it is that the background behind a hole looks like this or that source.

What is behind an object is mostly more of what is around it, and seldom another subject: a face
beside the hole is not to grow into it. The subject is told by U^2-Net-p where its weights are
here; elsewhere colours are unlikely that do not occur around the hole.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from ...base.arrays import F32, RGB, Mask
from ...segment.subject import SubjectNet

REACH = 0.35  # x the root of the hole's area: what is so near is around it
LEAST_REACH = 8.0  # px
STRANGE_COST = 2000.0  # squared levels of 255 that a source of a strange colour costs
SUBJECT_COST = 6000.0  # squared levels of 255 that a source on the subject costs
MOST_SUBJECT = 0.5  # share of what is around the hole: more, and the hole is amid the subject
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
        return np.asarray(SUBJECT_COST * subject(picture, around), np.float32)
    return np.asarray(STRANGE_COST * strange(picture, around), np.float32)


def subject(picture: RGB, around: Mask) -> F32:
    """(h, w) in [0, 1] the subject as U^2-Net-p sees it; nothing where the hole is amid it."""
    network, nothing = _network(), np.zeros(around.shape, np.float32)
    height, width = around.shape
    salience = cv2.resize(network.salience(picture), (width, height))
    if salience[around].mean() > MOST_SUBJECT:
        return nothing
    return np.clip(np.asarray(salience, np.float32), 0, 1)


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
