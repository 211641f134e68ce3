"""Writes docs/lifting/views.md and views.jpg: what a second photo of a solid adds.

python docs/lifting/make_views.py [NAME ...]

With names, only their rows are printed.
"""

from __future__ import annotations

import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path

import cv2
import mesh_view
import numpy as np
from solids import HELD_OUT, SOLIDS, load
from turning import AT, CAMERA, SEEN, SHARE, SIDE, Score, Shot, middle_of, over_plate, score

from objectmorpher_core.base.arrays import F64, Pixels
from objectmorpher_core.base.progress import silent
from objectmorpher_core.base.rotations import turn_matrix, turn_of
from objectmorpher_core.compose.composite import object_texture
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import LiftedObject, Matte, Placement
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.lift import LiftError, LiftSubject
from objectmorpher_core.lift.registration.other_photo import OtherPhoto, with_photo
from objectmorpher_core.lift.relief.lifter import ReliefLifter
from objectmorpher_core.segment.matting.matte import cut_out

FOLDER = Path(__file__).resolve().parent
sys.path.append(str(FOLDER.parent))
from meshes import fetched  # noqa: E402  # beside this folder: other pages have them, too

VIEWS = (50.0, -35.0)  # degrees of yaw, of the second photo
SHOWN = (20.0, 35.0, 50.0)  # degrees to the same side, that are compared
PICTURED = ("figure", "vase", "duck")


@dataclass(frozen=True)
class Row:
    """One solid and one second photo of it."""

    name: str
    yaw: float  # degrees
    off: float | None = None  # degrees, of the pose that was found; None: refused
    alone: tuple[Score, ...] = ()  # at SHOWN, from one photo
    both: tuple[Score, ...] = ()

    def __str__(self) -> str:
        if self.off is None:
            return f"| {self.name} | {self.yaw:.0f}° | refused |" + " |" * len(SHOWN)
        cells = [
            f"{a.psnr:.1f} / {a.iou:.2f} → {b.psnr:.1f} / {b.iou:.2f}"
            for a, b in zip(self.alone, self.both, strict=True)
        ]
        return f"| {self.name} | {self.yaw:.0f}° | {self.off:.0f}° | {' | '.join(cells)} |"


def measured(name: str, meshes: Path) -> list[tuple[Row, np.ndarray | None]]:
    """The rows of a solid, and pictures: the truth, from one photo, from both."""
    solid = load(name, meshes)
    rest = solid.vertices + CAMERA.unproject(AT, CAMERA.focal / (SHARE * SIDE))
    centre = 0.5 * (rest.min(0) + rest.max(0))

    def seen(yaw: float) -> Shot:
        world = (rest - centre) @ turn_matrix(yaw, 0, 0).T + centre
        view = mesh_view.draw(solid, world, CAMERA)
        return Shot(view.color, view.alpha)

    first = seen(0)
    pixels, mask = _photo(first), first.alpha > 0.5
    subject = LiftSubject(pixels, CAMERA, mask, cut_out(pixels, mask))
    alone = ReliefLifter().lift(subject, SEEN, silent)
    rows: list[tuple[Row, np.ndarray | None]] = []
    for yaw in VIEWS:
        side = seen(yaw)
        other = OtherPhoto("side.png", _photo(side), CAMERA, side.alpha > 0.5)
        try:
            settings, both = with_photo(subject, SEEN, ReliefLifter(), other)
        except LiftError:
            rows.append((Row(name, yaw), None))
            continue
        angles = [float(np.copysign(angle, yaw)) for angle in SHOWN]
        truths = [seen(angle) for angle in angles]
        shots = [
            [_turned(item, subject.matte, *pair) for pair in zip(angles, truths, strict=True)]
            for item in (alone, both)
        ]
        scores = [
            tuple(score(shot, true) for shot, true in zip(own, truths, strict=True))
            for own in shots
        ]
        off = _apart(settings.views[0].pose, turn_matrix(yaw, 0, 0))
        row = Row(name, yaw, off, scores[0], scores[1])
        sheet = np.vstack([np.hstack([over_plate(s) for s in own]) for own in (truths, *shots)])
        rows.append((row, sheet))
    return rows


def _photo(shot: Shot) -> Pixels:
    return np.clip(255 * over_plate(shot) + 0.5, 0, 255).astype(np.uint8)


