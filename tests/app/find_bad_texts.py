"""Where the window's texts overlap or are cut off, read from what ImGui draws.

`python tests/app/find_bad_texts.py` needs a display; it prints one line of JSON for each bad place,
and nothing where all is well. Arguments: WIDTHxHEIGHTxSCALE, of one window after the other.
"""

from __future__ import annotations

import ctypes
import json
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
from imgui_bundle import imgui

from objectmorpher.cli.options import WindowOptions
from objectmorpher.editor.view import Popup, ToolName
from objectmorpher.gui.window.glfw_window import open_window
from objectmorpher.gui.window.window import Window
from objectmorpher.tools.pointer import Button
from objectmorpher_core.document.model import Document
from shoot_views import made_document

FRAMES = 4  # ImGui lays out in two; fades are off
CUT = 1.5  # px that a letter reaches past what is shown of its window
COVERED = 0.3  # of a letter's own box, by another text's letter
TURNED = 20.0  # canvas px that the pointer turns an object by
SHADOW = 2.5  # px between a letter and its own dark outline
VERTEX = np.dtype([("place", "<f4", 2), ("uv", "<f4", 2), ("color", "<u4")])


def glyphs(draw: imgui.ImDrawList, atlas: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """For each command: the boxes (N, 4) of its letters, and what is shown (4,), x0, y0, x1, y1."""
    count = draw.vtx_buffer.size()
    if not count:
        return
    raw = (ctypes.c_char * (count * VERTEX.itemsize)).from_address(draw.vtx_buffer.data_address())
    vertices = np.frombuffer(bytes(raw), VERTEX)
    kind = {2: np.uint16, 4: np.uint32}[imgui.INDEX_SIZE]
    size = draw.idx_buffer.size() * imgui.INDEX_SIZE
    raw = (ctypes.c_char * size).from_address(draw.idx_buffer.data_address())
    indices = np.frombuffer(bytes(raw), kind).astype(int)
    for command in draw.cmd_buffer:
        if command.get_tex_id() != atlas:
            continue
        own = indices[command.idx_offset : command.idx_offset + command.elem_count]
        own = own[: len(own) // 3 * 3].reshape(-1, 3) + command.vtx_offset
        # A letter is two triangles: a, a + 1, a + 2 and a, a + 2, a + 3, of different places in
        # the atlas.
        pairs = [
            one[0]
            for one, other in pairwise(own)
            if tuple(one - one[0]) == (0, 1, 2) and tuple(other - one[0]) == (0, 2, 3)
        ]
        corners = np.array([vertices[a : a + 4]["uv"] for a in pairs]).reshape(-1, 4, 2)
        places = np.array([vertices[a : a + 4]["place"] for a in pairs]).reshape(-1, 4, 2)
        low, high = corners[:, 0], corners[:, 2]
        is_upright = (corners[:, 1] == np.stack([high[:, 0], low[:, 1]], 1)).all(1)
        is_letter = is_upright & (high > low).all(1)
        boxes = np.concatenate([places[:, 0], places[:, 2]], 1)[is_letter]
        clip = np.array([*command.clip_rect])
        yield boxes, clip


def runs(boxes: np.ndarray) -> np.ndarray:
    """(N,) which text each letter belongs to: a line goes on to the right."""
    if not len(boxes):
        return np.empty(0, int)
    middle, height = boxes[:, [1, 3]].mean(1), boxes[:, 3] - boxes[:, 1]
    goes_on = (np.diff(boxes[:, 0]) > -1) & (np.abs(np.diff(middle)) < 1.2 * height[1:].clip(8))
    gap = boxes[1:, 0] - boxes[:-1, 2]
    return np.concatenate([[0], np.cumsum(~(goes_on & (gap < 12)))])


def bad_places(atlas: int) -> Iterator[tuple[str, str, list[int]]]:
    """What is wrong, in which of ImGui's windows, and where."""
    for draw in imgui.get_draw_data().cmd_lists:
        name, boxes, lines, first = draw._owner_name, [], [], 0
        for own, clip in glyphs(draw, atlas):
            shown = (own[:, :2] < clip[2:]).all(1) & (own[:, 2:] > clip[:2]).all(1)
            is_cut = shown & ((own[:, 0] < clip[0] - CUT) | (own[:, 2] > clip[2] + CUT))
            for box in own[is_cut]:
                yield "cut", name, box.astype(int).tolist()
            boxes.append(own[shown])
            lines.append(runs(own)[shown] + first)
            first += len(own) + 1
        if not boxes:
            continue
        letters, line = np.concatenate(boxes), np.concatenate(lines)
        low = np.maximum(letters[:, None, :2], letters[None, :, :2])
        high = np.minimum(letters[:, None, 2:], letters[None, :, 2:])
        shared = np.clip(high - low, 0, None).prod(-1)
        size = (letters[:, 2:] - letters[:, :2]).prod(1)
        is_near = np.abs(letters[:, None] - letters[None]).max(-1) < SHADOW
        is_bad = shared > COVERED * np.minimum(size[:, None], size[None])
        is_bad &= (line[:, None] < line[None]) & ~is_near
        for k in np.flatnonzero(is_bad.any(1))[:3]:
            yield "overlap", name, letters[k].astype(int).tolist()


@cache
def document() -> Document:
    return made_document()


def states(window: Window) -> Iterator[str]:
    """Puts the editor into one state after the other."""
    editor, view = window.editor, window.editor.view
    yield "start"
    editor.start(document())
    for tool in ToolName:
        view.tool = tool
        yield tool.value
    yield from at_the_edges(window)
    view.split = 0.02
    yield "split"
    view.split, view.has_history = None, True
    editor.say("Something has happened that is worth a whole sentence of the last line")
    yield "history and message"
    view.has_history, editor.message = False, None
    for popup in Popup:
        view.popup = popup
        yield popup.value


def at_the_edges(window: Window) -> Iterator[str]:
    """What stands beside a pointer: what it is on, and while it turns the object."""
    editor, hand = window.editor, window._input
    view, tool = editor.view, editor.view.tool
    for across, down in ((-1, 0), (1, 0), (1, 1)):
        view.tool = ToolName.COMPOSE
        hand.crosshair.move(editor, across * view.width, down * view.height)
        yield f"compose at {across}, {down}"
        view.tool = ToolName.PLACE
        hand._press(editor, Button.LEFT)
        hand.crosshair.move(editor, -across * TURNED, -TURNED)
        yield f"turn at {across}, {down}"
        hand.crosshair.move(editor, across * TURNED, TURNED)
        yield f"turn back to {across}, {down}"
        editor.hand.abort(editor)
        hand.crosshair.hide()
    view.tool = tool


def main() -> None:
    for size in sys.argv[1:]:
        look(size)


def look(size: str) -> None:
    """Prints a line for each state of a window of this size."""
    width, height, scale = size.split("x")
    options = WindowOptions(renderer="gl", size=(int(width), int(height)), scale=float(scale))
    window = Window(options, open_window(options))
    window.editor.settings = replace(window.editor.settings, motion="reduced")
    imgui.get_style().anti_aliased_lines = False
    for state in states(window):
        for _ in range(FRAMES):
            window._frame()
            imgui.get_style().anti_aliased_lines = False
        data = imgui.get_draw_data()
        used = Counter(c.get_tex_id() for d in data.cmd_lists for c in d.cmd_buffer)
        atlas = used.most_common(1)[0][0]
        found = sum(len(own) for d in data.cmd_lists for own, _ in glyphs(d, atlas))
        bad = list(bad_places(atlas))
        print(json.dumps({"size": size, "state": state, "letters": found, "bad": bad}))
    window.close()


if __name__ == "__main__":
    main()
