"""The shadow network that ships: it sees the shadows of scenes that it was not trained on."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest

from objectmorpher_core.compose.shadow.shadow_fit import Surroundings, surroundings
from objectmorpher_core.compose.shadow.shadow_look import SeenShadow, look_for_shadow, planes_of
from objectmorpher_core.models import registry
from objectmorpher_core.segment.matting.matte import build_matte
from tests.shadow_scenes import Scene, scene
from tests.tree import quick

SEEDS = range(1, 61, 2)  # held out
FEW = 14
LARGE = 0.15  # x the thing's area
PAGE = Path(__file__).parents[3] / "docs" / "compositing" / "README.md"


class Looked(NamedTuple):
    made: Scene
    around: Surroundings
    found: SeenShadow


@cache
def _looked(seed: int) -> Looked:
    made = scene(seed)
    around = surroundings(made.photo, build_matte(made.photo, made.mask, 20), None, 0.5)
    return Looked(made, around, _look(around))


def _look(around: Surroundings) -> SeenShadow:
    return look_for_shadow(around.brightness, around.colour, around.cover, around.free)


def test_the_weights_are_those_that_were_measured():
    assert hashlib.sha256(registry.shadow_network()).hexdigest() in PAGE.read_text("utf-8")


@pytest.mark.slow
def test_things_with_a_shadow_have_higher_odds():
    """Most pairs of a scene with a shadow that one sees and one without are in order."""
    odds: dict[bool, list[float]] = {True: [], False: []}
    for made, _, found in map(_looked, SEEDS):
        if not made.has_shadow or made.shade.sum() > LARGE * made.mask.sum():
            odds[made.has_shadow].append(found.odds)
    assert min(len(values) for values in odds.values()) > 5
    pairs = np.subtract.outer(odds[True], odds[False])
    assert (pairs > 0).mean() > 0.65


@pytest.mark.parametrize("seeds", quick([SEEDS[:FEW], SEEDS], 1), ids=len)
def test_shade_is_seen_where_it_lies(seeds: range):
    """Where the network is sure of a shadow, it sees more shade in it than on other ground."""
    inside, outside = [], []
    for made, around, found in map(_looked, seeds):
        if found.odds < 1 or not made.has_shadow:
            continue
        dark = _on_grid(made.dark, around)
        inside.append(found.shade[around.free & (dark > 0.2)].mean())
        outside.append(found.shade[around.free & (dark < 0.02)].mean())
    assert len(inside) > 3
    assert np.mean(inside) > 0.4
    assert np.mean(inside) > 4 * np.mean(outside)


def _on_grid(field: np.ndarray, around: Surroundings) -> np.ndarray:
    shift = [at + around.pitch / 2 - 0.5 for at in (around.left, around.top)]
    matrix = np.array([[around.pitch, 0, shift[0]], [0, around.pitch, shift[1]]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    size = around.cover.shape[::-1]
    return cv2.warpAffine(field.astype(np.float32), matrix, size, flags=flags)


def test_exposure_and_tint_change_nothing():
    for _, around, found in map(_looked, SEEDS[:4]):
        light = around.brightness + np.float32(0.4)
        tint = around.colour + np.float32([0.2, -0.1])
        other = look_for_shadow(light, tint, around.cover, around.free)
        np.testing.assert_allclose(other.odds, found.odds, atol=0.02)
        np.testing.assert_allclose(other.shade, found.shade, atol=0.02)


def test_any_surroundings_give_a_number():
    for shape in ((3, 70), (190, 5), (192, 192), (230, 200)):
        cover = np.zeros(shape, np.float32)
        for free in (np.zeros(shape, bool), np.ones(shape, bool)):
            found = look_for_shadow(cover - 3, np.zeros((*shape, 2), np.float32), cover, free)
            assert found.shade.shape == shape
            assert np.isfinite(found.shade).all()
            assert np.isfinite(found.odds)
            assert np.isfinite(planes_of(cover, np.zeros((*shape, 2)), cover, free)).all()
