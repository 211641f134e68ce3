"""Shader programs from the files in `shaders/`."""

from __future__ import annotations

import moderngl

from ..resources import resource


def build_program(context: moderngl.Context, vertex: str, fragment: str) -> moderngl.Program:
    """The program of two shader files."""
    sources = [
        resource(f"shaders/{name}").read_text(encoding="utf-8") for name in (vertex, fragment)
    ]
    return context.program(vertex_shader=sources[0], fragment_shader=sources[1])


def set_uniforms(program: moderngl.Program, **values: float | int | tuple[float, ...]) -> None:
    """Sets uniforms by name; the ones the compiler found unused are skipped."""
    for name, value in values.items():
        uniform = program.get(name, None)
        if isinstance(uniform, moderngl.Uniform):
            uniform.value = value
