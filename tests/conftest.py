"""Fixtures for every test: the real photos, as (H, W, 3) u8 RGB arrays."""

from __future__ import annotations

import os

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: ARCHITECTURE section 8

from tests import photos


def _photo_fixture(name: str):
    @pytest.fixture(name=name, scope="session")
    def fixture():
        return photos.photo(name)

    return fixture


chelsea, coffee, astronaut, rocket, flower, china = map(_photo_fixture, photos.NAMES)
