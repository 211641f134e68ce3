"""Learned models: what each is for, how large, whose; a download only by its button."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from imgui_bundle import ImVec2, imgui

from objectmorpher_core.models import Added, CacheState, HubState

from ...editor.editor import Editor
from ...editor.filing import Dialog
from ...editor.intents.methods import WorkerState
from ...editor.intents.models import DOWNLOAD, has_torch, names_of
from ...system.texts import sentence, t
from ..widgets.modal import PADDING, is_dismissed, modal
from ..widgets.segmented import Segment, segmented
from ..widgets.theme import Icon, theme
from ..widgets.widgets import (
    Emphasis,
    bold_text,
    button,
    checkbox,
    gap,
    half_width,
    heading,
    note,
    rule,
    tooltip,
    wrapped_text,
)

if TYPE_CHECKING:
    from objectmorpher_core.model_sets import SetOffer

WIDTH = 560.0  # points
BUTTON = 120.0
AROUND = 240.0  # what of the window's height the rows leave to title, button and surroundings
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
    for offer in editor.models.offers:
        _draw_set(editor, offer)
    for state in editor.models.states:
        _draw_model(editor, state)
    for own in editor.models.added:
        _draw_added(editor, own)
    draw_hub_rows(editor)
    draw_worker_rows(editor)
    if not editor.models.states:
        note(t("Looking at what is there…"))
    imgui.end_child()


SETS = {
    "clicks": ("Clicks", "A click selects nearly anything"),
    "light": ("Light", "Selecting, lifting, background and refining, for a GPU of 8 GB or more"),
    "paper": ("Paper", "What the paper uses, as far as the GPU holds it"),
}


@contextmanager
def _row(id: str, name: str) -> Iterator[None]:
    """A row that begins with a bold name, and what is drawn next at its right end."""
    rule()
    imgui.push_id(id)
    with bold_text():
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(name)
    imgui.same_line(imgui.get_window_width() - theme.pt(20 + BUTTON))
    yield
    imgui.pop_id()


def _draw_gain(text: str) -> None:
    """What the row's model is good for, left of the buttons."""
    wrapped_text(text, end=imgui.get_window_width() - theme.pt(20 + BUTTON + 16))


def _draw_set(editor: Editor, offer: SetOffer) -> None:
    """A set of models: whether it fits, what it takes, and the button that gets all of it."""
    name, gain = SETS[offer.set.id]
    with _row(f"set {offer.set.id}", t(name)):
        if not offer.missing and not _is_coming(editor, offer.set.id):
            _draw_installed()
        elif _download_button(editor, offer.set.id, editor.models.why_not_set(offer)):
            editor.models.download_set(offer)
        _draw_gain(t(gain))
        note(_fit_of(offer))
        size, licences = f"{offer.size / 1e9:.1f} GB", ", ".join(offer.licences)
        note(t("{size} on disk · licence {licence}", size=size, licence=licences))


def _fit_of(offer: SetOffer) -> str:
    """Whether it runs here, and about how long an edit then takes."""
    gpu = f"{offer.card.gpu / 2**30:.0f} GB"
    if not offer.card.gpu:
        return t("No GPU was found: most of it would take minutes or hours")
    if not offer.fits:
        told = next(step.why_not for step in offer.steps if step.why_not)
        return f"{sentence(told)}."
    seconds = offer.seconds
    if seconds is None or seconds < 1:
        return t("Fits your {size}", size=gpu)
    return t("Fits your {size} · about {seconds} s an edit, computed", size=gpu,
             seconds=f"{seconds:.0f}")  # fmt: skip


def _is_coming(editor: Editor, id: str) -> bool:
    return editor.models.downloading == id or editor.models.is_waiting(id)


def _download_button(editor: Editor, id: str, why_not: str | None) -> bool:
    """Cancel with how far it is, the place in the queue, or the button: whether it was clicked."""
    models = editor.models
    if models.downloading == id:
        chore = editor.chores.shown
        share = chore.fraction if chore is not None and chore.kind == DOWNLOAD else 0.0
        if button(t("Cancel, {share} %", share=f"{100 * share:.0f}"), width=BUTTON):
            models.cancel()
        return False
    if models.is_waiting(id):
        if button(t("Waiting, cancel"), width=BUTTON):
            models.forget_waiting(id)
        return False
    return button(t("Download"), Emphasis.PLAIN, why_not, width=BUTTON)


def _draw_installed() -> None:
    across = imgui.calc_text_size(f"{Icon.CHECK}{t('Installed')}").x + theme.pt(6)
    imgui.set_cursor_pos_x(imgui.get_window_width() - theme.pt(20) - across)
    imgui.align_text_to_frame_padding()
    imgui.text_colored(theme.vec("accent"), Icon.CHECK)
    imgui.same_line(0, theme.pt(6))
    imgui.text_colored(theme.vec("secondary"), t("Installed"))


