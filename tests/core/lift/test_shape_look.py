"""The shape network that ships: its weights are the ones that were measured, and they help."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_core.document.model import LiftSettings
from objectmorpher_core.lift.crop import Crop
from objectmorpher_core.lift.relief import shape_look
from objectmorpher_core.lift.relief.fusion import fused
from objectmorpher_core.lift.relief.shape_look import SeenShape, ShapeModel
from objectmorpher_core.models import registry
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_research.training.shape_eval import (
    camera_of,
    relief,
    score,
    surfaces_of,
    true_surfaces,
)
from objectmorpher_research.training.shapes.families import FAMILIES
from objectmorpher_research.training.shapes.sample import Sample, make_sample
from tests import shapes

CARD = Path(__file__).parents[3] / "docs" / "shape_network"
UNSEEN = range(60_000_000, 60_000_016)  # neither trained on nor in the card's figures
TRAINED = tuple(name for name in FAMILIES if name != "prints")  # of the network that ships
MOST = 12e6  # bytes


@pytest.fixture(scope="module")
def net() -> ShapeModel:
    if (reason := shape_look.missing()) is not None:
        pytest.skip(reason)
    return ShapeModel(registry.shape_network())


@cache
def sample(seed: int) -> Sample:
    return make_sample(seed, families=TRAINED)


def seen(net: ShapeModel, one: Sample) -> SeenShape:
    return net.look(one.rgb, one.mask, Crop(0, 0, len(one.mask), one.tangents))


@pytest.mark.skipif(not registry.is_shipped(), reason="no shape network ships yet")
def test_the_weights_are_those_of_the_card():
    weights = registry.shape_network()
    told = json.loads((CARD / "figures.json").read_text(encoding="utf-8"))
    digest = hashlib.sha256(weights).hexdigest()
    assert told["sha256"] == digest
    assert digest in (CARD / "README.md").read_text(encoding="utf-8")
    assert len(weights) < MOST


def test_without_dinov2_nothing_is_seen_and_the_silhouette_is_lifted(monkeypatch, tmp_path):
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path))
    inside, camera = shapes.mask("ellipse"), shapes.camera()
    pixels = shapes.picture(inside)
    assert "objectmorpher models get" in (shape_look.missing() or "")
    assert shape_look.look(pixels, inside, camera) is None
    plain, trusting = (
        lift_mask(pixels, camera, inside, "relief", LiftSettings(2000, trust=trust))[1]
        for trust in (0.0, 1.0)
    )
    assert np.array_equal(plain.gaussians.means, trusting.gaussians.means)


def test_it_looks_once_at_the_same_thing(net):
    inside, camera = shapes.mask("ellipse"), shapes.camera()
    pixels = shapes.picture(inside)
    first = shape_look.look(pixels, inside, camera)
    assert first is not None
    assert shape_look.look(pixels, inside, camera) is first
    other = shape_look.look(255 - pixels, inside, camera)
    assert other is not None and other is not first


def test_what_it_says_is_a_shape(net):
    for seed in UNSEEN[:2]:
        one = sample(seed)
        found = seen(net, one)
        assert found.front.shape == one.mask.shape
        assert abs(float(found.front[one.mask].mean())) < 1e-4
        assert (found.thickness >= 0).all() and (found.depth >= found.thickness).all()
        assert np.allclose(np.linalg.norm(found.normal, axis=-1), 1, atol=1e-3)
        assert (found.edge >= 0).all() and (found.edge <= 1).all()
        assert (found.front_error > 0).all() and (found.depth_error > 0).all()


def test_of_a_mirror_image_it_says_the_mirror_image(net):
    one = sample(UNSEEN[0])
    tangents = one.tangents * np.array([-1, 1, 1], np.float32)
    found = seen(net, one)
    other = seen(net, replace(one, rgb=one.rgb[:, ::-1], mask=one.mask[:, ::-1], tangents=tangents))
    for name in ("front", "thickness", "depth", "edge", "front_error", "depth_error"):
        assert np.allclose(getattr(other, name)[:, ::-1], getattr(found, name), atol=1e-4), name
    assert np.allclose(other.normal[:, ::-1] * [-1, 1, 1], found.normal, atol=1e-4)


@pytest.mark.slow
def test_it_is_nearer_to_the_truth_than_the_silhouette(net):
    """On objects that it was not trained on; how much nearer is in the card."""
    errors = []
    for seed in UNSEEN:
        one = sample(seed)
        plain = relief(one.mask, one.tangents)
        bodies = [
            plain,
            fused(plain, seen(net, one), camera_of(one.tangents, len(one.mask)), 1.0, 1.0),
        ]
        true = true_surfaces(one.front, one.depth, one.tangents)
        errors.append([score(surfaces_of(body, one.mask), true, one.mask) for body in bodies])
    front = np.array([[each.front for each in pair] for pair in errors])
    thickness = np.array([[each.thickness for each in pair] for pair in errors])
    for error in (front, thickness):  # geometric means
        assert np.log(error[:, 1] / error[:, 0]).mean() < np.log(0.9)


@pytest.mark.slow
def test_it_knows_where_it_is_wrong(net):
    """Where it expects a larger error there is one."""
    expected, own = [], []
    for seed in UNSEEN:
        one = sample(seed)
        found = seen(net, one)
        error = found.front - one.front
        expected.append(float(np.log(found.front_error[one.mask]).mean()))
        own.append(float(np.log(np.abs(error - error[one.mask].mean())[one.mask].mean())))
    assert np.corrcoef(expected, own)[0, 1] > 0.3
