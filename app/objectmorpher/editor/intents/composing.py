"""Intentions that concern the background and the way in which objects join it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, U8, Mask
from objectmorpher_core.base.brush import Stroke
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, EditObject, Plate
from objectmorpher_core.document.settings import Finish, Hint, Shadow, Share
from objectmorpher_core.document.transparency import colours_of, continued

from ...canvas.layer import CanvasLayer
from ...canvas.memo import same
from ...system.texts import t
from ...worker import job_functions
from ...worker.job_functions import BackendChoice, Variant
from ...worker.requests import JobError
from ..history import CLOCK
from ..state import Answers
from ..tasks import PLATE
from ..view import ToolName, ViewState

if TYPE_CHECKING:
    from objectmorpher_core.compose.plate.repair import PlatePatch

    from ..state import EditorState
    from ..tasks import Tasks
    from .methods import Methods

# Kinds of jobs, besides PLATE.
VARIANTS, REPAIR, DEPTH = "variants", "repair", "depth"
COUNT = 3  # variants
USUAL_SHADOW = 0.55
GRAIN = 2  # canvas px per px of a tint
FILLING, RESTORING = (0x5A, 0xA9, 0xFF), (0xFF, 0xFF, 0xFF)  # a stroke's colour


class Composing:
    """The plate and the joining."""

    def __init__(
        self,
        editor: EditorState,
        methods: Methods,
        tasks: Tasks,
    ) -> None:
        self._editor = editor
        self._methods, self._tasks = methods, tasks
        self._variants: tuple[tuple[Mask | None, ...], tuple[Variant, ...]] = ((), ())
        self._answers = Answers(editor)
        self._stroke: Stroke | None = None  # being painted
        self._is_restoring = False
        self._waiting: list[Stroke] = []  # painted, not filled in yet; the first is asked for
        self.newest = 0  # number of the last one, as of the history's steps
        # A variant that is looked at: of what and which, and the document with it
        self._compared: tuple[tuple[Document, Plate], Document] | None = None

    def forget(self) -> None:
        """Another document is opened."""
        self._variants = (), ()
        self._answers.forget()
        self._stroke, self._waiting, self._compared = None, [], None

    def deliver(self) -> bool:
        """Takes in what the worker has made, between strokes; once a frame."""
        if self._compared is not None and self._editor.view.tool is not ToolName.COMPOSE:
            self.compare_variant(None)
        return self._answers.deliver()

    # The background

    @property
    def trouble(self) -> str | None:
        """Return the sentence that stands in for the background; None where it is there."""
        editor = self._editor
        if editor.jobs.is_busy(PLATE):
            return t("The background is being filled in…")
        if editor.document is not None and editor.document.plate is None:
            return t("The background is not filled in")
        return None

    @property
    def is_repairing(self) -> bool:
        return bool(self._waiting)

    def toggle_bare(self) -> None:
        """Shows the background alone, or the whole picture."""
        view = self._editor.view
        view.compose.is_bare, view.compose.is_painting = not view.compose.is_bare, False

    @property
    def inpainter(self) -> str:
        """The backend that is asked to fill in the background; "auto" is the best that can run."""
        return self._methods.chosen("inpaint")

    def fill_again(self) -> None:
        """A new background with another seed: a step of its own."""
        document = self._editor.document
        if document is None:
            return
        if document.plate is None:
            self._tasks.fill_background()
            return
        self._ask_plate(document.hints, document.plate.seed + 1, t("Fill in again"), _nothing)

    def fill_from(self, hints: tuple[Hint, ...], label: str, end: Callable[[], None]) -> None:
        """A new background with other hints: a step of its own; then, or if not, `end`."""
        document = self._editor.document
        if document is None or document.plate is None:
            end()
            return
        self._ask_plate(hints, document.plate.seed, label, end)

    def _ask_plate(
        self, hints: tuple[Hint, ...], seed: int, label: str, end: Callable[[], None]
    ) -> None:
        editor, document = self._editor, self._editor.opened
        masks, covered = masks_of(document), editor.derived.hidden(document)

        def take(plate: Plate) -> None:
            end()
            self._take_plate(masks, plate, label, hints)

        def accept(plate: Plate) -> None:
            self._answers.add(lambda: take(plate))

        def fail(error: JobError) -> None:
            end()
            editor.complain_of(error)

        editor.jobs.start(
            t("Filling in the background"), job_functions.inpaint,
            continued(document.photo.picture, covered), covered,
            BackendChoice(self.inpainter, seed, hints),
            done=accept, failed=fail, cancelled=end, replaced=end, kind=PLATE,
        )  # fmt: skip

    def try_variants(self) -> None:
        """Asks for some backgrounds to choose from."""
        editor, document = self._editor, self._editor.document
        if document is None or document.plate is None:
            return
        masks, covered = masks_of(document), editor.derived.hidden(document)

        def accept(variants: tuple[Variant, ...]) -> None:
            self._variants = (masks, variants)

        editor.jobs.start(
            t("Filling in the background"), job_functions.fill_variants,
            continued(document.photo.picture, covered), covered,
            self.choice(document.plate.seed + 1), COUNT,
            done=accept, failed=editor.complain_of, kind=VARIANTS,
        )  # fmt: skip

    @property
    def variants(self) -> tuple[Variant, ...]:
        """The backgrounds to choose from, as long as the masks are the same."""
        document = self._editor.document
        masks, variants = self._variants
        return variants if document is not None and same(masks, masks_of(document)) else ()

    def compare_variant(self, k: int | None) -> None:
        """Show the edit on the variant at `k`, or, for None, on its own background again."""
        editor, document = self._editor, self._editor.committed
        is_free = document is not None and not editor.hand.is_busy
        k = k if is_free and k is not None and k < len(self.variants) else None
        if k is None or document is None:
            if self._compared is not None and editor.preview is self._compared[1]:
                editor.preview = None
            self._compared = None
            return
        plate = self.variants[k].plate
        if self._compared is None or not same(self._compared[0], (document, plate)):
            self._compared = (document, plate), edits.set_plate(document, plate)
        editor.preview = self._compared[1]

    def choose_variant(self, variant: Variant) -> None:
        self.compare_variant(None)
        document = self._editor.committed
        if document is not None and document.plate is not variant.plate:
            masks, hints = masks_of(document), document.hints
            self._take_plate(masks, variant.plate, t("Choose background"), hints)

    def _take_plate(
        self, masks: tuple[Mask | None, ...], plate: Plate, label: str, hints: tuple[Hint, ...]
    ) -> None:
        editor = self._editor
        document = editor.committed
        if document is not None and same(masks, masks_of(document)):
            editor.apply(label, edits.set_plate(edits.set_hints(document, hints), plate))

    def choice(self, seed: int) -> BackendChoice:
        """Who fills in the background, and how."""
        document = self._editor.document
        return BackendChoice(self.inpainter, seed, () if document is None else document.hints)

    # Repairing it

    def start_stroke(self, is_restoring: bool) -> bool:
        """The brush is put down; False where there is nothing to paint on."""
        editor = self._editor
        if editor.document is None or editor.document.plate is None:
            editor.say(self.trouble or t("Open a photo first"))
            return False
        self._stroke = Stroke(editor.document.photo.size, editor.view.brush)
        self._is_restoring = is_restoring
        return True

    def paint(self, canvas_xy: np.ndarray) -> None:
        if self._stroke is not None:
            x, y = self._editor.view.image_from_canvas(canvas_xy)
            self._stroke.move_to(float(x), float(y))

    def drop_stroke(self) -> None:
        self._stroke = None

    def end_stroke(self) -> None:
        """Fill in what was painted, or restore the photo there, as one step."""
        from objectmorpher_core.compose.plate.repair import patch_of, restored

        editor, stroke, self._stroke = self._editor, self._stroke, None
        document = editor.committed
        if stroke is None or stroke.box is None or document is None or document.plate is None:
            return
        x0, y0, x1, y1 = stroke.box
        if not stroke.coverage[y0:y1, x0:x1].any():
            return
        if not self._is_restoring:
            self._enqueue(stroke)
            return
        plate = restored(document, patch_of(document, stroke.coverage, stroke.box))
        if plate is not document.plate:
            editor.apply(t("Restore background"), edits.set_plate(document, plate))

    def _enqueue(self, stroke: Stroke) -> None:
        """One after the other."""
        self._waiting.append(stroke)
        self.newest = next(CLOCK)
        if len(self._waiting) == 1:
            self._ask_repair()

    def _ask_repair(self) -> None:
        """For the first stroke that waits, on the background as it is now."""
        from objectmorpher_core.compose.plate.repair import margin_of, patch_of

        editor, document = self._editor, self._editor.committed
        if document is None or document.plate is None or not self._waiting:
            self._waiting = []
            return
        stroke, asked = self._waiting[0], document.plate
        assert stroke.box is not None
        patch = patch_of(document, stroke.coverage, stroke.box)

        def accept(answer: tuple[PlatePatch, str]) -> None:
            self._answers.add(lambda: self._take_repair(stroke, asked, *answer))

        def fail(error: JobError) -> None:
            self._waiting = []
            editor.complain_of(error.retried_by(lambda: self._enqueue(stroke)))

        def drop() -> None:
            if self._is_first(stroke):
                self._waiting = []

        editor.jobs.start(
            t("Repairing the background"), job_functions.repair, patch, margin_of(document),
            self.choice(asked.seed + 1), done=accept, failed=fail, cancelled=drop, kind=REPAIR,
        )  # fmt: skip

    def _is_first(self, stroke: Stroke) -> bool:
        return bool(self._waiting) and self._waiting[0] is stroke

    @property
    def undo_label(self) -> str | None:
        """Of the last stroke that is not filled in yet; None: there is none."""
        return t("Repair background") if self._waiting else None

    def take_back(self) -> None:
        """Forget that stroke."""
        self._waiting.pop()
        if not self._waiting:
            self._editor.jobs.cancel(REPAIR)

    def _take_repair(self, stroke: Stroke, asked: Plate, patch: PlatePatch, backend: str) -> None:
        """A repaired part; dropped where the background is another one by now, or the stroke was
        taken back."""
        from objectmorpher_core.compose.plate.repair import with_patch

        if not self._is_first(stroke):
            return
        editor, document = self._editor, self._editor.committed
        self._waiting = self._waiting[1:]
        if document is not None and document.plate is asked:
            plate = with_patch(document, patch, backend)
            editor.apply(t("Repair background"), edits.set_plate(document, plate))
        if self._waiting:
            self.newest = next(CLOCK)
            self._ask_repair()

    def painted_layer(self) -> CanvasLayer | None:
        """Return the painted area that is not filled in yet, as a tint over the canvas."""
        strokes = [s for s in (self._stroke, *self._waiting) if s is not None]
        if not strokes:
            return None
        is_white = self._is_restoring and self._stroke is not None
        return stroke_tint(self._editor.view, strokes, RESTORING if is_white else FILLING)

    # Joining the object to it

    def preview_shadow(self, shadow: Shadow) -> None:
        """Previews another shadow of the current object; `Editor.commit` makes it a step."""
        self._preview(lambda document, k: edits.set_shadow(document, k, shadow))

    def preview_share(self, name: Share, share: float) -> None:
        """Previews how far the current object fits into its new place."""
        self._preview(lambda document, k: edits.set_share(document, k, name, share))

    def preview_finish(self, finish: Finish) -> None:
        """Previews another opacity and other colours of the current object."""
        self._preview(lambda document, k: edits.set_finish(document, k, finish))

    def preview_feather(self, feather: float) -> None:
        self._preview(lambda document, _: edits.set_feather(document, feather))

    def ground(self, shadow: Shadow) -> float:
        """Return the angle, degrees above the ground, at which the camera sees the object."""
        editor = self._editor
        return seen_from(editor.opened, editor.current, shadow)

    @property
    def usual_ground(self) -> float:
        """Return the same angle for a current object whose shadow has no ground of its own."""
        item = self._editor.chosen
        plain = replace(item, shadow=replace(item.shadow, ground=None))
        return self.ground(plain.grounded_shadow)

    def toggle_shadow(self) -> None:
        """Gives the current object a shadow, or takes it."""
        item = self._item
        if item is not None:
            is_new = item.shadow.strength == 0
            self.preview_shadow(replace(item.shadow, strength=USUAL_SHADOW if is_new else 0.0))
            self._editor.commit(t("Add shadow") if is_new else t("Remove shadow"))

    def toggle_depth(self) -> None:
        """Shadows fall on what the depth model sees in the photo, or on plain ground again."""
        editor, document = self._editor, self._editor.committed
        if document is None:
            return
        if document.depth is not None:
            editor.apply(t("Shadows on plain ground"), edits.set_depth(document, None))
            return

        def accept(depth: F32 | None) -> None:
            now = editor.committed
            if depth is None:
                editor.say(t("Walls and steps are seen by a depth model: Window > Models"))
            elif now is not None and now.photo is document.photo:
                editor.apply(t("Shadows on walls and steps"), edits.set_depth(now, depth))

        editor.jobs.start(
            t("Looking how deep the photo is"), job_functions.look_at_depth,
            colours_of(document.photo.picture),
            done=lambda depth: self._answers.add(lambda: accept(depth)),
            failed=editor.complain_of, kind=DEPTH,
        )  # fmt: skip

    def choose_refiner(self, name: str) -> None:
        """Choose one of `compose.REFINERS`."""
        item = self._item
        if item is not None and name != self.refiner:
            is_wanted = name == "harmonise"
            self._preview(lambda document, k: edits.harmonised(document, k, is_wanted))
            self._editor.commit(t("Adjust light"))

    @property
    def refiner(self) -> str:
        """Return the document's refiner; never a preview, so that no field vanishes in a drag."""
        editor = self._editor
        if editor.committed is None or self._item is None:
            return "none"
        item = editor.committed.objects[editor.current]
        has_any = item.harmony or item.relight or item.grain or item.defocus
        return "harmonise" if has_any else "none"

    @property
    def _item(self) -> EditObject | None:
        return self._editor.object if self._editor.is_lifted else None

    def _preview(self, change: Callable[[Document, int], Document]) -> None:
        editor = self._editor
        if editor.committed is None or not editor.is_lifted or editor.hand.is_busy:
            return
        try:
            editor.preview = change(editor.committed, editor.current)
        except ValueError as error:
            editor.complain(str(error))


