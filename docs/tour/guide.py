"""Hands that take a picture of every step, with the pointer drawn in."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from hands import Hands

QUALITY = 80  # of the JPEGs
DRAWN = 400  # px of the screen that differ: more than a hint, less than a small outline
PIECES = 8  # of a drag
ARROW = ((0, 0), (0, 16.5), (3.9, 12.9), (6.6, 18.9), (9.2, 17.8), (6.6, 11.9), (12, 11.9))
FINE = 4  # the arrow is drawn so many times larger, for its edges
CAPTIONS = "captions.json"


@dataclass(frozen=True)
class Caption:
    """What is said about a picture."""

    file: str
    title: str
    text: str


class Guide(Hands):
    """Shows one story: acts, and takes the pictures."""

    def __init__(
        self,
        environment: dict[str, str],
        out: Path,
        story: str,
        photo_size: tuple[int, int],
        pictures: Path,
    ) -> None:
        """`pictures`: the folder with the photos, for dialogs."""
        super().__init__(environment)
        self._out, self._story, self._photo_size = out, story, photo_size
        self.pictures = pictures
        self.captions: list[Caption] = []

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Where px of the photo are on the screen."""
        return self.on_photo(x, y, self._photo_size)

    def point(self, at: tuple[float, float]) -> None:
        """Moves the pointer there, by a way: what is under it on the way is left."""
        self.xdotool("mousemove", round(at[0]) - 3, round(at[1]) - 2)
        self.xdotool("mousemove", round(at[0]), round(at[1]))

    def middle(self) -> tuple[float, float]:
        """Of the photo, on the screen."""
        return self.place("Photo")

    @contextmanager
    def dragging(
        self, start: tuple[float, float], end: tuple[float, float], button: int = 1
    ) -> Iterator[None]:
        """Between press and release, with the pointer at the drag's end."""
        self.point(start)
        self.xdotool("mousedown", button)
        for k in range(1, PIECES + 1):
            x, y = (a + k / PIECES * (b - a) for a, b in zip(start, end, strict=True))
            self.xdotool("mousemove", round(x), round(y))
        yield
        self.xdotool("mouseup", button)
        self.settle()

    def pin(self, x: float, y: float) -> None:
        """An Alt-click on px of the photo."""
        self.point(self.at(x, y))
        self.xdotool("keydown", "alt", "click", 1, "keyup", "alt")

    def rest(self, x: float, y: float) -> None:
        """The pointer rests on px of the photo until the window draws what it found there."""
        before = self.settle()
        self.point(self.at(x, y))
        self.wait(lambda: (self.picture() != before).any(2).sum() > DRAWN, "showing a candidate")

    def pull(self, label: str, pixels: float) -> None:
        """Drags in a field with a number."""
        x, y = self.place(label)
        self.drag((x, y), (x + pixels, y))

    def reach(self, label: str) -> None:
        """Turn the wheel over the panel until it shows `label`, and a little farther."""
        self._point_at_panel()
        for _ in range(30):
            if label in self.places():
                break
            self.xdotool("click", 5)
            self.settle()
        self.xdotool("click", "--repeat", 2, 5)
        self.settle()

    def rewind(self) -> None:
        """Turn the wheel over the panel until its top is shown."""
        self._point_at_panel()
        self.xdotool("click", "--repeat", 40, "--delay", 20, 4)
        self.settle()

    def _point_at_panel(self) -> None:
        x, y = self.place("Export photo…")
        self.point((x, y - 150))

    def shoot(self, title: str, text: str) -> None:
        """A picture of the window as soon as it stands still."""
        pixels = self.settle()
        word = re.sub(r"[^a-z]+", "-", title.lower()).strip("-")
        name = f"{self._story}-{len(self.captions) + 1:02d}-{word}.jpg"
        picture = with_pointer(pixels, self.pointer(), pixels.shape[1] / 1440)
        picture.save(self._out / name, quality=QUALITY, optimize=True)
        self.captions.append(Caption(name, title, text))
        print(f"  {name}", flush=True)


def with_pointer(pixels: np.ndarray, at: tuple[int, int], scale: float) -> Image.Image:
    """A screen's picture lacks the pointer: an arrow, white with a dark line around it."""
    picture = Image.fromarray(pixels).convert("RGB")
    side = round(32 * scale)
    large = Image.new("RGBA", (side * FINE, side * FINE), (0, 0, 0, 0))
    places = [((4 + x) * scale * FINE, (4 + y) * scale * FINE) for x, y in ARROW]
    draw = ImageDraw.Draw(large)
    draw.line([*places, *places[:2]], (20, 20, 22), round(3.2 * scale * FINE), "curve")
    draw.polygon(places, (255, 255, 255))
    arrow = large.resize((side, side), Image.Resampling.LANCZOS)
    picture.paste(arrow, (round(at[0] - 4 * scale), round(at[1] - 4 * scale)), arrow)
    return picture


def write_captions(folder: Path, story: str, captions: list[Caption]) -> None:
    """Beside those of the other stories, so that one of them can be told anew alone."""
    path = folder / CAPTIONS
    known = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    known[story] = [[c.file, c.title, c.text] for c in captions]
    path.write_text(json.dumps(known, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def read_captions(folder: Path) -> dict[str, list[Caption]]:
    known = json.loads((folder / CAPTIONS).read_text(encoding="utf-8"))
    return {story: [Caption(*words) for words in captions] for story, captions in known.items()}
