"""Pan, zoom and the before/after line: the same in every tool."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .pointer import Button, Pointer, Stroke

if TYPE_CHECKING:
    from ..editor.editor import Editor

ZOOM_STEP = 1.2  # x per notch of the wheel
BRUSH_STEP = 1.15  # x per press of a key
HARDNESS_STEP = 0.1
SMALLEST_BRUSH, LARGEST_BRUSH = 0.5, 2000.0  # px of the photo, radius
SPLIT_REACH = 6.0  # points beside the before/after line where a press takes it


def zoom(editor: Editor, pointer: Pointer) -> None:
    """The wheel, around the point under the pointer."""
    photo = editor.photo_size
    if photo is not None:
        factor = ZOOM_STEP**pointer.wheel
        editor.view.set_zoom(editor.view.zoom * factor, (pointer.x, pointer.y), photo)


def zoom_step(editor: Editor, notches: float) -> None:
    """Keys and menu, around the middle of the canvas."""
    view = editor.view
    zoom(editor, Pointer(view.width / 2, view.height / 2, wheel=notches))


def zoom_to(editor: Editor, scale: float) -> None:
    """`scale` canvas px for each px of the photo, around the middle of the canvas."""
    view, photo = editor.view, editor.photo_size
    if photo is not None:
        view.set_zoom(scale, (view.width / 2, view.height / 2), photo)


def wants_pan(pointer: Pointer) -> bool:
    return pointer.button is Button.MIDDLE or (pointer.space and pointer.button is Button.LEFT)


def pan(editor: Editor, pointer: Pointer) -> Stroke:
    """The photo follows the pointer."""
    last = pointer
    while (pointer := (yield)).is_down:
        photo = editor.photo_size
        if photo is not None:
            editor.view.pan(pointer.x - last.x, pointer.y - last.y, photo)
        if pointer.wheel:
            zoom(editor, pointer)
        last = pointer


def is_on_split(editor: Editor, pointer: Pointer) -> bool:
    """Whether a press would take the before/after line."""
    view = editor.view
    if view.split is None:
        return False
    return abs(pointer.x - view.split * view.width) <= SPLIT_REACH * view.scale


def drag_split(editor: Editor, pointer: Pointer) -> Stroke:
    """The before/after line follows the pointer."""
    while (pointer := (yield)).is_down:
        editor.view.split = float(np.clip(pointer.x / editor.view.width, 0.02, 0.98))


def size_brush(editor: Editor, steps: float) -> None:
    """Makes the brush larger, or smaller where `steps` is negative."""
    brush = editor.view.brush
    radius = float(np.clip(brush.radius * BRUSH_STEP**steps, SMALLEST_BRUSH, LARGEST_BRUSH))
    editor.view.brush = replace(brush, radius=radius)


def harden_brush(editor: Editor, steps: float) -> None:
    """Makes the brush's edge harder, or softer where `steps` is negative."""
    brush = editor.view.brush
    hardness = float(np.clip(brush.hardness + HARDNESS_STEP * steps, 0, 1))
    editor.view.brush = replace(brush, hardness=hardness)
