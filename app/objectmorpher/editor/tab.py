"""A photo or session that is open: its document and steps, its files, and how it was looked at."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from objectmorpher_core.document.model import Document

from ..canvas.shape import Shapes
from .autosave import Autosave
from .history import History
from .view import ViewState

# Of the view, what belongs to the photo; brushes, panels and the like are the window's.
OWN_VIEW = (
    "width", "height", "scale", "zoom", "left", "top", "is_fitted", "tool", "split", "shown",
    "orbit",
)  # fmt: skip


@dataclass(eq=False)
class Tab:
    """Mutable. While another tab is shown it keeps no more than what is here."""

    history: History | None = None  # None: the start screen
    path: Path | None = None  # the session's file
    source: Path | None = None  # the photo's file
    current: int = 0  # index of the object that the tools change
    selected: tuple[int, ...] = ()  # handles, as the tab was left
    is_lifting: bool = False  # a lift was stopped when the tab was left
    shapes: Shapes = ()  # of its objects; kept for the tab that was left last
    looked: dict[str, Any] = field(default_factory=dict)  # OWN_VIEW, as the tab was left
    autosave: Autosave = field(init=False)

    def __post_init__(self) -> None:
        self.autosave = Autosave(self)

    @property
    def document(self) -> Document | None:
        """The document without a stroke in progress."""
        return self.history.document if self.history else None

    @property
    def is_saved(self) -> bool:
        return self.history is None or self.history.is_saved

    @property
    def name(self) -> str:
        """The session's name, or the photo's; "" of the start screen."""
        if self.path is not None:
            return self.path.name
        return self.document.photo.name if self.document is not None else ""

    def keep_view(self, view: ViewState) -> None:
        """The tab is left while `view` shows it."""
        self.looked = {name: getattr(view, name) for name in OWN_VIEW}

    def restore_view(self, view: ViewState) -> None:
        """The tab is shown again, by a canvas that may have another size now."""
        if self.document is None:
            return
        size, scale = (view.width, view.height), view.scale
        for name, value in self.looked.items():
            setattr(view, name, value)
        view.resize(size, scale, self.document.photo.size)
