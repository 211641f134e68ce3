"""Dragging and turning points of the lifted object, and what holds it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.rotations import turn_about, turned_by
from objectmorpher_core.document import edits, hold_edits
from objectmorpher_core.document.model import Document, EditObject
from objectmorpher_core.document.pose import turn_at

from ...canvas.derived import Spot
from ...system.texts import t
from .mirroring import MirrorIntents

if TYPE_CHECKING:
    from objectmorpher_core.deform.puppet import SurfacePoint
    from objectmorpher_core.document.hold_edits import Stays

    from ..state import EditorState


EXPECT = "expect a drag"  # kind of what runs in a thread
AT_REST = 2e-4  # x diameter: a smaller motion of a frame is none
# Of a drag's frame, for the solver: a compact object lags by less than a pixel, a slender one is
# given longer. While the pointer holds still there is more time.
DRAG = {"seconds": 0.007, "tolerance": 3e-3}
REST = {"seconds": 0.012}


class Posing:
    """The current object's handles and pose."""

    def __init__(self, editor: EditorState) -> None:
        self._editor = editor
        self.mirroring = MirrorIntents(editor)
        self.readout = ""  # of the turn in progress: "34°"
        self._selected: tuple[int, ...] = ()
        self._solved: Document | None = None  # the preview, if its pose was solved for
        self._restless: Document | None = None  # the same, as long as its pose is not at rest

    # What there is

    def surface_at(self, canvas_xy: np.ndarray) -> SurfacePoint | None:
        """The point of the object's surface that is seen at canvas px."""
        editor = self._editor
        if editor.document is None or not editor.is_lifted:
            return None
        return editor.derived.surface_at(editor.document, editor.current, editor.view, canvas_xy)

    def positions(self) -> F64:
        """Return the handles' targets in the view: (H, 2) image px."""
        editor = self._editor
        if editor.document is None or editor.object is None or not editor.object.handles:
            return np.empty((0, 2))
        targets = np.array([h.target for h in editor.object.handles])
        return editor.derived.project(editor.document, editor.current, targets)

    def spot(self, handle: int) -> Spot:
        """Return the place of a handle's target in the view, and its distance."""
        editor = self._editor
        target = editor.chosen.handles[handle].target
        return editor.derived.spot(editor.opened, editor.current, target)

    def line(self, handle: int) -> tuple[F64, F64]:
        """A handle's target (3,) and the surface's normal (3,) there, both world."""
        editor = self._editor
        own = editor.chosen.handles[handle]
        place = editor.derived.world(editor.opened, editor.current, own.target)
        return place, editor.cache.facts.normal_at(editor.opened, editor.current, own.point)

    def turn_of(self, handle: int) -> F64:
        """The rotation vector (3,) of a handle, object frame: its own, or as it comes."""
        editor = self._editor
        own, pose = editor.chosen.handles[handle], editor.chosen.pose
        return turn_at(pose, own.control_point) if own.turn is None else own.turn

    def forget(self) -> None:
        """The document is closed."""
        self._solved = self._restless = None

    @property
    def is_restless(self) -> bool:
        """Whether the previewed pose still moves towards its rest."""
        return self._restless is not None and self._restless is self._editor.preview

    # Selecting

    @property
    def selected(self) -> tuple[int, ...]:
        """The handles that keys and fields change, in the order in which they were selected."""
        thing = self._editor.object
        count = 0 if thing is None else len(thing.handles)
        return tuple(h for h in self._selected if h < count)

    @property
    def handle(self) -> int | None:
        """The handle that was selected last."""
        return self.selected[-1] if self.selected else None

    def select(self, *handles: int | None) -> None:
        """These handles, the last of them the current one; None is no handle."""
        self._selected = tuple(dict.fromkeys(h for h in handles if h is not None))

    def toggle(self, handle: int) -> None:
        """Adds a handle to the selection, or takes it out."""
        others = tuple(h for h in self.selected if h != handle)
        self.select(*(others if handle in self.selected else (*others, handle)))

    def select_all(self) -> None:
        thing = self._editor.object
        self.select(*range(len(thing.handles) if thing else 0))

    def select_box(self, low: np.ndarray, high: np.ndarray, is_added: bool) -> None:
        """The handles seen between two corners (2,) image px; added to the others or instead."""
        positions = self.positions()
        inside = np.flatnonzero(((positions >= low) & (positions <= high)).all(1)).tolist()
        self.select(*(self.selected if is_added else ()), *inside)

    def follow(self, before: EditObject | None) -> None:
        """After a step back or forth: the handles that were selected, by what they are on."""
        now, there = self._editor.object, {}
        if before is not None and now is not None and now.lifted is before.lifted:
            own = {handle.control_point: h for h, handle in enumerate(now.handles)}
            there = {h: own.get(handle.control_point) for h, handle in enumerate(before.handles)}
        self.select(*(there.get(h) for h in self._selected))

    def forget_lost(self) -> None:
        """Deselects what the document does not have any more."""
        self._selected = self.selected

    # Strokes

    def start_handle(
        self, canvas_xy: np.ndarray, is_pin: bool, is_added: bool = False
    ) -> int | None:
        """Previews a new handle on the surface; its index, or None beside the object.

        It holds what is there as it is, and is selected instead of the others, or with them.
        """
        editor = self._editor
        seen = self.surface_at(canvas_xy)
        if seen is None or editor.document is None or editor.object is None:
            return None
        k, item = editor.current, editor.object
        assert item.lifted is not None
        others = self.selected if is_added else ()
        nearest = edits.nearest_control_point(item.lifted, seen.rest)
        for h, other in enumerate(item.handles):
            if other.control_point == nearest:  # one control point, one handle
                self.select(*others, h)
                editor.preview = editor.document
                return h
        if item.rig.is_held(nearest):
            editor.say(_frozen())
            return None
        target = editor.derived.unplaced(editor.document, k, seen.world)
        added = len(item.handles)
        changed = edits.add_handle(editor.document, k, seen.rest, target, is_pin)
        changed = editor.derived.held(changed, k, (added,))
        changed = self.mirroring.followed(changed, (added,))
        self.hold(changed, tuple(range(added, len(changed.objects[k].handles))))
        self.select(*others, added)
        return added

    def pin(self) -> None:
        """A pin where the pointer is, or the handle that it is at becomes one, or none; a step."""
        editor = self._editor
        if editor.pointer is None or editor.document is None or editor.hand.is_busy:
            return
        h, editor.message = editor.hover.handle, None  # what stood in the way does not any more
        if h is not None and editor.object is not None:
            is_pin = not editor.object.handles[h].is_pin
            self.hold(edits.set_pin(editor.document, editor.current, h, is_pin))
            editor.commit(t("Make it a pin") if is_pin else t("Make it a handle"))
        elif self.start_handle(editor.pointer.xy, is_pin=True) is not None:
            editor.commit(t("Add pin"))

    def unpin(self, handle: int) -> None:
        """Previews a pin as a handle: it is dragged."""
        editor = self._editor
        if editor.document is not None:
            changed = edits.set_pin(editor.document, editor.current, handle, False)
            self.hold(self.mirroring.followed(changed, (handle,)), (handle,))

    def let_go(self, handles: tuple[int, ...]) -> None:
        """Previews what is to be dragged without anchors around it, such as a pin may have."""
        editor, k = self._editor, self._editor.current
        if editor.document is not None:
            deformer = editor.derived.deformer(editor.document, k)
            editor.preview = hold_edits.let_go(editor.document, k, deformer, handles)

    def expect_drag(self, handles: tuple[int, ...]) -> None:
        """Prepares the solver for a drag of these handles, which may begin in a moment.

        In a thread: what a change of the handles takes, the first frame of the drag need not
        wait for. A drag that begins earlier waits for the rest of it.
        """
        editor, k, document = self._editor, self._editor.current, self._editor.document
        if document is None:
            return
        deformer = editor.derived.deformer(document, k)
        item = hold_edits.let_go(document, k, deformer, handles).objects[k]
        editor.chores.start(
            "Getting ready", lambda progress: deformer.prepare(item.handles, item.footing),
            kind=EXPECT, done=lambda _: None, failed=editor.complain_of, is_quiet=True,
        )  # fmt: skip

    def drag(self, handle: int, spot: Spot) -> None:
        """Previews the handle at another place of the picture."""
        self.drag_all({handle: spot})

    def drag_all(self, spots: Mapping[int, Spot]) -> None:
        """Previews handles at other places of the picture."""
        editor = self._editor
        if editor.document is None:
            return
        camera = editor.document.photo.camera
        self.move_all({h: camera.unproject(s.xy, s.depth) for h, s in spots.items()})

    def move_all(self, places: Mapping[int, F64]) -> None:
        """Previews handles at other places of the world, (3,) each."""
        editor = self._editor
        changed, k = editor.document, editor.current
        if changed is None or editor.object is None:
            return
        places = {h: place for h, place in places.items() if not self._is_frozen(h)}
        if not places:
            return
        try:
            for h, place in places.items():
                target = editor.derived.unplaced(changed, k, place)
                changed = edits.move_handle(changed, k, h, target)
        except ValueError as error:
            editor.complain(str(error))
            return
        self.change(self.mirroring.followed(changed, tuple(places)))

    def turn(self, handle: int, start: F64, turn: F64) -> None:
        """Previews the handle turned from `start` (3,), object frame, by `turn` (3,), world."""
        editor = self._editor
        if editor.document is None or editor.object is None or self._is_frozen(handle):
            return
        k, document = editor.current, editor.document
        if editor.object.handles[handle].turn is None:  # from now on it is held as it is turned
            document = editor.derived.held(edits.turn_handle(document, k, handle, start), k)
        own = editor.cache.facts.turn_of(document, k).T @ turn
        changed = edits.turn_handle(document, k, handle, turned_by(start, own))
        self.change(self.mirroring.followed(changed, (handle,)))

    def _is_frozen(self, handle: int) -> bool:
        """Whether a handle is on a frozen part, which moves for nobody; says so."""
        thing = self._editor.object
        is_frozen = thing is not None and thing.rig.is_held(thing.handles[handle].control_point)
        if is_frozen:
            self._editor.say(_frozen())
        return is_frozen

    def change(self, changed: Document) -> None:
        """Previews the handles of `changed`, solved for from the pose that is shown."""
        editor, k = self._editor, self._editor.current
        start = editor.chosen.pose or editor.derived.deformer(changed, k).rest()
        solved = editor.derived.solved(changed, k, start, **DRAG)
        editor.preview = self._solved = self._restless = solved

    def hold(self, changed: Document, added: tuple[int, ...] = ()) -> None:
        """Previews `changed`, whose handles, some just `added`, hold the pose that is shown."""
        self._editor.preview = self._editor.derived.held(changed, self._editor.current, added)

    def relax(self) -> None:
        """Goes on with a drag's solve: for a frame in which the pointer holds still."""
        if not self.is_restless:
            return
        editor = self._editor
        document, self._restless = self._restless, None
        assert document is not None
        before = document.objects[editor.current].pose
        after = editor.derived.solved(document, editor.current, before, **REST)
        changed = after.objects[editor.current]
        assert before is not None and changed.pose is not None and changed.lifted is not None
        editor.preview = self._solved = after
        motion = np.abs(changed.pose.points - before.points).max()
        if motion > AT_REST * changed.lifted.diameter:
            self._restless = after

    def settle(self) -> None:
        """Lets the preview's pose come to rest: at the end of a stroke that changed something."""
        editor = self._editor
        preview = editor.preview
        if preview is not None and preview is self._solved and editor.object is not None:
            editor.preview = editor.derived.solved(preview, editor.current, editor.object.pose)
        self._solved = None

    # Steps

    def finish(self, label: str) -> None:
        """Turn the preview into one step."""
        self.settle()
        self._editor.commit(label)

    def nudge(self, dx: float, dy: float, depth: float = 0.0) -> None:
        """Moves the selected handles by image px, and by object diameters away; one step each."""
        if self.selected and not self._editor.hand.is_busy:
            delta = np.array([dx, dy])
            self.drag_all({h: self.spot(h).moved(delta, depth) for h in self.selected})
            self.finish(t("Nudge point"))

    def remove(self, handle: int | None = None) -> None:
        """Removes a handle, or all selected ones; the object stays as it is."""
        editor = self._editor
        gone = self.selected if handle is None else (handle,)
        if not gone or editor.document is None or editor.object is None or editor.hand.is_busy:
            return
        is_pin = all(editor.object.handles[h].is_pin for h in gone)
        label = t("Remove pin") if is_pin else t("Remove handle")
        if len(gone) > 1:
            label = t("Remove {count} handles", count=len(gone))
        changed = editor.document
        for h in sorted(gone, reverse=True):
            changed = edits.remove_handle(changed, editor.current, h)
        left = [h for h in self.selected if h not in gone]
        self.select(*(h - sum(g < h for g in gone) for h in left))
        editor.apply(label, editor.derived.held(changed, editor.current))

    def send_back(self, handles: tuple[int, ...], label: str) -> None:
        """These handles to where their points were in the photo; all but pins free to turn.

        With all of them the object is back, whatever was done to it before.
        """
        editor = self._editor
        if editor.document is None or editor.object is None or not handles:
            return
        changed, k = editor.document, editor.current
        for h in handles:
            own = editor.object.handles[h]
            changed = edits.move_handle(changed, k, h, own.point)
            changed = edits.turn_handle(changed, k, h, np.zeros(3) if own.is_pin else None)
        changed = self.mirroring.followed(changed, handles)
        if len(set(handles)) == len(changed.objects[k].handles):
            changed = edits.forget_base(changed, k)
        editor.apply(label, editor.derived.solved(changed, k, None))

    def set_stays(self, stays: Stays) -> None:
        """Set the part of the object that stays by itself; the picture stays as it is."""
        editor, k = self._editor, self._editor.current
        if editor.document is not None and editor.is_lifted:
            deformer = editor.derived.deformer(editor.document, k)
            changed = hold_edits.set_stays(editor.document, k, deformer, stays)
            editor.apply(t("What stays"), changed)

    def reset(self) -> None:
        """The object's shape as it was in the photo, without handles."""
        editor = self._editor
        document, thing = editor.document, editor.object
        if document is None or thing is None or not (thing.handles or thing.pose):
            return
        self.select(None)
        editor.apply(t("Reset pose"), edits.reset_pose(document, editor.current))


