"""Answers about pictures: begun ahead, kept for a while, given to each as its own."""

from __future__ import annotations

from threading import Thread

import cv2
import numpy as np
import pytest

from objectmorpher_core.base.progress import Cancelled
from objectmorpher_core.models.onnx_session import EarlyAnswers
from tests import photos

KEPT = 2


class Eye:
    """A costly look at pictures that counts how often it looked."""

    def __init__(self, picture: np.ndarray) -> None:
        self.picture, self.looks = picture, 0

    def __call__(self) -> np.ndarray:
        self.looks += 1
        return cv2.GaussianBlur(self.picture.astype(np.float32), (0, 0), 2)


def ignore() -> None:
    """Somebody who waits as long as it takes."""


EYES = [Eye(photos.photo(name)[:60, :80]) for name in photos.NAMES[:3]]


@pytest.fixture
def eyes() -> list[Eye]:
    for eye in EYES:
        eye.looks = 0
    return EYES


def test_what_was_answered_is_not_computed_again(eyes: list[Eye]) -> None:
    answers, eye = EarlyAnswers(KEPT), eyes[0]
    first = answers.answer(eye.picture, eye, ignore)
    again = answers.answer(eye.picture.copy(), eye, ignore)
    assert eye.looks == 1
    np.testing.assert_array_equal(again, eye())
    first[:] = 0  # each has an array of its own
    np.testing.assert_array_equal(answers.answer(eye.picture, eye, ignore), again)


def test_only_the_last_few_are_kept(eyes: list[Eye]) -> None:
    answers = EarlyAnswers(KEPT)
    for eye in (eyes[0], eyes[1], eyes[0], eyes[2]):  # the second has waited longest
        answers.answer(eye.picture, eye, ignore)
    assert [eye.looks for eye in eyes] == [1, 1, 1]
    for eye in (eyes[2], eyes[0], eyes[1]):
        answers.answer(eye.picture, eye, ignore)
    assert [eye.looks for eye in eyes] == [1, 2, 1]


def test_what_was_begun_is_waited_for(eyes: list[Eye]) -> None:
    answers, eye = EarlyAnswers(KEPT), eyes[0]
    compute = answers.expect(eye.picture, eye)
    waited = 0

    def watch() -> None:
        nonlocal waited
        waited += 1
        if waited == 3:
            Thread(target=compute).start()

    found = answers.answer(eye.picture, eye, watch)
    assert (eye.looks, waited >= 3) == (1, True)
    np.testing.assert_array_equal(found, eye())


def test_what_failed_ahead_is_computed_by_who_asks(eyes: list[Eye]) -> None:
    answers, eye = EarlyAnswers(KEPT), eyes[0]

    def fail() -> np.ndarray:
        raise OSError("no weights")

    answers.expect(eye.picture, fail)()
    np.testing.assert_array_equal(answers.answer(eye.picture, eye, ignore), eye())
    with pytest.raises(OSError, match="no weights"):
        answers.answer(eyes[1].picture, fail, ignore)
    answers.answer(eyes[1].picture, eyes[1], ignore)
    assert eyes[1].looks == 1, "a failure is not kept"


def test_who_cancels_gets_no_answer_even_if_it_is_known(eyes: list[Eye]) -> None:
    answers, eye = EarlyAnswers(KEPT), eyes[0]
    answers.answer(eye.picture, eye, ignore)

    def cancel() -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        answers.answer(eye.picture, eye, cancel)
