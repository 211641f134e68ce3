"""OpenGL without a window: for what is measured, and for tests."""

from __future__ import annotations

import moderngl


def create_context() -> moderngl.Context:
    """A context of its own, through EGL. Raises whatever the system's loader does."""
    return moderngl.create_context(standalone=True, backend="egl")
