"""A subject, and one thread: networks this small only wait for one another in more."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from objectmorpher_core.segment.matting.matte import build_matte
from tests import photos


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    if find_spec("torch") is None:
        yield
        return
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def subject():
    """The cup of the coffee photo, small."""
    return photos.small_cup(3, 37, 30)


@pytest.fixture(scope="module")
def picture(subject):
    """The same as the generators see it."""
    from objectmorpher_core.lift.trellis.picture import ConditionPicture

    return ConditionPicture.of(build_matte(subject[0], subject[2], 12))
