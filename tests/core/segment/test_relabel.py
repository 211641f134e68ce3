"""Votes of like pieces: they mend an answer's rim, obey what is known, and never blur an answer."""

from __future__ import annotations

from functools import cache

import numpy as np

from objectmorpher_core.segment.pieces.pieces import Pieces
from objectmorpher_core.segment.pieces.relabel import relabel, touching, votes
from tests.core.segment.simulated_user import inmost
from tests.core.segment.truth_masks import truth_mask
from tests.photos import photo

MOST = 0.97  # IoU with the truth, of an answer that colours alone can mend


@cache
def flower() -> Pieces:
    """Colours only: the vote needs no network."""
    return Pieces(photo("flower"), None)


@cache
def dahlia() -> np.ndarray:
    """(n,) the pieces that are mostly dahlia."""
    return flower().mean(truth_mask("dahlia")) > 0.5


def share(mask: np.ndarray, other: np.ndarray) -> float:
    """IoU of pieces (n,) by area."""
    area = flower().area
    return float(area[mask & other].sum() / area[mask | other].sum())


def voted(answer: np.ndarray) -> np.ndarray:
    """(n,) what the vote makes of an answer, where it hangs together with the dahlia's middle."""
    heart = np.zeros(flower().count, bool)
    heart[flower().at(*inmost(truth_mask("dahlia")))] = True
    found = relabel(flower(), answer, tuple(np.flatnonzero(heart)))
    return touching(flower(), found, heart)


def spoiled(seed: int) -> np.ndarray:
    """(n,) the dahlia with a twentieth of all pieces told wrongly."""
    wrong = np.random.default_rng(seed).random(flower().count) < 0.05
    return dahlia() ^ wrong


def test_pieces_told_wrongly_are_outvoted():
    for seed in range(3):
        before = spoiled(seed)
        assert share(voted(before), dahlia()) > max(MOST, share(before, dahlia()))


def test_a_right_answer_stays():
    assert share(voted(dahlia()), dahlia()) > MOST


def test_known_pieces_are_obeyed_whatever_the_others_say():
    inside, outside = int(np.flatnonzero(dahlia())[20]), int(np.flatnonzero(~dahlia())[20])
    found = relabel(flower(), dahlia(), (outside,), (inside,))
    assert found[outside]
    assert not found[inside]


def test_what_the_vote_makes_never_stands_out_much_less():
    rng = np.random.default_rng(0)
    for _ in range(3):
        rows, columns = flower().centres.T
        x, y = rng.uniform(100, 500), rng.uniform(100, 300)
        disc = (rows - x) ** 2 + (columns - y) ** 2 < 60**2
        found = relabel(flower(), disc, ())
        assert flower().contrast(found) >= 0.8 * flower().contrast(disc) - 1e-9


def test_nothing_and_everything_are_left_alone():
    nothing = np.zeros(flower().count, bool)
    np.testing.assert_array_equal(relabel(flower(), nothing, ()), nothing)
    np.testing.assert_array_equal(relabel(flower(), ~nothing, ()), ~nothing)


def test_no_piece_votes_for_itself():
    """A piece alone in its colour, in the object or not, hears the same from the others."""
    pieces, mask = flower(), dahlia()
    told = []
    for label in (True, False):
        changed = mask.copy()
        changed[0] = label
        told.append(votes(pieces, changed)[0])
    assert abs(told[0] - told[1]) < 0.02  # the object's size, and who is asked, differ by a piece


def test_a_click_takes_the_say_from_what_it_contradicts():
    """A strip beside a plain object: one click on it, and all of it goes."""
    image = np.full((120, 200, 3), 40, np.uint8)
    image[20:100, 60:120] = 200  # the object
    image[20:100, 120:132] = (120, 110, 60)  # what an answer took for a part of it
    pieces = Pieces(image, None)
    answer = pieces.mean(image[..., 0] > 100) > 0.5
    piece = pieces.at(126, 60)
    assert answer[piece]
    corrected = answer.copy()
    corrected[piece] = False
    found = relabel(pieces, corrected, (pieces.at(90, 60),), (piece,), piece)
    strip = pieces.mean((image == (120, 110, 60)).all(-1)) > 0.5
    plain = pieces.mean((image == 200).all(-1)) > 0.5
    assert (found & strip).sum() < 0.2 * strip.sum()
    assert found[plain].mean() > 0.95


def test_touching_keeps_only_what_hangs_together():
    image = np.zeros((60, 120, 3), np.uint8)
    image[20:40, 10:40] = image[20:40, 80:110] = 255
    pieces = Pieces(image, None)
    bright = pieces.mean(image[..., 0]) > 127
    start = np.zeros(pieces.count, bool)
    start[pieces.at(25, 30)] = True
    found = touching(pieces, bright, start)
    assert found[pieces.at(15, 30)]
    assert not found[pieces.at(95, 30)]
    assert not touching(pieces, bright, ~bright).any()