def stroke_tint(
    view: ViewState, strokes: Sequence[Stroke], colour: tuple[int, int, int]
) -> CanvasLayer:
    """What strokes cover, as a tint of the levels `colour` over the canvas."""
    covered = np.maximum.reduce([on_canvas(view, stroke.coverage) for stroke in strokes])
    return tint(covered[..., None] * np.array(colour, np.float32), covered * 255)


def on_canvas(view: ViewState, field: F32 | U8, scale: float = 1.0) -> F32:
    """(h, w) a field as the canvas shows it, of px that are `scale` to one of the photo."""
    size = (max(view.width // GRAIN, 1), max(view.height // GRAIN, 1))
    step = GRAIN / view.zoom * scale  # px of the field per px of the tint
    start = [edge * scale + step / 2 - 0.5 for edge in (view.left, view.top)]
    matrix = np.array([[step, 0, start[0]], [0, step, start[1]]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpAffine(field, matrix, size, flags=flags), np.float32)


def tint(ink: np.ndarray, alpha: np.ndarray) -> CanvasLayer:
    """Levels (h, w, 3), premultiplied, and alpha (h, w) of 255 over the canvas."""
    height, width = alpha.shape[:2]
    rgba = np.dstack([ink, alpha]).astype(np.uint8)
    box = (0.0, 0.0, float(width * GRAIN), float(height * GRAIN))
    return CanvasLayer(box, rgba, is_coarse=True, is_tint=True)


def _nothing() -> None:
    """Nobody waits for the background."""


def masks_of(document: Document) -> tuple[Mask | None, ...]:
    """The masks (H, W) of what hides the background: what was computed of others is out of date."""
    return tuple(o.mask for o in document.objects if o.hides_background)


def seen_from(document: Document, k: int, shadow: Shadow) -> float:
    """From how many degrees above the ground one looks at object `k` on it."""
    from objectmorpher_core.compose.light.lighting import ground_seen_from

    lifted = document.objects[k].lifted
    assert lifted is not None
    return ground_seen_from(lifted, document.photo.camera, document.horizon, shadow)
