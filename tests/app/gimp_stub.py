"""What GIMP 3's plug-in calls of GIMP, by its published interface: images, layers, files.

Layers hold pixels, so that a test sees what an image would show.
"""

from __future__ import annotations

import sys
import types
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture


class Layer:
    """A layer (H, W, 4) u8 at a place, or a group of layers, the uppermost first."""

    def __init__(self, pixels: np.ndarray | None, name: str = "") -> None:
        self.pixels, self.name, self.offsets, self.is_visible = pixels, name, (0, 0), True
        self.children: list[Layer] = []
        self.image: Image | None = None
        self.mode = "NORMAL"  # which mixes in linear light

    @staticmethod
    def new_from_drawable(layer: Layer, image: Image) -> Layer:
        copied = Layer(layer.pixels, layer.name)
        copied.offsets = layer.offsets
        copied.image = image
        return copied

    def resize_to_image_size(self) -> None:
        assert self.image is not None and self.pixels is not None
        whole = np.zeros((self.image.height, self.image.width, 4), np.uint8)
        (x, y), (h, w) = self.offsets, self.pixels.shape[:2]
        whole[y : y + h, x : x + w] = self.pixels
        self.pixels, self.offsets = whole, (0, 0)

    def get_parent(self) -> None:
        return None

    def set_name(self, name: str) -> None:
        self.name = name

    def set_offsets(self, x: int, y: int) -> None:
        self.offsets = (x, y)

    def set_mode(self, mode: str) -> None:
        self.mode = mode

    def set_visible(self, is_visible: bool) -> None:
        self.is_visible = is_visible


class Image:
    """An image: layers, the uppermost first."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self.layers: list[Layer] = []

    @staticmethod
    def new_with_precision(width: int, height: int, kind: object, precision: object) -> Image:
        return Image(width, height)

    def get_width(self) -> int:
        return self.width

    def get_height(self) -> int:
        return self.height

    def get_base_type(self) -> str:
        return "RGB"

    def get_precision(self) -> str:
        return "u8"

    def insert_layer(self, layer: Layer, parent: Layer | None, position: int) -> None:
        (self.layers if parent is None else parent.children).insert(position, layer)

    def get_item_position(self, layer: Layer) -> int:
        return self.layers.index(layer)

    def undo_group_start(self) -> None: ...

    def undo_group_end(self) -> None: ...

    def delete(self) -> None: ...

    def shown(self) -> np.ndarray:
        """(H, W, 4) u8 all layers over each other."""
        canvas = np.zeros((self.height, self.width, 4))
        flat = [part for layer in self.layers for part in (layer.children or [layer])]
        for layer in reversed(flat):
            if layer.is_visible and layer.pixels is not None:
                (x, y), (h, w) = layer.offsets, layer.pixels.shape[:2]
                power = 2.2 if layer.mode == "NORMAL" else 1.0  # about that of sRGB
                below, above = canvas[y : y + h, x : x + w], layer.pixels / 255
                alpha = above[..., 3:]
                mixed = alpha * above[..., :3] ** power + (1 - alpha) * below[..., :3] ** power
                below[..., :3] = mixed ** (1 / power)
                below[..., 3:] = alpha + (1 - alpha) * below[..., 3:]
        return np.rint(canvas * 255).astype(np.uint8)


class Procedure:
    """A procedure gives back its status and error."""

    def new_return_values(self, status: str, error: object) -> tuple[str, object]:
        return status, error


def make_gimp(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Puts a stand-in for `gi.repository` in place, and returns its Gimp."""
    gimp = types.SimpleNamespace(
        Image=Image, Layer=Layer, Procedure=Procedure, PlugIn=types.SimpleNamespace,
        RunMode=types.SimpleNamespace(NONINTERACTIVE=1),
        PDBStatusType=types.SimpleNamespace(SUCCESS="success", EXECUTION_ERROR="error"),
        GroupLayer=types.SimpleNamespace(new=lambda image, name: Layer(None, name)),
        file_save=lambda mode, image, file, options: Picture.fromarray(image.shown()).save(file),
        file_load_layer=lambda mode, image, file: Layer(
            np.asarray(Picture.open(file).convert("RGBA"))
        ),
        displays_flush=lambda: None,
        LayerMode=types.SimpleNamespace(
            NORMAL_LEGACY="NORMAL_LEGACY", MULTIPLY_LEGACY="MULTIPLY_LEGACY",
            SCREEN_LEGACY="SCREEN_LEGACY", SOFTLIGHT_LEGACY="SOFTLIGHT_LEGACY",
        ),
    )  # fmt: skip
    gimp.PlugIn = type("PlugIn", (), {"error_quark": staticmethod(lambda: 1)})
    gio = types.SimpleNamespace(File=types.SimpleNamespace(new_for_path=lambda path: path))
    error = type("Error", (), {"new_literal": staticmethod(lambda quark, text, code: text)})
    repository = types.ModuleType("gi.repository")
    repository.__dict__.update(Gimp=gimp, Gio=gio, GLib=types.SimpleNamespace(Error=error))
    gi = types.ModuleType("gi")
    gi.__dict__.update(require_version=lambda *_: None, repository=repository)
    monkeypatch.setitem(sys.modules, "gi", gi)
    monkeypatch.setitem(sys.modules, "gi.repository", repository)
    return gimp
