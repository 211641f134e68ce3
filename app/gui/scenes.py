"""From the editor to what the renderer draws."""

from __future__ import annotations

from objectmorpher_core.document import Document

from ..editor import Editor
from ..render.scene import Scene, SplatObject
from ..view import ToolName
from .theme import theme

VEIL = 0.45  # share of black outside the selection, while selecting
HATCH = 1.0


def build_scene(editor: Editor, renderer: str) -> Scene | None:
    """The canvas's picture, or None while no photo is open. `renderer`: "gl" or "tiles"."""
    document, view = editor.document, editor.view
    if document is None:
        return None
    photo, surround = document.photo.pixels, theme.rgb("surround")
    if view.tool is ToolName.SELECT:  # the selection is about the photo as it was
        is_veiled = editor.mask is not None and not view.is_before
        return Scene(photo, surround, mask=editor.mask, veil=VEIL if is_veiled else 0.0)
    is_edited = any(o.is_moved for o in document.objects)
    if view.is_before or not is_edited:
        return Scene(photo, surround)
    hole = None if document.plate else editor.derived.moved_mask(document)
    return Scene(
        photo,
        surround,
        plate=document.plate,
        layers=editor.derived.layers.draw(document, view) if renderer == "tiles" else (),
        objects=_objects(editor, document) if renderer == "gl" else (),
        mask=hole,
        hatch=HATCH if hole is not None else 0.0,
        blend=editor.derived.blend(document, view),
        split=view.split or 0.0,
    )


def _objects(editor: Editor, document: Document) -> tuple[SplatObject, ...]:
    camera, photo = document.photo.camera, document.photo
    return tuple(
        SplatObject(splats, editor.derived.shape(photo, document.objects[k]).texture, camera)
        for k, splats in editor.derived.layers.order(document).items()
    )
