"""The canvas copied into an emulated window as memory is the very picture, the right way up."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

# A picture in a window: written upright, from the bottom up for the shaders, and upright again.
SCRIPT = """
import numpy as np
from objectmorpher.cli.options import WindowOptions
from objectmorpher.gui.window.glfw_window import open_window
import moderngl
from objectmorpher.render.renderer import KeptCanvas, RowCopy

SIZE, VIEWPORT = (96, 80), (10, 20, 64, 48)
handle = open_window(WindowOptions(size=SIZE, scale=1.0, frames=1))
context = moderngl.create_context(require=330)
rows = RowCopy.found()
assert rows is not None
kept, rng = KeptCanvas(context, rows), np.random.default_rng(0)
left, bottom, width, height = VIEWPORT
for is_sampled in (False, True, False, False):
    pixels = rng.integers(0, 256, (height, width, 4), np.uint8)
    if kept.buffer is None:
        kept.begin(SIZE, (0.2, 0.4, 0.6))
    kept.write(pixels, VIEWPORT, (0.2, 0.4, 0.6), is_sampled)
    kept.copy_to(context.screen)
    data = context.screen.read(viewport=(0, 0, *SIZE), components=3, alignment=1)
    shown = np.frombuffer(data, np.uint8)
    shown = shown.reshape(SIZE[1], SIZE[0], 3)[::-1]
    top = SIZE[1] - bottom - height
    there = np.s_[top : top + height, left : left + width]
    assert np.array_equal(shown[there], pixels[..., :3]), is_sampled
    around = np.ones(shown.shape[:2], bool)
    around[there] = False
    assert (shown[around] == (51, 102, 153)).all()
    assert kept.read_pixel(left + 3, bottom + 5) == tuple(pixels[height - 6, 3, :3])
"""


@pytest.mark.window
def test_a_picture_arrives_as_it_is(window_environment: dict[str, str]) -> None:
    ran = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=os.environ | window_environment,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
