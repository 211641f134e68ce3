"""Pictures side by side under their labels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

GAP = 8  # px of white between panels
LABEL, FONT_SIZE = 30, 17  # px
INK = (35, 35, 40)
QUALITY = 90

Box = tuple[int, int, int, int]  # x0, y0, x1, y1 px
Labelled = tuple[str, np.ndarray]  # what it is, and the picture (h, w, 3) in [0, 1]


def draw_sheet(
    path: Path, panels: list[Labelled], box: Box, zoom: int = 1, columns: int = 0
) -> None:
    """Writes the `box` of each picture, magnified pixel by pixel; `columns` in a row, 0: all."""
    x0, y0, x1, y1 = box
    width, height = (x1 - x0) * zoom, (y1 - y0) * zoom
    across = columns or len(panels)
    down = -(-len(panels) // across)
    size = across * (width + GAP) - GAP, down * (height + LABEL + GAP) - GAP
    sheet = Image.new("RGB", size, "white")
    draw = ImageDraw.Draw(sheet)
    for k, (label, picture) in enumerate(panels):
        x, y = (k % across) * (width + GAP), (k // across) * (height + LABEL + GAP)
        crop = to_image(picture[y0:y1, x0:x1])
        sheet.paste(crop.resize((width, height), Image.Resampling.NEAREST), (x, y + LABEL))
        write(draw, (x + width / 2, y + LABEL / 2), label, width)
    sheet.save(path, quality=QUALITY, optimize=True)


def to_image(picture: np.ndarray) -> Image.Image:
    return Image.fromarray((np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8))


def write(draw: ImageDraw.ImageDraw, at: tuple[float, float], text: str, width: float) -> None:
    """A line of text about the point `at`, at most `width` px wide."""
    font = ImageFont.load_default(FONT_SIZE)
    if draw.textlength(text, font) > width:
        raise ValueError(f"the label {text!r} is wider than its panel")
    draw.text(at, text, INK, font, anchor="mm")
