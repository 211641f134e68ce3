"""Intentions that concern the shadow which an object throws in the photo.

It is looked for where the artist asks, and once by itself when an object has left its place. What
is found is outlined, and changes nothing before it is accepted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING
from weakref import WeakSet

import cv2
import numpy as np

from objectmorpher_core.base.arrays import Mask, crop
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, EditObject, Matte, Plate
from objectmorpher_core.document.settings import Shadow
from objectmorpher_core.document.transparency import continued

from ...canvas.memo import same
from ...system.texts import t
from ...worker import job_functions
from ...worker.job_functions import Cutout
from ..view import Action, StatusMessage, ToolName
from .composing import Answers, masks_of, seen_from

if TYPE_CHECKING:
    from ..state import EditorState
    from .composing import Composing

SHADOW = "shadow"  # kind of a job
SMOOTHED = np.ones((9, 9), np.uint8)  # px: the ground's own grain is no outline
SPECK = 0.05  # x the largest piece's area, of one that is no piece of a shadow
SEEN = 1 / 32  # of full scale, by which the ground becomes lighter where a shadow is outlined


@dataclass(frozen=True, eq=False)
class ShadowOffer:
    """An object's shadow in the photo, which it could take along."""

    document: Document  # in which it was looked for
    k: int
    shadow: Shadow
    plate: Plate  # without it
    action: Action | None = None  # which takes it along, where the artist did not ask

    def stands(self, document: Document, current: int) -> bool:
        """Whether it is of the current object of `document`, as that is now.

        What the artist did not ask for may come while the object is moved on.
        """
        if self.k != current:
            return False
        if self.action is None or document is self.document:
            return document is self.document
        own, was = document.objects[self.k], self.document.objects[self.k]
        is_same = document.plate is self.document.plate and own.matte is was.matte
        return is_same and own.shadow == was.shadow

    @cached_property
    def outlined(self) -> Mask:
        """(H, W) of the photo what would be taken off it."""
        photo, plate = self.document.photo, self.plate
        if plate.painted is None:
            return np.zeros(photo.size[::-1], bool)
        x0, y0, x1, y1 = plate.box
        change = cv2.absdiff(plate.pixels, photo.pixels[y0:y1, x0:x1]).max(-1)
        is_seen = plate.painted & (change > SEEN * np.iinfo(change.dtype).max)
        whole = crop(is_seen, plate.box, (0, 0, *photo.size)).astype(np.uint8)
        closed = cv2.morphologyEx(whole, cv2.MORPH_CLOSE, SMOOTHED)
        opened = cv2.morphologyEx(closed, cv2.MORPH_OPEN, SMOOTHED)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(opened)
        area = np.asarray(stats)[:, cv2.CC_STAT_AREA]
        area[0] = 0
        return (area > SPECK * area.max())[np.asarray(labels)]


Found = tuple[Shadow, Plate] | None


