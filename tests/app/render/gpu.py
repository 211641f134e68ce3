"""Fixtures: a GPU without a window, most often an emulated one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="module")
def context() -> Iterator[Any]:
    moderngl = pytest.importorskip("moderngl")
    try:
        made = moderngl.create_standalone_context(require=330, backend="egl")
    except Exception as error:
        pytest.skip(f"no OpenGL without a window here: {error}")
    yield made
    made.release()


@pytest.fixture(scope="module")
def splat_pass(context: Any) -> Any:
    from objectmorpher.render.splat_pass import SplatPass

    return SplatPass(context)
