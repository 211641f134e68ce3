"""Random sessions of an artist: the program changes nothing that the artist did not touch.

In each one the ball is posed, placed, retouched and duplicated in any order. What only chooses or
holds leaves the picture as it is; a refined outline leaves pose, place, handles and paint; and the
edited picture stays on screen whatever is chosen. A few are played here, more by `make sessions`.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from editor_steps import CENTRE, RADII, wait_until
from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import Painted, PoseView, Selecting, ToolName
from objectmorpher.gui.window.scenes import build_scene
from objectmorpher.tools.brush_tools import MaskTool
from objectmorpher.tools.pointer import Button, Pointer
from objectmorpher.tools.pose_tool import PoseTool
from objectmorpher_core.base.arrays import crop
from objectmorpher_core.base.brush import Brush
from objectmorpher_core.document.hold_edits import Stays
from objectmorpher_core.document.model import Document, EditObject, Placement
from strokes import stroke

SESSIONS = int(os.environ.get("SESSIONS", "3"))
ACTIONS = 9
SHOWN = 500 / (2 * RADII[1])  # x: the ball as an object that is 500 px large
SAME = 0.05  # px of it
POSE = PoseTool()
SIDES = (ToolName.SELECT, ToolName.MASK, ToolName.POSE, ToolName.PLACE, ToolName.COMPOSE)


def test_nothing_changes_that_was_not_touched(editor: Editor, ball: Document) -> None:
    for seed in range(SESSIONS):
        try:
            Artist(editor, ball, seed).work()
        except BaseException as error:
            error.add_note(f"session {seed}")
            raise


@dataclass
class Artist:
    """Somebody at work on a retouched photo of the lifted ball."""

    editor: Editor
    ball: Document
    seed: int

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(self.seed)
        self.editor.view.selecting, self.editor.view.pose = Selecting(), PoseView()
        self.editor.view.brush = Brush(6.0, 1.0)
        plate = self.ball.plate
        assert plate is not None
        painted = np.zeros(plate.hole.shape, bool)
        painted[:3, :3] = True  # a corner, which no outline reaches
        x, y = plate.left, plate.top
        self.corner = (x, y, x + 3, y + 3)
        self.editor.start(replace(self.ball, plate=replace(plate, painted=painted)))
        self.did: list[str] = []

    def work(self) -> None:
        """Changes that may move things first; then each action, and what it left as it was."""
        self.place()
        self.drag()
        acts = (self.add, self.pin, self.soften, self.remove, self.turn_into, self.stay, self.touch,
                self.choose, self.drag, self.place, self.copy, self.back, self.refine)  # fmt: skip
        for act in self.random.permutation(np.array(acts, object))[:ACTIONS]:
            self.did.append(act.__name__)
            try:
                act()
                self.see()
            except BaseException as error:
                error.add_note(f"after {', '.join(self.did)}")
                raise

    # What changes the picture

    def place(self) -> None:
        move = self.random.uniform(-25, 25, 2)
        yaw, pitch, roll = (float(angle) for angle in self.random.uniform(-20, 20, 3))
        there = Placement((float(move[0]), float(move[1])), 0.1, (yaw, pitch, roll), 1.05)
        self.editor.placing.move_to(there)
        self.editor.commit("Move object")

    def drag(self) -> None:
        place = self.somewhere()
        if place is not None:
            self.pose(place, place + self.random.uniform(-30, 30, 2))

    def copy(self) -> None:
        if self.item_count() < 3:
            run(self.editor, "duplicate")

    # What does not

    def add(self) -> None:
        self.quietly(self.somewhere())

    def pin(self) -> None:
        self.quietly(self.somewhere(), alt=True)

    def touch(self) -> None:
        """A drag of a handle that ends where it began."""
        positions = self.editor.posing.positions()
        if len(positions):
            at = self.editor.view.canvas_from_image(positions[self.some(len(positions))])
            before = self.places()
            self.pose(at, at + 9.0, at)
            self.is_unmoved(before)

    def quietly(self, place: np.ndarray | None, alt: bool = False) -> None:
        before = self.places()
        if place is not None:
            self.pose(place, alt=alt)
        self.is_unmoved(before)

    def remove(self) -> None:
        before, positions = self.places(), self.editor.posing.positions()
        if len(positions):
            at = self.editor.view.canvas_from_image(positions[self.some(len(positions))])
            self.pose(at, button=Button.RIGHT)
        self.is_unmoved(before)

    def soften(self) -> None:
        if self.handle():
            before = self.places()
            self.editor.handle_numbers.soften(float(self.random.choice([0.0, 0.4, 2.0])))
            self.editor.posing.finish("Soften handle")
            self.is_unmoved(before)

    def turn_into(self) -> None:
        """A pin into a handle, a handle into a pin; one that turns freely or not."""
        if self.handle():
            before, numbers = self.places(), self.editor.handle_numbers.read()
            assert numbers is not None
            if self.random.random() < 0.5:
                self.editor.handle_numbers.set_pin(not numbers.is_pin)
            else:
                self.editor.handle_numbers.set_free(not numbers.is_free)
            self.is_unmoved(before)

    def stay(self) -> None:
        before = self.places()
        self.editor.posing.set_stays(list(Stays)[self.some(3)])
        self.is_unmoved(before)

    def choose(self) -> None:
        """Objects, tools, handles, another object that is not there yet."""
        editor, before, committed = self.editor, self.places(), self.editor.committed
        for _ in range(4):
            match self.some(4):
                case 0:
                    editor.objects.choose(self.some(self.item_count()))
                case 1:
                    editor.objects.start_another()
                case 2:
                    editor.choose_tool(SIDES[self.some(len(SIDES))])
                case 3:
                    editor.posing.select_all()
            self.see()
        assert editor.committed is committed
        self.is_unmoved(before)
        editor.objects.choose(0)

    def back(self) -> None:
        """Undone and done again, it is the same edit."""
        before = self.editor.committed
        run(self.editor, "undo")
        run(self.editor, "redo")
        assert self.editor.committed is before

    def refine(self) -> None:
        """A dab on the outline, where it is seen now."""
        editor = self.editor
        editor.current = 0
        old, before, paint = self.item(), editor.committed, self.paint()
        assert old.mask is not None and before is not None
        angle = self.random.uniform(0, 2 * np.pi)
        rim = np.array(CENTRE) + 0.97 * np.array(RADII) * (np.cos(angle), np.sin(angle))
        seen = editor.derived.carried(before, 0, rim[None])[0]
        editor.view.tool, editor.view.selecting.painted = ToolName.MASK, Painted.SELECTION
        self.see()
        at = editor.view.canvas_from_image(seen)
        stroke(editor, MaskTool(), at, alt=bool(self.some(2)))
        wait_until(editor, lambda: self.item().shaped is None)
        assert editor.message is None or not editor.message.is_error, editor.message
        is_kept(before, old, self.item(), editor)
        np.testing.assert_array_equal(self.paint(), paint)
        editor.choose_tool(ToolName.POSE)

    # What is looked at

    def see(self) -> None:
        """The canvas shows the edit: its background, and each object that was moved."""
        document = self.editor.document
        assert document is not None
        scene = build_scene(self.editor, "tiles")
        moved = [o for o in document.objects if o.is_moved]
        assert scene is not None and scene.plate is not None and scene.blend is not None
        assert scene.veil == 0 and scene.paper is None
        assert len(scene.layers) >= len(moved) and not self.editor.view.is_before

    def places(self) -> list[np.ndarray]:
        """(N, 2) px where each object's surface is seen."""
        document = self.editor.document
        assert document is not None
        camera = document.photo.camera
        found = []
        for k in range(len(document.objects)):
            means = self.editor.derived.posed(document, k).means
            found.append(camera.project(means) * SHOWN)
        return found

    def is_unmoved(self, before: list[np.ndarray]) -> None:
        self.editor.poll()
        for was, now in zip(before, self.places(), strict=True):
            assert np.abs(now - was).max() <= SAME

    # Where and what

    def item_count(self) -> int:
        assert self.editor.document is not None
        return len(self.editor.document.objects)

    def item(self) -> EditObject:
        assert self.editor.document is not None
        return self.editor.document.objects[0]

    def paint(self) -> np.ndarray:
        """The repaired corner."""
        assert self.editor.document is not None and self.editor.document.plate is not None
        plate = self.editor.document.plate
        assert plate.painted is not None
        box = self.corner
        pixels = crop(plate.pixels, plate.box, box)
        return np.dstack([pixels, crop(plate.painted, plate.box, box)])

    def some(self, count: int) -> int:
        return int(self.random.integers(count))

    def somewhere(self) -> np.ndarray | None:
        """Canvas px on the object's surface that is seen, away from its handles."""
        editor = self.editor
        editor.choose_tool(ToolName.POSE)
        assert editor.document is not None
        inner = np.array(CENTRE) + self.random.uniform(-0.6, 0.6, (1, 2)) * RADII
        seen = editor.derived.carried(editor.document, editor.current, inner)[0]
        at = editor.view.canvas_from_image(seen)
        pointer = Pointer(*at)
        if editor.posing.surface_at(at) is None or POSE.handle_at(editor, pointer) is not None:
            return None
        if POSE.is_on_ring(editor, pointer) or editor.objects.other_at(at) is not None:
            return None
        return at

    def handle(self) -> bool:
        """Selects one, if there is any."""
        self.editor.choose_tool(ToolName.POSE)
        count = len(self.editor.posing.positions())
        if count:
            self.editor.posing.select(self.some(count))
        return count > 0

    def pose(self, *places: np.ndarray, button: Button = Button.LEFT, alt: bool = False) -> None:
        self.editor.choose_tool(ToolName.POSE)
        stroke(self.editor, POSE, *places, button=button, alt=alt)


