"""What tests of several inpainters look at."""

from __future__ import annotations

import pytest


@pytest.fixture
def view(rocket):
    """(220, 240, 3) of the photo, the rocket in it."""
    return rocket[180:400, 200:440]
