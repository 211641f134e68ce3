"""The background, and how the object is joined to it."""

from __future__ import annotations

from ..editor.editor import Editor
from ..editor.intents.composing import DEPTH, VARIANTS
from ..editor.intents.old_shadows import SHADOW
from ..editor.intents.refining import REFINE
from ..editor.tasks import PLATE
from ..editor.view import Composed, ToolName
from ..system.texts import sentence, t
from .command import Command, no_lift, nothing_lifted, unless


def _toggle_bare(editor: Editor) -> None:
    if editor.view.tool is not ToolName.COMPOSE:
        editor.choose_tool(ToolName.COMPOSE)
        editor.view.compose.is_bare = False
    editor.composing.toggle_bare()


def _is_bare(editor: Editor) -> bool:
    return editor.view.tool is ToolName.COMPOSE and editor.view.compose.is_bare


def _toggle_painting(editor: Editor) -> None:
    if editor.view.tool is not ToolName.COMPOSE:
        editor.choose_tool(ToolName.COMPOSE)
        editor.view.compose.is_painting = False
    editor.painting.toggle()


def _is_painting(editor: Editor) -> bool:
    return editor.view.tool is ToolName.COMPOSE and editor.view.compose.is_painting


_cannot_paint = unless(
    lambda e: e.object is not None and e.object.is_visible,
    lambda e: t("The object is hidden"),
    no_lift,
)
_not_painted = unless(
    lambda e: e.object is not None and e.object.is_painted,
    lambda e: t("Nothing is painted on the object"),
    no_lift,
)
# Shadow and light are of objects that have moved: the photo has those of the others.
not_moved = unless(
    lambda e: e.object is not None and e.object.is_moved,
    lambda e: t("Move the object first"),
    no_lift,
)
_no_sources = unless(
    lambda e: e.hinting.shown, lambda e: t("No fill source has been set"), nothing_lifted
)
_not_refined = unless(
    lambda e: e.refining.refined is not None,
    lambda e: t("The edit is not refined"),
    nothing_lifted,
)


def _toggle_taking(editor: Editor) -> None:
    """To the drag that says from where, with the background alone; or back to repairing."""
    is_taking = _is_taking(editor)
    if not _is_bare(editor):
        _toggle_bare(editor)
    editor.view.compose.drag = Composed.REPAIR if is_taking else Composed.TAKE


def _is_taking(editor: Editor) -> bool:
    return _is_bare(editor) and editor.view.compose.drag is Composed.TAKE


def _cannot_fill(editor: Editor) -> str | None:
    if editor.jobs.is_busy(PLATE):
        return t("The background is being filled in…")
    document, name = editor.document, editor.composing.inpainter
    reason, is_random = editor.methods.filler(name)
    if reason is not None:
        return sentence(reason)
    if document is not None and document.plate is not None:
        is_same = document.plate.backend == name and not is_random
        if is_same and document.plate.painted is None:
            return t("This filler gives the same picture every time")
    return nothing_lifted(editor)


def _cannot_vary(editor: Editor) -> str | None:
    if editor.jobs.is_busy(VARIANTS):
        return t("The variants are being made")
    if (trouble := editor.composing.trouble) is not None:
        return nothing_lifted(editor) or trouble
    reason, is_random = editor.methods.filler(editor.composing.inpainter)
    if reason is not None:
        return sentence(reason)
    if not is_random:
        return t("This filler gives the same picture every time")
    return nothing_lifted(editor)


def _cannot_take(editor: Editor) -> str | None:
    if editor.jobs.is_busy(SHADOW):
        return t("Its shadow is being looked for")
    if editor.object is not None and editor.object.is_visitor:
        return t("It comes from another photo, and left its shadow there")
    return not_moved(editor) or editor.composing.trouble


def _cannot_refine(editor: Editor) -> str | None:
    if editor.jobs.is_busy(REFINE):
        return t("The edit is being refined")
    if (reason := nothing_lifted(editor)) is not None:
        return reason
    if not any(item.is_moved for item in editor.opened.objects):
        return t("Move the object first")
    if (trouble := editor.composing.trouble) is not None:
        return trouble
    if not editor.methods.is_known:
        return t("Looking at what can run here")
    reason = editor.methods.why_not("refine")
    return None if reason is None else sentence(reason)


def _cannot_look(editor: Editor) -> str | None:
    if editor.jobs.is_busy(DEPTH):
        return t("The depth model is looking at the photo")
    return nothing_lifted(editor)


COMMANDS: dict[str, Command] = {
    "bare": Command("Background alone", "B", _toggle_bare, nothing_lifted, _is_bare),
    "paint": Command(
        "Paint on the object", "Shift+P", _toggle_painting, _cannot_paint, _is_painting
    ),
    "unpaint": Command(
        "Remove paint", "", lambda e: e.painting.remove(), _not_painted
    ),
    "take_from": Command(
        "Fill from a spot", "Shift+B", _toggle_taking, nothing_lifted, _is_taking
    ),
    "forget_sources": Command(
        "Clear fill sources", "", lambda e: e.hinting.remove_all(), _no_sources
    ),
    "fill_again": Command(
        "Fill in again", "", lambda e: e.composing.fill_again(), _cannot_fill
    ),
    "variants": Command(
        "Try 3 variants", "", lambda e: e.composing.try_variants(), _cannot_vary
    ),
    "take_shadow": Command(
        "Shadow as in the photo", "", lambda e: e.old_shadows.look(), _cannot_take
    ),
    "refine": Command("Refine", "", lambda e: e.refining.run(), _cannot_refine),
    "refine_again": Command(
        "Another", "", lambda e: e.refining.run_again(),
        lambda e: _not_refined(e) or _cannot_refine(e),
    ),
    "unrefine": Command(
        "Remove refinement", "", lambda e: e.refining.remove(), _not_refined
    ),
    "shadow": Command(
        "Add or remove shadow", "", lambda e: e.composing.toggle_shadow(), not_moved
    ),
    "depth": Command(
        "Shadows fall on walls and steps", "", lambda e: e.composing.toggle_depth(),
        _cannot_look, lambda e: e.document is not None and e.document.depth is not None,
    ),
}  # fmt: skip
