"""The tool behind each name."""

from __future__ import annotations

from ..editor.view import ToolName
from .compose_tool import ComposeTool
from .look_tool import LookTool
from .mask_tool import MaskTool
from .place_tool import PlaceTool
from .pointer import Tool
from .pose_tool import PoseTool
from .select_tool import SelectTool

TOOLS: dict[ToolName, Tool] = {
    ToolName.SELECT: SelectTool(),
    ToolName.MASK: MaskTool(),
    ToolName.POSE: PoseTool(),
    ToolName.PLACE: PlaceTool(),
    ToolName.LOOK: LookTool(),
    ToolName.COMPOSE: ComposeTool(),
}