def _apart(pose: F64, turn: F64) -> float:
    """Degrees between the rotation of a similarity (4, 4) and one (3, 3)."""
    found = pose[:3, :3] / np.cbrt(np.linalg.det(pose[:3, :3]))
    cosine = (np.trace(found.T @ turn) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def _turned(lifted: LiftedObject, matte: Matte, yaw: float, truth: Shot) -> Shot:
    """The lift turned, moved so that its box is about the middle of the true one's."""
    puppet, texture = Puppet(lifted, DeformSettings(), CAMERA), object_texture(matte, lifted)

    def drawn(shift: F64) -> Shot:
        move = float(shift[0]), float(shift[1])
        place = Placement(move=move, turn=turn_of(turn_matrix(yaw, 0, 0)))
        picture = puppet.draw(None, place, texture, CAMERA)
        alpha = np.asarray(picture.alpha, np.float64)
        return Shot(np.asarray(picture.color) / np.maximum(alpha, 1e-6)[..., None], alpha)

    return drawn(middle_of(truth.alpha) - middle_of(drawn(np.zeros(2)).alpha))


HEAD = """# What a second photo of a thing adds

Made by `python docs/lifting/make_views.py`. Each of the twenty solids of [this folder](README.md)
is lifted from one photo, and from that and a second one that was taken from {views} degrees aside
(`--more-views`, *Add a photo from another side…*). Then it is turned to the same side and compared
with the truth: PSNR in dB over the plate, and the overlap of the outlines, from one photo → from
both. "Off" is by how much the second camera's direction was mistaken; what is flatter and turned
less far looks nearly the same, so ten degrees are no fault of the picture. A photo is refused
where less than eight tenths of what the first shows was found in it, or that is less than a third
of the thing there: then nothing changes.

The method was chosen on figure, mug, vase, hand, box, brick, robot, duck and cone at 50 degrees;
all else on this page was measured afterwards, but for a limit on how far a surface may move, which
the mug at -35 asked for.

"""


def main() -> None:
    names = sys.argv[1:]
    meshes = fetched()
    rows, sheets = [], []
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for found in pool.map(measured, names or (*SOLIDS, *HELD_OUT), repeat(meshes)):
            for row, sheet in found:
                print(row, flush=True)
                rows.append(row)
                if sheet is not None and row.name in PICTURED and row.yaw == VIEWS[1]:
                    sheets.append(sheet)
    if names:
        return
    text = HEAD.format(views=" and ".join(f"{v:.0f}" for v in VIEWS))
    heads = [f"turn {angle:.0f}" for angle in SHOWN]
    text += f"| solid | second photo | off | {' | '.join(heads)} |\n"
    text += f"|---|---|---|{'---|' * len(heads)}\n"
    text += "".join(f"{row}\n" for row in rows)
    for yaw in VIEWS:
        text += _means([row for row in rows if row.yaw == yaw])
    pictured, turns = ", ".join(PICTURED), ", ".join(f"{angle:.0f}" for angle in SHOWN)
    text += (
        "\n![Turned towards a second photo](views.jpg)\n\nAbove the truth, in the middle from one"
        f" photo, below from both: {pictured}, turned by {turns} degrees towards the second photo"
        f" at {VIEWS[1]:.0f}.\n"
    )
    (FOLDER / "views.md").write_text(text, encoding="utf-8")
    small = [cv2.resize(s, None, fx=0.45, fy=0.45, interpolation=cv2.INTER_AREA) for s in sheets]
    picture = (255 * np.hstack(small)[..., ::-1]).clip(0, 255).astype(np.uint8)
    cv2.imwrite(str(FOLDER / "views.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, 85])


def _means(rows: list[Row]) -> str:
    known = [row for row in rows if row.off is not None]
    cells = []
    for k in range(len(SHOWN)):
        a, b = ([getattr(row, way)[k] for row in known] for way in ("alone", "both"))
        means = [
            np.mean([getattr(s, key) for s in own]) for own in (a, b) for key in ("psnr", "iou")
        ]
        cells.append("{:.1f} / {:.2f} → {:.1f} / {:.2f}".format(*means))
    off = np.mean([row.off for row in known if row.off is not None])
    return f"| **mean of {len(known)}** | {rows[0].yaw:.0f}° | {off:.0f}° | {' | '.join(cells)} |\n"


if __name__ == "__main__":
    main()
