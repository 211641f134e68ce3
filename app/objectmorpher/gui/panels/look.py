"""The Look tool's settings: what is shown, beside what, and from how near."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from objectmorpher_core.document.bounds import LEAST_THICKNESS, MOST_THICKNESS

from ...canvas.painter import shown_now
from ...commands import hint_of, keys_of, run, why_not
from ...editor.editor import Editor
from ...editor.view import Shown
from ...system.texts import t
from ..widgets.segmented import Segment, segmented
from ..widgets.theme import Icon, theme
from ..widgets.widgets import (
    Number,
    checkbox,
    command_button,
    drawn_button,
    end_row,
    fill_row,
    gap,
    heading,
    icon_button,
    note,
    number_field,
    small_text,
    text_top,
    tooltip,
)

ROW = 28.0  # points
ZOOMS = (("fit", "Fit"), ("actual", "100 %"), ("double", "200 %"), ("pixels", "800 %"))


def draw_look(editor: Editor) -> None:
    """Draw the Look tool's part of the inspector."""
    draw_shape(editor)
    heading(t("View"))
    for shown in Shown:
        _draw_view(editor, shown)
    gap(12)
    command_button(editor, "reset_look", icon=Icon.RESET)
    gap(12)
    heading(t("Before and after"))
    is_split = editor.view.split is not None
    keys = keys_of(editor, "split")
    if checkbox(f"{t('Split the view')}  ({keys})", is_split) != is_split:
        run(editor, "split")
    note(t("Hold X to see the photo as it was."))
    gap(12)
    heading(t("Zoom"))
    _draw_zooms(editor)


def _draw_view(editor: Editor, shown: Shown) -> None:
    """A row: the name of a view, and the keys that show it."""
    name = f"show_{shown.name.lower()}"
    reason = why_not(editor, name)
    start = imgui.get_cursor_screen_pos()
    size = ImVec2(imgui.get_content_region_avail().x, theme.pt(ROW))
    imgui.begin_disabled(reason is not None)
    is_pressed = drawn_button(name, size)
    imgui.end_disabled()
    draw = imgui.get_window_draw_list()
    end = ImVec2(start.x + size.x, start.y + size.y)
    is_current = shown_now(editor.document, editor.view) is shown
    fill_row(start, end, is_current, imgui.is_item_hovered() and reason is None)
    dim = 0.45 if reason is not None else 1.0
    top = text_top(start, size.y)
    role = "accent" if is_current else "text"
    draw.add_text(ImVec2(start.x + theme.pt(8), top), theme.u32(role, dim), t(shown.value))
    with small_text():
        keys = keys_of(editor, name)
        width = imgui.calc_text_size(keys).x
        at = ImVec2(end.x - theme.pt(8) - width, text_top(start, size.y))
        draw.add_text(at, theme.u32("secondary", dim), keys)
    end_row(start, ROW)
    if reason is not None:
        tooltip(reason)
    elif is_pressed:
        run(editor, name)


def _draw_zooms(editor: Editor) -> None:
    """Buttons side by side."""
    space = theme.pt(4)
    across = (imgui.get_content_region_avail().x - (len(ZOOMS) - 1) * space) / len(ZOOMS)
    for i, (name, label) in enumerate(ZOOMS):
        if i:
            imgui.same_line(0, space)
        imgui.push_style_var(imgui.StyleVar_.frame_padding, theme.size(2, 6))
        command_button(editor, name, t(label), across / theme.scale)
        imgui.pop_style_var()
        if why_not(editor, name) is None:
            tooltip(hint_of(editor, name))


# The object's shape in the Look tool, where it is seen from all sides.


def draw_shape(editor: Editor) -> None:
    """Its kind, thickness, the other side, symmetry; and an object out of a file instead."""
    if not editor.is_lifted:
        return
    heading(t("Shape"))
    if (reason := editor.shaping.why_fixed) is None:
        _draw_kind(editor)
        _draw_thickness(editor)
        _draw_trust(editor)
        _draw_back(editor)
        _draw_symmetry(editor)
        _draw_standing(editor)
        _draw_depth(editor)
        _draw_photos(editor)
    else:
        note(f"{reason}.")
        _draw_poses(editor)
    command_button(editor, "import_shape", icon=Icon.CUBE)
    gap(12)


def _draw_kind(editor: Editor) -> None:
    """What the object is, and what it was recognised as."""
    choices = (
        Segment("auto", t("Auto"), t("What its outline and the learned shape say")),
        Segment("round", t("Round"), t("Turned about an axis: a cup, a plate, a bottle, a ball")),
        Segment("flat", t("Flat"), t("A thin sheet: a leaf, a poster, a butterfly, a drawing")),
        Segment("box", t("Box"), t("Six flat sides at right angles")),
        Segment("tube", t("Tube"), t("Every cross-section is a circle: a branch, a limb, a hose")),
        Segment("free", t("Free"), t("Nothing in particular")),
    )
    note(t("Kind"))
    kind = segmented("kind", choices, editor.shaping.settings.kind)
    if (seen := editor.shaping.recognised_as) is not None and kind == "auto":
        labels = {choice.value: choice.label for choice in choices}
        note(t("Recognised as: {kind}", kind=labels[seen]))
    if kind != editor.shaping.settings.kind:
        editor.shaping.say(t("Kind of shape"), kind=kind)


