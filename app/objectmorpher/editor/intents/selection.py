"""Which object is meant: clicks, a box, a line around it, the subject."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import F32, Mask, frozen
from objectmorpher_core.base.arrays import Selection as SelectionMask
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import LEVELS, Click, Document, Plate, Prompt
from objectmorpher_core.segment import Found, mask_edit

from ...system.texts import t
from ..tasks import SELECT, Combine, Question
from ..view import Action, ToolName
from .masking import loses_work

if TYPE_CHECKING:
    from objectmorpher_core.compose.plate.residue import Ghost

    from ..candidate import Candidates, CloserLook
    from ..state import EditorState
    from ..tasks import Tasks
    from .landing import Landing
    from .masking import Masking

MOST_SHARED = 0.5  # of another object, which is said of a selection that holds more of it
SAME_PLACE = 5.0  # points: a click this near to the last one asks for more or less around it


class Selection:
    """The current object's mask and the prompt that led to it.

    A selection that a prompt made is refined by each further click; what was changed of it by
    hand meanwhile stays, see `edits.answer_prompt`. One that was made by hand alone (a line, a
    brush, a file) has no prompt: there a click adds the object that it is on, or takes it away.
    """

    def __init__(
        self,
        editor: EditorState,
        tasks: Tasks,
        masking: Masking,
        candidates: Candidates,
        closer_look: CloserLook,
    ) -> None:
        self._editor = editor
        self._tasks, self._masking = tasks, masking
        self._candidates, self._closer_look = candidates, closer_look
        candidates.answered, closer_look.improved = self.take, self.improve
        self.path: list[np.ndarray] | None = None  # the line being drawn, canvas px (2,) each
        self._told: tuple[Mask | None, float | None] = None, None  # a mask, and how sure it was

    # What there is

    @property
    def pending(self) -> Prompt | None:
        """Return the prompt that is being segmented; the document gets it with its mask."""
        return self._tasks.pending

    @property
    def prompt(self) -> Prompt:
        """Return the prompt about the current object, answered or not."""
        return self._tasks.prompt

    @property
    def share(self) -> float:
        """Return the selected share of the photo, in [0, 1]."""
        mask = self._editor.mask
        return 0.0 if mask is None else self._editor.derived.share(mask)

    @property
    def confidence(self) -> float | None:
        """Return the expected overlap (IoU) of the selection with the thing meant, in [0, 1].

        None where nobody can tell: it was changed by hand, put together, or is an older step.
        """
        mask, told = self._told
        return told if mask is not None and mask is self._editor.mask else None

    @property
    def level(self) -> str:
        """Return the level of detail of clicks: that of the selection, or of the next one."""
        prompt = self.prompt
        return prompt.level if prompt.clicks else self._editor.view.selecting.level

    # Saying what is meant

    def add_click(self, x: float, y: float, is_foreground: bool) -> None:
        """A point of the photo, image px, that belongs to the object or does not."""
        editor = self._editor
        size = editor.photo_size
        if size is None or not (0 <= x < size[0] and 0 <= y < size[1]) or self._is_being_lifted():
            return
        question = self._tasks.question if self.pending is not None else None
        before, click = self.prompt, Click(x, y, is_foreground)
        if question is None and before.is_empty and editor.mask is not None:
            self._combine_click(click, Prompt())
        elif question is not None and question.combine in (Combine.ADDED, Combine.REMOVED):
            self._combine_click(click, before)
        elif before.is_empty and not is_foreground:
            editor.say(t("Click the object first; then right-click what does not belong to it"))
        elif is_foreground and self._is_repeated(before, click):
            if question is None:  # else nobody has seen yet what is to be more, or less
                self.set_level(LEVELS[LEVELS.index(before.level) - 1])  # part first, then group
        else:
            label = _label(Combine.ADDED if is_foreground else Combine.REMOVED)
            level = before.level if before.clicks else editor.view.selecting.level
            self._ask(replace(before, clicks=(*before.clicks, click), level=level), label)

    def set_box(
        self, box: tuple[float, float, float, float], combine: Combine = Combine.ANEW
    ) -> None:
        """The object is inside a box x0, y0, x1, y1 image px: a selection made anew, or more."""
        if not self._is_being_lifted():
            self._ask(Prompt(box=box), _label(combine), combine)

    def set_outline(self, outline: np.ndarray, combine: Combine = Combine.ANEW) -> None:
        """Select everything inside a closed line (N, 2), image px."""
        editor = self._editor
        if editor.document is None or editor.photo_size is None or self._is_being_lifted():
            return
        inside = mask_edit.enclosed(outline, editor.photo_size)
        question = Question(Prompt(), t("Draw around"), editor.current, combine, editor.mask)
        if inside.any():
            editor.jobs.cancel(SELECT)
            self._apply(question, inside, editor.document)

    def _is_being_lifted(self) -> bool:
        """Whether the object is on its way into 3D: a click then may be meant as a pin already."""
        editor = self._editor
        wish = self._tasks.wishes.get(editor.current)
        is_held = wish is not None and wish.mask is editor.mask and not editor.is_lifted
        if is_held:
            editor.say(t("The object is being lifted; its outline can be changed when it is there"))
        return is_held

    def select_subject(self) -> None:
        """The photo's main subject."""
        self._ask(Prompt(is_subject=True), t("Select subject"), Combine.ANEW)

    def set_level(self, level: str) -> None:
        """Set the level of detail of clicks, for this selection or for the next one."""
        prompt = self.prompt
        if not prompt.clicks:
            self._editor.view.selecting.level = level
        elif prompt.level != level:
            self._ask(replace(prompt, level=level), _LEVEL_LABELS[level]())

    def clear(self) -> None:
        """Clear the current object's selection."""
        editor, document = self._editor, self._editor.committed
        editor.jobs.cancel(SELECT)
        if document is not None and editor.mask is not None:
            cleared = edits.set_mask(document, editor.current, None, Prompt())
            self._masking.take(t("Clear selection"), cleared, editor.current)

    # Answers

    def take(self, question: Question, found: Found, asked: Prompt | None = None) -> None:
        """The answer of a question is the next step; `asked`: what was answered, if another."""
        editor, document = self._editor, self._editor.document
        if document is None or question.k > len(document.objects):
            return
        before, k = editor.mask, question.k
        base = document.objects[k].selection if k < len(document.objects) else None
        self._apply(question, found.mask, document.with_backend("segment", found.backend))
        if editor.mask is before:
            return
        if question.combine in (Combine.ANEW, Combine.REFINED):
            self._told = editor.mask, found.confidence
        if question is self._tasks.lifts and k == editor.current and not editor.is_lifted:
            self._tasks.lift()
        elif not found.is_final:
            self._closer_look.begin(question, base, asked or question.prompt)

    def improve(self, question: Question, base: SelectionMask | None, found: Found) -> None:
        """A better answer takes the place of the one that is shown, in the same step.

        `base` (H, W): what was selected before the step.
        """
        editor = self._editor
        assert editor.history is not None
        try:
            document = _changed(editor.history.document, question, found.mask, base)
        except ValueError:  # such as all of the photo: then the first answer stays
            return
        if loses_work(editor.history.document, document, question.k):
            return
        self._masking.mirroring.carry(editor.history.document, document)
        editor.history.amend(document, is_repeatable=False)
        if question.combine in (Combine.ANEW, Combine.REFINED):
            self._told = editor.mask, found.confidence

    def _apply(self, question: Question, mask: Mask, document: Document) -> None:
        editor, k = self._editor, question.k
        if k == len(document.objects):
            document = edits.add_object(document)
        try:
            document = _with_work(document, question)
            changed = _changed(document, question, mask, document.objects[k].selection)
        except ValueError as error:
            editor.complain(str(error))
            return
        self._masking.take(question.label, changed, k)
        self._say_twin(k)

    def _say_twin(self, k: int) -> None:
        """Say so where what is not lifted yet, object `k`, holds most of another one."""
        objects = self._editor.opened.objects
        own = objects[k] if k < len(objects) else None
        if own is None or own.mask is None or own.lifted is not None:
            return
        for other in objects:
            if other is own or other.mask is None or not other.mask.any():
                continue
            if (own.mask & other.mask).sum() > MOST_SHARED * other.mask.sum():
                self._editor.say(
                    t("{name} is in this selection, too · Right-click it to leave it out",
                      name=other.name)
                )  # fmt: skip
                return

    # Questions

    def _ask(self, prompt: Prompt, label: str, combine: Combine = Combine.REFINED) -> None:
        editor = self._editor
        asked, before = self._tasks.question, editor.mask
        if asked is not None and self.pending is not None and combine is Combine.REFINED:
            before = asked.before  # it is in this one
        question = Question(prompt, label, editor.current, combine, before)
        if asked is not None and asked is self._tasks.lifts and asked.k == question.k:
            self._tasks.lifts = question  # this one is answered instead
        if not self._candidates.take(question):
            self._tasks.segment(question, self.take)

    def _combine_click(self, click: Click, before: Prompt) -> None:
        """The object that a click is on, besides a selection that no prompt made, or not in it.

        `before`: the same, asked and not answered yet.
        """
        question = self._tasks.question
        combine = Combine.ADDED if click.is_foreground else Combine.REMOVED
        is_same = before.clicks and question is not None and question.combine is combine
        clicks = (*before.clicks, replace(click, is_foreground=True)) if is_same else ()
        prompt = Prompt(clicks or (replace(click, is_foreground=True),), level=self.level)
        self._ask(prompt, _label(combine), combine)

    def _is_repeated(self, before: Prompt, click: Click) -> bool:
        """Whether a click is on the only one before it."""
        if len(before.clicks) != 1 or before.box is not None:
            return False
        last, view = before.clicks[0], self._editor.view
        gap = float(np.hypot(click.x - last.x, click.y - last.y)) * view.zoom
        return last.is_foreground and gap <= SAME_PLACE * view.scale


