"""Clicks on real photos give whole, clean objects; nonsense gives one sentence."""

from __future__ import annotations

import time
from functools import cache

import cv2
import numpy as np
import pytest

from objectmorpher_core import segment
from objectmorpher_core.base.progress import silent
from objectmorpher_core.document.model import Click, Prompt
from objectmorpher_core.segment import SelectionError
from tests.core.segment.contract import *  # noqa: F403
from tests.core.segment.contract import SKETCH, ellipses, overlap, prompt
from tests.core.segment.encoded import dino, embedding
from tests.photos import photo
from tests.tree import quick

RESIZED = 0.97  # IoU of a photo's mask with the mask of the photo at another size
RAGGED = 1.08  # outline's length over its smoothed one; a staircase of patches is 1.3 and more

LONG = ("rocket", "chelsea")  # by size; the others are in the first stage
OBJECTS = {  # photo: clicks, points that must be in the mask, points that must not
    "chelsea": (
        [(150, 80), (15, 50, False)],
        [(250, 150), (330, 12), (275, 150), (40, 270), (210, 280), (25, 150)],
        [(15, 50), (400, 100), (400, 250), (440, 20)],
    ),
    "coffee": (
        [(300, 130)],
        [(230, 270), (120, 250), (365, 280), (290, 30), (405, 85)],
        [(40, 40), (550, 60), (560, 350), (60, 380)],
    ),
    "astronaut": (
        [(180, 440), (400, 430, False)],
        [(220, 60), (225, 130), (60, 300), (150, 380), (225, 190), (330, 330)],
        [(400, 430), (410, 100), (20, 100), (400, 300), (100, 60)],
    ),
    "rocket": ([(320, 250)], [(322, 140), (323, 200), (324, 380)], [(300, 200), (200, 200)]),
}


@cache
def loaded(name: str) -> segment.Segmenter:
    """A backend, its networks read once for all tests."""
    return segment.load(name)


@pytest.fixture(scope="module", params=quick(sorted(segment.BACKENDS), 2))
def segmenter(request):
    """Every backend that can run here."""
    backend = loaded(request.param)
    reason = backend.missing()
    if reason is not None:
        pytest.skip(reason)
    return backend


@pytest.fixture(scope="module")
def is_trained() -> bool:
    return True


@pytest.fixture(scope="module", name="dino")
def _dino() -> segment.Segmenter:
    """The learned backend; the test is skipped without its networks."""
    return dino()


@pytest.mark.slow
def test_a_huge_photo_takes_seconds():
    small = photo("flower")
    huge = cv2.resize(small, (6000, 4000), interpolation=cv2.INTER_LINEAR)
    start = time.process_time()
    mask = segment.load("grabcut").segment(huge, prompt([(2900, 2250)]), None, silent)
    assert time.process_time() - start < 10  # s; 1.5 on two idle cores
    same = segment.load("grabcut").segment(small, prompt([(309, 240)]), None, silent)
    shrunk = cv2.resize(mask.astype(np.uint8), same.shape[::-1], interpolation=cv2.INTER_AREA)
    assert overlap(shrunk > 0, same) > RESIZED


def test_an_unknown_backend_is_refused_with_the_known_names():
    with pytest.raises(SelectionError, match=r"'dinosaur'.*dino, subject, grabcut"):
        segment.load("dinosaur")


def test_without_weights_auto_is_grabcut_and_the_subject_says_what_is_missing(
    monkeypatch, tmp_path, disc
):
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path))
    assert segment.load("auto").name == "grabcut"
    for name in segment.BACKENDS:
        with pytest.raises(SelectionError, match="objectmorpher models get"):
            segment.load(name).segment(disc, Prompt(is_subject=True), None, silent)


def test_with_weights_auto_is_dino(dino):
    assert segment.load().name == "dino"


# Without weights ------------------------------------------------------------------------------


def test_colours_alone_find_the_flower(flower):
    mask = segment.load("grabcut").segment(flower, prompt([(310, 240)]), None, silent)
    assert overlap(mask, ellipses(flower.shape, (308, 223, 138, 137))) > SKETCH


