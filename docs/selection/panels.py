"""The picture of every object with its masks."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from measure import Row

from objectmorpher_core.base.arrays import RGB, Mask
from tests.core.segment.simulated_user import Step
from tests.photos import photo

HEIGHT = 190  # px of a panel
COLUMNS = 3  # objects beside each other
QUALITY = 82
MISSING, EXTRA = (255, 190, 0), (230, 40, 200)  # RGB: outlines of what is missing, and too much
OBJECT, NOT = (60, 220, 60), (240, 50, 50)  # RGB of clicks


def draw_objects(rows: list[Row], masks: dict[str, Mask], path: Path) -> None:
    """Each object after one click and after three; `masks`: the true ones."""
    cells = []
    for row in rows:
        name, is_part = row.ours.truth.name, row.ours.truth.kind == "part"
        rgb, steps = photo(row.ours.truth.photo), row.ours.steps
        shown = steps[-1:] if is_part else [steps[0], steps[-1]]
        cells.append(np.hstack([_panel(rgb, step, masks[name]) for step in shown]))
    lines: list[np.ndarray] = []
    for wanted in (2, 1):  # panels a cell: wholes, parts
        chosen = [c for c, row in zip(cells, rows, strict=True)
                  if (row.ours.truth.kind == "part") == (wanted == 1)]  # fmt: skip
        count = COLUMNS * 2 // wanted
        lines += [np.hstack(chosen[k : k + count]) for k in range(0, len(chosen), count)]
    width = max(line.shape[1] for line in lines)
    sheet = np.vstack([cv2.copyMakeBorder(line, 2, 2, 0, width - line.shape[1], cv2.BORDER_CONSTANT,
                                          value=(255, 255, 255)) for line in lines])  # fmt: skip
    _, coded = cv2.imencode(".jpg", sheet[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    path.write_bytes(coded.tobytes())


def _panel(rgb: RGB, step: Step, truth: Mask) -> RGB:
    """The photo, what is not selected darkened, errors outlined, clicks dotted."""
    scale = HEIGHT / rgb.shape[0]
    size = (round(rgb.shape[1] * scale), HEIGHT)
    image = np.where(step.mask[..., None], rgb, rgb // 4)
    image = cv2.resize(image.astype(np.uint8), size, interpolation=cv2.INTER_AREA)
    for wrong, color in ((truth & ~step.mask, MISSING), (step.mask & ~truth, EXTRA)):
        share = cv2.resize(wrong.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        image[share > 0.5] = color
    for click in step.prompt.clicks:
        at = int(click.x * scale), int(click.y * scale)
        cv2.circle(image, at, 4, (255, 255, 255), -1, cv2.LINE_AA)
        cv2.circle(image, at, 3, OBJECT if click.is_foreground else NOT, -1, cv2.LINE_AA)
    return image
