"""Draws posed objects side by side, at one scale, with this repository's own rasteriser."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from models import CAMERA, Model
from PIL import Image, ImageDraw, ImageFont

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.deform.skinning import Skinned
from objectmorpher_core.raster import projection, rules, tiles
from objectmorpher_core.raster.posed import PosedSplats, RestSplats
from objectmorpher_core.raster.texture import build_levels

SUPERSAMPLE = 3
MARGIN = 10  # px around what is drawn
GAP = 8  # px of white between panels
LABEL, FONT_SIZE = 30, 19  # px
GROUND = (0.955, 0.96, 0.97)
LIGHT = np.array([-0.55, -0.65, -0.52])  # towards it: upper left, in front
AMBIENT = 0.40
OUTLINE = 0.5  # x standard deviation
QUALITY = 88
INK, RED, BLUE, GREY = (35, 35, 40), (205, 25, 30), (20, 80, 190), (110, 115, 125)
NO_TEXTURE = build_levels(np.zeros((4, 4, 3), np.float32), np.zeros((4, 4), np.float32), 0, 0)


@dataclass(frozen=True, eq=False)
class Dots:
    """Marks at points (N, 3), object frame."""

    points: F64
    color: tuple[int, int, int]
    radius: float  # px


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines between points (N, 3) and (N, 3), object frame."""

    starts: F64
    ends: F64
    color: tuple[int, int, int]
    width: float  # px


@dataclass(frozen=True, eq=False)
class Panel:
    """One object in one pose."""

    label: str
    model: Model
    splats: PosedSplats
    marks: tuple[Dots | Lines, ...] = field(default=())
    has_outlines: bool = False  # of the Gaussians


def posed(model: Model, skinned: Skinned, normals: F64, colors: F64 | None = None) -> PosedSplats:
    """The model's Gaussians where `skinned` puts them, lit there by the surface's `normals`."""
    splats = PosedSplats(RestSplats(model.lifted, CAMERA), skinned, np.eye(4))
    return lit(splats, model, normals, colors)


def lit(splats: PosedSplats, model: Model, normals: F64, colors: F64 | None = None) -> PosedSplats:
    """`splats` in their own colours, or in `colors` (N, 3), under a soft light."""
    world = normals @ model.lifted.world_from_object[:3, :3].T
    light = LIGHT / np.linalg.norm(LIGHT)
    shade = AMBIENT + (1 - AMBIENT) * ((1 + world @ light) / 2) ** 1.5
    own = splats.rest.lifted.gaussians.colors if colors is None else colors
    return splats.painted(own * shade[:, None])


def draw_figure(
    path: Path, panels: list[Panel], width: int, columns: int = 0, box: F64 | None = None
) -> None:
    """Writes the panels, each `width` px wide, `columns` of them in a row; 0: all.

    `box` (4,) x0 y0 x1 y1 px of CAMERA is what they show; without it, all that there is.
    """
    box = _box_of(panels) if box is None else box
    zoom = (width - 2 * MARGIN) / (box[2] - box[0])
    height = round((box[3] - box[1]) * zoom) + 2 * MARGIN
    corner = box[:2] - MARGIN / zoom
    size = SUPERSAMPLE * width, SUPERSAMPLE * height
    camera = CAMERA.windowed(*corner, *size, SUPERSAMPLE * zoom)
    across = columns or len(panels)
    down = -(-len(panels) // across)
    sheet = Image.new(
        "RGB", (across * (width + GAP) - GAP, down * (height + LABEL + GAP) - GAP), "white"
    )
    draw = ImageDraw.Draw(sheet)
    for k, panel in enumerate(panels):
        x, y = (k % across) * (width + GAP), (k // across) * (height + LABEL + GAP)
        sheet.paste(_draw_panel(panel, camera).reduce(SUPERSAMPLE), (x, y + LABEL))
        write(draw, (x + width / 2, y + LABEL / 2), panel.label, width)
    sheet.save(path, quality=QUALITY, optimize=True)


def write(draw: ImageDraw.ImageDraw, at: tuple[float, float], text: str, width: int) -> None:
    """A line of text about the point `at`, at most `width` px wide."""
    font = ImageFont.load_default(FONT_SIZE)
    if draw.textlength(text, font) > width:
        raise ValueError(f"the label {text!r} is wider than its panel")
    draw.text(at, text, INK, font, anchor="mm")


def _box_of(panels: list[Panel]) -> F64:
    """(4,) px of CAMERA that holds all that the panels show."""
    all_points = []
    for panel in panels:
        all_points.append(panel.splats.means)
        for mark in panel.marks:
            points = mark.points if isinstance(mark, Dots) else mark.starts
            all_points.append(panel.model.lifted.world_points(points))
    seen = CAMERA.project(np.concatenate(all_points))
    return np.concatenate([seen.min(0), seen.max(0)])


def _draw_panel(panel: Panel, camera: Camera) -> Image.Image:
    picture = tiles.render(panel.splats, NO_TEXTURE, camera, CAMERA)
    rgb = picture.color + (1 - picture.alpha[..., None]) * np.array(GROUND, np.float32)
    image = Image.fromarray(np.uint8(np.clip(rgb, 0, 1) * 255 + 0.5))
    draw = ImageDraw.Draw(image)
    if panel.has_outlines:
        _draw_outlines(draw, projection.project(panel.splats, camera, CAMERA))
    for mark in panel.marks:
        if isinstance(mark, Lines):
            starts, ends = (_seen(panel, camera, p) for p in (mark.starts, mark.ends))
            for a, b in zip(starts, ends, strict=True):
                draw.line([*a, *b], mark.color, max(1, round(mark.width * SUPERSAMPLE)))
            continue
        radius = mark.radius * SUPERSAMPLE
        for x, y in _seen(panel, camera, mark.points):
            circle = [x - radius, y - radius, x + radius, y + radius]
            draw.ellipse(circle, mark.color, "white", max(1, round(radius / 4)))
    return image


def _draw_outlines(draw: ImageDraw.ImageDraw, projected: F64) -> None:
    """Each Gaussian that faces the camera, as an ellipse of half a standard deviation."""
    angle = np.linspace(0, 2 * np.pi, 25)
    circle = OUTLINE * np.stack([np.cos(angle), np.sin(angle)])
    for row in projected[projected[:, rules.BODY] > 0.5]:
        # the covariance from its parts, see `projection`
        yy = 1 / row[rules.RYY]
        xy = -row[rules.TILT] * yy
        xx = 1 / row[rules.QXX] + xy * xy / yy
        root = np.linalg.cholesky(np.array([[xx, xy], [xy, yy]], np.float64))
        at = row[[rules.CX, rules.CY]] + (root @ circle).T
        draw.line(at.ravel().tolist(), INK, SUPERSAMPLE)


def _seen(panel: Panel, camera: Camera, points: F64) -> F64:
    return camera.project(panel.model.lifted.world_points(points))
