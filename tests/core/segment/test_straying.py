"""Outlines that lie beside the edge of the picture, and those that do not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from objectmorpher_core.base.arrays import RGB, Mask
from objectmorpher_core.segment.matting.soft_edge import signed_distance
from objectmorpher_core.segment.matting.straying import settle_outline
from tests.core.segment.truth_masks import TRUTHS, truth, truth_mask
from tests.photos import photo
from tests.tree import over

PLAIN = ("astronaut", "cat", "coffee", "dahlia", "second flower")  # no part is thin
WIDTH, RADIUS = 0.06, 0.09  # x root of the object's area, of what is wrong about an outline


def rgb_of(name: str) -> RGB:
    return np.asarray(photo(truth(name).photo))


def wrong(mask: Mask, adds: bool, rng: np.random.Generator) -> Mask:
    """The mask with a bulge over the ground, or a bite out of the object, at a random place."""
    root, away = np.sqrt(mask.sum()), signed_distance(mask)
    edge = np.argwhere(np.abs(away) < 1)
    y, x = edge[rng.integers(len(edge))]
    spot = np.zeros(mask.shape, np.uint8)
    cv2.circle(spot, (int(x), int(y)), round(RADIUS * root), 1, -1)
    near = (spot > 0) & (np.abs(away) < WIDTH * root)
    return mask | near if adds else mask & ~near


@over("name", [each.name for each in TRUTHS if each.kind == "whole"])
def test_a_true_outline_stays(name: str) -> None:
    mask = truth_mask(name)
    settled = settle_outline(rgb_of(name), mask)
    either = np.count_nonzero(settled | mask)
    assert np.count_nonzero(settled & mask) >= (1.0 if name in PLAIN else 0.985) * either


@pytest.mark.parametrize("adds", [True, False])
def test_a_wrong_outline_comes_nearer_to_the_true_one(adds: bool) -> None:
    before, after = 0, 0
    for name in PLAIN:
        mask, rgb, rng = truth_mask(name), rgb_of(name), np.random.default_rng(3)
        for _ in range(4):
            damaged = wrong(mask, adds, rng)
            settled = settle_outline(rgb, damaged)
            own, left = (np.count_nonzero(m != mask) for m in (damaged, settled))
            assert left <= 1.1 * own, name
            before, after = before + own, after + left
    assert after < 0.7 * before


def test_what_was_clicked_stays() -> None:
    name = "second flower"
    mask, rgb, rng = truth_mask(name), rgb_of(name), np.random.default_rng(3)
    damaged = wrong(mask, True, rng)
    settled = settle_outline(rgb, damaged)
    lost = damaged & ~settled
    assert lost.sum() > 0.5 * (damaged & ~mask).sum()
    y, x = np.argwhere(lost)[len(np.argwhere(lost)) // 2]
    clicked = np.zeros_like(mask)
    clicked[y, x] = True
    assert settle_outline(rgb, damaged, clicked)[y, x]


def test_nothing_and_everything_have_no_outline() -> None:
    rgb = np.zeros((40, 60, 3), np.uint8)
    for mask in (np.zeros((40, 60), bool), np.ones((40, 60), bool)):
        assert np.array_equal(settle_outline(rgb, mask), mask)
    line = np.zeros((40, 60), bool)
    line[20, 5:50] = True
    assert np.array_equal(settle_outline(rgb, line), line)
