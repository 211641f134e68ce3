"""OpenGL without a window: for what is measured, and for tests."""

from __future__ import annotations

from typing import Any

import moderngl


def create_context() -> moderngl.Context:
    """A context of its own, through EGL. Raises whatever the system's loader does."""
    settings: Any = {"backend": "egl"}  # moderngl's annotation of it is of another type
    return moderngl.create_context(standalone=True, **settings)