def _changed(
    document: Document, question: Question, mask: Mask, base: SelectionMask | None
) -> Document:
    """The document in which a question has that answer (H, W). Raises ValueError.

    `base` (H, W): what was selected of the object before, for an answer that is put to it.
    """
    k = question.k
    if question.combine is Combine.ADDED:
        return edits.change_mask(document, k, mask_edit.united(base, mask))
    if question.combine is Combine.REMOVED:
        return edits.change_mask(document, k, mask_edit.without(base, mask))
    return edits.answer_prompt(document, k, mask, question.prompt)


def _with_work(document: Document, question: Question) -> Document:
    """The document in which the answer keeps what was painted since the question was asked.

    A selection made anew keeps nothing else.
    """
    item = document.objects[question.k]
    is_anew = question.combine is Combine.ANEW
    if item.mask is None or not (is_anew or question.combine is Combine.REFINED):
        return document
    if item.mask is question.before:
        return document.with_object(question.k, replace(item, found=None)) if is_anew else document
    if is_anew or item.found is None:
        before = np.zeros_like(item.mask) if question.before is None else question.before
        item = replace(item, found=frozen(before))
    return document.with_object(question.k, item)


def _label(combine: Combine) -> str:
    if combine is Combine.REMOVED:
        return t("Remove from selection")
    return t("Add to selection") if combine is Combine.ADDED else t("Select by box")


