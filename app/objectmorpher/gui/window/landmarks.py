"""The places of the window's buttons and fields by their texts, for tests and tours.

So are the photo, the handles on it and the rings: what is drawn there cannot be found otherwise.

With OBJECTMORPHER_LANDMARKS=FILE in the environment the window writes them there whenever they
change. Without it nothing is collected.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

from imgui_bundle import ImVec2, imgui

VARIABLE = "OBJECTMORPHER_LANDMARKS"
POINTER = "Pointer"
FOCUS = "Focus"  # before the name of what the keyboard has reached

_file = os.environ.get(VARIABLE) or None
_places: dict[str, tuple[float, float, float, float]] = {}
_written = ""


def mark(label: str) -> None:
    """The last item is called `label`; what stands after ## or before an icon is left out."""
    if _file is None or not imgui.is_item_visible():
        return
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    _places[clean(label)] = (low.x, low.y, high.x, high.y)
    if imgui.is_item_focused() and imgui.get_io().nav_visible:
        _places[f"{FOCUS}: {clean(label)}"] = _places[clean(label)]


def mark_on_canvas(label: str, low: ImVec2, high: ImVec2) -> None:
    """Something that is drawn over the photo and can be taken hold of."""
    if _file is not None:
        _places[label] = (low.x, low.y, high.x, high.y)


def clean(label: str) -> str:
    """Return a text as a user reads it: without icons (private use area) and ids."""
    text = label.partition("##")[0]
    return "".join(c for c in text if not "\ue000" <= c <= "\uf8ff").strip()


def write() -> None:
    """At the end of a frame: x0, y0, x1, y1 window units of each. The next frame begins anew."""
    global _written
    if _file is None:
        return
    mouse = imgui.get_io().mouse_pos
    _places[POINTER] = (mouse.x, mouse.y, mouse.x, mouse.y)  # what came before it was answered
    text = json.dumps(_places)
    _places.clear()
    if text != _written:
        _written = text
        temporary = Path(f"{_file}.tmp")
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(_file)
