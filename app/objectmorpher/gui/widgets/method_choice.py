"""Who does a stage: a list of its backends, those that cannot run here with the reason."""

from __future__ import annotations

from imgui_bundle import imgui

from ...editor.editor import Editor
from ...editor.settings import AUTO
from ...system.texts import sentence, t
from ..window.landmarks import mark
from .widgets import tooltip

NAMES = {
    "dino": "DINOv2's pieces", "grabcut": "Colours", "sam2": "SAM 2.1", "sam3": "SAM 3",
    "sam": "SAM", "sam-onnx": "Small SAMs (ONNX)",
    "relief": "Relief", "trellis": "TRELLIS", "cupid": "CUPID",
    "pixelhacker": "PixelHacker", "lama": "LaMa", "migan": "MI-GAN",
    "patchmatch": "Patches", "telea": "Smooth",
    "qwen": "Qwen-Image-Edit", "klein": "FLUX.2 klein",
}  # fmt: skip
FILL = -1.0  # as wide as there is room


def draw_method(editor: Editor, stage: str) -> None:
    """The list of "segment", "lift", "inpaint" or "refine"; what is chosen holds from now on."""
    chosen = editor.methods.chosen(stage)
    imgui.set_next_item_width(FILL)
    is_open = imgui.begin_combo(f"##{stage}", _label(editor, stage, chosen))
    mark(stage)
    if not is_open:
        return
    for method in editor.methods.of(stage):
        is_disabled = method.why_not is not None
        flags = imgui.SelectableFlags_.disabled if is_disabled else imgui.SelectableFlags_.none
        label = _label(editor, stage, method.name)
        if imgui.selectable(label, method.name == chosen, flags)[0]:
            editor.methods.choose(stage, method.name)
        mark(f"{stage}: {method.name}")
        if method.why_not is not None:
            tooltip(sentence(method.why_not))
    if imgui.is_key_pressed(imgui.Key.escape):
        imgui.close_current_popup()
    imgui.end_combo()


def _label(editor: Editor, stage: str, name: str) -> str:
    """A backend's name for people; "auto" also tells who that is, once it is known."""
    if name != AUTO:
        return _named(name)
    taken = editor.methods.taken(stage)
    return t("Automatic: {name}", name=_named(taken)) if taken else t("Automatic")


def _named(name: str) -> str:
    """What a backend is called for people: a model's own id stays as it is."""
    return t(NAMES[name]) if name in NAMES else name