def _draw_model(editor: Editor, state: CacheState) -> None:
    """Installed, on its way with Cancel, or the button that gets it; and its facts."""
    weight, names = state.weight, names_of(state.weight.id)
    with _row(weight.id, names.name):
        if state.state == "ok" and not _is_coming(editor, weight.id):
            _draw_installed()
        elif _download_button(editor, weight.id, None):
            editor.models.download(weight.id)
        _draw_gain(t(names.gain))
        megabytes = f"{weight.wheel_size / 1e6:.0f} MB"
        note(t("{size} to download · licence {licence}", size=megabytes, licence=weight.licence))
        note(t("From {source}, by {page}", source=weight.wheel.split("==")[0],
               page=weight.page.removeprefix("https://")))  # fmt: skip


def _draw_added(editor: Editor, own: Added) -> None:
    """A model that users bring: nothing is fetched for it."""
    with _row(own.kind.id, t("Depth model")):
        if own.state == "missing":
            if button(t("Use a file…"), width=BUTTON):
                editor.filing.wanted = Dialog.MODEL_OPEN
        elif button(t("Remove"), width=BUTTON):
            editor.models.remove()
        _draw_gain(t("A lifted object is as deep as it looks, not as its outline says"))
        if own.state == "ok":
            size, hash = f"{own.size / 1e6:.0f} MB", own.sha256[:16]
            note(t("{name}, {size}, SHA-256 {hash}", name=own.name, size=size, hash=hash))
        elif own.state == "damaged":
            note(t("Its file is damaged."))
        else:
            note(
                t("Nothing is downloaded: for instance an ONNX export of Depth-Anything-V2-Small.")
            )


def draw_offer(editor: Editor) -> None:
    """Draw an offer beside the selection: a model that would help and is not installed."""
    models = editor.models
    weight = models.offered
    if weight is None or models.downloading is not None:
        return
    rule()
    gain = t(names_of(weight.id).gain)
    note(t("Selecting can be better: {gain}, with a model of {size} MB.",
           gain=gain[:1].lower() + gain[1:], size=f"{weight.wheel_size / 1e6:.0f}"))  # fmt: skip
    gap(8)
    half = half_width()
    if button(t("See the model…"), width=half):
        models.open()
    imgui.same_line()
    if button(t("Not now"), width=half):
        models.decline(weight.id)
    tooltip(t("It stays in Window > Models"))


# The models list's rows of models of several files: a family each, and of it one size.

NAMES = {
    "sam2": "SAM 2.1", "sam3": "SAM 3", "sam": "SAM", "sam-onnx": "Small SAMs (ONNX)",
    "pixelhacker": "PixelHacker", "moebius": "Moebius",
    "pixelhacker-vae": "PixelHacker's autoencoder", "lama": "LaMa", "migan": "MI-GAN",
    "trellis": "TRELLIS", "cupid": "CUPID", "triposplat": "TripoSplat",
    "dinov2-with-registers": "DINOv2 with registers",
    "depth-anything": "Depth Anything V2, by PyTorch", "depth-graph": "Depth, without a GPU",
    "qwen-image-edit": "Qwen-Image-Edit",
    "qwen-image-edit-2511-lightning": "Lightning for Qwen-Image-Edit-2511",
    "qwen-image-edit-2509-lightning": "Lightning for Qwen-Image-Edit-2509",
    "qwen-refine-lora": "Your LoRA on Qwen-Image-Edit",
    "flux2-klein": "FLUX.2-klein", "flux2-klein-base": "FLUX.2-klein, base",
    "klein-refine-lora": "Your LoRA on FLUX.2-klein",
    "klein-remove-lora": "Object removal for FLUX.2-klein",
}  # fmt: skip
GAINS = {
    "sam2": "Clicks select nearly anything; parts, objects and groups",
    "sam3": "The newest, for a large GPU",
    "sam": "The first of its kind, which the paper uses",
    "sam-onnx": "Smaller and quicker, without PyTorch",
    "pixelhacker": "Invents what is behind objects, for a GPU: the paper's",
    "moebius": "The same with a quarter of the numbers",
    "pixelhacker-vae": "What Moebius draws with; PixelHacker brings it, too",
    "lama": "Invents what is behind large objects, without a GPU",
    "migan": "Invents what is behind objects, the quickest",
    "trellis": "The whole object from one picture, for a GPU: the paper's",
    "cupid": "The same with the photo's camera",
    "triposplat": "The whole object in as many splats as you want, for a GPU; by DINOv3",
    "dinov2-with-registers": "What TRELLIS and CUPID see a picture with",
    "depth-anything": "A lifted object is as deep as it looks, not as its outline says",
    "depth-graph": "A lifted object is as deep as it looks, without PyTorch or a GPU",
    "qwen-image-edit": "Makes the edit look photographed, for a very large GPU: the paper's",
    "qwen-image-edit-2511-lightning": "The same in 4 steps instead of 40",
    "qwen-image-edit-2509-lightning": "The same in 4 or 8 steps instead of 40",
    "qwen-refine-lora": "What you have trained it to do",
    "flux2-klein": "Makes the edit look photographed, in four steps, for a GPU of 12 GB",
    "flux2-klein-base": "What a LoRA of yours for FLUX.2-klein is trained on",
    "klein-refine-lora": "What you have trained it to do",
    "klein-remove-lora": "Objects go with their shadows and reflections",
}
SIZES = {
    "sam2.1-tiny": "Tiny", "sam2.1-small": "Small", "sam2.1-base-plus": "Base",
    "sam2.1-large": "Large",
    "sam-vit-base": "Base", "sam-vit-large": "Large", "sam-vit-huge": "Huge",
    "moge-2-vits": "MoGe-2", "depth-anything-v2-small-onnx": "Depth Anything V2",
    "mobile-sam": "MobileSAM", "efficient-sam": "EfficientSAM",
    "qwen-image-edit-2509": "2509", "qwen-image-edit-2511": "2511",
    "qwen-image-edit-2509-lightning-4": "4 steps", "qwen-image-edit-2509-lightning-8": "8 steps",
}  # fmt: skip
STAGES = {
    "segment": "For selecting", "inpaint": "For the background", "lift": "For lifting",
    "depth": "For the depth of what is lifted", "refine": "For refining",
}  # fmt: skip


