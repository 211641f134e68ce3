"""Makes the figures of docs/concepts anew, with the program itself: `make figures`.

Objects are chosen by the outlines drawn by hand in tests/core/segment/truth, so that no learned
model is needed.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.sparse import csr_array, triu

import objectmorpher_core as om
from objectmorpher_core.base.arrays import F64, RGB
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose.light.lighting import object_texture
from objectmorpher_core.deform.deformer import Deformer
from objectmorpher_core.deform.puppet import puppet_of
from objectmorpher_core.document.model import Document
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.pictures.image import to_u8
from objectmorpher_core.raster import tiles

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
SAMPLES, OUTLINES = ROOT / "assets" / "samples", ROOT / "tests" / "core" / "segment" / "truth"
GAP, LABEL, FONT = 8, 28, 17  # px
INK, LINE, DOT, RED = (35, 35, 40), (60, 190, 255), (255, 255, 255), (225, 40, 40)
FINER = 3  # x the photo: drawings of dots and lines
QUALITY = 86
STRONGEST = 2500  # of the links that are drawn: all of them would cover everything
Box = tuple[int, int, int, int]  # x0, y0, x1, y1 px

ASTRONAUT_PINS = ((170, 230), (300, 240), (210, 290), (100, 320), (330, 330))
ASTRONAUT_MOVES = (((228, 40), (288, 62)), ((222, 165), (232, 168)))


def make_figures() -> None:
    """All of them."""
    astronaut = _open("astronaut", "astronaut").lift()
    bent = astronaut
    for at in ASTRONAUT_PINS:
        bent = bent.pin(*at)
    for at, to in ASTRONAUT_MOVES:
        bent = bent.drag(at, to)
    _graph(astronaut, bent)
    _arap(bent)
    _texture(_open("flower", "dahlia").lift().turn(28, -12, 0))
    _plate(_open("coffee", "coffee").lift().move(40, -45, 0.9))


def _open(photo: str, outline: str) -> om.Edit:
    return om.open(SAMPLES / f"{photo}.jpg").mask(OUTLINES / f"{outline}.png")


def _graph(rest: om.Edit, bent: om.Edit) -> None:
    """Control points on the photo, their links, and the same after a drag."""
    still, moved = rest.document, bent.render()
    box = (30, 0, 420, 470)
    camera = still.photo.camera
    lifted = still.objects[0].lifted
    assert lifted is not None
    pose = moved.edited.document.objects[0].pose
    assert pose is not None
    links = Deformer(lifted, DeformSettings()).graph.weights
    at_rest = camera.project(lifted.world_points(lifted.control_points))
    posed = camera.project(lifted.world_points(pose.points))
    faint = still.photo.pixels // 2 + 90
    sheet = [
        ("512 control points", _drawn(faint, box, at_rest, None)),
        (f"their {STRONGEST:,} strongest links", _drawn(faint, box, at_rest, links)),
        ("after a drag", _drawn(moved.pixels // 2 + 90, box, posed, links)),
    ]
    _write("control-graph.jpg", sheet, 380)


def _drawn(pixels: RGB, box: Box, points: F64, links: csr_array | None) -> RGB:
    """The `box` of a picture, enlarged, with points (M, 2) px of the photo and links on it."""
    x0, y0, x1, y1 = box
    large = cv2.resize(pixels[y0:y1, x0:x1], None, fx=FINER, fy=FINER)
    image = Image.fromarray(large)
    draw = ImageDraw.Draw(image)
    at = (points - (x0, y0)) * FINER
    if links is not None:
        half = triu(links).tocoo()
        for k in half.data.argsort()[-STRONGEST:]:
            a, b = half.row[k], half.col[k]
            draw.line((*at[a], *at[b]), LINE, 2)
    for x, y in at:
        draw.ellipse((x - 4, y - 4, x + 4, y + 4), DOT, INK)
    return np.asarray(image)


def _arap(bent: om.Edit) -> None:
    """The same handles, solved three ways."""
    photo = bent.document.photo.pixels
    box = (0, 0, 460, 500)
    sheet = [("the photo, and what is asked for", _handles(photo, bent, box))]
    for label, said in (
        ("as rigidly as possible", {}),
        ("linear (Laplacian)", {"deform": "laplacian"}),
    ):
        made = bent.options(**said).render().pixels
        sheet.append((label, _handles(made, None, box)))
    _write("arap.jpg", sheet, 380)


def _handles(pixels: RGB, edit: om.Edit | None, box: Box) -> RGB:
    x0, y0, x1, y1 = box
    image = Image.fromarray(cv2.resize(pixels[y0:y1, x0:x1], None, fx=FINER, fy=FINER))
    draw = ImageDraw.Draw(image)
    if edit is not None:
        for x, y in edit.script.pin:
            u, v = (x - x0) * FINER, (y - y0) * FINER
            draw.polygon([(u - 14, v), (u, v - 14), (u + 14, v), (u, v + 14)], DOT, INK)
        for move in edit.script.handle:
            ends = [((x - x0) * FINER, (y - y0) * FINER) for x, y in (move.at, move.to)]
            draw.line(ends, RED, 9)
            (u, v) = ends[1]
            draw.ellipse((u - 13, v - 13, u + 13, v + 13), RED, DOT)
    return np.asarray(image)


def _texture(edit: om.Edit) -> None:
    """A turned object out of plain colours, and out of maps into the photo; and its Gaussians."""
    result = edit.render()
    document = result.edited.document
    item = document.objects[0]
    assert item.matte is not None
    camera, box = document.photo.camera, (205, 130, 345, 270)
    splats = puppet_of(item, camera).posed(item.pose, item.placement)
    texture = object_texture(item.matte, item.lifted)
    plain = splats.painted(splats.rest.lifted.gaussians.colors.astype(np.float64))
    sheet = [
        ("the photo", _cut(document.photo.pixels, box)),
        ("turned: one colour each", _cut(_render(plain, document, texture, camera), box)),
        ("turned: each looks into the photo", _cut(result.pixels, box)),
    ]
    _write("photo-texture.jpg", sheet, 380)


def _render(splats: object, document: Document, texture: object, camera: Camera) -> RGB:
    """Over the photo, in sRGB."""
    made = tiles.render(splats, texture, camera, camera)  # type: ignore[arg-type]
    photo = document.photo.pixels / 255.0
    return to_u8(((made.color + (1 - made.alpha[..., None]) * photo) * 65535).astype(np.uint16))


def _plate(edit: om.Edit) -> None:
    """What is filled in, the plate, and the edit over it."""
    result = edit.render()
    document = result.edited.document
    plate = document.plate
    assert plate is not None
    photo = document.photo.pixels.copy()
    x0, y0, x1, y1 = plate.box
    hole = np.zeros(photo.shape[:2], np.uint8)
    hole[y0:y1, x0:x1] = plate.hole
    contours, _ = cv2.findContours(hole, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(photo, contours, -1, RED, 2)
    behind = om.Result(result.edited).encode(".png", "plate")
    filled = cv2.imdecode(np.frombuffer(behind, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    whole = (0, 0, photo.shape[1], photo.shape[0])
    sheet = [
        ("what is to be filled in", _cut(photo, whole)),
        ("the plate", _cut(filled, whole)),
        ("the edit", _cut(result.pixels, whole)),
    ]
    _write("plate.jpg", sheet, 380)


def _cut(pixels: RGB, box: Box) -> RGB:
    x0, y0, x1, y1 = box
    return cv2.resize(pixels[y0:y1, x0:x1], None, fx=FINER, fy=FINER, interpolation=cv2.INTER_CUBIC)


def _write(name: str, sheet: list[tuple[str, RGB]], width: int) -> None:
    """Pictures side by side under their labels, each `width` px wide."""
    height = max(round(picture.shape[0] * width / picture.shape[1]) for _, picture in sheet)
    size = len(sheet) * (width + GAP) - GAP, height + LABEL
    image = Image.new("RGB", size, "white")
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(FONT)
    for k, (label, picture) in enumerate(sheet):
        left = k * (width + GAP)
        draw.text((left + width / 2, LABEL / 2), label, INK, font, anchor="mm")
        own = width, round(picture.shape[0] * width / picture.shape[1])
        small = Image.fromarray(picture).resize(own, Image.Resampling.LANCZOS)
        image.paste(small, (left, LABEL))
    image.save(HERE / name, quality=QUALITY, optimize=True)


if __name__ == "__main__":
    make_figures()
