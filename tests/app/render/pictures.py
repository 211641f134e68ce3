"""The GPU's picture as arrays, the specification's, and what is between them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F32
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import Handle, Pose
from objectmorpher_core.raster import reference
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.raster.reference import Picture3D
from objectmorpher_core.raster.texture import TextureLevels
from tests import shapes

View = tuple[
    PosedSplats, TextureLevels, Camera, Camera
]  # an object, the view's camera, the photo's


def rendered(splat_pass: Any, *view: Any) -> F32:
    """(h, w, 4) premultiplied, by the GPU."""
    return pixels_of(splat_pass.draw(*view).color)


def specified(*view: Any) -> F32:
    """The same by `raster/reference.py`."""
    return premultiplied(reference.render(*view))


def premultiplied(picture: Picture3D) -> F32:
    """(h, w, 4) a drawn object's colours and alpha."""
    return np.dstack([picture.color, picture.alpha])


def pixels_of(texture: Any) -> F32:
    """(h, w, 4) of a texture of 16 or 32 bits."""
    bits = {"f2": np.float16, "f4": np.float32, "nu2": np.uint16}[texture.dtype]
    pixels = np.frombuffer(texture.read(), bits).reshape(texture.height, texture.width, 4)
    most = 65535 if texture.dtype == "nu2" else 1
    return pixels.astype(np.float32) / np.float32(most)


@cache
def bent(name: str, count: int, largeness: float) -> tuple[shapes.Scene, Pose]:
    """A scene with one end of its object dragged and another pressed, the rest of it held."""
    scene = shapes.scene(name, count)
    points = scene.lifted.control_points.astype(np.float64)
    left, right, top = points[:, 0].argmin(), points[:, 0].argmax(), points[:, 1].argmin()
    middle = np.abs(points - points.mean(0)).sum(1).argmin()
    moves = {
        int(left): np.array([0.1, -0.3, 0.1]) * largeness,
        int(top): np.array([0.05, 0.15, -0.1]) * largeness,
        int(right): np.zeros(3),
        int(middle): np.zeros(3),
    }
    handles: tuple[Handle, ...] = tuple(
        shapes.handle(scene.lifted, k, move) for k, move in moves.items()
    )
    return scene, scene.puppet.deformer.solve(handles).pose


def make_renderer(
    context: Any, monkeypatch: pytest.MonkeyPatch, kind: str, size: tuple[int, int]
) -> Any:
    """A renderer whose window is a framebuffer of `size` px."""
    import moderngl

    from objectmorpher.render.renderer import Renderer

    window = context.framebuffer([context.texture(size, 4)])
    monkeypatch.setattr(moderngl, "create_context", lambda **_: context)
    monkeypatch.setattr(context, "_screen", window)
    return Renderer(kind)
