"""What a click on a wrong place means: seen from both sides, and what it cuts off stays."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.document.model import Click, Prompt
from objectmorpher_core.segment.pieces import answers
from objectmorpher_core.segment.pieces.answers import PieceAnswer, add_click
from objectmorpher_core.segment.pieces.choice import Correction, PieceGround, correct
from objectmorpher_core.segment.pieces.pieces import Pieces

GROUND, COAT, FACE, POLE = (120, 150, 90), (40, 40, 50), (210, 180, 160), (70, 70, 85)


def picture(*patches: tuple[tuple[int, int, int], slice, slice]) -> np.ndarray:
    """(160, 240, 3) colours in rows and columns of a plain ground, a little noisy."""
    image = np.full((160, 240, 3), GROUND, np.int16)
    for color, rows, columns in patches:
        image[rows, columns] = color
    image += np.random.default_rng(0).integers(-2, 3, image.shape, dtype=np.int16)
    return image.clip(0, 255).astype(np.uint8)


def share(pieces: np.ndarray, inside: np.ndarray) -> float:
    """How much of the pieces in `inside` (n,) are in `pieces` (n,)."""
    return float(pieces[inside].mean())


def test_a_correction_may_be_what_the_other_click_leaves():
    """A walk from the coat is on the pole, which is like it, long before it is on the face."""
    coat = (slice(40, 150), slice(20, 120))
    face = (slice(10, 40), slice(30, 70))
    pole = (slice(90, 100), slice(120, 220))
    image = picture((COAT, *coat), (FACE, *face), (POLE, *pole))
    pieces = Pieces(image, None)
    is_man, is_pole = np.zeros(image.shape[:2]), np.zeros(image.shape[:2])
    is_man[coat] = is_man[face] = is_pole[pole] = 1
    man, thing = pieces.mean(is_man) > 0.5, pieces.mean(is_pole) > 0.5
    ask = Correction(Click(70, 95, False), man | thing, (pieces.at(210, 95),))
    choice = correct(PieceGround(pieces, None), ask)
    regions = [region.pieces for region in choice.others]
    assert any(share(each, man) > 0.95 and share(each, thing) < 0.1 for each in regions)


def test_no_correction_holds_what_a_click_denies():
    image = picture((COAT, slice(40, 150), slice(20, 120)), (POLE, slice(90, 100), slice(120, 220)))
    pieces = Pieces(image, None)
    rng = np.random.default_rng(0)
    for _ in range(5):
        allowed = rng.random(pieces.count) < 0.9
        click = Click(float(rng.uniform(20, 120)), float(rng.uniform(40, 150)), False)
        walls = tuple(rng.integers(0, pieces.count, 2))
        walls = tuple(int(wall) for wall in walls if wall != pieces.at(click.x, click.y))
        choice = correct(PieceGround(pieces, None), Correction(click, allowed, walls))
        assert choice.pieces[pieces.at(click.x, click.y)]
        for region in choice.others:
            assert not region.pieces[list(walls)].any()


@pytest.mark.parametrize(("width", "stays"), [(60, True), (8, False)])
def test_what_a_click_cuts_off_stays_where_it_is_no_speck(width: int, stays: bool):
    """Three things side by side are selected, and a click says that the middle one is not it."""
    left, right = (slice(50, 100), slice(30, 90)), (slice(50, 100), slice(150, 150 + width))
    middle = (slice(50, 100), slice(90, 150))
    image = picture((FACE, *left), (COAT, *middle), (FACE, *right))
    mask = np.zeros(image.shape[:2], bool)
    mask[left] = mask[middle] = mask[right] = True
    prompt = Prompt((Click(60, 75), Click(120, 75, False)))
    ground = PieceGround(Pieces(image, None), None)
    found = add_click(ground, image, PieceAnswer(mask, ()), prompt).mask
    assert found[left].mean() > 0.9
    assert found[middle].mean() < 0.1
    assert (found[right].mean() > 0.8) == stays


def test_an_island_stays_when_a_click_is_elsewhere():
    """A small one that no click touches, and a large one, of which a click takes a part away."""
    large, part, small = (
        (slice(40, 120), slice(20, 100)),
        (slice(100, 120), slice(20, 100)),
        (slice(60, 72), slice(200, 212)),
    )
    image = picture((FACE, *large), (COAT, *part), (FACE, *small))
    mask = np.zeros(image.shape[:2], bool)
    mask[large] = mask[small] = True
    prompt = Prompt((Click(60, 70), Click(60, 110, False)))
    found = add_click(
        PieceGround(Pieces(image, None), None), image, PieceAnswer(mask, ()), prompt
    ).mask
    assert found[part].mean() < 0.1
    assert found[small].all()


@pytest.mark.parametrize("width", [3, 4, 6])
def test_a_strip_narrower_than_the_pieces_goes_without_what_it_runs_along(width: int):
    body, strip = (slice(30, 130), slice(80, 140)), (slice(30, 130), slice(140, 140 + width))
    image = picture((FACE, *body), (COAT, *strip))
    mask = np.zeros(image.shape[:2], bool)
    mask[body] = mask[strip] = True
    prompt = Prompt((Click(110, 80), Click(140 + width / 2, 80, False)))
    found = add_click(
        PieceGround(Pieces(image, None), None), image, PieceAnswer(mask, ()), prompt
    ).mask
    assert found[strip].mean() < 0.5
    assert found[body].mean() > 0.98


def test_a_window_that_cuts_off_what_a_click_means_is_widened():
    """What coarse pieces say of a long strip is short, and so is the first window around it."""
    body, strip = (slice(40, 120), slice(80, 140)), (slice(40, 120), slice(140, 144))
    image = picture((FACE, *body), (COAT, *strip))
    mask = np.zeros(image.shape[:2], bool)
    mask[body] = mask[strip] = True
    prompt = Prompt((Click(110, 80), Click(142, 80, False)))
    short = np.zeros_like(mask)
    short[76:84, 140:144] = True
    ground = PieceGround(Pieces(image, None), None)
    window = answers._around(short)
    assert window.bottom - window.top < 50
    found = answers._finer(ground, image, mask, prompt, window)
    assert found[strip].mean() > 0.8
    assert found[body].mean() < 0.02


def test_what_coarser_pieces_say_is_heard_and_holds_no_denied_piece():
    """A thing of two colours that a walk from one of them does not leave; no edge parts the two."""
    upper, lower = (slice(40, 90), slice(60, 180)), (slice(90, 140), slice(60, 180))
    image = picture((FACE, *upper), (COAT, *lower))
    pieces = Pieces(image, None)
    ground, click = PieceGround(pieces, None), Click(120, 65)
    whole = np.zeros(image.shape[:2])
    whole[upper] = whole[lower] = 1
    guess = pieces.mean(whole) > 0.5
    everything = np.ones(pieces.count, bool)
    wall = pieces.at(120, 115)
    heard = correct(ground, Correction(click, everything, guess=guess))
    assert any((region.pieces == guess).all() for region in heard.others)
    walled = correct(ground, Correction(click, everything, (wall,), guess=guess))
    assert not any(region.pieces[wall] for region in walled.others)
