"""The scene that the renderer draws, built from the editor."""

from __future__ import annotations

from dataclasses import replace

from objectmorpher_core.document.model import Document

from ...canvas.frame import BARE, Frame, build_frame
from ...canvas.layer import CanvasLayer, is_front
from ...canvas.painter import shown_now
from ...editor.editor import Editor
from ...editor.intents.landing import OF_THE_PHOTO
from ...editor.view import Shown, ToolName
from ...render.scene import Hatch, Scene, SplatObject
from ..widgets.theme import theme

VEIL = 0.25  # share of black outside the selection, while selecting
PAINTED_VEIL = 0.45  # while it is painted: a stroke in progress has no outline
MISSING = Hatch((0.5, 0.5, 0.5), strength=0.35, brightness=0.25)  # pixels that are not there yet
LIFTED = Hatch((1.0, 0.69, 0.0))  # colours that the colour-blind tell apart, too
INPAINTED = Hatch((0.55, 0.50, 1.0), slant=-1.0)
REFINED = Hatch((0.0, 0.85, 0.75), slant=0.0)


def build_scene(editor: Editor, renderer: str) -> Scene | None:
    """The canvas's picture, or None while no photo is open. `renderer`: "gl" or "tiles"."""
    document, view = editor.looking.document, editor.view
    if document is None:
        return None
    photo, surround = editor.derived.photo(document.photo), theme.rgb("surround")
    shown = shown_now(document, view)
    if view.tool is ToolName.COMPOSE and view.compose.is_bare and not view.is_before:
        return _bare_scene(editor, document)
    is_edited = any(o.is_moved for o in document.objects)
    is_selecting = shown is Shown.COMPOSITE and view.tool in OF_THE_PHOTO
    if is_selecting and (view.is_before or not is_edited):
        return _selecting(editor, document)
    if editor.looking.orbit is not None and not view.is_before:
        return _alone(editor, document, renderer)
    if view.is_before or (not is_edited and shown in (Shown.COMPOSITE, Shown.PROVENANCE)):
        tint = editor.painting.painted_layer()
        return Scene(photo, surround, layers=() if tint is None else (tint,))
    if shown is Shown.DEPTH and editor.preview is None:
        editor.cache.painter.measure(document)
    split = view.split or 0.0
    if shown in BARE:
        return replace(_bare(editor, document, renderer, shown), split=split)
    filled = editor.derived.with_background(document)
    frame = build_frame(filled, view, editor.cache, shown, renderer)
    mask, hatch = editor.derived.unfilled(document), MISSING
    if mask is None:
        is_told = filled.plate is not None and shown is Shown.PROVENANCE
        mask = editor.derived.invented_background(filled) if is_told else None
        hatch = INPAINTED if is_told else None
    layers, objects = (*frame.layers, *frame.refined), ()
    if renderer == "gl":
        layers, objects = (), (*splat_objects(document, frame), *frame.refined)
    if is_selecting and (veil := editor.masking.veil_layer(_veil_of(editor))) is not None:
        layers = (*layers, veil)
    if is_selecting and (tint := editor.shaping.painted_layer()) is not None:
        layers = (*layers, tint)
    if (tint := editor.painting.painted_layer()) is not None:
        layers = (*layers, tint)
    return Scene(
        photo, surround, frame.plate, frame.shades, layers, objects, mask,
        hatch=hatch, marks=LIFTED, refined=REFINED, blend=frame.blend, split=split,
    )  # fmt: skip


def _bare(editor: Editor, document: Document, renderer: str, shown: Shown) -> Scene:
    """Objects without the photo, on a checker or on plain paper."""
    photo, surround = editor.derived.photo(document.photo), theme.rgb("surround")
    frame = build_frame(document, editor.view, editor.cache, shown, renderer)
    objects = splat_objects(document, frame) if renderer == "gl" else ()
    layers = () if renderer == "gl" else frame.layers
    paper = _paper(shown)
    return Scene(photo, surround, layers=layers, objects=objects, paper=paper, marks=LIFTED)


def _alone(editor: Editor, document: Document, renderer: str) -> Scene:
    """The object from somewhere else, on a checker: the photo does not show what is behind."""
    shown = editor.view.shown
    shown = Shown.OBJECT if shown is Shown.COMPOSITE else shown
    if shown is Shown.DEPTH and not editor.hand.is_busy:
        editor.cache.painter.measure(document)
    return _bare(editor, document, renderer, shown)


def _selecting(editor: Editor, document: Document) -> Scene:
    """The photo, of which nothing was moved, veiled where it is not selected."""
    selection, painting = editor.masking.shown, editor.masking.painting
    is_veiled = selection is not None and not editor.view.is_before
    tint = editor.shaping.painted_layer() if editor.view.tool is ToolName.MASK else None
    return Scene(
        editor.derived.photo(document.photo), theme.rgb("surround"),
        layers=() if tint is None else (tint,),
        mask=selection,
        touched=tuple(painting.touched) if painting else (),
        veil=_veil_of(editor) if is_veiled else 0.0,
    )  # fmt: skip


def _veil_of(editor: Editor) -> float:
    return PAINTED_VEIL if editor.view.tool is ToolName.MASK else VEIL


def _bare_scene(editor: Editor, document: Document) -> Scene:
    """The background alone, and what of it is being repaired."""
    photo, surround = editor.derived.photo(document.photo), theme.rgb("surround")
    plate, split = editor.derived.bare_plate(document), editor.view.split or 0.0
    mask = editor.derived.hidden(document) if document.plate is None else None
    fronts = [
        editor.cache.fronts.layer(item, editor.view)
        for k, item in enumerate(document.objects)
        if is_front(document, k)
    ]
    found = (*fronts, editor.composing.painted_layer())
    layers = tuple(layer for layer in found if layer is not None)
    hatch = None if mask is None else MISSING
    return Scene(photo, surround, plate, (), layers, (), mask, hatch=hatch, split=split)


def _paper(shown: Shown) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """A checker says that nothing is there; under colours that mean something it would disturb."""
    panel = theme.rgb("panel")
    is_plain = shown not in (Shown.DEPTH, Shown.NORMALS)
    return panel, theme.rgb("raised") if is_plain else panel


def splat_objects(document: Document, frame: Frame) -> tuple[SplatObject | CanvasLayer, ...]:
    """What the GPU is to draw of a frame, back to front."""
    found: list[SplatObject | CanvasLayer] = []
    for own in frame.objects:
        if isinstance(own, CanvasLayer):
            found.append(own)
            continue
        if own.layer is not None:
            found.append(own.layer)
            continue
        part, look = own.part, own.lit
        item = SplatObject(
            own.splats, own.shape.texture, document.photo.camera,
            is_marked=part.is_marked, is_tint=part.look is Shown.STRAIN,
        )  # fmt: skip
        if not part.is_painted:
            light = {"gain": look.gain, "relit": look.relit, "grain": look.grain}
            own = {"saturation": look.saturation, "opacity": look.opacity, "mode": look.mode}
            item = replace(item, **light, **own, blur=look.blur, sharpness=look.sharpness)
        found.append(item)
    return tuple(found)
