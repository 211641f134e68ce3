"""The current object's shape: its thickness, its other side, what hides it, or a file's instead.

What is said about a shape before it is lifted is kept for the lift. Afterwards each word is a step:
the worker lifts the object anew, and its handles go over.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, Mask
from objectmorpher_core.base.brush import Brush, Stroke
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document import edits
from objectmorpher_core.document.bounds import MOST_VIEWS
from objectmorpher_core.document.model import (
    AS_SEEN,
    Document,
    LiftedObject,
    LiftSettings,
    Matte,
    Placement,
)
from objectmorpher_core.document.transparency import colours_of

from ...canvas.layer import CanvasLayer
from ...system.texts import t
from ...worker import job_functions
from ..view import Painted
from .composing import GRAIN, on_canvas, tint

if TYPE_CHECKING:
    from objectmorpher_core.lift.registration.imported import Import, ImportTarget
    from objectmorpher_core.lift.registration.other_photo import OtherPhoto
    from objectmorpher_core.lift.registration.placement import Proposal

    from ..state import EditorState
    from ..tasks import Tasks
    from .landing import Landing
    from .posing import Posing

IMPORT = "import"  # kind of job
DETAIL = 512  # px, longer side of the map of what is nearer
STEP = 0.06  # x the object's size, that one stroke brings nearer
DEEPEST = 0.6  # x the object's size: no stroke goes on beyond
NEARER, FARTHER, HIDDEN = (0xFF, 0xB0, 0x00), (0x5A, 0xA9, 0xFF), (0xB4, 0x8C, 0xFF)
FULL_TINT = 0.2  # of nearness, that is shown at full strength
TINT = 170  # of 255, its strength
# What is painted is carried along with a moved object by a mesh of so many points a side.
MESH, MARGIN = 24, 24  # px of the field that the mesh goes on around it
STRIDE = 8  # px of a tint between places that are looked up in it
BESIDE = 10.0  # px, off any field


@dataclass(frozen=True, eq=False)
class Fitting:
    """An object from a file, and the poses that were proposed for it."""

    name: str
    mask: Mask
    found: Import
    chosen: Proposal


class Shaping:
    """The artist's words about a shape, and their effect."""

    def __init__(self, editor: EditorState, landing: Landing, posing: Posing, tasks: Tasks) -> None:
        self._editor, self._landing = editor, landing
        self._posing, self._tasks = posing, tasks
        self._stroke: Stroke | None = None
        self._painted, self._is_inverse = Painted.DEPTH, False
        self._fitting: Fitting | None = None
        self._trust: float | None = None  # while it is dragged

    @property
    def settings(self) -> LiftSettings:
        """The words about the current object, also those that its shape does not follow yet."""
        return self._tasks.wished or AS_SEEN

    @property
    def why_fixed(self) -> str | None:
        """Why nothing can be said about the shape, or None."""
        thing = self._editor.object
        if thing is not None and thing.lifted is not None and thing.lifted.middle is None:
            return t("This shape comes from a 3D file and stays as it is there")
        return None

    @property
    def recognised_as(self) -> str | None:
        """Return the kind, of `document.KINDS`, that the lift recognised; None where none."""
        thing = self._editor.object
        return thing.lifted.kind or None if thing is not None and thing.lifted else None

    # Words

    def preview_thickness(self, thickness: float) -> None:
        """Shows the object thicker or thinner; `end_thickness` makes it a step."""
        editor, document = self._editor, self._editor.committed
        if document is None or not editor.is_lifted or editor.hand.is_busy or self.why_fixed:
            return
        k = editor.current
        if document.objects[k].shape.thickness == thickness:
            editor.preview = None
            return
        try:
            changed = edits.set_thickness(document, k, thickness)
            editor.preview = editor.derived.posed_again(changed, k)
        except ValueError as error:
            editor.complain(str(error))

    def end_thickness(self) -> None:
        """Make the object as thick as it is shown, in its key poses, too."""
        editor = self._editor
        if editor.preview is not None:
            editor.preview = editor.derived.keys_again(editor.preview, editor.current)
        editor.commit(t("Thickness"))

    @property
    def trust(self) -> float:
        """Return the trust in the shape network, as it is or as it is being dragged."""
        return self.settings.trust if self._trust is None else self._trust

    def preview_trust(self, trust: float) -> None:
        """Another trust is shown as a number; `end_trust` lifts the object with it."""
        self._trust = trust

    def end_trust(self) -> None:
        trust, self._trust = self.trust, None
        if trust != self.settings.trust:
            self.say(t("Learned shape"), trust=trust)

    def say(self, label: str, **words: object) -> None:
        """A word about the shape: fields of `LiftSettings`."""
        editor, document = self._editor, self._editor.committed
        thing = editor.object
        if document is None or thing is None or self.why_fixed is not None:
            return
        if thing.lifted is not None:
            self._tasks.lift(label, **words)
            return
        shape = replace(self.settings, **words)
        editor.apply(label, edits.set_shape(document, editor.current, shape))
        if editor.current in self._tasks.wishes:  # it is being lifted without that word
            self._tasks.lift()

    # Strokes

    def start_stroke(self, is_inverse: bool) -> bool:
        """A brush is put down on the photo; False where it cannot paint."""
        editor, document = self._editor, self._editor.document
        if document is None or editor.mask is None:
            editor.say(t("Select an object first"))
            return False
        if (reason := self.why_fixed) is not None:
            editor.say(reason)
            return False
        self._painted, self._is_inverse = editor.view.selecting.painted, is_inverse
        size, brush = document.photo.size, editor.view.brush
        if self._painted is Painted.DEPTH:
            scale = _scale(size)
            size = _reduced(size)
            brush = Brush(max(brush.radius * scale, 1.0), brush.hardness)
        self._stroke = Stroke(size, brush)
        return True

    def paint(self, canvas_xy: np.ndarray) -> None:
        """The brush moves to canvas px (2,)."""
        document, stroke, landing = self._editor.document, self._stroke, self._landing
        if stroke is None or document is None:
            return
        scale = _scale(document.photo.size) if self._painted is Painted.DEPTH else 1.0
        land = landing.begin if stroke.box is None else landing.go_on
        x, y = land(canvas_xy) * scale
        stroke.move_to(float(x), float(y))

    def end_stroke(self) -> None:
        """Turn what was painted into a hint about the shape."""
        stroke, document = self._stroke, self._editor.document
        if stroke is None or document is None:
            return
        if self._painted is Painted.DEPTH:
            label = t("Farther") if self._is_inverse else t("Nearer")
            nearness = self._nearness(document.photo.size)
            self.say(label, nearness=nearness if nearness.any() else None)
        else:
            hidden = self._hidden(document.photo.size)
            label = t("Erase hidden part") if self._is_inverse else t("Paint hidden part")
            self.say(label, hidden=hidden if hidden.any() else None)
        self.drop_stroke()

    def drop_stroke(self) -> None:
        """Drop the stroke as if nothing had been painted."""
        self._stroke = None

    def clear_painted(self) -> None:
        """Clear everything painted with the chosen brush."""
        if self._editor.view.selecting.painted is Painted.HIDDEN:
            self.say(t("Clear hidden parts"), hidden=None)
        else:
            self.say(t("Clear painted depth"), nearness=None)

    def _nearness(self, size: tuple[int, int]) -> F32:
        """(h, w) with the stroke in progress."""
        now = self.settings.nearness
        width, height = _reduced(size)
        now = np.zeros((height, width), np.float32) if now is None else now
        if self._stroke is None or self._painted is not Painted.DEPTH:
            return now
        step = -STEP if self._is_inverse else STEP
        return np.clip(now + step * self._stroke.coverage, -DEEPEST, DEEPEST).astype(np.float32)

    def _hidden(self, size: tuple[int, int]) -> Mask:
        """(H, W) with the stroke in progress."""
        now = self.settings.hidden
        now = np.zeros(size[::-1], bool) if now is None else now
        if self._stroke is None or self._painted is not Painted.HIDDEN:
            return now
        covered = self._stroke.coverage >= 0.5
        return now & ~covered if self._is_inverse else now | covered

    def painted_layer(self) -> CanvasLayer | None:
        """Return the painted hints about the shape, as a tint over the canvas."""
        editor, document = self._editor, self._editor.document
        painted = editor.view.selecting.painted
        if document is None or painted not in (Painted.DEPTH, Painted.HIDDEN):
            return None
        size = document.photo.size
        if painted is Painted.DEPTH:
            field, scale = self._nearness(size), _scale(size)
        else:
            field, scale = self._hidden(size).astype(np.float32) * FULL_TINT, 1.0
        if not field.any():
            return None
        seen = self._seen(document, field, scale)
        alpha = np.clip(np.abs(seen) / FULL_TINT, 0, 1)[..., None]
        up = HIDDEN if painted is Painted.HIDDEN else NEARER
        ink = np.where(seen[..., None] > 0, np.array(up, np.float32), np.array(FARTHER, np.float32))
        strength = alpha * (TINT / 255)
        return tint(ink * strength, 255 * strength)

    def _seen(self, document: Document, field: F32, scale: float) -> F32:
        """(h, w) a field over the canvas, each part of it where the object shows it now."""
        view, k = self._editor.view, self._editor.current
        if not self._landing.is_current_moved:
            return on_canvas(view, field, scale)
        from scipy.spatial import Delaunay

        corners = [(v.min() - MARGIN, v.max() + MARGIN) for v in np.nonzero(field)[::-1]]
        x, y = (np.linspace(low, high, MESH) / scale for low, high in corners)
        photo = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)  # image px, around what is painted
        shown = view.canvas_from_image(self._editor.derived.carried(document, k, photo)) / GRAIN
        height, width = max(view.height // GRAIN, 1), max(view.width // GRAIN, 1)
        rows, columns = height // STRIDE + 1, width // STRIDE + 1
        tint_xy = (np.mgrid[:rows, :columns][::-1].reshape(2, -1).T + 0.5) * STRIDE
        mesh = Delaunay(shown, qhull_options="QJ")  # also of what is seen from its edge
        triangle = mesh.find_simplex(tint_xy)  # -1 beside it
        to_shares = mesh.transform[triangle]
        shares = np.einsum("nij,nj->ni", to_shares[:, :2], tint_xy - to_shares[:, 2])
        shares = np.column_stack([shares, 1 - shares.sum(1)])  # of a triangle's corners
        at = np.einsum("ni,nij->nj", shares, photo[mesh.simplices[triangle]]) * scale - 0.5
        at[triangle < 0] = np.nan
        at = at.astype(np.float32).reshape(rows, columns, 2)
        fine = cv2.resize(at, (columns * STRIDE, rows * STRIDE))[:height, :width]
        fine = np.where(np.isfinite(fine), fine, np.float32(-BESIDE))
        return np.asarray(
            cv2.remap(field, fine[..., 0], fine[..., 1], cv2.INTER_LINEAR), np.float32
        )

    # Other photos of the object

    @property
    def why_no_photo(self) -> str | None:
        """Why no other photo can be added, or None."""
        if len(self.settings.views) >= MOST_VIEWS:
            return t("An object has {count} further photos at most", count=MOST_VIEWS)
        return self.why_fixed

    def add_photo(self, other: Path | OtherPhoto) -> None:
        """Another photo of the current object; of a file its main subject."""
        editor = self._editor
        if not editor.is_lifted:
            editor.say(editor.why_no_shape)
        elif (reason := self.why_no_photo) is not None:
            editor.say(reason)
        else:
            self._tasks.lift_with(other, t("Add photo"))

    def drop_photo(self, number: int) -> None:
        """The object is as it was without that photo; one step."""
        views = self.settings.views
        self.say(t("Remove photo"), views=(*views[:number], *views[number + 1 :]))

    # Objects out of files

    @property
    def fitting(self) -> Fitting | None:
        """The poses proposed for the current object, which came out of a file."""
        fitting, thing = self._fitting, self._editor.object
        is_own = fitting is not None and thing is not None and thing.mask is fitting.mask
        return fitting if is_own and self.why_fixed is not None else None

    def open_file(self, path: Path) -> None:
        """A 3D object out of a file takes the place of what is selected."""
        editor, scene = self._editor, self._scene()
        if scene is None:
            editor.say(t("Select what the 3D object replaces first"))
            return
        document, mask, k = editor.opened, editor.mask, editor.current
        assert mask is not None

        def accept(answer: tuple[Import, Matte, LiftedObject]) -> None:
            found, matte, lifted = answer
            fitting = Fitting(path.name, mask, found, found.registration.best)
            self._take_import(k, fitting, matte, lifted, t("Use 3D file"))

        editor.message = None
        editor.jobs.start(
            t("Fitting {name} to the photo", name=path.name), job_functions.import_object,
            path, scene, document.seed, done=accept, failed=editor.complain_of, kind=IMPORT,
        )  # fmt: skip

    def choose(self, proposal: Proposal) -> None:
        """Another of the poses that were proposed."""
        editor, fitting, scene = self._editor, self.fitting, self._scene()
        document = editor.document
        if fitting is None or scene is None or document is None or proposal is fitting.chosen:
            return
        k, chosen = editor.current, replace(fitting, chosen=proposal)

        def accept(answer: tuple[Matte, LiftedObject]) -> None:
            self._take_import(k, chosen, *answer, t("Try another fit"))

        editor.jobs.start(
            t("Placing the object"), job_functions.place_object,
            scene, fitting.found.gaussians, proposal, document.seed,
            done=accept, failed=editor.complain_of, kind=IMPORT,
        )  # fmt: skip

    def fit_again(self) -> None:
        """The pose that agrees best with the photo near to where the object was placed by hand."""
        editor, scene = self._editor, self._scene()
        document, thing, mask = editor.document, editor.object, editor.mask
        if document is None or thing is None or thing.lifted is None or scene is None:
            return
        assert mask is not None
        k, body = editor.current, thing.lifted.body
        moved = thing.placement.matrix(thing.lifted, document.photo.camera)
        start, name = moved @ thing.lifted.world_from_object, thing.name

        def accept(answer: tuple[Import, Matte, LiftedObject]) -> None:
            found, matte, lifted = answer
            fitting = Fitting(name, mask, found, found.registration.best)
            self._take_import(k, fitting, matte, lifted, t("Fit to photo"))

        editor.jobs.start(
            t("Fitting the object to the photo"), job_functions.fit_object,
            scene, body, start, document.seed,
            done=accept, failed=editor.complain_of, kind=IMPORT,
        )  # fmt: skip

    def _scene(self) -> ImportTarget | None:
        """The photo and the mask that an object stands for."""
        from objectmorpher_core.lift.registration.imported import ImportTarget

        editor, document = self._editor, self._editor.document
        thing = editor.object
        if document is None or thing is None or thing.selection is None:
            return None
        photo = document.photo
        is_alone = not any(o.lifted for o in document.objects if o is not thing)
        is_guess = photo.camera == Camera.from_fov(*photo.size)
        is_free, mixed = is_alone and is_guess, thing.mixed
        pixels = colours_of(photo.picture)
        return ImportTarget(pixels, photo.camera, thing.selection, is_free, mixed)

    def _take_import(
        self, k: int, fitting: Fitting, matte: Matte, lifted: LiftedObject, label: str
    ) -> None:
        editor = self._editor

        def change(document: Document) -> Document | None:
            if k >= len(document.objects) or document.objects[k].mask is not fitting.mask:
                return None
            try:
                changed = edits.set_camera(document, fitting.chosen.camera, k)
            except ValueError as error:
                editor.complain(str(error))
                return None
            changed = edits.set_lifted(changed, k, matte, lifted)
            return edits.set_placement(changed, k, Placement())

        self._tasks.make_ready(
            k, change, t("Placing the object"),
            lambda changed: self._show_import(fitting, changed, label),
        )  # fmt: skip

    def _show_import(self, fitting: Fitting, changed: Document, label: str) -> None:
        editor = self._editor
        self._posing.select(None)
        editor.apply(label, changed)
        self._fitting = fitting
        share = f"{100 * fitting.chosen.iou:.0f}"
        sentence = t("It covers the photo's outline to {share} %", share=share)
        found = fitting.found.registration
        editor.say(f"{sentence}. {found.reason}" if found.is_ambiguous else sentence)


def _scale(size: tuple[int, int]) -> float:
    """Px of the map of what is nearer per px of a photo of `size` (width, height)."""
    return min(1.0, DETAIL / max(size))


def _reduced(size: tuple[int, int]) -> tuple[int, int]:
    scale = _scale(size)
    return max(1, round(size[0] * scale)), max(1, round(size[1] * scale))