@pytest.mark.parametrize("at", [(300, 215), (175, 125), (375, 375)])
def test_colours_alone_answer_a_click_on_a_speck_by_what_it_is_on(coffee, at):
    """What stands out most there is a highlight of a few cells, that colours then swallow."""
    found = segment.load("grabcut").segment(coffee, Prompt((Click(*at),)), None, silent)
    assert found[at[1], at[0]]
    assert 0.01 < found.mean() < 0.5


def test_colours_alone_find_the_pagoda_in_its_box(china):
    mask = segment.load("grabcut").segment(china, Prompt(box=(40, 10, 330, 420)), None, silent)
    for x, y in [(200, 60), (180, 150), (190, 250), (250, 340)]:
        assert mask[y, x]
    for x, y in [(60, 50), (310, 60), (325, 100)]:
        assert not mask[y, x]


# With weights ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n in LONG else ()) for n in OBJECTS]
)
def test_a_click_or_two_choose_the_whole_object(dino, name):
    clicks, inside, outside = OBJECTS[name]
    mask = dino.segment(photo(name), prompt(clicks), embedding(name), silent)
    assert [(x, y) for x, y in inside if not mask[y, x]] == []
    assert [(x, y) for x, y in outside if mask[y, x]] == []
    count, _ = cv2.connectedComponents(mask.astype(np.uint8))
    assert count == 2  # one piece, and the background


def test_the_cup_stands_on_its_saucer(dino, coffee):
    mask = dino.segment(coffee, prompt([(300, 130)]), embedding("coffee"), silent)
    drawn = ellipses(coffee.shape, (279, 214, 201, 175), (291, 105, 117, 88))
    assert overlap(mask, drawn) > SKETCH


def test_outlines_are_smooth(dino, coffee):
    mask = dino.segment(coffee, prompt([(300, 130)]), embedding("coffee"), silent)
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 4) > 0.5

    def length(image: np.ndarray) -> float:
        outlines, _ = cv2.findContours(
            image.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_TC89_L1
        )
        return max(cv2.arcLength(outline, True) for outline in outlines)

    assert length(mask) < RAGGED * length(smooth)


def test_any_click_on_the_astronaut_chooses_the_astronaut(dino, astronaut):
    masks = [
        dino.segment(astronaut, prompt([at]), embedding("astronaut"), silent)
        for at in [(220, 80), (180, 440), (150, 400)]
    ]
    assert min(overlap(masks[0], mask) for mask in masks[1:]) > RESIZED


def test_a_negative_click_takes_away_just_the_helmet(dino, astronaut):
    whole = dino.segment(astronaut, prompt([(220, 80)]), embedding("astronaut"), silent)
    asked = prompt([(220, 80), (400, 430, False)])
    without = dino.segment(astronaut, asked, embedding("astronaut"), silent)
    assert not (without & ~whole).sum() > 0.01 * whole.sum()
    gone = whole & ~without
    assert overlap(gone, ellipses(astronaut.shape, (390, 440, 112, 96))) > 0.8  # cut by the frame


@pytest.mark.slow
def test_a_second_positive_click_adds_what_it_is_on(dino, chelsea):
    head = [(250, 150), (40, 270, False)]
    first = dino.segment(chelsea, prompt(head), embedding("chelsea"), silent)
    asked = prompt([(250, 150), (40, 270)])
    second = dino.segment(chelsea, asked, embedding("chelsea"), silent)
    assert not first[270, 40]
    assert second[270, 40]
    assert (first & ~second).sum() < 0.01 * first.sum()


def test_the_subject_needs_no_click(dino, coffee):
    mask = dino.segment(coffee, Prompt(is_subject=True), embedding("coffee"), silent)
    clicked = dino.segment(coffee, prompt([(300, 130)]), embedding("coffee"), silent)
    assert overlap(mask, clicked) > RESIZED
    alone = segment.load("subject").segment(coffee, Prompt(is_subject=True), None, silent)
    assert overlap(alone, clicked) > RESIZED


@pytest.mark.slow
def test_the_same_photo_at_twice_the_size_gives_the_same_object(dino, coffee):
    small = dino.segment(coffee, prompt([(300, 130)]), embedding("coffee"), silent)
    double = cv2.resize(coffee, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
    large = dino.segment(double, prompt([(600, 260)]), None, silent)
    shrunk = cv2.resize(large.astype(np.uint8), small.shape[::-1], interpolation=cv2.INTER_AREA)
    assert overlap(shrunk > 0, small) > RESIZED