_LEVEL_LABELS = {
    "part": lambda: t("Select the part"),
    "object": lambda: t("Select the object"),
    "group": lambda: t("Select the group"),
}


# What a selection left out: pieces beside the object that look like parts of it.
#
# They are found with the background, offered once, and marked while the offer stands; the command
# stays.

MOST_OFFERED = 4  # pieces


class LeavingOut:
    """The pieces beside the document's lifted objects."""

    def __init__(self, editor: EditorState, landing: Landing) -> None:
        self._editor, self._landing = editor, landing
        self._offered: Action | None = None
        self._seen: Plate | None = None  # the background that was looked at last
        self._found: tuple[Plate | None, tuple[Ghost, ...]] = (None, ())  # of which plate

    @property
    def pieces(self) -> tuple[Ghost, ...]:
        """Those of the current object."""
        document, editor = self._editor.document, self._editor
        if document is None or not editor.is_lifted:
            return ()
        return tuple(piece for piece in self._all(document) if piece.owner == editor.current)

    @property
    def outlines(self) -> tuple[F32, ...]:
        """(N, 2) image px each, around what is offered now: where its object would show it."""
        message, document = self._editor.message, self._editor.document
        if self._offered is None or message is None or message.action is not self._offered:
            return ()
        if document is None or document.plate is None:
            return ()
        view = self._editor.view
        if view.tool is ToolName.COMPOSE and view.compose.is_bare:  # where no object is seen
            return ()
        corner = np.array([document.plate.left, document.plate.top], np.float32)
        derived, editor = self._editor.derived, self._editor
        outlines = tuple(
            outline + corner + np.array(piece.box[:2], np.float32)
            for piece in self.pieces
            for outline in derived.contours(piece.there)
        )
        if not self._landing.is_current_moved:
            return outlines
        moved = (derived.carried(document, editor.current, each) for each in outlines)
        return tuple(each.astype(np.float32) for each in moved)

    def poll(self) -> bool:
        """Offers what a new background shows; once a frame. Whether anything changed."""
        editor, document = self._editor, self._editor.committed
        plate = document.plate if document is not None else None
        if plate is self._seen or editor.hand.is_busy or editor.preview is not None:
            return False
        self._seen = plate
        if not editor.is_saved:  # else it was offered when it was edited
            self._offer()
        return True

    def _offer(self) -> None:
        """Says so where something of the current object was left out.

        Of many pieces most are no part of it: what lies behind spokes or leaves.
        """
        pieces, asked = self._not_asked()
        count = len(pieces)
        if not 0 < count <= MOST_OFFERED or self._editor.object is None:
            return
        self._editor.tab.asked = asked
        self._offered = Action(t("Add it") if count == 1 else t("Add them"), self.add)
        name = self._editor.object.name
        question = t("Is the outlined piece a part of {name}?", name=name)
        if count > 1:
            question = t("Are the outlined pieces parts of {name}?", name=name)
        self._editor.say(question, self._offered)

    def _not_asked(self) -> tuple[tuple[Ghost, ...], Mask]:
        """The pieces of which most was in no earlier question in this tab; and (H, W) the px of
        those and of these."""
        document, asked = self._editor.opened, self._editor.tab.asked
        size = document.photo.pixels.shape[:2]
        known = np.zeros(size, bool) if asked is None or asked.shape != size else asked
        both, new = known.copy(), []
        for piece in self.pieces:
            assert document.plate is not None, "pieces are of a plate"
            x0, y0, x1, y1 = piece.box
            top, left = document.plate.top, document.plate.left
            place = slice(top + y0, top + y1), slice(left + x0, left + x1)
            if known[place][piece.there].mean() < 0.5:
                new.append(piece)
                both[place] |= piece.there
        return tuple(new), both

    def add(self) -> None:
        """The pieces belong to the object: its outline takes them in, and its shape follows."""
        from objectmorpher_core.compose.plate.plate import hole_margin
        from objectmorpher_core.compose.plate.residue import with_parts

        editor, document, pieces = self._editor, self._editor.committed, self.pieces
        thing = editor.object
        if document is None or document.plate is None or thing is None or thing.mask is None:
            return
        margin = hole_margin(*document.photo.size)
        mask = with_parts(thing.mask, document, pieces, margin)
        if thing.coverage is not None:  # soft elsewhere
            mask = np.where(mask & ~thing.mask, np.uint8(255), thing.coverage)
        editor.apply(t("Add what was left out"), edits.change_mask(document, editor.current, mask))

    def _all(self, document: Document) -> tuple[Ghost, ...]:
        from objectmorpher_core.compose.plate.plate import hole_margin
        from objectmorpher_core.compose.plate.residue import is_like_owner, left_out

        if self._found[0] is not document.plate:
            margin = hole_margin(*document.photo.size)
            ghosts = self._editor.derived.ghosts(document)
            parts = left_out(document, ghosts, margin)
            like = tuple(g for g in parts if is_like_owner(g, document, margin))
            self._found = document.plate, like
        return self._found[1]
