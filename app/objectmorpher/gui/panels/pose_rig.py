"""What dragging does, and the regions that move in a way of their own."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from ...editor.editor import Editor
from ...editor.intents.rigging import Region
from ...editor.pose_view import BRUSHES, PoseMode
from ...system.texts import t
from ..widgets.rows import end_row, text_top
from ..widgets.segmented import Choice, segmented
from ..widgets.theme import Icon, theme
from ..widgets.widgets import Number, gap, heading, icon_button, note, number_field
from .brush import draw_radius

ROW = 28.0  # points
ICONS = {
    PoseMode.DRAG: Icon.POSE, PoseMode.FREEZE: Icon.FREEZE, PoseMode.STIFFEN: Icon.STIFFEN,
    PoseMode.BODY: Icon.BODY, PoseMode.CUT: Icon.CUT, PoseMode.GLUE: Icon.GLUE,
}  # fmt: skip
NOTES = {
    PoseMode.FREEZE: "Paint what must stay exactly where it is now.",
    PoseMode.STIFFEN: "Paint what must bend less than the rest, or more.",
    PoseMode.BODY: "Paint what must move as one rigid piece: a head, a shoe, a lid. "
    "A stroke that begins on a group makes it larger.",
    PoseMode.CUT: "Draw a line where two parts touch but do not belong together. "
    "It cuts right through the object.",
    PoseMode.GLUE: "Drag from one part to another: what is under the brush at both ends "
    "hangs together from then on.",
}


def draw_modes(editor: Editor) -> None:
    """The row of what dragging does, and its settings."""
    view = editor.view.pose
    modes = tuple(Choice(mode, ICONS[mode], t(mode.value)) for mode in PoseMode)
    view.mode = segmented("mode", modes, view.mode)
    if view.mode is PoseMode.DRAG:
        return
    gap(8)
    heading(t(view.mode.value))
    note(t(NOTES[view.mode]))
    gap(4)
    if view.mode in BRUSHES or view.mode is PoseMode.GLUE:
        draw_radius(editor)
    if view.mode is PoseMode.STIFFEN:
        stiff = Number(t("Stiffness"), "%.2f ×", 0.02, 0.5, 4.0, 0.05, 50.0)
        view.stiffness = number_field(stiff, view.stiffness).value


def draw_regions(editor: Editor) -> None:
    """What was painted, with a button to take each back."""
    regions = editor.rigging.regions()
    if not regions:
        return
    gap(12)
    heading(t("Regions"))
    numbers: dict[PoseMode, int] = {}
    for row, region in enumerate(regions):
        numbers[region.kind] = numbers.get(region.kind, 0) + 1
        _draw_region(editor, region, row, _name(region, numbers[region.kind]))


def _name(region: Region, number: int) -> str:
    if region.kind is PoseMode.FREEZE:
        return t("Frozen")
    if region.kind is PoseMode.STIFFEN:
        factor = f"{region.value:.3g}"
        return t("Stiffness {factor}×", factor=factor)
    names = {
        PoseMode.BODY: "Rigid group {number}", PoseMode.CUT: "Cut {number}",
        PoseMode.GLUE: "Glue {number}",
    }  # fmt: skip
    return t(names[region.kind], number=number)


def _draw_region(editor: Editor, region: Region, row: int, name: str) -> None:
    start = imgui.get_cursor_screen_pos()
    width, height = imgui.get_content_region_avail().x, theme.pt(ROW)
    draw = imgui.get_window_draw_list()
    top = text_top(start, height)
    draw.add_text(ImVec2(start.x + theme.pt(8), top), theme.u32("secondary"), ICONS[region.kind])
    draw.add_text(ImVec2(start.x + theme.pt(34), top), theme.u32("text"), name)
    points = t("{count} points", count=len(region.nodes))
    right = start.x + width - theme.pt(36) - imgui.calc_text_size(points).x
    draw.add_text(ImVec2(right, top), theme.u32("secondary"), points)
    imgui.set_cursor_screen_pos(ImVec2(start.x + width - theme.pt(28), start.y))
    if icon_button(Icon.CLOSE, f"region{row}", t("Remove it")):
        editor.rigging.remove(region)
    end_row(start, ROW)
