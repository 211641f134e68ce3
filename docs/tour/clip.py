"""The moving picture of the README: a drag from the first click to the edit, docs/drag.webp.

The window is recorded frame by frame: the pointer goes on when what it did is drawn, so that the
clip runs at the speed of an idle machine wherever it is made.
"""

from __future__ import annotations

import math
import time
from pathlib import Path

from guide import Guide, with_pointer
from PIL import Image

SIZE = (1040, 660)  # points, of the window
WIDTH = 780  # px of the clip
RATE = 12.5  # frames a second
QUALITY = 62  # of WebP
DRAWN = 0.12  # s, after which a frame that has seen the pointer is on the screen
PHOTO = (512, 512)  # px
HEAD = (228.0, 40.0)  # px of the photo: the point that is dragged
PINS = ((170, 230), (300, 240), (210, 290))
SWING = 42.0  # px, of the head to both sides
DRAG = 2.6  # s


class Camera(Guide):
    """Hands whose every move is filmed."""

    def __init__(self, environment: dict[str, str], pictures: Path) -> None:
        super().__init__(environment, pictures, "clip", PHOTO, pictures)
        self.frames: list[Image.Image] = []
        self.lasting: list[float] = []  # ms

    def take(self, seconds: float = 1 / RATE) -> None:
        """Film the window as it is."""
        time.sleep(DRAWN)
        picture = with_pointer(self.picture(), self.pointer(), 1.0)
        height = round(picture.height * WIDTH / picture.width)
        self.frames.append(picture.resize((WIDTH, height), Image.Resampling.LANCZOS))
        self.lasting.append(1000 * seconds)

    def glide(self, end: tuple[float, float], seconds: float) -> None:
        """Move the pointer there, starting and ending slowly."""
        start, count = self.pointer(), max(round(seconds * RATE), 1)
        for k in range(1, count + 1):
            share = 0.5 - 0.5 * math.cos(math.pi * k / count)
            self.step(tuple(a + share * (b - a) for a, b in zip(start, end, strict=True)))

    def step(self, at: tuple[float, ...]) -> None:
        """Move the pointer, and film what that has done."""
        self.xdotool("mousemove", round(at[0]), round(at[1]))
        self.take()

    def save(self, path: Path) -> None:
        """Write the clip, which is played for ever."""
        first, *rest = self.frames
        first.save(path, "WEBP", save_all=True, append_images=rest, duration=self.lasting, loop=0,
                   quality=QUALITY, method=4, minimize_size=True)  # fmt: skip
        total = sum(self.lasting) / 1000
        print(f"  {path.name}: {len(self.frames)} frames, {total:.1f} s, {path.stat().st_size:,} B")


def film(camera: Camera) -> None:
    """Click, lift, pin, drag; and the photo as it was."""
    camera.area("Photo")
    camera.point(camera.at(550, 200))  # beside the photo
    camera.settle()
    camera.take(0.4)
    camera.glide(camera.at(220, 80), 0.5)
    camera.settle()
    camera.take(0.5)  # dots around what a click would take
    camera.click(*camera.at(220, 80))
    camera.place("Lift object")
    camera.settle()
    camera.take(0.4)
    camera.glide(camera.place("Lift object"), 0.4)
    camera.choose("Lift object")
    camera.area("Drag a point on the object")
    camera.settle()
    camera.take(0.3)
    for x, y in PINS:
        camera.glide(camera.at(x, y), 0.2)
        camera.pin(x, y)
        camera.take()
    camera.glide(camera.at(*HEAD), 0.4)
    camera.xdotool("mousedown", 1)
    count = round(DRAG * RATE)
    for k in range(1, count + 1):  # over to one side, to the other, and back to the first
        swing = SWING * math.sin(2.5 * math.pi * k / count)
        camera.step(camera.at(HEAD[0] + swing, HEAD[1] + 0.12 * abs(swing)))
    camera.xdotool("mouseup", 1)
    camera.settle()
    camera.glide(camera.at(440, 120), 0.4)
    camera.take(0.3)
    camera.xdotool("keydown", "x")
    camera.take(0.5)
    camera.xdotool("keyup", "x")
    camera.take(0.7)
