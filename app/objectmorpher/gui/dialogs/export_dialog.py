"""The export dialog: what, how, and where to; its button says what will be written."""

from __future__ import annotations

from imgui_bundle import imgui

from ...editor.editor import Editor
from ...editor.export_plan import LENGTHS, VideoMotion, What
from ...editor.filing import Dialog
from ...editor.intents.exporting import Exporting
from ...system.texts import t
from ..widgets.modal import is_confirmed, is_dismissed, modal
from ..widgets.segmented import Segment, segmented, unfolding
from ..widgets.theme import FIELD, PRIMARY, theme
from ..widgets.widgets import (
    FILL,
    Emphasis,
    bold_text,
    button,
    fitted,
    note,
    shortened,
    shown_path,
    tooltip,
    wrapped_text,
)
from ..window.landmarks import mark

WIDTH = 480.0  # points
LABELS = 88.0  # width of the names left of the fields
BROWSE = 96.0
ROW = 4  # formats that fit beside each other
DEPTHS = (8, 16)  # bits a channel
ABOUT = {
    What.PHOTO: "The whole photo with the edit in it.",
    What.CUTOUT: "The current object alone, where it is now, on nothing.",
    What.MASK: "The current object's selection in the opened photo, white on black.",
    What.DEPTH: "How near the objects are: the nearest point white, twice as far half as bright.",
    What.BACKGROUND: "The photo with its objects painted out.",
    What.LAYERS: "Photo, background, shadows and objects, for paint programs; PNG: in a folder.",
    What.VIDEO: "A looping film, at most 1280 px wide.",
    What.SOLID: "The current object as it is posed: a mesh with the photo on it, or Gaussians.",
}


def draw_export(editor: Editor) -> None:
    """While the editor has an export to decide on."""
    exporting, title = editor.exporting, t("Export")
    if exporting.draft is None and not imgui.is_popup_open(title):
        return
    with modal(title, WIDTH) as is_shown:
        if not is_shown:
            return
        if exporting.draft is not None:
            _draw_what(exporting)
            _draw_how(exporting)
            is_entered = _draw_where(editor)
            _draw_foot(exporting, is_entered)
        # Its document may also have been closed, by a file that was dropped on the window.
        if exporting.draft is None or editor.filing.wanted is not None:
            imgui.close_current_popup()


def _draw_what(exporting: Exporting) -> None:
    assert exporting.draft is not None
    _name(t("What"))
    choices = [Segment(what, t(what.value), why_not=exporting.why_not(what)) for what in What]
    imgui.set_next_item_width(FILL)
    if (chosen := unfolding("what", choices, exporting.draft.what)) is not exporting.draft.what:
        exporting.choose_what(chosen)
    imgui.set_cursor_pos_x(_field())
    if exporting.draft.what is What.VIDEO and exporting.is_folder:
        note(t("A folder of pictures, one for each frame, at most 1280 px wide."))
    else:
        note(t(ABOUT[exporting.draft.what]))
    imgui.dummy(theme.size(0, 0))


def _draw_how(exporting: Exporting) -> None:
    assert exporting.draft is not None
    _name(t("Format"))
    _draw_format(exporting)
    if exporting.draft.what is What.VIDEO:
        _draw_motion(exporting)
    elif exporting.has_bits:
        _name(t("Depth"))
        depths = tuple(Segment(bits, t("{bits} bit", bits=bits)) for bits in DEPTHS)
        bits = segmented("bits", depths, exporting.bits)
        if bits != exporting.bits:
            exporting.choose_bits(0 if bits == exporting.own_bits else bits)
    elif exporting.has_quality:
        _name(t("Quality"))
        imgui.set_next_item_width(FILL)
        shown = t("lossless") if exporting.is_lossless else "%d"
        is_changed, quality = imgui.slider_int("##quality", exporting.quality, 50, 100, shown)
        if is_changed:
            exporting.choose_quality(quality)
        tooltip(t("Higher is larger and truer. Below lossless, every pixel changes a little."))
    imgui.dummy(theme.size(0, 0))


def _draw_format(exporting: Exporting) -> None:
    """A row of formats, or a list where they are many."""
    assert exporting.draft is not None
    chosen = exporting.draft.format
    draw = unfolding if len(exporting.formats) > ROW else segmented
    choices = [Segment(f, f.value, why_not=exporting.why_no_format(f)) for f in exporting.formats]
    imgui.set_next_item_width(FILL)
    format = draw("format", choices, chosen)
    if format is not chosen:
        exporting.choose_format(format)


def _draw_motion(exporting: Exporting) -> None:
    """What a video shows, and for how long."""
    draft = exporting.draft
    assert draft is not None
    _name(t("Motion"))
    choices = tuple(
        Segment(motion, t(motion.value), why_not=exporting.why_no_motion(motion))
        for motion in VideoMotion
    )
    motion = segmented("motion", choices, draft.motion)
    if motion is not draft.motion:
        exporting.choose_motion(motion)
    _name(t("Length"))
    imgui.set_next_item_width(FILL)
    shortest, longest = LENGTHS
    is_changed, seconds = imgui.slider_float(
        "##seconds", draft.seconds, shortest, longest, "%.1f s"
    )
    if is_changed:
        exporting.choose_seconds(round(2 * seconds) / 2)


def _draw_where(editor: Editor) -> bool:
    """Name and folder; True when Enter was pressed in the name."""
    exporting = editor.exporting
    assert exporting.draft is not None
    _name(t("Folder") if exporting.is_folder else t("Name"))
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    imgui.set_next_item_width(FILL)
    flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
    name = exporting.draft.name
    is_entered, typed = imgui.input_text_with_hint("##name", t("name or path"), name, flags)
    mark(t("Name"))
    if typed != name:
        exporting.set_name(typed)
    _name(t("In"))
    imgui.align_text_to_frame_padding()
    room = imgui.get_content_region_avail().x - theme.pt(BROWSE + 8)
    folder = shown_path(exporting.path.parent)
    imgui.text_colored(theme.vec("secondary"), shortened(folder, room))
    tooltip(folder)
    imgui.same_line(imgui.get_window_width() - theme.pt(20 + BROWSE))
    if button(t("Browse…"), width=BROWSE):
        editor.filing.wanted = Dialog.EXPORT
    return is_entered


def _draw_foot(exporting: Exporting, is_entered: bool) -> None:
    """What is wrong, or what will be replaced; Cancel and the button that does it."""
    problem = exporting.problem
    imgui.dummy(theme.size(0, 4))
    warning = t("{name} already exists.", name=exporting.path.name)
    text = problem or (warning if exporting.is_replacing else exporting.renaming)
    wrapped_text(text or " ", "warning")
    top = imgui.get_cursor_pos_y()
    imgui.set_cursor_pos_y(top + theme.pt((PRIMARY - FIELD) / 2))
    is_cancelled = button(t("Cancel"), width=BROWSE)
    imgui.same_line()
    imgui.set_cursor_pos_y(top)
    room = imgui.get_content_region_avail().x - 2 * imgui.get_style().frame_padding.x
    with bold_text():
        label = f"{fitted(exporting.label, room)}###go"
    is_pressed = button(label, Emphasis.PRIMARY, problem)
    if is_cancelled or is_dismissed():
        exporting.close()
    elif is_pressed or is_entered or is_confirmed():
        exporting.confirm()


def _name(text: str) -> None:
    """Left of a field."""
    imgui.align_text_to_frame_padding()
    imgui.text_colored(theme.vec("secondary"), text)
    imgui.same_line(_field())


def _field() -> float:
    """Where the fields begin, window units."""
    return theme.pt(20 + LABELS)
