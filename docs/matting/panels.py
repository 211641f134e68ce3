"""Pictures side by side under their labels."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from measures import over
from PIL import Image, ImageDraw, ImageFont
from truth import Case

from objectmorpher_core.base.arrays import F32

GAP = 6  # px of white between panels
LABEL, FONT_SIZE = 26, 14  # px
INK = (35, 35, 40)
QUALITY = 88
GREEN = np.array([0.15, 0.55, 0.3], np.float32)
SIDE = 84  # px of the photo that a panel shows
ZOOM = 3


def draw_case(path: Path, case: Case, found: dict[str, tuple[F32, F32]], corner: tuple[int, int]):
    """A part of a case: what was given, and every cut-out on green and as alpha."""
    given = case.photo / np.float32(255)
    mask = (case.given.astype(bool)).astype(np.uint8)
    edge = cv2.morphologyEx(mask, cv2.MORPH_GRADIENT, np.ones((2, 2), np.uint8)) > 0
    outlined = np.where(edge[..., None], np.array([1, 0, 1], np.float32), given)
    shown = {"truth": (case.alpha, case.foreground)} | found
    on_green = [("photo", given)] + [(k, over(a, f, GREEN)) for k, (a, f) in shown.items()]
    alphas = [("given", outlined)] + [("", np.dstack([a] * 3)) for a, _ in shown.values()]
    columns, size = len(on_green), SIDE * ZOOM
    sheet = Image.new("RGB", (columns * (size + GAP) - GAP, 2 * (size + LABEL)), "white")
    draw = ImageDraw.Draw(sheet)
    x0, y0 = corner
    for k, (label, picture) in enumerate(on_green + alphas):
        left, top = (k % columns) * (size + GAP), (k // columns) * (size + LABEL)
        part = np.clip(picture[y0 : y0 + SIDE, x0 : x0 + SIDE], 0, 1)
        panel = Image.fromarray((part * 255 + 0.5).astype(np.uint8))
        sheet.paste(panel.resize((size, size), Image.Resampling.NEAREST), (left, top + LABEL))
        font = ImageFont.load_default(FONT_SIZE)
        draw.text((left + size / 2, top + LABEL / 2), label, INK, font, anchor="mm")
    sheet.save(path, quality=QUALITY, optimize=True)
