"""Real photos, turned: what is left of their detail, by what the Gaussians carry."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from measures import detail, inside, on_grey
from panels import Box, Labelled, draw_sheet
from plain import fitted_colors, lifted_colors

from objectmorpher_core.base.arrays import F32, Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose.composite import object_texture
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import GAUSSIANS, LiftSettings, Placement
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.pipeline import lift_mask, open_photo, select
from objectmorpher_core.raster import tiles
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.raster.texture import TextureLevels
from objectmorpher_core.scripting.options import EditScript

SAMPLES = Path(__file__).resolve().parents[2] / "assets" / "samples"
TURN = Placement(turn=(20, 0, 0))
MANY = 5  # x GAUSSIANS
SHOWN = (("photo-textured", GAUSSIANS), ("plain", GAUSSIANS), ("plain, fitted", MANY * GAUSSIANS))
MARGIN = 5  # px inside the object's edge: the outline is not detail


@dataclass(frozen=True, eq=False)
class Subject:
    """An object in a photo."""

    title: str
    file: str  # of its picture
    pixels: F32  # (H, W, 3) in [0, 1]
    mask: Mask
    camera: Camera
    crop: Box  # what the picture shows


@dataclass(frozen=True)
class Row:
    name: str
    gaussians: int
    at_rest: float  # detail over the photo's own
    turned: float


def subjects() -> Iterator[Subject]:
    """A cat's face, an oval of it, and a portrait as it is selected by two clicks."""
    y, x = np.mgrid[:300, :451] + 0.5
    oval = ((x - 215) / 135) ** 2 + ((y - 140) / 125) ** 2 < 1
    yield _subject("A cat's face", "chelsea", oval, None, (95, 30, 265, 230))
    clicks = EditScript(click=((220, 80), (180, 440)))
    yield _subject("A portrait", "astronaut", None, clicks, (150, 20, 310, 220))


def _subject(
    title: str, name: str, mask: Mask | None, script: EditScript | None, crop: Box
) -> Subject:
    document = open_photo((SAMPLES / f"{name}.jpg").read_bytes(), f"{name}.jpg")
    if script is not None:
        mask = select(document, script).objects[0].mask
    assert mask is not None
    pixels = document.photo.pixels.astype(np.float32) / 255
    return Subject(title, f"{name}.jpg", pixels, mask, document.photo.camera, crop)


def compare(subject: Subject, path: Path) -> list[Row]:
    """Draws the turned object in every way; what is left of its detail."""
    rows: list[Row] = []
    shown: dict[tuple[str, int], Labelled] = {}
    for count in (GAUSSIANS, MANY * GAUSSIANS):
        pixels = np.round(subject.pixels * 255).astype(np.uint8)
        matte, lifted = lift_mask(
            pixels, subject.camera, subject.mask, "relief", LiftSettings(count)
        )
        texture = object_texture(matte, lifted)
        puppet = Puppet(lifted, DeformSettings(), subject.camera)
        rest, turned = puppet.posed(None, Placement()), puppet.posed(None, TURN)
        where = inside(tiles.render(rest, texture, subject.camera, subject.camera).alpha, MARGIN)
        fitted = fitted_colors(rest, texture, subject.camera, subject.pixels, where)
        ways = {"photo-textured": None, "plain": lifted_colors(rest), "plain, fitted": fitted}
        for name, colors in ways.items():
            row, picture = _measured(subject, texture, name, (rest, turned), colors)
            rows.append(row)
            shown[name, count] = f"{name}, {row.gaussians:,}", picture
    first: Labelled = ("the photo", subject.pixels)
    panels = [shown[key] for key in SHOWN]
    draw_sheet(path, [first, *panels], subject.crop, 2)
    return rows


def _measured(
    subject: Subject, texture: TextureLevels, name: str, poses: tuple[PosedSplats, PosedSplats],
    colors: np.ndarray | None,
) -> tuple[Row, F32]:  # fmt: skip
    """At rest and turned, in `colors` or with the photo; the turned picture."""
    camera, ratios, shown = subject.camera, [], subject.pixels
    for splats in poses:
        drawn = splats if colors is None else splats.painted(colors)
        picture = tiles.render(drawn, texture, camera, camera)
        where = inside(picture.alpha, MARGIN)
        shown = on_grey(picture)
        own = inside(tiles.render(poses[0], texture, camera, camera).alpha, MARGIN)
        ratios.append(detail(shown, where) / detail(subject.pixels, own))
    return Row(name, len(poses[0]), ratios[0], ratios[1]), shown
