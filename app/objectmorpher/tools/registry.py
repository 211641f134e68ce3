"""The tool behind each name."""

from __future__ import annotations

from typing import Protocol

from ..editor.editor import Editor
from ..editor.view import ToolName
from .compose_tool import ComposeTool
from .look_tool import LookTool
from .mask_tool import MaskTool
from .place_tool import PlaceTool
from .pointer import Pointer, PointerShape, Stroke
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


TOOLS: dict[ToolName, Tool] = {
    ToolName.SELECT: SelectTool(),
    ToolName.MASK: MaskTool(),
    ToolName.POSE: PoseTool(),
    ToolName.PLACE: PlaceTool(),
    ToolName.LOOK: LookTool(),
    ToolName.COMPOSE: ComposeTool(),
}
