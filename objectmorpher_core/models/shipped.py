"""The program's own weights, which come with it (docs/shape_network)."""

from __future__ import annotations

from importlib.resources import files

PACKAGE, SHAPE = "objectmorpher_core.models", "shape.onnx"
TOKENS = "dinov2-vits14"  # the weight whose tokens the shape network reads


def is_shipped() -> bool:
    """Whether the shape network came with this installation."""
    return files(PACKAGE).joinpath(SHAPE).is_file()


def shape_network() -> bytes:
    """The shape network, an ONNX file. Raises FileNotFoundError."""
    return files(PACKAGE).joinpath(SHAPE).read_bytes()