def _frozen() -> str:
    return t("This part is frozen: erase that with the Freeze brush before moving it")


# The current handle in numbers, for fields that are dragged and typed into.

SIGHT = np.array([0.0, 0.0, 1.0])  # world, into the picture


@dataclass(frozen=True)
class Numbers:
    """The numbers of one handle."""

    x: float  # image px
    y: float
    depth: float  # object diameters, farther away than at rest
    turn: float  # degrees about the line of sight, clockwise
    softness: float
    is_pin: bool
    is_free: bool  # it turns as the object does
    rest: tuple[float, float]  # image px, where its point was


class HandleNumbers:
    """The numbers of the handle selected last, a preview until `finish` makes them a step."""

    def __init__(self, editor: EditorState, posing: Posing) -> None:
        self._editor = editor
        self._posing = posing
        self._read: tuple[Document, int, int, Numbers] | None = None  # of what, and what it was

    def read(self) -> Numbers | None:
        """Return them: the panel asks for them, and the ring."""
        editor = self._editor
        h, k = self._posing.handle, editor.current
        if h is None or editor.object is None or editor.document is None:
            return None
        last = self._read
        if last is None or last[0] is not editor.document or last[1:3] != (k, h):
            self._read = last = editor.document, k, h, self._read_anew(editor.document, h)
        return last[3]

    def _read_anew(self, document: Document, h: int) -> Numbers:
        editor = self._editor
        handle, spot = editor.chosen.handles[h], self._posing.spot(h)
        rest = editor.derived.spot(document, editor.current, handle.point)
        return Numbers(
            float(spot.xy[0]), float(spot.xy[1]), (spot.depth - rest.depth) / spot.diameter,
            np.degrees(self._roll(h)), handle.softness, handle.is_pin, handle.turn is None,
            (float(rest.xy[0]), float(rest.xy[1])),
        )  # fmt: skip

    def _roll(self, h: int) -> float:
        """Radians about the line of sight."""
        editor = self._editor
        turn = editor.cache.facts.turn_of(editor.opened, editor.current)
        return turn_about(turn @ self._posing.turn_of(h), SIGHT)

    def move(self, x: float, y: float, depth: float) -> None:
        """Previews the handle at image px, so many diameters farther than at rest."""
        editor = self._editor
        point = editor.chosen.handles[self._handle].point
        rest = editor.derived.spot(editor.opened, editor.current, point)
        there = rest.moved(np.zeros(2), depth)
        self._posing.drag(self._handle, replace(there, xy=np.array([x, y])))

    def turn(self, degrees: float) -> None:
        """Previews the handle turned so far about the line of sight."""
        more = np.radians(degrees) - self._roll(self._handle)
        self._posing.turn(self._handle, self._posing.turn_of(self._handle), more * SIGHT)

    def soften(self, softness: float) -> None:
        """Previews the handle giving way from now on: 0 = not at all."""
        self._hold(edits.soften_handle, softness)

    def set_free(self, is_free: bool) -> None:
        """Whether it turns as the object does, or stays as it is turned now; one step."""
        self._hold(edits.turn_handle, None if is_free else self._posing.turn_of(self._handle))
        self._posing.finish(t("Free handle's turn") if is_free else t("Hold handle's turn"))

    def set_pin(self, is_pin: bool) -> None:
        """A pin holds, a handle is dragged; one step."""
        self._hold(edits.set_pin, is_pin)
        self._posing.finish(t("Make it a pin") if is_pin else t("Make it a handle"))

    @property
    def _handle(self) -> int:
        """The handle, for whatever is done only where its numbers are shown."""
        assert self._posing.handle is not None
        return self._posing.handle

    def _hold(self, edit: Callable[..., Document], value: object) -> None:
        """Previews the handle after an edit of it."""
        editor = self._editor
        self._posing.hold(edit(editor.opened, editor.current, self._handle, value))
