"""The models list's rows of models of several files: a family each, and of it one size."""

from __future__ import annotations

from imgui_bundle import imgui

from objectmorpher_core.models import HubState

from ..editing.hub_models import has_torch
from ..editing.models import DOWNLOAD
from ..editor import Editor
from ..filing import Dialog
from ..texts import t
from .segmented import Choice, segmented
from .theme import theme
from .widgets import Kind, bold_text, button, checkbox, gap, note, rule

BUTTON = 120.0  # points
NAMES = {
    "sam2": "SAM 2.1", "sam3": "SAM 3", "sam": "SAM", "sam-onnx": "Small SAMs (ONNX)",
}  # fmt: skip
GAINS = {
    "sam2": "Clicks select nearly anything; parts, objects and groups",
    "sam3": "The newest, for a large GPU",
    "sam": "The first of its kind, which the paper uses",
    "sam-onnx": "Smaller and quicker, without PyTorch",
}
SIZES = {
    "sam2.1-tiny": "Tiny", "sam2.1-small": "Small", "sam2.1-base-plus": "Base",
    "sam2.1-large": "Large",
    "sam-vit-base": "Base", "sam-vit-large": "Large", "sam-vit-huge": "Huge",
    "mobile-sam": "MobileSAM", "efficient-sam": "EfficientSAM",
}  # fmt: skip


def draw_hub_rows(editor: Editor) -> None:
    """All families."""
    for family in editor.models.hub.families:
        if family in NAMES:
            imgui.push_id(family)
            _draw_family(editor, family)
            imgui.pop_id()


def _draw_family(editor: Editor, family: str) -> None:
    hub = editor.models.hub
    sizes, shown = hub.of(family), hub.shown(family)
    rule()
    with bold_text():
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(t(NAMES[family]))
    imgui.same_line(imgui.get_window_width() - theme.pt(20 + BUTTON))
    _draw_button(editor, shown)
    imgui.push_text_wrap_pos(imgui.get_window_width() - theme.pt(20 + BUTTON + 16))
    imgui.text_unformatted(t(GAINS[family]))
    imgui.pop_text_wrap_pos()
    if len(sizes) > 1:
        gap(4)
        imgui.begin_child("##sizes", theme.size(WIDE, 28))
        choices = [Choice(s.model.id, t(SIZES[s.model.id])) for s in reversed(sizes)]
        chosen = segmented(family, choices, shown.model.id)
        imgui.end_child()
        if chosen != shown.model.id:
            hub.choose(family, chosen)
    _draw_facts(editor, shown)


WIDE = 360.0  # points, of the choice of a size


def _draw_facts(editor: Editor, shown: HubState) -> None:
    """Size, licence and source; the licence's box where it needs one; what is in the way."""
    hub, model = editor.models.hub, shown.model
    size = f"{model.size / 1e6:.0f} MB" if model.size < 1e9 else f"{model.size / 1e9:.1f} GB"
    if shown.is_own:
        note(t("In your folder {folder}", folder=shown.path.name))
    elif model.repository:
        note(t("{size} to download · licence {licence}", size=size, licence=model.licence))
    if shown.state == "damaged":
        note(t("It is damaged: {reason}", reason=shown.reason))
    source = model.home.removeprefix("https://")
    if shown.state == "ok":
        return
    if not model.repository:
        note(t("Nothing is downloaded: get it from {page}, as two ONNX files.", page=source))
        note(t("Licence {licence}", licence=model.licence))
        return
    note(t("From {source}", source=source))
    if not has_torch() and hub.why_not(model):
        note(hub.why_not(model) or "")
    elif not model.is_free:
        label = t("I have read and accept the {licence}", licence=model.licence)
        hub.accept(model, checkbox(label, hub.accepts(model)))
    if imgui.text_link(t("Use a folder of mine…")):
        hub.wanted, editor.filing.wanted = model.id, Dialog.MODEL_FOLDER


def _draw_button(editor: Editor, shown: HubState) -> None:
    """Remove, Cancel with how far it is, Download, or the folder's choice."""
    models, hub, id = editor.models, editor.models.hub, shown.model.id
    if models.downloading == id:
        chore = editor.chores.shown
        share = chore.fraction if chore is not None and chore.kind == DOWNLOAD else 0.0
        if button(t("Cancel, {share} %", share=f"{100 * share:.0f}"), width=BUTTON):
            models.cancel()
    elif shown.state == "ok" or shown.is_own:
        if button(t("Remove"), width=BUTTON):
            hub.remove(id)
    elif not shown.model.repository:
        if button(t("Use a folder…"), width=BUTTON):
            hub.wanted, editor.filing.wanted = id, Dialog.MODEL_FOLDER
    elif button(t("Download"), Kind.PLAIN, hub.why_not(shown.model), width=BUTTON):
        hub.download(id)