def is_kept(before: Document, old: EditObject, new: EditObject, editor: Editor) -> None:
    """Pose, place and handles of what is still there."""
    assert old.lifted is not None and new.lifted is not None and editor.document is not None
    camera = before.photo.camera
    was_placed, is_placed = (
        placement.matrix(lifted, camera)
        for placement, lifted in ((old.placement, old.lifted), (new.placement, new.lifted))
    )
    np.testing.assert_allclose(was_placed, is_placed, atol=1e-9)
    known = {tuple(h.point): h for h in old.handles}
    for handle in new.handles:  # on what they hold, which a soft one has not taken to its target
        own = known[tuple(handle.point)]
        assert (own.is_pin, own.softness) == (handle.is_pin, handle.softness)
        if own.softness == 0:
            reach = 500 / old.lifted.diameter
            assert np.abs(own.target - handle.target).max() * reach <= 1.0
    found = KDTree(new.lifted.gaussians.means).query(old.lifted.gaussians.means)
    gaps, same = map(np.asarray, found)
    still = gaps == 0
    assert still.mean() > 0.7
    was = camera.project(editor.derived.posed(before, 0).means[still])
    now = camera.project(editor.derived.posed(editor.document, 0).means[same[still]])
    moved = np.hypot(*(was - now).T) * SHOWN
    assert np.quantile(moved, 0.9) <= SAME and moved.max() < 5.0, np.quantile(moved, [0.9, 1])
