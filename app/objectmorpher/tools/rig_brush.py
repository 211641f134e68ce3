"""The Pose tool's brushes: painting regions that move in a way of their own, cutting, gluing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..editor.view import BRUSHES, PoseMode
from ..system.texts import t
from .pointer import Button, Pointer, Stroke

if TYPE_CHECKING:
    from ..editor.editor import Editor

HINTS = {
    PoseMode.FREEZE: "Paint what must stay as it is now · Alt erases · [ and ] size the brush",
    PoseMode.STIFFEN: "Paint what must bend less · Alt erases · [ and ] size the brush",
    PoseMode.BODY: "Paint what must move as one rigid piece · Alt erases · [ and ] size the brush",
    PoseMode.CUT: "Draw a line where parts must come loose; it cuts right through · Alt erases",
    PoseMode.GLUE: "Drag from one part to another: the ends are joined · Alt erases glue",
}


def paint(editor: Editor, start: Pointer) -> Stroke:
    """Marks what the brush covers on the side that is seen; the release makes it so."""
    rigging, mode = editor.rigging, editor.view.pose.mode
    is_erasing = start.alt or start.button is Button.RIGHT
    try:
        pointer = start
        _extend(editor, start)
        while (pointer := (yield)).is_down:
            _extend(editor, pointer)
        nodes, way = rigging.painted, rigging.drawn
        if mode in BRUSHES:
            rigging.paint(mode, nodes, is_erasing)
        elif is_erasing:
            rigging.unseam(mode, nodes)
        elif mode is PoseMode.CUT:
            rigging.cut(way)
        else:
            rigging.glue(way)
    finally:
        rigging.painted, rigging.drawn = np.empty(0, np.int32), np.empty((0, 2))


def _extend(editor: Editor, pointer: Pointer) -> None:
    """The way up to here, and the control points under it, in the order they were met."""
    rigging = editor.rigging
    here = editor.view.image_from_canvas(pointer.xy)
    rigging.drawn = np.concatenate([rigging.drawn, here[None]])
    found = rigging.near(rigging.drawn[-2:])
    new = np.setdiff1d(found, rigging.painted)
    rigging.painted = np.concatenate([rigging.painted, new]).astype(np.int32)


def hint(editor: Editor) -> str:
    return t(HINTS[editor.view.pose.mode])
