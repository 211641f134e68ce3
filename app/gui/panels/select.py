"""The Select tool's settings."""

from __future__ import annotations

from ...commands import run, why_not
from ...editor import Editor
from ..models_dialog import draw_offer
from ..theme import Icon
from ..widgets import button, gap, heading, note


def draw_select(editor: Editor) -> None:
    heading("Selection")
    gap(4)
    if button(f"{Icon.PERSON}  Select subject", why_not=why_not(editor, "subject")):
        run(editor, "subject")
    if button(f"{Icon.ERASE}  Clear selection", why_not=why_not(editor, "clear")):
        run(editor, "clear")
    gap(12)
    prompt, mask = editor.selection.prompt, editor.mask
    if mask is not None and editor.document is not None:
        share = editor.selection.share
        note(f"{share:.1%} of the photo is selected.")
    adds = sum(c.is_foreground for c in prompt.clicks)
    removes = len(prompt.clicks) - adds
    if adds or removes:
        note(f"{adds} added, {removes} removed by click.")
    if mask is None:
        note("Left click adds what belongs to the object, right click removes what does not.")
    elif not editor.is_lifted:
        note("Right-click what does not belong to the object, then lift it.")
    else:
        note("The photo is shown as it was. A new click makes a new selection and a new lift.")
    draw_offer(editor)
