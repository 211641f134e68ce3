"""The background, and how the object is joined to it."""

from __future__ import annotations

from .command import Command

COMMANDS: dict[str, Command] = {}
