"""How much around a click is meant: a part is in its object, and the object in its group."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_core import segment
from objectmorpher_core.base.progress import silent
from objectmorpher_core.document.model import LEVELS, Click, Prompt
from objectmorpher_core.pictures.image import read_picture
from tests.core.segment.encoded import embedding
from tests.photos import photo
from tests.tree import quick

SAMPLES = Path(__file__).parents[3] / "assets" / "samples"
PLACES = {
    "chelsea": (155, 113),
    "coffee": (300, 130),
    "rocket": (320, 200),
    "astronaut": (400, 430),
    "flower": (320, 200),
}


@cache
def loaded(backend: str) -> segment.Segmenter:
    return segment.load(backend)


@cache
def levels(backend: str, name: str) -> list[np.ndarray]:
    """The masks of a click at each of LEVELS."""
    reason = loaded(backend).missing()
    if reason is not None:
        pytest.skip(reason)
    rgb = read_picture((SAMPLES / f"{name}.jpg").read_bytes()).pixels
    is_known = backend == "dino" and np.array_equal(rgb, photo(name))
    known = embedding(name) if is_known else loaded(backend).encode(rgb, silent)
    prompts = [Prompt((Click(*PLACES[name]),), level=level) for level in LEVELS]
    return [loaded(backend).segment(rgb, p, known, silent) for p in prompts]


def check_nested(masks: list[np.ndarray], name: str) -> None:
    part, whole, group = masks
    x, y = PLACES[name]
    assert part[y, x]
    assert not (part & ~whole).any()
    assert not (whole & ~group).any()


@pytest.mark.parametrize("name", quick(PLACES, 2))
def test_a_part_is_in_its_object_and_the_object_in_its_group(name):
    check_nested(levels("grabcut", name), name)


@pytest.mark.slow
def test_so_it_is_by_tokens():
    check_nested(levels("dino", "flower"), "flower")


@pytest.mark.parametrize("backend", ["grabcut", "dino"])
def test_a_part_is_much_less_than_its_object_and_a_second_flower_belongs_to_the_group(backend):
    part, whole, group = levels(backend, "flower")
    assert part.sum() < 0.5 * whole.sum()
    assert group.sum() > 1.02 * whole.sum()


def test_a_level_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="level is 'all'"):
        Prompt(level="all")


def test_a_box_has_no_level():
    rgb = read_picture((SAMPLES / "flower.jpg").read_bytes()).pixels
    box = (150.0, 50.0, 500.0, 350.0)
    masks = [
        loaded("grabcut").segment(rgb, Prompt(box=box, level=level), None, silent)
        for level in ("part", "object")
    ]
    np.testing.assert_array_equal(*masks)
