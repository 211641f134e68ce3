"""The models list's rows of models of several files: a family each, and of it one size."""

from __future__ import annotations

from imgui_bundle import imgui

from objectmorpher_core.models import HubState

from ...editor.editor import Editor
from ...editor.filing import Dialog
from ...editor.intents.hub_models import has_torch
from ...editor.intents.models import DOWNLOAD
from ...system.texts import t
from ..widgets.segmented import Choice, segmented
from ..widgets.theme import theme
from ..widgets.widgets import Kind, bold_text, button, checkbox, gap, heading, note, rule

BUTTON = 120.0  # points
NAMES = {
    "sam2": "SAM 2.1", "sam3": "SAM 3", "sam": "SAM", "sam-onnx": "Small SAMs (ONNX)",
    "pixelhacker": "PixelHacker", "lama": "LaMa", "migan": "MI-GAN",
    "trellis": "TRELLIS", "cupid": "CUPID", "dinov2-with-registers": "DINOv2 with registers",
    "depth-anything": "Depth Anything V2", "qwen-image-edit": "Qwen-Image-Edit",
    "qwen-image-edit-2511-lightning": "Lightning for Qwen-Image-Edit-2511",
    "qwen-image-edit-2509-lightning": "Lightning for Qwen-Image-Edit-2509",
    "qwen-refine-lora": "Your LoRA on Qwen-Image-Edit",
    "flux2-klein": "FLUX.2-klein", "flux2-klein-base": "FLUX.2-klein, base",
    "klein-refine-lora": "Your LoRA on FLUX.2-klein",
}  # fmt: skip
GAINS = {
    "sam2": "Clicks select nearly anything; parts, objects and groups",
    "sam3": "The newest, for a large GPU",
    "sam": "The first of its kind, which the paper uses",
    "sam-onnx": "Smaller and quicker, without PyTorch",
    "pixelhacker": "Invents what is behind objects, for a GPU: the paper's",
    "lama": "Invents what is behind large objects, without a GPU",
    "migan": "Invents what is behind objects, the quickest",
    "trellis": "The whole object from one picture, for a GPU: the paper's",
    "cupid": "The same with the photo's camera; also needs TRELLIS",
    "dinov2-with-registers": "What TRELLIS and CUPID see a picture with",
    "depth-anything": "A lifted object is as deep as it looks, not as its outline says",
    "qwen-image-edit": "Makes the edit look photographed, for a very large GPU: the paper's",
    "qwen-image-edit-2511-lightning": "The same in 4 steps instead of 40",
    "qwen-image-edit-2509-lightning": "The same in 4 or 8 steps instead of 40",
    "qwen-refine-lora": "What you have trained it to do",
    "flux2-klein": "Makes the edit look photographed, in four steps, for a GPU of 12 GB",
    "flux2-klein-base": "What a LoRA of yours for FLUX.2-klein is trained on",
    "klein-refine-lora": "What you have trained it to do",
}
SIZES = {
    "sam2.1-tiny": "Tiny", "sam2.1-small": "Small", "sam2.1-base-plus": "Base",
    "sam2.1-large": "Large",
    "sam-vit-base": "Base", "sam-vit-large": "Large", "sam-vit-huge": "Huge",
    "mobile-sam": "MobileSAM", "efficient-sam": "EfficientSAM",
    "qwen-image-edit-2509": "2509", "qwen-image-edit-2511": "2511",
    "qwen-image-edit-2509-lightning-4": "4 steps", "qwen-image-edit-2509-lightning-8": "8 steps",
}  # fmt: skip
STAGES = {
    "segment": "For selecting", "inpaint": "For the background", "lift": "For lifting",
    "depth": "For the depth of what is lifted", "refine": "For refining",
}  # fmt: skip


def draw_hub_rows(editor: Editor) -> None:
    """All families, by what they are for."""
    before = ""
    for family in editor.models.hub.families:
        if family in NAMES:
            stage = editor.models.hub.shown(family).model.stage
            if stage != before:
                gap(12)
                heading(t(STAGES[stage]))
            before = stage
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
        if model.family.endswith("-lora"):
            note(t("Nothing is downloaded: one .safetensors file in a folder of yours."))
            return
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
