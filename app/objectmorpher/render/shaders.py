"""Shader programs from the files in `shaders/`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import moderngl

from ..system.resources import resource

VERSION = re.compile(r"^#version .*\n")
INCLUDE = re.compile(r'^#include "(.*)"\n', re.MULTILINE)


def build_program(
    context: moderngl.Context, vertex: str, fragment: str, *defines: str, **files: str
) -> moderngl.Program:
    """The program of two shader files, see `source`."""
    return context.program(
        vertex_shader=source(vertex, *defines, **files),
        fragment_shader=source(fragment, *defines, **files),
    )


def build_feedback(
    context: moderngl.Context, vertex: str, outputs: Sequence[str], *defines: str, **files: str
) -> moderngl.Program:
    """The program of a vertex shader alone, whose `outputs` are captured one after the other."""
    text = source(vertex, *defines, **files)
    return context.program(vertex_shader=text, varyings=tuple(outputs))


def source(name: str, *defines: str, **files: str) -> str:
    """The text of a shader file; where it includes "WORD", the file that `files` names so.

    `defines`: what is put after #define at its start, such as "LAYER 1".
    """
    lines = "".join(f"#define {define}\n" for define in defines)
    return VERSION.sub(lambda match: match[0] + lines, _included(name, files), count=1)


def _included(name: str, files: dict[str, str]) -> str:
    text = resource(f"shaders/{name}").read_text(encoding="utf-8")
    return INCLUDE.sub(lambda match: _included(files.get(match[1], match[1]), files), text)


class Programs:
    """A program's variants by their defines, each with a vertex array that reads no vertices."""

    def __init__(
        self, context: moderngl.Context, vertex: str, fragment: str, units: dict[str, int]
    ) -> None:
        """`units`: texture units of its samplers."""
        self._context, self._files, self._units = context, (vertex, fragment), units
        self._made: dict[tuple[str, ...], tuple[moderngl.Program, moderngl.VertexArray]] = {}

    def __call__(self, *defines: str) -> tuple[moderngl.Program, moderngl.VertexArray]:
        """Compiled when it is first needed."""
        if defines not in self._made:
            program = build_program(self._context, *self._files, *defines)
            set_uniforms(program, **self._units)
            self._made[defines] = (program, self._context.vertex_array(program, []))
        return self._made[defines]


def set_uniforms(program: moderngl.Program, **values: Any) -> None:
    """Sets uniforms by name; the ones the compiler found unused are skipped."""
    for name, value in values.items():
        uniform = program.get(name, None)
        if isinstance(uniform, moderngl.Uniform):
            uniform.value = value


def buffer_layout(
    program: moderngl.Program, buffer: moderngl.Buffer, columns: Sequence[tuple[str, str]], step=""
) -> tuple[Any, ...]:
    """A buffer of interleaved (name, format) columns; what a program does not read is skipped.

    `step`: "/i" where a row belongs to an instance.
    """
    words = [form if name in program else f"{4 * int(form[0])}x" for name, form in columns]
    names = [name for name, _ in columns if name in program]
    return (buffer, " ".join([*words, step]).strip(), *names)
