"""Projected Gaussians in a buffer on the GPU, each drawn as a rectangle."""

from __future__ import annotations

import moderngl

from .gpu_memory import Stream
from .shaders import buffer_layout

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
        """All rows, which waits for the GPU."""
        return self._stream.buffer.read(self.count * self.row_size)

    def draw(self, program: moderngl.Program) -> None:
        if self.count == 0:
            return
        if program.glo not in self._arrays:
            layout = buffer_layout(program, self._stream.buffer, self.columns, "/i")
            self._arrays[program.glo] = self._context.vertex_array(program, [layout])
        self._arrays[program.glo].render(moderngl.TRIANGLE_STRIP, 4, instances=self.count)
