"""What every segmenter keeps to: tests for the module that imports them.

The module has a fixture `segmenter` of module scope, and `is_trained`: whether it finds objects, or
is a network of random weights, whose masks may be anything.
"""

from __future__ import annotations

import pickle

import cv2
import numpy as np
import pytest

from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.document.model import BesidePrompt, Click, Prompt
from objectmorpher_core.segment import SelectionError
from objectmorpher_core.segment.selection import check_prompt
from tests.tree import over

SKETCH = 0.9  # IoU with outlines drawn by eye as ellipses; a patch-wide rim would lose 0.1


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


def test_every_backend_keeps_the_contract(segmenter, is_trained, disc, disc_embedding):
    before = disc.copy()
    asked = prompt([(100, 75)])
    mask = segmenter.segment(disc, asked, disc_embedding, silent)
    assert mask.shape == disc.shape[:2]
    assert mask.dtype == np.bool_
    np.testing.assert_array_equal(disc, before)
    np.testing.assert_array_equal(mask, segmenter.segment(disc, asked, None, silent))
    assert not is_trained or overlap(mask, ellipses(disc.shape, (100, 75, 40, 40))) > SKETCH


def test_every_backend_takes_a_box(segmenter, is_trained, disc, disc_embedding):
    mask = segmenter.segment(disc, Prompt(box=(50, 25, 150, 125)), disc_embedding, silent)
    assert mask.any() and not mask[:, :50].any() and not mask[125:].any()
    assert not is_trained or overlap(mask, ellipses(disc.shape, (100, 75, 40, 40))) > SKETCH


def test_nothing_outside_the_box_is_chosen(segmenter, disc, disc_embedding):
    asked = Prompt((Click(80, 60),), box=(40, 20, 100, 75))
    mask = segmenter.segment(disc, asked, disc_embedding, silent)
    assert mask[60, 80]
    assert not mask[:, 100:].any()
    assert not mask[75:].any()


def test_what_other_objects_cover_is_not_chosen(segmenter, is_trained, disc, disc_embedding):
    taken = np.zeros(disc.shape[:2], bool)
    taken[:, 100:] = True
    asked = BesidePrompt((Click(80, 75),), taken=taken)
    mask = segmenter.segment(disc, asked, disc_embedding, silent)
    assert mask[75, 80] and not (mask & taken).any()
    half = ellipses(disc.shape, (100, 75, 40, 40)) & ~taken
    assert not is_trained or overlap(mask, half) > SKETCH


def test_a_click_beside_the_box_says_that_it_was_too_small(
    segmenter, is_trained, disc, disc_embedding
):
    asked = Prompt((Click(75, 75), Click(130, 75)), box=(60, 35, 120, 115))
    check_prompt(disc, asked)
    if not is_trained:  # random weights may see nothing at all
        return
    mask = segmenter.segment(disc, asked, disc_embedding, silent)
    assert mask[75, 75] and mask[75, 130]
    assert overlap(mask, ellipses(disc.shape, (100, 75, 40, 40))) > SKETCH


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
}


@over("case", NONSENSE)
def test_nonsense_is_one_sentence_with_the_values(segmenter, disc, case):
    asked, sentence = NONSENSE[case]
    with pytest.raises(SelectionError, match=sentence):
        segmenter.segment(disc, asked, None, silent)


@over("tiny", [((1, 1), 1), ((1, 50), 255), ((16, 16), 1), ((12, 180), 255)])
def test_tiny_and_empty_photos_give_a_mask_or_a_sentence(segmenter, tiny):
    shape, grain = tiny  # of one colour, or of noise
    image = np.random.default_rng(1).integers(0, grain, (*shape, 3), dtype=np.uint8)
    asked = prompt([(shape[1] // 2, shape[0] // 2)])
    try:
        mask = segmenter.segment(image, asked, None, silent)
    except SelectionError:
        return
    assert mask.shape == shape
    assert mask[shape[0] // 2, shape[1] // 2]
    assert not mask.all()
