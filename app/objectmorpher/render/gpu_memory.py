"""Arrays on the GPU, remembered by identity, and buffers that are refilled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import moderngl
import numpy as np

from .shaders import buffer_layout


class Releasable(Protocol):
    """An object that holds GPU memory until it is released."""

    def release(self) -> Any: ...


T = TypeVar("T", bound=Releasable)

MOST_KEPT = 64  # copies; where every frame brings new things, the older ones go by themselves


class Uploads:
    """Copies of things that do not change, until they are not asked for any more."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, int], tuple[Any, Releasable]] = {}
        self._used: set[tuple[str, int]] = set()

    def __call__(self, kind: str, thing: Any, build: Callable[[], T]) -> T:
        """The copy of `thing`, made by `build` the first time."""
        key = (kind, id(thing))
        entry = self._kept.pop(key, None) or (thing, build())  # held: no other can get its id
        self._kept[key] = entry
        self._used.add(key)
        while len(self._kept) > MOST_KEPT:
            self._kept.pop(next(iter(self._kept)))[1].release()
        copy: Any = entry[1]
        return copy

    def sweep(self) -> None:
        """Releases what nobody has asked for since the last time."""
        for key in [key for key in self._kept if key not in self._used]:
            self._kept.pop(key)[1].release()
        self._used.clear()

    def __len__(self) -> int:
        return len(self._kept)


class Stream:
    """A buffer that is filled anew for each frame, and grows when it has to."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self.buffer = context.buffer(reserve=4, dynamic=True)

    def reserve(self, size: int) -> bool:
        """Room for so many bytes; whether that made a new buffer. What was there is lost."""
        if self.buffer.size >= size:
            self.buffer.orphan()
            return False
        self.buffer.release()
        self.buffer = self._context.buffer(reserve=size, dynamic=True)
        return True

    def write(self, data: np.ndarray) -> bool:
        """Replaces the contents; whether that made a new buffer."""
        is_new = self.reserve(max(data.nbytes, 4))
        if data.nbytes:
            self.buffer.write(np.ascontiguousarray(data))
        return is_new


# Projected Gaussians in a buffer on the GPU, each drawn as a rectangle.

Columns = tuple[tuple[str, str], ...]  # name and format of each column of a buffer


class Instances:
    """Rows of `columns`, for the programs that draw them."""

    def __init__(self, context: moderngl.Context, columns: Columns) -> None:
        self.columns = columns
        self.count = 0
        self._context = context
        self._stream = Stream(context)
        self._arrays: dict[int, moderngl.VertexArray] = {}

    @property
    def row_size(self) -> int:
        """Bytes."""
        return 4 * sum(int(form[0]) for _, form in self.columns)

    def reserve(self, count: int) -> moderngl.Buffer:
        """Room for so many rows."""
        self.count = count
        if self._stream.reserve(max(count, 1) * self.row_size):
            for array in self._arrays.values():
                array.release()
            self._arrays.clear()
        return self._stream.buffer

    def read(self) -> bytes:
        """Read all rows, which waits for the GPU."""
        return self._stream.buffer.read(self.count * self.row_size)

    def draw(self, program: moderngl.Program) -> None:
        if self.count == 0:
            return
        if program.glo not in self._arrays:
            layout = buffer_layout(program, self._stream.buffer, self.columns, "/i")
            self._arrays[program.glo] = self._context.vertex_array(program, [layout])
        self._arrays[program.glo].render(moderngl.TRIANGLE_STRIP, 4, instances=self.count)
