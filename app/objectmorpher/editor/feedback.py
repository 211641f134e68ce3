"""Feedback of the editor: a sentence for the status line, and the thing under the pointer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from objectmorpher_core.deform.puppet import SurfacePoint


@dataclass(frozen=True)
class Action:
    """A button beside a message that does something about it."""

    label: str
    run: Callable[[], None]


@dataclass(frozen=True)
class StatusMessage:
    """A sentence for the status line."""

    text: str
    is_error: bool = False
    details: str = ""
    action: Action | None = None


@dataclass(frozen=True)
class Hover:
    """The thing under the pointer."""

    handle: int | None = None
    surface: SurfacePoint | None = None
    is_pin: bool = False  # a click would set a pin
    part: str | None = None  # of the Place tool's frame
    place: tuple[float, float] | None = None  # image px, where a click would select something
    other: int | None = None  # index of the object that a click would make the current one
