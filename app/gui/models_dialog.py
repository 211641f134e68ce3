"""Learned models: what each is for, how large, whose; a download only by its button."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from objectmorpher_core.models import Added, State

from ..editing.models import DOWNLOAD, names_of
from ..editor import Editor
from ..filing import Dialog
from ..texts import t
from .hub_rows import draw_hub_rows
from .modal import PADDING, is_dismissed, modal
from .theme import Icon, theme
from .widgets import Kind, bold_text, button, gap, half_width, note, rule, tooltip
from .worker_rows import draw_worker_rows

WIDTH = 560.0  # points
BUTTON = 120.0
AROUND = 200.0  # what of the window's height the rows leave to title, button and surroundings
ABOUT = (
    "Everything works without them. What you download stays on this computer, and no photo ever "
    "leaves it."
)


def draw_models(editor: Editor) -> None:
    """While the list is open."""
    if not editor.models.is_open:
        return
    with modal(t("Models"), WIDTH, t(ABOUT)) as is_shown:
        if not is_shown:
            return
        _draw_rows(editor)
        imgui.dummy(theme.size(0, 4))
        imgui.set_cursor_pos_x(imgui.get_window_width() - theme.pt(20 + BUTTON))
        if button(t("Close"), width=BUTTON) or is_dismissed():
            editor.models.is_open = False
            imgui.close_current_popup()


def _draw_rows(editor: Editor) -> None:
    """All that there is, scrolled where the window is too low for it."""
    room = imgui.get_main_viewport().size.y - theme.pt(AROUND)
    across = imgui.get_content_region_avail().x + theme.pt(PADDING)  # the scroll bar is in there
    imgui.set_next_window_size_constraints(ImVec2(across, 0), ImVec2(across, max(room, 1)))
    imgui.begin_child("##rows", ImVec2(across, 0), imgui.ChildFlags_.auto_resize_y)
    for state in editor.models.states:
        _draw_model(editor, state)
    for own in editor.models.added:
        _draw_added(editor, own)
    draw_hub_rows(editor)
    draw_worker_rows(editor)
    if not editor.models.states:
        note(t("Looking at what is there…"))
    imgui.end_child()


def _draw_model(editor: Editor, state: State) -> None:
    weight, names = state.weight, names_of(state.weight.id)
    rule()
    imgui.push_id(weight.id)
    with bold_text():
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(names.name)
    imgui.same_line(imgui.get_window_width() - theme.pt(20 + BUTTON))
    _draw_state(editor, state)
    room = imgui.get_window_width() - theme.pt(20 + BUTTON + 16)
    imgui.push_text_wrap_pos(room)
    imgui.text_unformatted(t(names.gain))
    imgui.pop_text_wrap_pos()
    megabytes = f"{weight.wheel_size / 1e6:.0f} MB"
    note(t("{size} to download · licence {licence}", size=megabytes, licence=weight.licence))
    note(t("From {source}, by {page}", source=weight.wheel.split("==")[0],
           page=weight.page.removeprefix("https://")))  # fmt: skip
    imgui.pop_id()


def _draw_added(editor: Editor, own: Added) -> None:
    """A model that users bring: nothing is fetched for it."""
    rule()
    imgui.push_id(own.kind.id)
    with bold_text():
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(t("Depth model"))
    imgui.same_line(imgui.get_window_width() - theme.pt(20 + BUTTON))
    if own.state == "missing":
        if button(t("Use a file…"), width=BUTTON):
            editor.filing.wanted = Dialog.MODEL_OPEN
    elif button(t("Remove"), width=BUTTON):
        editor.models.remove()
    room = imgui.get_window_width() - theme.pt(20 + BUTTON + 16)
    imgui.push_text_wrap_pos(room)
    imgui.text_unformatted(t("A lifted object is as deep as it looks, not as its outline says"))
    imgui.pop_text_wrap_pos()
    if own.state == "ok":
        size = f"{own.size / 1e6:.0f} MB"
        note(t("{name}, {size}, SHA-256 {hash}", name=own.name, size=size, hash=own.sha256[:16]))
    elif own.state == "damaged":
        note(t("Its file is damaged."))
    else:
        note(t("Nothing is downloaded: for instance an ONNX export of Depth-Anything-V2-Small."))
    imgui.pop_id()


def _draw_state(editor: Editor, state: State) -> None:
    """Installed, on its way with Cancel, or the button that gets it."""
    models, id = editor.models, state.weight.id
    if models.downloading == id:
        chore = editor.chores.shown
        share = chore.fraction if chore is not None and chore.kind == DOWNLOAD else 0.0
        if button(t("Cancel, {share} %", share=f"{100 * share:.0f}"), width=BUTTON):
            models.cancel()
    elif state.state == "ok":
        across = imgui.calc_text_size(f"{Icon.CHECK}{t('Installed')}").x + theme.pt(6)
        imgui.set_cursor_pos_x(imgui.get_window_width() - theme.pt(20) - across)
        imgui.align_text_to_frame_padding()
        imgui.text_colored(theme.vec("accent"), Icon.CHECK)
        imgui.same_line(0, theme.pt(6))
        imgui.text_colored(theme.vec("secondary"), t("Installed"))
    else:
        busy = t("Another model is on its way") if models.downloading else None
        if button(t("Download"), Kind.PLAIN, busy, width=BUTTON):
            models.download(id)


def draw_offer(editor: Editor) -> None:
    """Where the user selects: a model that would help and is not there."""
    models = editor.models
    weight = models.offered
    if weight is None or models.downloading is not None:
        return
    rule()
    note(t("Selecting can be better: {gain}, with a model of {size} MB.",
           gain=_lower(t(names_of(weight.id).gain)),
           size=f"{weight.wheel_size / 1e6:.0f}"))  # fmt: skip
    gap(8)
    half = half_width()
    if button(t("See the model…"), width=half):
        models.open()
    imgui.same_line()
    if button(t("Not now"), width=half):
        models.decline(weight.id)
    tooltip(t("It stays in Window > Models"))


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]
