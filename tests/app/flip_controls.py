"""Flips each control of each panel in a real window, and undoes what that changed.

`python tests/app/flip_controls.py` needs a display; it prints one line of JSON for each control and
gesture: where it is, whether it changed the edit, and what was wrong with that, or "".
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from imgui_bundle import imgui

from editor_steps import not_lifted
from objectmorpher.cli.options import WindowOptions
from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import ComposeView, Painted, PoseMode, ToolName
from objectmorpher.gui.window import landmarks
from objectmorpher.gui.window.glfw_window import open_window
from objectmorpher.gui.window.window import Window
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from shoot_views import made_document

SIZE = (560, 1900)  # px: no panel has to be scrolled, and the picture is small
PANEL = 255.0  # px from the left, from where on it is the panel
LAYOUT = 3  # frames, in which ImGui lays out
DRAG = 24.0  # px, to the side
# As "Grow": a shape that follows the selection takes seconds, so the object has none for these.
ALIKE = ("Shrink", "Smooth", "Feather", "Fill holes", "Remove islands")
PATIENCE = 180.0  # s, that the worker may take
# They leave the document: files, another photo, models that would be fetched.
LEFT_ALONE = ("…", "Export", "Undo", "Redo", "Menu:", "Tool:", "Pointer", "Photo", "Refine")

Open = Callable[[Editor], None]


class Flipper:
    """A window, and a hand at its controls."""

    def __init__(self, folder: Path) -> None:
        landmarks._file = str(folder / "landmarks.json")
        options = WindowOptions(renderer="tiles", size=SIZE, scale=1.0)
        self._window = Window(options, open_window(options))
        imgui.get_io().mouse_double_click_time = 0.0  # however fast one gesture follows another
        self.editor = self._window.editor
        self.editor.settings = replace(self.editor.settings, motion="reduced", gaussians=2500)
        self._document = worked_on(made_document())

    def close(self) -> None:
        self._window.close()

    def open(self, unfold: Open, is_lifted: bool = True) -> None:
        """Begin anew with the document; `unfold` shows the controls."""
        editor = self.editor
        editor.view.popup, editor.filing.wanted, editor.message = None, None, None
        editor.start(self._document if is_lifted else not_lifted(self._document))
        editor.current, editor.view.compose = 0, ComposeView()
        editor.view.selecting.painted, editor.view.pose.mode = Painted.SELECTION, PoseMode.DRAG
        editor.view.wants_panel = True
        self._point(2.0, SIZE[1] - 2.0)
        unfold(editor)
        if not is_lifted:
            self.settle()  # its background is that of no object now

    def settle(self) -> None:
        """Frames until nothing runs."""
        end = time.monotonic() + PATIENCE
        self.frames(1)
        while self.editor.poll() or not (self.editor.jobs.is_idle and self.editor.chores.is_idle):
            time.sleep(0.01)
            if time.monotonic() > end:
                raise TimeoutError(f"{self.editor.jobs.current}: {self.editor.message}")

    def frames(self, count: int = LAYOUT) -> None:
        for _ in range(count):
            self._window._frame()

    def labels(self) -> dict[str, tuple[float, float]]:
        """The controls of the panel: px of their middles."""
        self.frames()
        places = json.loads(Path(str(landmarks._file)).read_text(encoding="utf-8"))
        return {
            label: ((x0 + x1) / 2, (y0 + y1) / 2)
            for label, (x0, y0, x1, y1) in places.items()
            if x0 > PANEL and not any(part in label for part in LEFT_ALONE)
        }

    def _point(self, x: float, y: float) -> None:
        """The next frame sees the pointer there."""
        imgui.get_io().add_mouse_pos_event(x, y)

    def _press(self, is_down: bool) -> None:
        """Also when the press is known in the frame that follows."""
        imgui.get_io().add_mouse_button_event(0, is_down)
        self.frames(2)

    def click(self, x: float, y: float) -> None:
        self.drag(x, y, 0.0)

    def drag(self, x: float, y: float, far: float = DRAG) -> None:
        self._point(x, y)
        self.frames(1)
        self._press(True)
        for share in (0.5, 1.0) if far else ():
            self._point(x + share * far, y)
            self.frames(1)
        self._press(False)

    def press_escape(self) -> None:
        """Close what a click has opened."""
        for is_down in (True, False):
            imgui.get_io().add_key_event(imgui.Key.escape, is_down)
            self.frames(1)
        self.settle()


def worked_on(document: Document) -> Document:
    """The club moved, with a copy beside it."""
    document = edits.set_placement(document, 0, Placement(move=(12.0, 0.0), turn=(-30.0, 0.0, 0.0)))
    document = edits.duplicate(document, 0)
    return edits.set_placement(document, 1, Placement(move=(-40.0, 4.0)))


def states() -> Iterator[tuple[str, Open]]:
    """Each tool, and what its controls unfold."""

    def tool(name: ToolName) -> Open:
        return lambda editor: editor.choose_tool(name)

    for name in ToolName:
        yield name.value, tool(name)
    for painted in Painted:

        def paint(editor: Editor, painted: Painted = painted) -> None:
            editor.choose_tool(ToolName.MASK)
            editor.view.selecting.painted = painted

        yield f"{ToolName.MASK.value}, {painted.value}", paint
    for mode in (PoseMode.DRAG, PoseMode.STIFFEN):

        def pose(editor: Editor, mode: PoseMode = mode) -> None:
            editor.choose_tool(ToolName.POSE)
            editor.posing.select(0)
            editor.view.pose.mode = mode

        yield f"pose, {mode.value}", pose

    def compose(editor: Editor) -> None:
        editor.choose_tool(ToolName.COMPOSE)
        assert editor.committed is not None
        document = edits.harmonised(editor.committed, 0)
        shadow = replace(document.objects[0].shadow, strength=0.5)
        editor.start(edits.set_shadow(document, 0, shadow))
        editor.current = 0
        editor.choose_tool(ToolName.COMPOSE)

    yield "compose, unfolded", compose

    def bare(editor: Editor) -> None:
        editor.choose_tool(ToolName.COMPOSE)
        run(editor, "bare")

    yield "compose, background alone", bare


def wrong_with(flipper: Flipper, before: Document) -> str:
    """What a gesture did that one undo does not take back."""
    editor = flipper.editor
    if editor.preview is not None:
        return "a preview is left"
    after, history = editor.committed, editor.history
    assert history is not None
    if after is before:
        return ""
    if history.cursor != 1:
        return f"{history.cursor} steps: {', '.join(history.steps[1:])}"
    run(editor, "undo")
    flipper.settle()
    if editor.committed is not before:
        return "undone, it is another document"
    run(editor, "redo")
    flipper.settle()
    return "" if editor.committed is after else "done again, it is another document"


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        flipper, seen = Flipper(Path(folder)), set[str]()
        for state, unfold in states():
            flipper.open(unfold)
            tool = state.partition(",")[0].lower()
            for label in flipper.labels():
                if {f"{tool}: {label}", f"select: {label}"} & seen:
                    continue
                seen.add(f"{tool}: {label}")
                for row in flipped(flipper, unfold, label):
                    print(json.dumps({"state": state, "label": label, **row}), flush=True)
        flipper.close()


def flipped(flipper: Flipper, unfold: Open, label: str) -> Iterator[dict[str, object]]:
    """A control clicked, and, where that changes nothing, dragged."""
    for gesture in (flipper.click, flipper.drag):
        flipper.open(unfold, is_lifted=label not in ALIKE)
        before, place = flipper.editor.committed, flipper.labels().get(label)
        if before is None or place is None:
            return
        gesture(*place)
        flipper.press_escape()
        is_changed = flipper.editor.committed is not before
        wrong = wrong_with(flipper, before)
        yield {"gesture": gesture.__name__, "changed": is_changed, "wrong": wrong}
        if is_changed:
            return


if __name__ == "__main__":
    sys.exit(main())
