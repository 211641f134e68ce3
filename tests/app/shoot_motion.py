"""How many pictures of the window differ from the last one after each action.

`python tests/app/shoot_motion.py full|reduced` needs a display; it prints a JSON of counts, one
for each action: of the pictures from the second on, which differ from the one before.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from objectmorpher.cli.options import WindowOptions
from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import Popup, StatusMessage, ToolName
from objectmorpher.gui.window.glfw_window import open_window
from objectmorpher.gui.window.window import Window
from shoot_views import made_document

SIZE = (900, 640)
FRAMES = 12
PAUSE = 0.03  # s: together, three times as long as anything fades
WAKE = 2  # frames: ImGui lays out in them


def show_popup(editor: Editor) -> None:
    editor.view.popup = Popup.PREFERENCES


def hide_popup(editor: Editor) -> None:
    editor.view.popup = None


def say(editor: Editor) -> None:
    editor.message = StatusMessage("Something has happened")


def fall_silent(editor: Editor) -> None:
    editor.message = None


def zoom(editor: Editor) -> None:
    run(editor, "zoom_in")


def change_tool(editor: Editor) -> None:
    editor.view.tool = ToolName.PLACE


def nudge(editor: Editor) -> None:
    editor.placing.nudge(6, 2)


def see_depth(editor: Editor) -> None:
    run(editor, "show_depth")


ACTIONS: tuple[Callable[[Editor], None], ...] = (
    show_popup, hide_popup, say, fall_silent, zoom, change_tool, nudge, see_depth,
)  # fmt: skip


def main() -> None:
    options = WindowOptions(renderer="gl", size=SIZE, scale=1.0)
    window = Window(options, open_window(options))
    editor = window.editor
    editor.settings = replace(editor.settings, motion=sys.argv[1])
    editor.start(made_document())
    editor.view.tool = ToolName.POSE

    def picture() -> np.ndarray:
        window._frame()
        return window._renderer.read(SIZE).copy()

    for _ in range(FRAMES):
        picture()
        time.sleep(PAUSE)
    found = {}
    for act in ACTIONS:
        act(editor)
        for _ in range(WAKE - 1):
            picture()
        before = picture()
        count = 0
        for _ in range(FRAMES):
            time.sleep(PAUSE)
            after = picture()
            count += not np.array_equal(before, after)
            before = after
        found[act.__name__] = count
    print(json.dumps(found))
    window.close()


if __name__ == "__main__":
    main()
