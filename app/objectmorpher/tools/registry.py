"""The tool behind each name, and the one that walks around the object and changes nothing."""

from __future__ import annotations

from typing import Protocol

from ..editor.editor import Editor
from ..editor.view import Orbit, ToolName
from ..system.texts import t
from .brush_tools import ComposeTool, MaskTool
from .place_tool import PlaceTool
from .pointer import TURN_SPEED, Button, Pointer, PointerShape, Stroke, has_moved
from .pose_tool import PoseTool
from .select_tool import SelectTool


class Tool(Protocol):
    """A tool. It is stateless: everything that must last is in the Editor."""

    def press(self, editor: Editor, pointer: Pointer) -> Stroke:
        """A button went down on the canvas."""
        ...

    def hover(self, editor: Editor, pointer: Pointer) -> PointerShape:
        """The pointer is over the canvas, no button down. Sets what the overlays show."""
        ...

    def hint(self, editor: Editor) -> str:
        """Return the effects of click, drag and the modifier keys here and now."""
        ...


class LookTool:
    """Drag turns the object, a double click shows the photo again."""

    def press(self, editor: Editor, pointer: Pointer) -> Stroke:
        start, first, is_moved = editor.looking.orbit or Orbit(), pointer, False
        if first.clicks == 2:
            editor.looking.reset()
        while (pointer := (yield)).is_down:
            is_moved = is_moved or has_moved(editor, first, pointer)
            if is_moved and first.button is Button.LEFT:
                dx, dy = (pointer.xy - first.xy) / editor.view.scale * TURN_SPEED
                editor.looking.turn(start.turned(-float(dx), float(dy)))

    def hover(self, editor: Editor, pointer: Pointer) -> PointerShape:
        return PointerShape.TURN

    def hint(self, editor: Editor) -> str:
        if editor.looking.orbit is not None:
            return t("Drag turns the object · Wheel zooms · Double-click or Esc: the photo")
        return t("Drag to see the object from all sides · Wheel zooms · Hold X for the photo")


TOOLS: dict[ToolName, Tool] = {
    ToolName.SELECT: SelectTool(),
    ToolName.MASK: MaskTool(),
    ToolName.POSE: PoseTool(),
    ToolName.PLACE: PlaceTool(),
    ToolName.LOOK: LookTool(),
    ToolName.COMPOSE: ComposeTool(),
}
