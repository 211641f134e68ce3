"""What tests of several inpainters look at."""

from __future__ import annotations

import cv2
import pytest


@pytest.fixture
def view(rocket):
    """(110, 120, 3) of the photo, the rocket in it."""
    return cv2.resize(rocket[180:400, 200:440], (120, 110), interpolation=cv2.INTER_AREA)


@pytest.fixture
def without_weights(tmp_path, monkeypatch) -> None:
    """As on a machine without the networks' weights: U^2-Net-p looks at no picture to be filled.

    For tests in which it does not matter what a picture shows: a look takes longer than to fill a
    small hole.
    """
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path))