def _draw_thickness(editor: Editor) -> None:
    shape = editor.shaping.settings
    low, high = 100 * LEAST_THICKNESS, 100 * MOST_THICKNESS
    number = Number(t("Thickness"), "%.0f %%", 1.0, 10.0, 100.0, low, high)
    change = number_field(number, 100 * shape.thickness)
    if change.is_changed:
        editor.shaping.preview_thickness(change.value / 100)
    if change.is_done:
        editor.shaping.end_thickness()


def _draw_trust(editor: Editor) -> None:
    """How far the shape network is believed, where it can look."""
    if not editor.models.has_shape:
        return
    number = Number(t("Learned shape"), "%.0f %%", 1.0, 10.0, 100.0, 0.0, 100.0)
    change = number_field(number, 100 * editor.shaping.trust)
    tooltip(t("How much of the shape the network decides; at 0 % only the outline does"))
    if change.is_changed:
        editor.shaping.preview_trust(change.value / 100)
    if change.is_done:
        editor.shaping.end_trust()


def _draw_back(editor: Editor) -> None:
    choices = (
        Segment(
            "auto", t("Auto"), t("As the object looks: mirrored where it is seen from the side")
        ),
        Segment("mirrored", t("Mirrored"), t("The other side looks like this one")),
        Segment("continued", t("Continued"), t("The rim goes on to the other side")),
    )
    note(t("Other side"))
    back = segmented("back", choices, editor.shaping.settings.back)
    if back != editor.shaping.settings.back:
        editor.shaping.say(t("Other side"), back=back)


def _draw_symmetry(editor: Editor) -> None:
    choices: tuple[Segment[bool | None], ...] = (
        Segment(None, t("Auto"), t("Left and right are taken to be alike where they look so")),
        Segment(True, t("Symmetric"), t("Left and right are alike: what is hidden is mirrored")),
        Segment(False, t("None"), t("Left and right have nothing to do with each other")),
    )
    note(t("Symmetry"))
    chosen = segmented("symmetry", choices, editor.shaping.settings.is_symmetric)
    if chosen != editor.shaping.settings.is_symmetric:
        editor.shaping.say(t("Symmetry"), is_symmetric=chosen)


def _draw_standing(editor: Editor) -> None:
    is_standing = editor.shaping.settings.is_standing
    chosen = checkbox(t("It stands in the photo"), is_standing)
    tooltip(t("Its feet show which end is nearer. Untick this for things that fly or hang"))
    if chosen != is_standing:
        editor.shaping.say(t("Standing"), is_standing=chosen)


def _draw_depth(editor: Editor) -> None:
    """Where a depth model is there, or would be used."""
    uses_depth = editor.shaping.settings.uses_depth
    if not editor.models.has_depth and uses_depth:
        return
    chosen = checkbox(t("Use the depth model"), uses_depth)
    tooltip(t("Its front is as deep as the model sees it; what you painted is added to that"))
    if chosen != uses_depth:
        editor.shaping.say(t("Depth model"), uses_depth=chosen)


def _draw_photos(editor: Editor) -> None:
    """Other photos of the object, from which its shape and its sides are known."""
    note(t("Photos from other sides"))
    for number, view in enumerate(editor.shaping.settings.views):
        imgui.push_id(number)
        if icon_button(Icon.CLOSE, "drop", t("Remove this photo")):
            editor.shaping.drop_photo(number)
        imgui.pop_id()
        imgui.same_line()
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(view.photo)
    command_button(editor, "add_photo", icon=Icon.IMAGE)
    if why_not(editor, "add_photo") is None:
        tooltip(t("The main subject of that photo, or what is selected where it is open in a tab"))


def _draw_poses(editor: Editor) -> None:
    """The poses in which the file's object looks like the photo."""
    fitting = editor.shaping.fitting
    if fitting is not None and len(fitting.found.registration.proposals) > 1:
        proposals = fitting.found.registration.proposals
        choices = tuple(
            Segment(
                proposal, f"{100 * proposal.iou:.0f} %",
                t("Its outline agrees by {share} %, its colours differ by {error} %",
                  share=f"{100 * proposal.iou:.1f}", error=f"{100 * proposal.colour_error:.1f}"),
            )
            for proposal in proposals
        )  # fmt: skip
        chosen = segmented("poses", choices, fitting.chosen)
        if chosen is not fitting.chosen:
            editor.shaping.choose(chosen)
        if fitting.found.registration.is_ambiguous:
            note(fitting.found.registration.reason)
    command_button(editor, "fit_again")
    note(t("Place it by hand, then fit it from there."))
