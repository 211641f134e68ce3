"""A photo with an edit of it, and the methods' results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from .guidance import EditGuidance


@dataclass(frozen=True)
class MethodResult:
    """A method's result for a subject."""

    picture: Path
    log: Path | None = None  # .jsonl, or our report's .json
    frames: Path | None = None  # of our window's drags


@dataclass(frozen=True)
class EvaluatedEdit:
    """A photo and an edit of it."""

    name: str  # may hold slashes
    image: Path
    guidance: EditGuidance
    results: Mapping[str, MethodResult] = field(default_factory=dict)  # by method


def methods_of(subjects: tuple[EvaluatedEdit, ...]) -> tuple[str, ...]:
    """The names of all methods that have a result."""
    return tuple(sorted({method for subject in subjects for method in subject.results}))
