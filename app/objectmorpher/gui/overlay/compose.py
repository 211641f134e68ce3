"""The Compose tool's drawings: the brush, and a note that the background is shown alone."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2

from objectmorpher_core.document.settings import Hint

from ...editor.intents.landing import Of
from ...editor.view import Composed
from ...system.texts import t
from ..widgets.theme import theme
from ..window.landmarks import mark_on_canvas
from .canvas import ACCENT, WHITE, CanvasPainter

BARB = 10.0  # points, of an arrow
SOURCE = 6.0  # points, radius of the mark from where is cloned


def draw_compose(canvas: CanvasPainter) -> None:
    """Draw the Compose tool's brush and note over the photo."""
    editor = canvas.editor
    if editor.view.compose.is_painting:
        if editor.pointer is not None and editor.is_on_photo(editor.pointer.xy):
            canvas.brush(editor.pointer.alt)
        if (source := editor.painting.source) is not None:
            canvas.circle(canvas.at(np.array([source]))[0], theme.pt(SOURCE), ACCENT)
        return
    if not editor.view.compose.is_bare:
        _draw_owner(canvas)
        return
    text = editor.composing.trouble or t("Background alone")
    if editor.composing.is_repairing:
        text = t("Repairing…")
    x = canvas.rect.x + canvas.rect.width / 2
    canvas.label(text, x, canvas.rect.y + theme.pt(12), side=0.5)
    if editor.pointer is not None and editor.is_on_photo(editor.pointer.xy):
        canvas.brush()
    if editor.view.compose.drag is Composed.TAKE:
        for hint in editor.hinting.shown:
            _draw_hint(canvas, hint, 0.75)
        if editor.hinting.dragged is not None:
            _draw_hint(canvas, editor.hinting.dragged, 1.0)


def draw_offered_shadow(canvas: CanvasPainter) -> None:
    """Outline what would be taken along of a shadow in the photo."""
    editor = canvas.editor
    if (offer := editor.old_shadows.offer) is not None:
        for outline in editor.derived.contours(offer.outlined):
            at = canvas.at(outline)
            mark_on_canvas("Offered shadow", at[0], at[0])
            canvas.dashes(at)


def _draw_owner(canvas: CanvasPainter) -> None:
    """What is under the pointer: the photo, the filled-in background, or which object."""
    editor, document = canvas.editor, canvas.editor.document
    if editor.pointer is None or document is None or editor.hand.is_busy:
        return
    owner = editor.landing.owner_at(editor.pointer.xy)
    if owner is None:
        return
    if isinstance(owner, Of):
        text = t("Photo") if owner is Of.PHOTO else t("Background, filled in")
    else:
        item = document.objects[owner]
        text = item.name
        for outline in editor.derived.contours(item.mask) if item.mask is not None else ():
            if item.is_moved:
                outline = editor.derived.carried(document, owner, outline)
            canvas.polyline(canvas.at(outline), ACCENT, 1.5, alpha=0.8)
    at = canvas.on_canvas(editor.pointer.xy)[0]
    canvas.label(text, at.x + theme.pt(14), at.y + theme.pt(14))


def _draw_hint(canvas: CanvasPainter, hint: Hint, alpha: float) -> None:
    """A full circle around what is taken, a dashed one where it is wanted, an arrow between."""
    source, to = canvas.at(np.array([hint.source, hint.to]))
    radius = hint.radius * canvas.editor.view.zoom / canvas.ratio
    along = np.array([to.x - source.x, to.y - source.y])
    length = float(np.hypot(*along))
    canvas.circle(source, radius, WHITE, alpha)
    if length < 1:
        return
    turns = np.linspace(0, 2 * np.pi, 25)
    spots = [ImVec2(to.x + radius * np.cos(a), to.y + radius * np.sin(a)) for a in turns]
    for k in range(0, len(spots) - 1, 2):
        canvas.line(spots[k], spots[k + 1], ACCENT, alpha=alpha)
    along /= length
    side = np.array([-along[1], along[0]])
    canvas.line(source, to, ACCENT, alpha=alpha)
    for turn in (-1, 1):
        barb = theme.pt(BARB) * (0.5 * turn * side - along)
        canvas.line(ImVec2(to.x + barb[0], to.y + barb[1]), to, ACCENT, alpha=alpha)
