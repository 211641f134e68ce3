"""Parts before others: the front is cut between them, and each has a back of its own."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from objectmorpher_core.document.model import LiftSettings
from objectmorpher_core.lift.relief.body import FRONT, ReliefBody
from objectmorpher_core.lift.relief.cuts import REACH, find_cuts
from objectmorpher_core.lift.relief.fusion import fused
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.lift.relief.spreading import spread
from objectmorpher_research.training.shapes.sample import make_sample
from tests.core.lift.test_fusion import SIDE, camera_of, truth

SIZE, CELL, EXTENT = 80, 1.0, 70.0
INSIDE = np.zeros((SIZE, SIZE), bool)
INSIDE[5:75, 5:75] = True
BAR = np.zeros((SIZE, SIZE), bool)
BAR[5:75, 30:45] = True
JUMP = 20.0  # px
TILTED = 0.2 * np.arange(SIZE)[None, :] + 0.1 * np.arange(SIZE)[:, None]
NEAR_EDGE = (BAR & ~cv2.erode(BAR.astype(np.uint8), np.ones((1, 3))).astype(bool)).astype(float)


def cuts_of(front, edge=NEAR_EDGE):
    return find_cuts(front, edge, INSIDE, CELL, EXTENT)


def test_a_bar_is_cut_along_both_its_sides_and_nowhere_else():
    found = cuts_of(TILTED + JUMP * BAR)
    assert found is not None
    assert not found.down.any()
    columns = np.unique(np.nonzero(found.right)[1])
    assert columns.tolist() == [29, 44]
    assert found.right[5:75, [29, 44]].all()


def test_nothing_is_cut_without_an_edge_or_without_a_jump():
    assert cuts_of(TILTED + JUMP * BAR, np.zeros((SIZE, SIZE))) is None
    assert cuts_of(TILTED, np.ones((SIZE, SIZE))) is None
    assert cuts_of(4 * TILTED, np.ones((SIZE, SIZE))) is None  # steep, but a slope


def test_slopes_are_those_of_either_side():
    found = cuts_of(TILTED + JUMP * BAR)
    assert found is not None
    down, right = found.gradient(TILTED + JUMP * BAR)
    assert np.allclose(right[6:74], 0.2)
    assert np.allclose(down[6:74], 0.1)


@pytest.mark.parametrize("blur", [1.0, 1.5])
def test_a_blurred_jump_is_made_sharp(blur):
    sharp = JUMP * BAR.astype(float)
    blurred = cv2.GaussianBlur(sharp, (0, 0), blur)
    found = cuts_of(blurred, cv2.GaussianBlur(NEAR_EDGE, (0, 0), 1.0) * 2)
    assert found is not None
    again = found.sharpened(blurred, INSIDE)
    before, after = (np.abs(f - sharp)[INSIDE].mean() for f in (blurred, again))
    assert after < 0.2 * before
    far = cv2.dilate(found.beside().astype(np.uint8), np.ones((2 * REACH + 1,) * 2)) == 0
    assert np.array_equal(again[far], blurred[far])


@pytest.fixture(scope="module")
def armed():
    """A figure whose arm, or leg, is before the rest of it: the sample, where, and its body."""
    sample = make_sample(3, families=("figures",))
    apart = (sample.depth - sample.thickness > 0.06) & sample.mask
    assert sample.edge.sum() > 60 and apart.sum() > 400
    outline = ReliefSilhouette.of(sample.mask)
    return sample, apart, ReliefBody.of(outline, camera_of(sample), LiftSettings())


def test_an_arm_before_a_body_has_a_back_and_the_body_goes_on_beneath(armed):
    sample, apart, body = armed
    found = fused(body, truth(sample), camera_of(sample), 1.0, 1.0)
    inner = found.overlaps
    assert inner is not None and found.cuts is not None
    outline = found.silhouette
    at = outline.photo_xy(outline.cells).astype(int).clip(0, SIDE - 1)
    is_true = apart[at[..., 1], at[..., 0]] & outline.inside
    assert (inner.is_apart & is_true).sum() > 0.4 * is_true.sum()
    assert (inner.is_apart & ~is_true).sum() < 0.3 * max(inner.is_apart.sum(), 1)
    front = found.sample(outline.photo_xy(outline.cells).reshape(-1, 2), FRONT)[0]
    front = front.reshape(outline.shape)
    assert (inner.own_back <= front + 1e-6).all()
    assert (inner.beneath < inner.own_back)[inner.is_apart].all()
    assert (inner.walls.foot <= inner.walls.top).all()


def test_no_front_hangs_between_two_parts(armed):
    """Uncut, the front is a curtain from the arm to the body behind it."""
    sample, _, whole = armed

    def hanging(seen) -> float:
        body = fused(whole, seen, camera_of(sample), 1.0, 1.0)
        surface, _ = spread(body, 6000, 1.0, np.random.default_rng(0))
        own = surface.is_front & surface.is_seen & ~surface.is_brim
        x, y = surface.xy[own].astype(int).clip(0, SIDE - 1).T
        height = surface.height[own] / SIDE
        low, high = (f(sample.front, np.ones((3, 3))) for f in (cv2.erode, cv2.dilate))
        shift = np.median(height - sample.front[y, x])
        share = (height - shift - low[y, x]) / np.maximum(high - low, 1e-3)[y, x]
        between = (share > 0.25) & (share < 0.75)
        beside = cv2.dilate(sample.edge.astype(np.uint8), np.ones((3, 3)))[y, x] > 0
        return float(between[beside].mean())

    seen = truth(sample)
    uncut = replace(seen, edge=np.zeros_like(seen.edge))
    # Settling draws some of what hangs to its side even without an edge, so cuts save less.
    assert hanging(seen) < 0.65 * hanging(uncut)


def test_what_is_inside_is_not_seen_at_rest(armed):
    sample, _, body = armed
    found = fused(body, truth(sample), camera_of(sample), 1.0, 1.0)
    surface, spacing = spread(found, 6000, 1.0, np.random.default_rng(0))
    inner = surface.is_front & ~surface.is_seen
    assert inner.any()
    top = found.sample(surface.xy[inner], FRONT)[0]
    is_under = surface.height[inner] < top + spacing
    assert is_under.mean() > 0.97
