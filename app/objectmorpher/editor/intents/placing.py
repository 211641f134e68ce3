"""The whole object somewhere else in the photo."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.rotations import CAMERA_GIMBAL, Gimbal
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, LiftedObject, Placement
from objectmorpher_core.document.placement import (
    Ground,
    HeldPoint,
    centre_of,
    down_of,
    foot_of,
    gimbal_of,
    scaled,
    set_seen_from,
    turned,
    with_centre,
)
from objectmorpher_core.document.visitor_edits import ground_for

from ...canvas.derived import ObjectFrame
from ...system.texts import t

if TYPE_CHECKING:
    from ..state import EditorState
    from .posing import Posing


# x the camera's height above the ground, of the camera above an object's middle: with less, the
# foot slides by more than four times as many px as the middle.
LEAST_HEIGHT = 0.25


class Placing:
    """The current object's placement."""

    def __init__(self, editor: EditorState, posing: Posing) -> None:
        self._editor = editor
        self._posing = posing

    @property
    def placement(self) -> Placement | None:
        editor = self._editor
        return editor.object.placement if editor.is_lifted and editor.object else None

    @property
    def home(self) -> Placement:
        """Where the current object was in the photo; one of another photo where it came in."""
        thing = self._editor.object
        origin = None if thing is None or thing.lifted is None else thing.lifted.origin
        return Placement() if origin is None or origin.home is None else origin.home

    def frame(self) -> ObjectFrame | None:
        """The object's outline box in the picture."""
        editor = self._editor
        if editor.document is None or not editor.is_lifted:
            return None
        return editor.derived.frame(editor.document, editor.current)

    @property
    def gimbal(self) -> Gimbal:
        """The axes about which the current object turns; the camera's where nothing is lifted."""
        document, thing = self._editor.document, self._editor.object
        if document is None or thing is None:
            return CAMERA_GIMBAL
        return gimbal_of(thing, document)

    @property
    def seen_from(self) -> float:
        """From how many degrees above one looks down on the current object, at rest."""
        thing = self._editor.object
        told = None if thing is None else thing.seen_from
        return self.usual_seen_from if told is None else told

    @property
    def usual_seen_from(self) -> float:
        """The same, as it is seen to stand, whatever the artist says."""
        document, k = self._editor.document, self._editor.current
        assert document is not None and document.objects[k].lifted is not None
        document = set_seen_from(document, k, None)
        thing = document.objects[k]
        assert thing.lifted is not None
        way = thing.lifted.centre / np.linalg.norm(thing.lifted.centre)
        down = gimbal_of(thing, document).down
        return float(np.degrees(np.arcsin(np.clip(way @ down, 0.0, 1.0))))

    def look_down(self, degrees: float | None) -> None:
        """Previews the current object as seen from so many degrees above; None: as it stands."""
        editor = self._editor
        if editor.committed is not None and editor.is_lifted:
            changed = set_seen_from(editor.committed, editor.current, degrees)
            editor.preview = self._on_new_ground(changed)

    @property
    def angles(self) -> tuple[float, float, float]:
        """Yaw, pitch and roll of the current object, degrees, about its own axes."""
        placement = self.placement
        return (0.0, 0.0, 0.0) if placement is None else self.gimbal.of(placement.turn)

    def turned_to(self, start: Placement, angles: tuple[float, float, float]) -> Placement:
        """`start` with other angles about the object's own axes, degrees."""
        return self.turned(start, self.gimbal.turn(angles))

    def centre(self) -> np.ndarray:
        """(3,) world: the object's middle, about which its rings lie and a hand rolls it."""
        document, thing = self._editor.opened, self._editor.chosen
        assert thing.lifted is not None
        return centre_of(thing.placement, thing.lifted, document.photo.camera)

    # Holding it

    def hold(self, canvas_xy: np.ndarray | None = None) -> HeldPoint:
        """The object held by its surface at canvas px, or by its centre; on the ground by what
        it stands on."""
        document, thing = self._editor.opened, self._editor.chosen
        assert thing.lifted is not None
        camera, lifted, placement = document.photo.camera, thing.lifted, thing.placement
        ground = self.ground
        if ground is not None:
            placement = self.stood(placement)
            centre = centre_of(placement, lifted, camera)
            contact = ground.lowest(centre + self._offsets(placement))
            return HeldPoint(placement, lifted, camera, contact, ground)
        seen = None if canvas_xy is None else self._posing.surface_at(canvas_xy)
        point = self.centre() if seen is None else seen.world
        return HeldPoint(placement, lifted, camera, np.asarray(point, np.float64))

    def move_to(self, placement: Placement) -> None:
        """Previews the whole object elsewhere."""
        editor = self._editor
        if editor.committed is None or not editor.is_lifted:
            return
        try:
            editor.preview = edits.set_placement(editor.committed, editor.current, placement)
        except ValueError as error:
            editor.preview = None
            editor.complain(str(error))

    def move_away(self, depth: float) -> None:
        """Previews the object at a depth, in diameters from where it was; on the ground it slides
        there."""
        placement = self.placement
        if placement is None:
            return
        if self.ground is None:
            self.move_to(replace(placement, depth=depth))
        else:
            self.move_to(self.hold().moved(np.zeros(2), depth - placement.depth))

    def move_down(self, down: float) -> None:
        """Previews the object with its middle so many image px below where it was in the photo; on
        the ground it slides there, and the middle is where the ground lets it be."""
        placement, ground = self.placement, self.ground
        if placement is None:
            return
        delta = np.array([0.0, down - placement.move[1]])
        if ground is None:
            self.move_to(replace(placement, move=(placement.move[0], down)))
            return
        # The middle slides on a plane of its own, unless that is seen too much from its side.
        held, centre = self.hold(), self.centre()
        height = float(centre @ ground.normal)
        if height >= LEAST_HEIGHT * ground.height:
            held = replace(held, point=centre, ground=Ground(ground.normal, height))
        self.move_to(held.moved(delta))

    # The ground

    @property
    def horizon(self) -> float:
        """Px, the row of the photo that the horizon is in."""
        document = self._editor.opened
        return document.photo.size[1] / 2 if document.horizon is None else document.horizon

    @property
    def needs_horizon(self) -> bool:
        """Whether nothing but the horizon says how the ground of the current object lies."""
        document, thing = self._editor.document, self._editor.object
        if document is None or thing is None or thing.lifted is None:
            return False
        return down_of(thing, document) is None

    @property
    def is_grounded(self) -> bool:
        """Whether moving the current object slides it over the ground."""
        return self._editor.object is not None and self._editor.object.is_grounded

    @property
    def ground(self) -> Ground | None:
        """Return the ground for the object to stand on; None where it need not or cannot stand."""
        return self._find_ground()[0] if self.is_grounded else None

    @property
    def why_no_ground(self) -> str | None:
        """Why the object cannot stand on the ground, if it cannot."""
        return self._find_ground()[1]

    def _find_ground(self) -> tuple[Ground | None, str | None]:
        document, thing = self._editor.document, self._editor.object
        if document is None or thing is None or thing.lifted is None:
            return None, self._editor.why_no_shape
        if (ground := ground_for(document, thing)) is not None:
            return ground, None
        return None, t("The object's lowest point is above the horizon, so it cannot stand")

    def stood(self, placement: Placement) -> Placement:
        """`placement`, moved up or down so that the object stands on the ground, if it is to."""
        document, thing, ground = self._editor.document, self._editor.object, self.ground
        if ground is None or document is None or thing is None or thing.lifted is None:
            return placement
        camera = document.photo.camera
        try:
            centre = centre_of(placement, thing.lifted, camera)
        except ValueError:  # behind the camera, as `move_to` will say
            return placement
        standing = ground.stood(centre, self._offsets(placement))
        return with_centre(placement, standing, thing.lifted, camera)

    def turned(self, start: Placement, turn: tuple[float, float, float]) -> Placement:
        """`start` with another turn, about the object's foot or its middle."""
        try:
            changed = turned(start, turn, *self._standing())
        except ValueError:  # behind the camera, as `move_to` will say
            changed = replace(start, turn=turn)
        return self.stood(changed)

    def rolled(self, start: Placement, turn: tuple[float, float, float]) -> Placement:
        """`start` with another turn, about the object's middle, as a ball in the hand."""
        return self.stood(replace(start, turn=turn))

    def scaled(self, start: Placement, scale: float) -> Placement:
        """`start` with another scale, about the object's foot where it stands."""
        try:
            changed = scaled(start, scale, *self._standing())
        except ValueError:  # likewise
            changed = replace(start, scale=scale)
        return self.stood(changed)

    def pivot(self) -> np.ndarray:
        """(3,) world: what stays while the object grows; its foot where it stands."""
        assert self.placement is not None
        return foot_of(self.placement, *self._standing())

    def _standing(self) -> tuple[np.ndarray, LiftedObject, Camera, np.ndarray]:
        """The object's points (N, 3) world at rest, itself, the camera, and what is down there."""
        document, thing = self._editor.opened, self._editor.chosen
        assert thing.lifted is not None
        own = self._editor.derived.body_points(document, self._editor.current)
        points = thing.lifted.world_points(own)
        return points, thing.lifted, document.photo.camera, self.gimbal.down

    def _offsets(
        self, placement: Placement, document: Document | None = None, k: int | None = None
    ) -> np.ndarray:
        """(N, 3) world: where an object's Gaussians are from its centre, turned and scaled.

        Of object `k` in `document`, by default of the current one as it is shown.
        """
        document = self._editor.opened if document is None else document
        k = self._editor.current if k is None else k
        lifted = document.objects[k].lifted
        assert lifted is not None
        rest = replace(placement, move=(0.0, 0.0), depth=0.0)
        linear = rest.matrix(lifted, document.photo.camera)[:3, :3]
        points = self._editor.derived.body_points(document, k)
        return (lifted.world_points(points) - lifted.centre) @ linear.T

    def toggle_ground(self) -> None:
        """The object slides over the ground while it is moved, or not any more; one step."""
        editor = self._editor
        if editor.document is None or not editor.is_lifted or editor.hand.is_busy:
            return
        is_on = not self.is_grounded
        label = t("Move along the ground") if is_on else t("Move freely")
        editor.apply(label, edits.set_grounded(editor.document, editor.current, is_on))
        self.say_why_no_ground()

    def say_why_no_ground(self) -> None:
        reason = self.why_no_ground
        if self.is_grounded and reason is not None:
            self._editor.say(reason)

    def drag_horizon(self, row: float) -> None:
        """Previews the horizon in another row of the photo, px."""
        editor = self._editor
        if editor.committed is not None:
            editor.preview = self._on_new_ground(edits.set_horizon(editor.committed, row))

    def _on_new_ground(self, changed: Document) -> Document:
        """`changed`, in which the ground lies differently: what slides over it is still on it,
        and seen where it was."""
        before, camera = self._editor.committed, changed.photo.camera
        assert before is not None
        for k, item in enumerate(changed.objects):
            if item.lifted is None or not item.is_grounded or item.is_locked:
                continue
            ground, was = ground_for(changed, item), ground_for(before, before.objects[k])
            is_same = was is not None and ground is not None and was.is_as(ground)
            if ground is None or is_same or item.placement.is_identity:
                continue
            try:
                centre = centre_of(item.placement, item.lifted, camera)
                contact = ground.lowest(centre + self._offsets(item.placement, changed, k))
                held = HeldPoint(item.placement, item.lifted, camera, contact, ground)
                changed = edits.set_placement(changed, k, held.moved(np.zeros(2)))
            except ValueError:  # behind the camera: it stays where it is
                continue
        return changed

    # Steps

    def nudge(self, dx: float, dy: float, depth: float = 0.0) -> None:
        """Moves the object by image px, and by its diameters away; one step each."""
        editor = self._editor
        if self.placement is not None and not editor.hand.is_busy:
            self.move_to(self.hold().moved(np.array([dx, dy]), depth))
            editor.commit(t("Nudge object"))

    def reset(self) -> None:
        """Back to where it was in the photo, or where it came into it."""
        if self.placement is not None and self.placement != self.home:
            self.move_to(self.home)
            self._editor.commit(t("Back to where it was"))

    def reset_position(self) -> None:
        """Back there as large and as turned as it is; what is to stand on the ground stands."""
        home = self.home

        def moved_back(placement: Placement) -> Placement:
            back = replace(placement, move=home.move, depth=home.depth)
            return back if back == home else self.stood(back)

        self._reset(t("Reset position"), moved_back)

    def reset_turn(self) -> None:
        self._reset(t("Reset turn"), lambda p: self.turned(p, (0.0, 0.0, 0.0)))

    def reset_size(self) -> None:
        self._reset(t("Reset size"), lambda p: self.scaled(p, self.home.scale))

    def _reset(self, label: str, change: Callable[[Placement], Placement]) -> None:
        placement = self.placement
        if placement is not None and (changed := change(placement)) != placement:
            self.move_to(changed)
            self._editor.commit(label)
