"""The learned backend and what it has encoded of the photos, once for all tests."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

from objectmorpher_core import segment
from objectmorpher_core.base.progress import silent
from tests.photos import photo


@cache
def dino() -> segment.Segmenter:
    """The backend with both of its networks."""
    backend = segment.load("dino")
    for reason in (backend.missing(), segment.load("subject").missing()):
        if reason is not None:
            pytest.skip(reason)
    return backend


@cache
def embedding(name: str) -> Any:
    return dino().encode(photo(name), silent)
