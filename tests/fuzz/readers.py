"""All readers by name."""

from __future__ import annotations

from functools import cache
from importlib import import_module

from .checks import Reader

MODULES = ("pictures", "objects", "documents", "small_files")


@cache
def readers() -> tuple[Reader, ...]:
    """Every way into the product."""
    modules = [import_module(f"tests.fuzz.{name}") for name in MODULES]
    return tuple(reader for module in modules for reader in module.READERS)


def by_name(name: str) -> Reader:
    return next(reader for reader in readers() if reader.name == name)
