"""What a frame costs, against the number of Gaussians, and where its time goes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from panels import FONT_SIZE, INK
from PIL import Image, ImageDraw, ImageFont

from objectmorpher_research.bench.render import tiles_row
from objectmorpher_research.bench.scenes import cloud_scene, lift_scene
from objectmorpher_research.bench.timing import Effort

CLOUDS = (1_000, 3_000, 10_000, 30_000, 100_000, 300_000)
LIFTS = (1_000, 3_000, 10_000, 30_000, 100_000)
SIZES = (512, 1024)
EFFORT = Effort(1.0, 9, 60)
PARTS = {
    "project_ms": ("skin and project", (60, 110, 180)), "sort_ms": ("sort", (230, 160, 60)),
    "bin_ms": ("bin", (110, 170, 90)), "draw_ms": ("draw", (190, 70, 75)),
}  # fmt: skip
LINES = {
    ("cloud", 1024): (190, 70, 75), ("cloud", 512): (230, 160, 60),
    ("lift", 1024): (60, 110, 180), ("lift", 512): (110, 170, 90),
}  # fmt: skip
SIZE, SCALE = (760, 440), 2  # px of a picture; drawn larger and reduced
LEFT, RIGHT, TOP, BOTTOM = 90, 190, 20, 60  # px around the axes
MOST, LEAST = 5.7, 2.7  # log10 of the Gaussians on the axis
SLOWEST, FASTEST = 3.0, 0.0  # log10 of the ms

Row = dict[str, Any]


def measure() -> list[Row]:
    """Rows of the tile rasteriser, as `objectmorpher bench render` reports them."""
    tiles_row(cloud_scene(300, 64), EFFORT)  # loads what is compiled
    tiles_row(lift_scene(300, 64), EFFORT)
    scenes = [(cloud_scene, n) for n in CLOUDS] + [(lift_scene, n) for n in LIFTS]
    rows = []
    for make, count in scenes:
        scene = make(count)
        rows += [tiles_row(scene.sized(size), EFFORT) for size in SIZES]
    return rows


class Canvas:
    """A picture that is drawn larger than it is written."""

    def __init__(self, size: tuple[int, int] = SIZE) -> None:
        self.image = Image.new("RGB", (size[0] * SCALE, size[1] * SCALE), "white")
        self._draw = ImageDraw.Draw(self.image)
        self._font = ImageFont.load_default(FONT_SIZE * SCALE * 0.85)

    def line(self, points: list[tuple[float, float]], color: tuple[int, ...], width: float) -> None:
        flat = [SCALE * v for point in points for v in point]
        self._draw.line(flat, color, max(round(width * SCALE), 1), joint="curve")

    def box(self, x0: float, y0: float, x1: float, y1: float, color: tuple[int, ...]) -> None:
        self._draw.rectangle([SCALE * v for v in (x0, y0, x1, y1)], color)

    def text(self, x: float, y: float, text: str, anchor: str = "mm") -> None:
        self._draw.text((SCALE * x, SCALE * y), text, INK, self._font, anchor=anchor)

    def save(self, path: Path) -> None:
        self.image.reduce(SCALE).save(path, optimize=True)


def draw_curves(rows: list[Row], path: Path) -> None:
    """Frame time against Gaussians, both logarithmic; thin: the least that was taken."""
    canvas = Canvas()
    width, height = SIZE[0] - LEFT - RIGHT, SIZE[1] - TOP - BOTTOM

    def at(count: float, milliseconds: float) -> tuple[float, float]:
        x = (np.log10(count) - LEAST) / (MOST - LEAST)
        y = (SLOWEST - np.log10(milliseconds)) / (SLOWEST - FASTEST)
        return LEFT + width * float(np.clip(x, 0, 1)), TOP + height * float(np.clip(y, 0, 1))

    for step in (1, 3, 10, 30, 100, 300, 1000):
        y = at(1, step)[1]
        canvas.line([(LEFT, y), (LEFT + width, y)], (225, 225, 230), 1)
        canvas.text(LEFT - 8, y, f"{step} ms", "rm")
    for count in CLOUDS:
        x = at(count, 1)[0]
        canvas.line([(x, TOP), (x, TOP + height)], (225, 225, 230), 1)
        canvas.text(x, TOP + height + 16, f"{count // 1000}k")
    canvas.text(LEFT + width / 2, SIZE[1] - 16, "Gaussians")
    for k, ((scene, size), color) in enumerate(LINES.items()):
        own = [r for r in rows if (r["scene"], r["width"]) == (scene, size)]
        points = [at(r["gaussians"], r["frame_ms"]) for r in own]
        canvas.line(points, color, 2.5)
        canvas.line([at(r["gaussians"], r["frame_least_ms"]) for r in own], color, 0.5)
        for x, y in points:
            canvas.box(x - 3, y - 3, x + 3, y + 3, color)
        y = TOP + 14 + 26 * k
        canvas.line([(SIZE[0] - RIGHT + 14, y), (SIZE[0] - RIGHT + 40, y)], color, 2.5)
        canvas.text(SIZE[0] - RIGHT + 48, y, f"{scene}, {size} px", "lm")
    canvas.save(path)


def draw_parts(rows: list[Row], path: Path) -> None:
    """Where the time of a frame goes, as shares of the parts' sum."""
    canvas = Canvas()
    shown = _bars(rows)
    step = (SIZE[1] - TOP - BOTTOM) / len(shown)
    left, width = 170, SIZE[0] - 170 - 100
    for k, (label, row) in enumerate(shown.items()):
        y, x = TOP + step * k, float(left)
        total = sum(row[part] for part in PARTS)
        canvas.text(left - 8, y + step / 2, label, "rm")
        for part, (_, color) in PARTS.items():
            end = x + width * row[part] / total
            canvas.box(x, y + 0.18 * step, end, y + 0.82 * step, color)
            x = end
        canvas.text(left + width + 10, y + step / 2, f"{row['frame_ms']:.1f} ms", "lm")
    x = float(left)
    for name, color in PARTS.values():
        canvas.box(x, SIZE[1] - 34, x + 16, SIZE[1] - 18, color)
        canvas.text(x + 22, SIZE[1] - 26, name, "lm")
        x += 60 + 9 * len(name)
    canvas.save(path)


def _bars(rows: list[Row]) -> Mapping[str, Row]:
    """The rows that are shown, under their labels: the whole view, a few of the counts."""
    shown = {}
    for row in rows:
        count = f"{round(row['gaussians'] / 1000)}k"
        if row["width"] == SIZES[-1] and row["gaussians"] > 5_000:
            shown[f"{row['scene']}, {count}"] = row
    return shown