class OldShadows:
    """The shadows in the photo, and what is offered of them."""

    def __init__(
        self, editor: EditorState, composing: Composing, choose_tool: Callable[[ToolName], None]
    ) -> None:
        self._editor, self._composing, self._choose_tool = editor, composing, choose_tool
        self._answers = Answers(editor)
        self._offer: ShadowOffer | None = None  # found in the photo, not taken along yet
        self._said: StatusMessage | None = None  # that it is outlined
        self._watched: tuple[Document | None, int] = (None, 0)  # looked at last
        self._looked_for: WeakSet[Matte] = WeakSet()  # whose shadows were looked for unasked

    def forget(self) -> None:
        """Another document is opened."""
        self._answers.forget()
        self._offer, self._watched = None, (None, 0)

    def poll(self) -> bool:
        """Takes in what was found, and looks what was moved; once a frame."""
        return self._answers.deliver() | self._watch() | self._fall_silent()

    @property
    def offer(self) -> ShadowOffer | None:
        """What would be taken along, as long as the document is the one in which it was found."""
        offer, editor = self._offer, self._editor
        if offer is None or editor.document is None:
            return None
        if offer.action is not None:  # it lasts as long as the question
            message = editor.message
            if message is None or message.action is not offer.action:
                return None
        return offer if offer.stands(editor.document, editor.current) else None

    def look(self) -> None:
        """Looks for the shadow of the current object, and outlines what it finds.

        Nothing changes before `accept`; `refuse`, or any other edit, ends the offer.
        """
        editor, document, k = self._editor, self._editor.committed, self._editor.current
        if document is None or document.plate is None or not editor.is_lifted:
            return
        masks = masks_of(document)

        def accept(answer: Found) -> None:
            if answer is None:
                about = t("No clear shadow was found in the photo")
                editor.say(about + " · " + t("Strength adds one, B paints an old one out"))
                return
            offer = _offer_of(document, k, answer)
            self._answers.add(lambda: self._show(masks, offer))

        editor.jobs.start(
            t("Looking for its shadow"), job_functions.take_shadow, self._cutout(document, k),
            self._composing.choice(document.plate.seed + 1), done=accept,
            failed=editor.complain_of, kind=SHADOW,
        )  # fmt: skip

    def accept(self) -> None:
        """What was outlined goes along; one step for undo."""
        offer, self._offer, document = self._offer, None, self._editor.document
        if offer is None or document is None or not offer.stands(document, self._editor.current):
            return
        changed = edits.set_plate(document, offer.plate)
        changed = edits.set_shadow(changed, offer.k, offer.shadow)
        self._editor.apply(t("Shadow as in the photo"), changed)
        self._editor.message = None

    def refuse(self) -> None:
        """What was outlined stays in the photo."""
        self._offer = None
        self._editor.message = None

    def _watch(self) -> bool:
        """Looks once whether an object that was moved leaves a shadow behind.

        It is offered where it is sure; nothing is said where none is. Whether a search began.
        """
        editor, document, k = self._editor, self._editor.committed, self._editor.current
        if editor.hand.is_busy or editor.preview is not None or not editor.jobs.is_idle:
            return False
        if document is None:
            return False
        before, self._watched = self._watched, (document, k)
        if before[0] is document and before[1] == k:
            return False
        if document.plate is None or not editor.is_lifted:
            return False
        if not self._may_leave_one(document.objects[k], document) or editor.is_saved:
            return False
        cutout = replace(self._cutout(document, k), is_asked=False)
        self._looked_for.add(cutout.matte)

        def accept(answer: Found) -> None:
            if answer is not None:
                action = Action(t("Take it along"), self.accept)
                offer = replace(_offer_of(document, k, answer), action=action)
                self._answers.add(lambda: self._suggest(offer))

        def look_again() -> None:
            self._looked_for.discard(cutout.matte)
            self._watched = None, 0

        editor.jobs.start(
            t("Looking for its shadow"), job_functions.take_shadow, cutout,
            self._composing.choice(document.plate.seed + 1), done=accept,
            failed=lambda error: None, cancelled=look_again, replaced=look_again, kind=SHADOW,
            is_quiet=True, is_spare=True,
        )  # fmt: skip
        return True

    def _fall_silent(self) -> bool:
        """Says no longer that a shadow is outlined once none is. Whether it was said."""
        editor, said = self._editor, self._said
        if said is None or self.offer is not None:
            return False
        if editor.hand.is_busy or editor.preview is not None:  # it may be taken back
            return False
        self._said, is_said = None, editor.message is said
        if is_said:
            editor.message = None
        return is_said

    def _may_leave_one(self, item: EditObject, document: Document) -> bool:
        from objectmorpher_core.scripting.runner import has_left

        if item.matte is None or item.is_visitor or not item.is_visible:
            return False
        if item.shadow.strength > 0:
            return False
        alike = (o for o in document.objects if o.matte is item.matte)
        if not all(has_left(o, document) for o in alike):  # one stands in its shadow in the photo
            # What leaves it last is a new move.
            self._looked_for.discard(item.matte)
            return False
        return item.matte not in self._looked_for

    def _cutout(self, document: Document, k: int) -> Cutout:
        """A lifted object, and what there is to be known of its ground."""
        item = document.objects[k]
        assert item.matte is not None, "it is lifted"
        shadow = item.grounded_shadow
        is_known = shadow.ground is not None or document.horizon is not None
        ground = seen_from(document, k, shadow) if is_known else None
        covered = self._editor.derived.hidden(document)
        return Cutout(continued(document.photo.picture, covered), item.matte, covered, ground)

    def _suggest(self, offer: ShadowOffer) -> None:
        """Offers what was found unasked, where nothing else is offered."""
        editor = self._editor
        document, said = editor.committed, editor.message
        if document is None or not offer.stands(document, editor.current):
            return
        if said is not None and (said.is_error or said.action is not None):
            return
        self._offer = offer
        editor.say(t("What is outlined is its shadow, and stays behind"), offer.action)
        self._said = editor.message

    def _show(self, masks: tuple[Mask | None, ...], offer: ShadowOffer) -> None:
        """Offers what the artist has asked for."""
        editor, document = self._editor, self._editor.committed
        if document is None or not same(masks, masks_of(document)):
            return
        self._offer = replace(offer, document=document)
        self._choose_tool(ToolName.COMPOSE)  # which outlines it
        text = t("What is outlined is its shadow, and would go along")
        editor.say(text, Action(t("Leave it in the photo"), self.refuse))
        self._said = editor.message


def _offer_of(document: Document, k: int, answer: tuple[Shadow, Plate]) -> ShadowOffer:
    shadow, plate = answer
    if shadow.ground is None:  # it was known how one looks at it
        shadow = replace(shadow, ground=document.objects[k].shadow.ground)
    return ShadowOffer(document, k, shadow, plate)
