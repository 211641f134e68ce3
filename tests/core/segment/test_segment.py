"""Clicks on real photos give whole, clean objects; nonsense gives one sentence."""

from __future__ import annotations

import pickle
import time
from functools import cache

import cv2
import numpy as np
import pytest

from objectmorpher_core import segment
from objectmorpher_core.document import Click, Prompt
from objectmorpher_core.progress import Cancelled, silent
from objectmorpher_core.segment import SelectionError
from tests.photos import photo

SKETCH = 0.9  # IoU with outlines drawn by eye as ellipses; a patch-wide rim would lose 0.1
RESIZED = 0.97  # IoU of a photo's mask with the mask of the photo at another size
RAGGED = 1.08  # outline's length over its smoothed one; a staircase of patches is 1.3 and more

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


def prompt(clicks) -> Prompt:
    return Prompt(tuple(Click(*click) for click in clicks))


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union."""
    return (a & b).sum() / (a | b).sum()


def ellipses(shape, *drawn) -> np.ndarray:
    """(H, W) union of ellipses (centre x, y, radius x, y)."""
    image = np.zeros(shape[:2], np.uint8)
    for x, y, across, down in drawn:
        cv2.ellipse(image, (x, y), (across, down), 0, 0, 360, (1,), -1)
    return image > 0


@pytest.fixture(scope="module", params=segment.BACKENDS)
def segmenter(request):
    """Every backend that can run here."""
    backend = loaded(request.param)
    reason = backend.missing()
    if reason is not None:
        pytest.skip(reason)
    return backend


@pytest.fixture(scope="module")
def dino():
    """The learned backend with both of its networks."""
    for name in ("dino", "subject"):
        reason = segment.load(name).missing()
        if reason is not None:
            pytest.skip(reason)
    return loaded("dino")


@pytest.fixture(scope="module")
def embeddings(dino):
    """photo name -> embedding, computed once."""
    kept: dict[str, object] = {}

    def embedding(name: str):
        if name not in kept:
            kept[name] = dino.encode(photo(name), silent)
        return kept[name]

    return embedding


@pytest.fixture(scope="module")
def disc() -> np.ndarray:
    """A light disc on grey with a little grain."""
    rng = np.random.default_rng(0)
    image = np.full((150, 200, 3), 90, np.uint8)
    cv2.circle(image, (100, 75), 40, (190, 180, 170), -1)
    return image + rng.integers(0, 6, image.shape, dtype=np.uint8)


@pytest.fixture(scope="module")
def disc_embedding(segmenter, disc):
    """Through pickle, as between the window and its worker."""
    return pickle.loads(pickle.dumps(segmenter.encode(disc, silent)))


# Every backend --------------------------------------------------------------------------------


def test_every_backend_keeps_the_contract(segmenter, disc, disc_embedding):
    before = disc.copy()
    asked = prompt([(100, 75)])
    mask = segmenter.segment(disc, asked, disc_embedding, silent)
    assert mask.shape == disc.shape[:2]
    assert mask.dtype == np.bool_
    np.testing.assert_array_equal(disc, before)
    np.testing.assert_array_equal(mask, segmenter.segment(disc, asked, None, silent))
    assert overlap(mask, ellipses(disc.shape, (100, 75, 40, 40))) > SKETCH


def test_every_backend_takes_a_box(segmenter, disc, disc_embedding):
    mask = segmenter.segment(disc, Prompt(box=(50, 25, 150, 125)), disc_embedding, silent)
    assert overlap(mask, ellipses(disc.shape, (100, 75, 40, 40))) > SKETCH


def test_nothing_outside_the_box_is_chosen(segmenter, disc, disc_embedding):
    asked = Prompt((Click(80, 60),), box=(40, 20, 100, 75))
    mask = segmenter.segment(disc, asked, disc_embedding, silent)
    assert mask[60, 80]
    assert not mask[:, 100:].any()
    assert not mask[75:].any()


def test_every_backend_lets_a_cancel_pass(segmenter, disc):
    def cancel(fraction: float, note: str) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        segmenter.segment(disc, prompt([(100, 75)]), None, cancel)


NONSENSE = {
    "empty": (Prompt(), "nothing is chosen"),
    "outside": (prompt([(200, 75)]), "click at 200, 75 is outside the photo of 200 x 150 px"),
    "negative": (prompt([(-1, 75)]), "click at -1, 75 is outside"),
    "nan": (prompt([(float("nan"), 75)]), "click at nan, 75 is outside"),
    "only not": (prompt([(100, 75, False)]), "click the object too"),
    "contradiction": (prompt([(100, 75), (100, 75, False)]), "say both"),
    "empty box": (Prompt(box=(50, 50, 50, 90)), "the box 50, 50, 50, 90 holds nothing"),
    "far box": (Prompt(box=(300, 0, 400, 90)), "holds nothing of the photo"),
    "click beside box": (Prompt((Click(10, 10),), box=(50, 50, 90, 90)), "is outside the box"),
}


@pytest.mark.parametrize("case", NONSENSE)
def test_nonsense_is_one_sentence_with_the_values(segmenter, disc, case):
    asked, sentence = NONSENSE[case]
    with pytest.raises(SelectionError, match=sentence):
        segmenter.segment(disc, asked, None, silent)


@pytest.mark.parametrize(
    "shape", [(1, 1), (1, 50), (16, 16), (12, 180)], ids=lambda s: f"{s[0]}x{s[1]}"
)
@pytest.mark.parametrize("grain", [1, 255], ids=["one colour", "noise"])
def test_tiny_and_empty_photos_give_a_mask_or_a_sentence(segmenter, shape, grain):
    image = np.random.default_rng(1).integers(0, grain, (*shape, 3), dtype=np.uint8)
    asked = prompt([(shape[1] // 2, shape[0] // 2)])
    try:
        mask = segmenter.segment(image, asked, None, silent)
    except SelectionError:
        return
    assert mask.shape == shape
    assert mask[shape[0] // 2, shape[1] // 2]
    assert not mask.all()


@pytest.mark.slow
def test_a_huge_photo_takes_seconds():
    small = photo("flower")
    huge = cv2.resize(small, (6000, 4000), interpolation=cv2.INTER_LINEAR)
    start = time.perf_counter()
    mask = segment.load("grabcut").segment(huge, prompt([(2900, 2250)]), None, silent)
    assert time.perf_counter() - start < 10  # s; 1.5 on two idle cores
    same = segment.load("grabcut").segment(small, prompt([(309, 240)]), None, silent)
    shrunk = cv2.resize(mask.astype(np.uint8), same.shape[::-1], interpolation=cv2.INTER_AREA)
    assert overlap(shrunk > 0, same) > RESIZED


def test_an_unknown_backend_is_refused_with_the_known_names():
    with pytest.raises(SelectionError, match=r"'sam'.*dino, subject, grabcut"):
        segment.load("sam")


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


def test_colours_alone_find_the_pagoda_in_its_box(china):
    mask = segment.load("grabcut").segment(china, Prompt(box=(40, 10, 330, 420)), None, silent)
    for x, y in [(200, 60), (180, 150), (190, 250), (250, 340)]:
        assert mask[y, x]
    for x, y in [(60, 50), (310, 60), (325, 100)]:
        assert not mask[y, x]


# With weights ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", OBJECTS)
def test_a_click_or_two_choose_the_whole_object(dino, embeddings, name):
    clicks, inside, outside = OBJECTS[name]
    mask = dino.segment(photo(name), prompt(clicks), embeddings(name), silent)
    assert [(x, y) for x, y in inside if not mask[y, x]] == []
    assert [(x, y) for x, y in outside if mask[y, x]] == []
    count, _ = cv2.connectedComponents(mask.astype(np.uint8))
    assert count == 2  # one piece, and the background


def test_the_cup_stands_on_its_saucer(dino, embeddings, coffee):
    mask = dino.segment(coffee, prompt([(300, 130)]), embeddings("coffee"), silent)
    drawn = ellipses(coffee.shape, (279, 214, 201, 175), (291, 105, 117, 88))
    assert overlap(mask, drawn) > SKETCH


def test_outlines_are_smooth(dino, embeddings, coffee):
    mask = dino.segment(coffee, prompt([(300, 130)]), embeddings("coffee"), silent)
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 4) > 0.5

    def length(image: np.ndarray) -> float:
        outlines, _ = cv2.findContours(
            image.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_TC89_L1
        )
        return max(cv2.arcLength(outline, True) for outline in outlines)

    assert length(mask) < RAGGED * length(smooth)


def test_any_click_on_the_astronaut_chooses_the_astronaut(dino, embeddings, astronaut):
    masks = [
        dino.segment(astronaut, prompt([at]), embeddings("astronaut"), silent)
        for at in [(220, 80), (180, 440), (150, 400)]
    ]
    assert min(overlap(masks[0], mask) for mask in masks[1:]) > RESIZED


def test_a_negative_click_takes_away_just_the_helmet(dino, embeddings, astronaut):
    whole = dino.segment(astronaut, prompt([(220, 80)]), embeddings("astronaut"), silent)
    asked = prompt([(220, 80), (400, 430, False)])
    without = dino.segment(astronaut, asked, embeddings("astronaut"), silent)
    assert not (without & ~whole).sum() > 0.01 * whole.sum()
    gone = whole & ~without
    assert overlap(gone, ellipses(astronaut.shape, (390, 440, 112, 96))) > 0.8  # cut by the frame


def test_a_second_positive_click_adds_what_it_is_on(dino, embeddings, chelsea):
    head = [(250, 150), (40, 270, False)]
    first = dino.segment(chelsea, prompt(head), embeddings("chelsea"), silent)
    asked = prompt([(250, 150), (40, 270)])
    second = dino.segment(chelsea, asked, embeddings("chelsea"), silent)
    assert not first[270, 40]
    assert second[270, 40]
    assert (first & ~second).sum() < 0.01 * first.sum()


def test_the_subject_needs_no_click(dino, embeddings, coffee):
    mask = dino.segment(coffee, Prompt(is_subject=True), embeddings("coffee"), silent)
    clicked = dino.segment(coffee, prompt([(300, 130)]), embeddings("coffee"), silent)
    assert overlap(mask, clicked) > RESIZED
    alone = segment.load("subject").segment(coffee, Prompt(is_subject=True), None, silent)
    assert overlap(alone, clicked) > RESIZED


@pytest.mark.slow
def test_the_same_photo_at_twice_the_size_gives_the_same_object(dino, embeddings, coffee):
    small = dino.segment(coffee, prompt([(300, 130)]), embeddings("coffee"), silent)
    double = cv2.resize(coffee, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
    large = dino.segment(double, prompt([(600, 260)]), None, silent)
    shrunk = cv2.resize(large.astype(np.uint8), small.shape[::-1], interpolation=cv2.INTER_AREA)
    assert overlap(shrunk > 0, small) > RESIZED
