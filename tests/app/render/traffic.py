"""What a frame sends to the GPU: every call of moderngl that uploads or draws, as it is made."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

UPLOADS = {  # class and method: which argument the data is
    ("Context", "buffer"): (0, "data"),
    ("Context", "texture"): (2, "data"),
    ("Context", "texture3d"): (2, "data"),
    ("Buffer", "write"): (0, "data"),
    ("Texture", "write"): (0, "data"),
    ("Texture3D", "write"): (0, "data"),
}
DRAWS = (("VertexArray", "render"), ("VertexArray", "transform"))


@dataclass
class Traffic:
    """Of some frames."""

    uploads: list[tuple[str, bytes]] = field(default_factory=list)  # by what, and its contents
    draws: int = 0  # calls, without those that clear

    @property
    def sizes(self) -> list[int]:
        """Bytes of each upload."""
        return [len(data) for _, data in self.uploads]

    def clear(self) -> None:
        self.uploads.clear()
        self.draws = 0


@contextmanager
def recorded() -> Iterator[Traffic]:
    """Records what goes through moderngl meanwhile; each call is made as it would be without."""
    import moderngl

    traffic = Traffic()

    def listening(name: str, place: tuple[int, str], call: Callable[..., Any]) -> Any:
        index, key = place

        def listened(self: Any, *args: Any, **options: Any) -> Any:
            data = options.get(key, args[index] if len(args) > index else None)
            if data is not None:
                traffic.uploads.append((name, np.ascontiguousarray(_array(data)).tobytes()))
            return call(self, *args, **options)

        return listened

    def counting(call: Callable[..., Any]) -> Any:
        def counted(self: Any, *args: Any, **options: Any) -> Any:
            traffic.draws += 1
            return call(self, *args, **options)

        return counted

    with pytest.MonkeyPatch.context() as patch:
        for (kind, method), place in UPLOADS.items():
            owner = getattr(moderngl, kind)
            name = f"{kind}.{method}"
            patch.setattr(owner, method, listening(name, place, getattr(owner, method)))
        for kind, method in DRAWS:
            owner = getattr(moderngl, kind)
            patch.setattr(owner, method, counting(getattr(owner, method)))
        yield traffic


def _array(data: Any) -> np.ndarray:
    return data if isinstance(data, np.ndarray) else np.frombuffer(data, np.uint8)
