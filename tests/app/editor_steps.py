"""The steps of an editor that tests share, and the photo of a ball that they open."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hands import PATIENCE
from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import ToolName
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement, Prompt

WIDTH, HEIGHT = 180, 140  # px of the made photo
CENTRE = (90.0, 72.0)  # px, of the ball in it
RADII = (34.0, 44.0)


def made_photo() -> np.ndarray:
    """A shaded red ball before a blue-green wall (H, W, 3) u8."""
    random = np.random.default_rng(7)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    wall = np.stack([40 + 0.1 * x, 90 + 0.3 * y, 110 + 0.2 * x], -1)
    wall += random.normal(0, 4, (HEIGHT, WIDTH, 1))
    dx, dy = (x - CENTRE[0]) / RADII[0], (y - CENTRE[1]) / RADII[1]
    inside = 1 - dx**2 - dy**2
    shade = 0.45 + 0.55 * np.sqrt(inside.clip(0)) - 0.15 * dx
    ball = np.array([225, 60, 40]) * shade[..., None] + random.normal(0, 3, (HEIGHT, WIDTH, 1))
    share = (inside / 0.05).clip(0, 1)[..., None]
    return (wall * (1 - share) + ball * share).clip(0, 255).astype(np.uint8)


def open_file(editor: Editor, path: Path) -> None:
    """Opens it and waits for it."""
    editor.filing.open(path)
    wait_until(editor, lambda: editor.chores.is_idle)


def close_all(editor: Editor) -> None:
    """Leaves one tab with the start screen; nothing is asked."""
    for tab in editor.tabs.all:
        if tab is not editor.tab:
            editor.tabs.close(tab)
    editor.close_document()


def wait_until(editor: Editor, is_reached: Callable[[], bool]) -> None:
    """Polls as the window's loop does."""
    end = time.monotonic() + PATIENCE
    while not is_reached():
        assert time.monotonic() < end, f"nothing came in time; the message is {editor.message}"
        editor.poll()
        time.sleep(0.005)


def wait_for_jobs(editor: Editor) -> None:
    wait_until(
        editor,
        lambda: not editor.poll() and editor.jobs.is_idle and editor.chores.is_idle,
    )


def lift_ball(editor: Editor) -> Document:
    """The ball, selected, lifted and with a background behind it."""
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    assert editor.mask is not None, editor.message
    run(editor, "lift")
    wait_for_jobs(editor)
    assert editor.is_lifted, editor.message
    assert editor.document is not None
    assert editor.document.plate is not None
    return editor.document


def duplicate(editor: Editor, document: Document, *move: float) -> None:
    """Opens the document; a copy of its object, moved by so many px, becomes the current one."""
    editor.start(document)
    editor.view.tool = ToolName.PLACE
    run(editor, "duplicate")
    editor.placing.move_to(Placement(move=(move[0], move[1])))
    editor.commit("Move object")


def not_lifted(document: Document) -> Document:
    """Its first object with the same mask, and nothing that was made of it."""
    bare = edits.set_mask(document, 0, None, Prompt())
    return edits.set_mask(bare, 0, document.objects[0].mask, Prompt())
