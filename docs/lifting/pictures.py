"""The pictures of the page."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from motorcycle import read_pair
from PIL import Image, ImageDraw, ImageFont
from turning import Scene, Shot, over_plate

from objectmorpher_core.compose.plate.plate import plate_cover
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import AS_SEEN, Document, LiftSettings, Placement, Prompt
from objectmorpher_core.pictures.image import Picture, encode_picture
from objectmorpher_core.pipeline import export, lift_mask, make_plate, open_photo, select
from objectmorpher_core.scripting.options import EditScript

SAMPLES = Path(__file__).resolve().parents[2] / "assets" / "samples"
CLICKS = {
    "chelsea": EditScript(click=((150.0, 80.0),), not_click=((15.0, 50.0),)),
    "coffee": EditScript(click=((300.0, 130.0),)),
    "astronaut": EditScript(click=((220.0, 80.0), (180.0, 440.0))),
    "flower": EditScript(click=((310.0, 240.0),)),
    "rocket": EditScript(click=((322.0, 200.0),)),
}
MOTORCYCLE = "motorcycle"  # by its true mask
GAP, LABEL, FONT_SIZE, QUALITY = 6, 24, 15, 86
INK = (35, 35, 40)
BOX = (75, 95, 425, 445)  # px of the made photos that is shown
Sheet = list[list[np.ndarray]]  # rows of pictures (h, w, 3) u8

Turn = tuple[float, float, float]
TURNS: dict[str, Turn] = {"yaw -25": (-25, 0, 0), "yaw 25": (25, 0, 0), "pitch 20": (0, 20, 0)}


def draw_solids(path: Path, shown: list[tuple[Scene, dict[str, Shot]]]) -> None:
    """Photo, truth, and what is predicted at 35 degrees, two solids in a row."""
    x0, y0, x1, y1 = BOX
    rows = []
    for scene, shots in shown:
        pictures = [over_plate(s) for s in (scene.photo, scene.edited["yaw 35"], *shots.values())]
        rows.append([_bytes(p[y0:y1, x0:x1]) for p in pictures])
    labels = ["the photo", "35 degrees, true", "network", "relief", "card"]
    half = -(-len(rows) // 2)
    pairs = [a + b for a, b in zip(rows[:half], rows[half:], strict=True)]
    _write(path, labels * 2, pairs, 160)


def draw_real(path: Path) -> None:
    """Photos, turned, with the network and without."""
    rows = []
    for name in (*CLICKS, MOTORCYCLE):
        learned, plain = (_lifted(name, replace(AS_SEEN, trust=trust)) for trust in (1.0, 0.0))
        row = [learned.photo.pixels]
        for turn in TURNS.values():
            row += [_turned(learned, turn), _turned(plain, turn)]
        rows.append(row)
    labels = [f"{turn}, {way}" for turn in TURNS for way in ("network", "relief")]
    _write(path, ["the photo", *labels], rows, 200)


def draw_backs(path: Path) -> None:
    """The back as the photo says, mirrored and continued."""
    rows = []
    for name in ("astronaut", "flower", "coffee"):
        row = [_turned(_lifted(name, AS_SEEN), (0, 0, 0))]
        for back in ("mirrored", "continued"):
            document = _lifted(name, replace(AS_SEEN, back=back))
            row += [_turned(document, (turn, 0, 0)) for turn in (100, 180)]
        rows.append(row)
    labels = ["the photo", "mirrored, 100", "180", "continued, 100", "180 degrees"]
    _write(path, labels, rows, 230)


def draw_thickness(path: Path) -> None:
    """Thinner and thicker, seen from the side."""
    rows = []
    for name in ("flower", "chelsea"):
        document = _lifted(name, AS_SEEN)
        row = [_turned(document, (0, 0, 0))]
        for thickness in (0.3, 1.0, 1.8):
            row.append(_turned(edits.set_thickness(document, 0, thickness), (50, 0, 0)))
        rows.append(row)
    _write(path, ["the photo", "50 degrees, 0.3", "1", "1.8"], rows, 280)


@cache
def _selected(name: str) -> Document:
    if name == MOTORCYCLE:
        pair = read_pair()
        document = open_photo(encode_picture(Picture(pair.left), ".png"), name)
        return edits.set_mask(edits.add_object(document), 0, pair.mask, Prompt())
    return select(open_photo((SAMPLES / f"{name}.jpg").read_bytes(), name), CLICKS[name])


def _lifted(name: str, settings: LiftSettings) -> Document:
    document = _selected(name)
    photo, mask = document.photo, document.objects[0].mask
    assert mask is not None
    lift = lift_mask(photo.pixels, photo.camera, mask, settings=settings)
    return edits.set_lifted(document, 0, *lift, settings)


def _turned(document: Document, turn: Turn) -> np.ndarray:
    """(h, w, 3) u8 the photo with its object turned."""
    if not any(turn):
        return document.photo.pixels
    moved = edits.set_placement(document, 0, Placement(turn=turn))
    moved = edits.set_plate(moved, make_plate(moved.photo.pixels, plate_cover(moved)))
    return export(moved).pixels


def _bytes(picture: np.ndarray) -> np.ndarray:
    return np.clip(picture * 255 + 0.5, 0, 255).astype(np.uint8)


def _sized(picture: np.ndarray, width: int) -> np.ndarray:
    height = round(width * picture.shape[0] / picture.shape[1])
    return cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)


def _write(path: Path, labels: list[str], rows: Sheet, width: int) -> None:
    """Rows of pictures, `width` px wide each, under their labels."""
    sized = [[_sized(picture, width) for picture in row] for row in rows]
    across = len(labels) * (width + GAP) - GAP
    down = LABEL + sum(row[0].shape[0] + GAP for row in sized) - GAP
    sheet = Image.new("RGB", (across, down), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(FONT_SIZE)
    for k, label in enumerate(labels):
        draw.text((k * (width + GAP) + width / 2, LABEL / 2), label, INK, font, anchor="mm")
    y = LABEL
    for row in sized:
        for k, picture in enumerate(row):
            sheet.paste(Image.fromarray(picture), (k * (width + GAP), y))
        y += row[0].shape[0] + GAP
    sheet.save(path, quality=QUALITY, optimize=True)
