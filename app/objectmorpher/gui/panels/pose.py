"""The Pose tool's settings."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from objectmorpher_core.document.hold_edits import Stays, stays_of
from objectmorpher_core.document.model import EditObject
from objectmorpher_core.document.settings import Rigidity, rigidity_of

from ...canvas.painter import shown_now
from ...commands import why_not
from ...editor.editor import Editor
from ...editor.intents.posing import Numbers
from ...editor.intents.rigging import MovedPart
from ...editor.view import BRUSHES, PoseMode, Shown
from ...system.texts import t
from ..widgets.segmented import Segment, named_icons, segmented
from ..widgets.theme import Icon, theme
from ..widgets.widgets import (
    BETWEEN,
    Number,
    checkbox,
    command_button,
    drawn_button,
    end_row,
    fill_row,
    gap,
    half_width,
    heading,
    icon_button,
    mark,
    note,
    number_field,
    text_top,
    tooltip,
)
from .select import draw_radius

STAYS = {Stays.FAR: "Far side", Stays.ELSE: "All else", Stays.NOTHING: "Only pins"}
WHAT_STAYS = {
    Stays.FAR: "The part farthest from the first handle stays where it is",
    Stays.ELSE: "Only what is near a handle moves, everything else stays",
    Stays.NOTHING: "Nothing stays by itself: only pins and handles hold",
}
NAMES = {Rigidity.RIGID: "Rigid", Rigidity.NORMAL: "Normal", Rigidity.SOFT: "Soft"}


def draw_pose(editor: Editor) -> None:
    thing = editor.object
    if thing is None:
        return
    draw_modes(editor)
    if editor.view.pose.mode is PoseMode.DRAG:
        gap(8)
        draw_handles(editor)
        draw_numbers(editor)
    draw_regions(editor)
    gap(12)
    _draw_material(editor, thing)
    gap(12)
    _draw_symmetry(editor)
    _draw_overlays(editor)
    gap(12)
    half = half_width()
    command_button(editor, "reset_handles", width=half)
    imgui.same_line()
    command_button(editor, "reset_pose", width=half, icon=Icon.RESET)
    gap(12)
    draw_timeline(editor)


def _draw_material(editor: Editor, thing: EditObject) -> None:
    heading(t("Rigidity"))
    now, held = rigidity_of(thing.deform), stays_of(thing)
    presets: tuple[Segment[Rigidity | None], ...] = tuple(Segment(r, t(NAMES[r])) for r in Rigidity)
    chosen = segmented("rigidity", presets, now)
    if chosen is not None and chosen is not now:
        editor.rigging.set_rigidity(chosen)
    gap(8)
    heading(t("What stays"))
    kinds = tuple(Segment(s, t(STAYS[s]), t(WHAT_STAYS[s])) for s in Stays)
    stays = segmented("stays", kinds, held)
    if stays is not held:
        editor.posing.set_stays(stays)


def _draw_symmetry(editor: Editor) -> None:
    heading(t("Symmetry"))
    mirroring = editor.posing.mirroring
    if checkbox(t("Drag the mirrored point too"), mirroring.is_on) != mirroring.is_on:
        mirroring.toggle()
    if mirroring.is_on and not mirroring.is_found():
        note(t("No mirror plane was found: an upright one through the middle is used."))
    gap(12)


def _draw_overlays(editor: Editor) -> None:
    heading(t("Show"))
    pose, view = editor.view.pose, editor.view
    pose.has_ring = checkbox(t("Rotation ring (R)"), pose.has_ring)
    pose.has_anchors = checkbox(t("Anchors"), pose.has_anchors)
    pose.has_regions = checkbox(t("Regions"), pose.has_regions)
    pose.has_influence = checkbox(t("Influence of the handle"), pose.has_influence)
    view.has_points = checkbox(t("Control graph"), view.has_points)
    is_strain = shown_now(editor.document, view) is Shown.STRAIN
    if checkbox(t("Strain"), is_strain) != is_strain:
        view.shown = Shown.COMPOSITE if is_strain else Shown.STRAIN


# The list of handles, and the numbers of the current one.

ROW = 28.0  # points
VISIBLE_ROWS = 6
PER_PX = 0.5  # px per point that a field is dragged
_revealed: list[int | None] = [None]  # the handle that the list was scrolled to last


def draw_handles(editor: Editor) -> None:
    """Draw the list of handles; a click selects one, with Shift or Ctrl one more."""
    heading(t("Handles"))
    thing = editor.object
    if thing is None or not thing.handles:
        note(t("Drag a point on the object: it follows, and the far side holds still."))
        return
    count = len(thing.handles)
    if count <= VISIBLE_ROWS:
        for h in range(count):
            _draw_row(editor, h)
        return
    step = theme.pt(ROW + BETWEEN)
    imgui.begin_child("##handles", ImVec2(0, VISIBLE_ROWS * step + step / 2))
    is_new, _revealed[0] = _revealed[0] != editor.posing.handle, editor.posing.handle
    for h in range(count):
        if is_new and h == editor.posing.handle:
            imgui.set_scroll_from_pos_y(imgui.get_cursor_pos_y() - imgui.get_scroll_y() + step / 2)
        if editor.object is not None and h < len(editor.object.handles):  # one may be removed
            _draw_row(editor, h)
    imgui.end_child()


def _draw_row(editor: Editor, h: int) -> None:
    thing = editor.object
    if thing is None or h >= len(thing.handles):
        return
    is_pin = thing.handles[h].is_pin
    start = imgui.get_cursor_screen_pos()
    size = ImVec2(imgui.get_content_region_avail().x, theme.pt(ROW))
    imgui.set_next_item_allow_overlap()
    if drawn_button(f"##handle{h}", size):
        io = imgui.get_io()
        if io.key_shift or io.key_ctrl:
            editor.posing.toggle(h)
        else:
            editor.posing.select(h)
    draw = imgui.get_window_draw_list()
    end = ImVec2(start.x + size.x, start.y + size.y)
    fill_row(start, end, h in editor.posing.selected, imgui.is_item_hovered())
    middle = ImVec2(start.x + theme.pt(16), (start.y + end.y) / 2)
    if h == editor.posing.handle:
        draw.add_circle(middle, theme.pt(9), theme.u32("accent"), 0, theme.pt(2))
    if is_pin:
        draw.add_ngon_filled(middle, theme.pt(6), theme.u32("text"), 4)
    else:
        draw.add_circle_filled(middle, theme.pt(5), theme.u32("accent"))
    top = text_top(start, size.y)
    name = t("Pin {number}", number=h + 1) if is_pin else t("Handle {number}", number=h + 1)
    draw.add_text(ImVec2(start.x + theme.pt(34), top), theme.u32("text"), name)
    imgui.set_cursor_screen_pos(ImVec2(end.x - theme.pt(28), start.y))
    if icon_button(Icon.CLOSE, f"remove{h}", t("Remove it (Del)")):
        editor.posing.remove(h)
    end_row(start, ROW)


def draw_numbers(editor: Editor) -> None:
    """Draw the numbers of the handle selected last."""
    numbers = editor.handle_numbers.read()
    if numbers is None:
        return
    gap(12)
    h = editor.posing.handle
    assert h is not None
    is_pin = numbers.is_pin
    heading(t("Pin {number}", number=h + 1) if is_pin else t("Handle {number}", number=h + 1))
    _draw_place(editor, numbers)
    _draw_turn(editor, numbers)
    soft = Number(t("Softness"), "%.2f", 0.005, 0.1, 0.0, 0.0, 10.0)
    change = number_field(soft, numbers.softness)
    if change.is_changed:
        editor.handle_numbers.soften(change.value)
    if change.is_done:
        editor.posing.finish(t("Softness of handle"))
    now_pin = checkbox(t("Pin: it holds still"), is_pin)
    if now_pin != is_pin:
        editor.handle_numbers.set_pin(now_pin)
    half = half_width()
    command_button(editor, "reset_handle", t("Reset"), half)
    tooltip(t("Selected handles go back to where their points were"))
    imgui.same_line()
    command_button(editor, "remove_handle", t("Remove"), half)


def _draw_place(editor: Editor, numbers: Numbers) -> None:
    fields = (
        (Number("X", "%.1f px", PER_PX, 1.0, numbers.rest[0]), "x"),
        (Number("Y", "%.1f px", PER_PX, 1.0, numbers.rest[1]), "y"),
        (Number(t("Depth"), t("%.2f × its size"), 0.005, 0.05), "depth"),
    )
    for number, name in fields:
        change = number_field(number, getattr(numbers, name))
        if name == "depth":
            tooltip(t("How much farther away, in sizes of the object; below 0 it is nearer"))
        if change.is_changed:
            wanted = replace(numbers, **{name: change.value})
            editor.handle_numbers.move(wanted.x, wanted.y, wanted.depth)
        if change.is_done:
            editor.posing.finish(t("{name} of handle", name=number.name))


def _draw_turn(editor: Editor, numbers: Numbers) -> None:
    change = number_field(Number(t("Turn"), "%.1f°", 0.25, 5.0), numbers.turn)
    if change.is_changed:
        editor.handle_numbers.turn(change.value)
    if change.is_done:
        editor.posing.finish(t("Turn of handle"))
    is_free = checkbox(t("Turns with the object"), numbers.is_free)
    tooltip(t("Off: it is held as it is turned"))
    if is_free != numbers.is_free:
        editor.handle_numbers.set_free(is_free)


# What dragging does, and the regions that move in a way of their own.

ICONS = {
    PoseMode.DRAG: Icon.POSE, PoseMode.FREEZE: Icon.FREEZE, PoseMode.STIFFEN: Icon.STIFFEN,
    PoseMode.BODY: Icon.BODY, PoseMode.CUT: Icon.CUT, PoseMode.GLUE: Icon.GLUE,
}  # fmt: skip
WORDS = {
    PoseMode.DRAG: "Drag", PoseMode.FREEZE: "Freeze", PoseMode.STIFFEN: "Stiffen",
    PoseMode.BODY: "Group", PoseMode.CUT: "Cut", PoseMode.GLUE: "Glue",
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
    modes = tuple(
        Segment(mode, t(WORDS[mode]), t(mode.value), icon=ICONS[mode]) for mode in PoseMode
    )
    view.mode = named_icons("mode", modes, view.mode)
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
    """Draw the painted regions, each with a button that takes it back."""
    regions = editor.rigging.regions()
    if not regions:
        return
    gap(12)
    heading(t("Regions"))
    numbers: dict[PoseMode, int] = {}
    for row, region in enumerate(regions):
        numbers[region.kind] = numbers.get(region.kind, 0) + 1
        _draw_region(editor, region, row, _name(region, numbers[region.kind]))


def _name(region: MovedPart, number: int) -> str:
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


def _draw_region(editor: Editor, region: MovedPart, row: int, name: str) -> None:
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


# The timeline: the key poses of an animation in their order, and what can be done with them.

STATION = 26.0  # points, width and height of a key pose


def draw_timeline(editor: Editor) -> None:
    """Draw the key poses on a line; a click goes to one."""
    heading(t("Animation"))
    half = half_width()
    command_button(editor, "add_key", icon=Icon.PLUS)  # above what its clicks add: it stays there
    if editor.keying.count:
        _draw_stations(editor)
        command_button(editor, "replace_key", t("Replace"), half)
        if why_not(editor, "replace_key") is None:
            tooltip(
                t("The key pose that you were in last becomes what you see now"), is_beside=True
            )
        imgui.same_line()
        command_button(editor, "remove_key", t("Remove"), half)
    if editor.keying.count < 2:
        note(t("Keep two poses or more: a video can show the way from one to the next."))


def _draw_stations(editor: Editor) -> None:
    keying, draw = editor.keying, imgui.get_window_draw_list()
    shown, last, side = keying.shown, keying.last, theme.pt(STATION)
    start, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    step = min((room - side) / max(keying.count - 1, 1), 2 * side)
    first = ImVec2(start.x + side / 2, start.y + side / 2)
    end = ImVec2(first.x + (keying.count - 1) * step, first.y)
    draw.add_line(first, end, theme.u32("line"), theme.pt(2))
    for n in range(keying.count):
        imgui.set_cursor_screen_pos(ImVec2(start.x + n * step, start.y))
        if drawn_button(f"##key{n}", ImVec2(side, side)):
            keying.show(n)
        name = t("Go to key pose {number}", number=n + 1)
        mark(name)
        tooltip(name, is_beside=True)
        role = "accent" if n == shown else "hovered" if imgui.is_item_hovered() else "raised"
        at, number = ImVec2(start.x + n * step + side / 2, start.y + side / 2), str(n + 1)
        draw.add_circle_filled(at, side / 2 - theme.pt(1), theme.u32(role))
        if n == last and n != shown:
            draw.add_circle(at, side / 2 - theme.pt(1), theme.u32("accent"), 0, theme.pt(2))
        size = imgui.calc_text_size(number)
        ink = theme.u32("on_accent" if n == shown else "text")
        draw.add_text(ImVec2(at.x - size.x / 2, at.y - size.y / 2), ink, number)
    imgui.set_cursor_screen_pos(ImVec2(start.x, start.y + side))
    gap(4)