def draw_hub_rows(editor: Editor) -> None:
    """Draw all families, ordered by their purpose."""
    before = ""
    for family in editor.models.hub.families:
        if family in NAMES:
            stage = editor.models.hub.shown(family).model.stage
            if stage != before:
                gap(12)
                heading(t(STAGES[stage]))
            before = stage
            _draw_family(editor, family)


def _draw_family(editor: Editor, family: str) -> None:
    hub = editor.models.hub
    sizes, shown = hub.of(family), hub.shown(family)
    with _row(family, t(NAMES[family])):
        _draw_button(editor, shown)
        _draw_gain(t(GAINS[family]))
        if len(sizes) > 1:
            gap(4)
            imgui.begin_child("##sizes", theme.size(WIDE, 28))
            choices = [Segment(s.model.id, t(SIZES[s.model.id])) for s in reversed(sizes)]
            chosen = segmented(family, choices, shown.model.id)
            imgui.end_child()
            if chosen != shown.model.id:
                hub.choose(family, chosen)
        _draw_facts(editor, shown)


WIDE = 360.0  # points, of the choice of a size


def _draw_facts(editor: Editor, shown: HubState) -> None:
    """Size, licence and source; the licence's box where it needs one; what is in the way."""
    hub, model = editor.models.hub, shown.model
    *needed, _ = wanted = hub.missing(model)
    total = sum(each.size for each in wanted)
    size = f"{total / 1e6:.0f} MB" if total < 1e9 else f"{total / 1e9:.1f} GB"
    if shown.is_own:
        note(t("In your folder {folder}", folder=shown.path.name))
    elif model.repository:
        licences = ", ".join(dict.fromkeys(each.licence for each in wanted))
        note(t("{size} to download · licence {licence}", size=size, licence=licences))
        if needed:
            names = ", ".join(NAMES[each.family] for each in needed)
            note(t("With what it needs: {names}", names=names))
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
    hub, id = editor.models.hub, shown.model.id
    if _is_coming(editor, id):
        _download_button(editor, id, None)
    elif shown.state == "ok" or shown.is_own:
        if button(t("Remove"), width=BUTTON):
            hub.remove(id)
    elif not shown.model.repository:
        if button(t("Use a folder…"), width=BUTTON):
            hub.wanted, editor.filing.wanted = id, Dialog.MODEL_FOLDER
    elif _download_button(editor, id, hub.why_not(shown.model)):
        hub.download(id)


# The models list's rows of workers: the licence's box, and which one lifts.


def draw_worker_rows(editor: Editor) -> None:
    """Draw a row per worker; nothing where there is none."""
    states = editor.models.workers.states
    if states:
        gap(12)
        heading(t("Workers, which lift in environments of their own"))
    for state in states:
        with _row(f"worker {state.name}", state.name):
            _draw_worker(editor, state)


def _draw_worker(editor: Editor, state: WorkerState) -> None:
    workers, worker = editor.models.workers, state.worker
    if workers.is_chosen(state.name):
        button(t("Lifts now"), Emphasis.PLAIN, t("It is chosen"), width=BUTTON)
    elif button(t("Lift with it"), Emphasis.PLAIN, _why_not(state), width=BUTTON):
        workers.choose(state.name)
    if worker is None:
        note(f"{sentence(state.why_not or '')}.")
        return
    note(t("Licence {licence}", licence=worker.licence or t("unknown")))
    if worker.page:
        note(t("From {source}", source=worker.page.removeprefix("https://")))
    if not worker.is_free:
        label = t("I have read and accept the {licence}", licence=worker.licence)
        workers.accept(state.name, checkbox(label, state.is_accepted))
    if state.why_not is not None and state.is_accepted:
        note(f"{sentence(state.why_not)}.")


def _why_not(state: WorkerState) -> str | None:
    """Why it cannot be chosen: short where the row says the rest."""
    is_asked = state.worker is not None and not state.is_accepted
    return t("Accept its licence first") if is_asked else state.why_not
