"""The ellipsoid, whose every view is known: how near to the truth the pictures come."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import exact_lift
import numpy as np
import solid
from measures import GREY, detail, inside, on_grey, psnr
from panels import Labelled, draw_sheet
from plain import fitted_colors, lifted_colors

from objectmorpher_core.base.arrays import F32, F64, Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.deform.skinning import Skinned
from objectmorpher_core.document.model import Placement
from objectmorpher_core.raster import reference, tiles
from objectmorpher_core.raster.posed import PosedSplats, RestSplats

CAMERA = solid.CAMERA
MARGIN = 3  # px inside the edge
RAYS = 4  # by as many in a pixel, of pictures that are only looked at
SMALL, SMALL_RAYS = 0.3, 10
LONG = 3.0  # times as wide
FAR = 60.0  # degrees


@dataclass(frozen=True)
class Row:
    name: str
    gaussians: int | None
    at_rest: float | None  # dB against the photo
    seen: float  # dB against the truth, where the photo showed the surface
    whole: float  # dB, everywhere
    detail: float  # over the truth's


@dataclass(frozen=True, eq=False)
class Truth:
    """A view of the moved ellipsoid, and the best that the photo can make of it."""

    camera: Camera
    exact: solid.Cast
    ceiling: solid.Cast

    @staticmethod
    def of(motion: F64, rays: int, camera: Camera = CAMERA) -> Truth:
        photo = exact_lift.photo().color.astype(np.float32)
        return Truth(
            camera, solid.cast(camera, motion, rays), solid.cast(camera, motion, RAYS, photo)
        )

    @property
    def whole(self) -> Mask:
        return inside(self.exact.alpha, MARGIN)

    @property
    def seen(self) -> Mask:
        return self.whole & self.exact.seen

    def row(
        self, name: str, picture: np.ndarray, count: int | None = None, rest: float | None = None
    ) -> Row:
        truth = self.exact.color
        share = detail(picture, self.seen) / detail(truth, self.seen)
        of_seen, of_whole = psnr(picture, truth, self.seen), psnr(picture, truth, self.whole)
        return Row(name, count, rest, of_seen, of_whole, share)


def compare_turn(path: Path) -> list[Row]:
    """Turned by 20 degrees, with few and with many Gaussians."""
    motion = exact_lift.placed(Placement(turn=(20, 0, 0)))
    truth = Truth.of(motion, exact_lift.RAYS)
    photo = exact_lift.photo().color
    where = inside(exact_lift.photo().alpha, MARGIN)
    rows = [truth.row("the photo, looked up through the exact geometry", truth.ceiling.color)]
    panels: dict[str, F32] = {"exact": shown(truth.exact)}
    for count in (5_000, 20_000, 100_000):
        lift = exact_lift.lift(count)
        rest, turned = lift.splats(), lift.splats(motion)
        fitted = fitted_colors(rest, lift.texture, CAMERA, photo, where)
        ways = {"photo-textured": None, "plain": lifted_colors(rest), "plain, fitted": fitted}
        for name, colors in ways.items():
            at_rest, there = (
                on_grey(tiles.render(_painted(s, colors), lift.texture, CAMERA, CAMERA))
                for s in (rest, turned)
            )
            rows.append(truth.row(name, there, len(rest), psnr(at_rest, photo, where)))
            panels[f"{name}, {count // 1000}k"] = there
    names = ("exact", "photo-textured, 20k", "plain, 20k", "plain, fitted, 100k")
    draw_sheet(path, [(name, panels[name]) for name in names], (200, 150, 380, 330), 2)
    return rows


def compare_small(path: Path) -> list[Row]:
    """At 0.3 times the size, with and without the photo's halved copies."""
    motion = exact_lift.placed(Placement(scale=SMALL))
    camera = CAMERA.windowed(170, 180, 172, 152)
    truth = Truth.of(motion, SMALL_RAYS, camera)
    lift = exact_lift.lift(20_000)
    splats, full_size = lift.splats(motion), replace(lift.texture, shapes=lift.texture.shapes[:1])
    pictures = {
        "photo-textured": tiles.render(splats, lift.texture, camera, CAMERA),
        "without halved copies": reference.render(splats, full_size, camera, CAMERA),
        "plain": tiles.render(splats.painted(lifted_colors(splats)), lift.texture, camera, CAMERA),
    }
    panels: list[Labelled] = [("exact", shown(truth.exact))]
    rows = []
    for name, picture in pictures.items():
        panels.append((name, on_grey(picture)))
        rows.append(truth.row(name, panels[-1][1], len(splats)))
    draw_sheet(path, panels, (0, 0, 172, 152), 2)
    return rows


def compare_stretched(path: Path) -> list[Row]:
    """Three times as wide."""
    lift = exact_lift.lift(20_000)
    stretch = np.diag([LONG, 1.0, 1.0])
    rest = RestSplats(lift.lifted, CAMERA)
    linear = np.broadcast_to(stretch, (len(rest), 3, 3)).copy()
    splats = PosedSplats(rest, Skinned(rest.means @ stretch, linear), np.eye(4))
    world = lift.lifted.world_from_object
    motion = world @ np.diag([LONG, 1.0, 1.0, 1.0]) @ np.linalg.inv(world)
    return _looked_at(path, splats, Truth.of(motion, RAYS, _wide()), (0, 0, 460, 260))


def compare_far(path: Path) -> list[Row]:
    """Turned so far that the photo's grazing surfaces face the camera."""
    motion = exact_lift.placed(Placement(turn=(FAR, 0, 0)))
    splats = exact_lift.lift(20_000).splats(motion)
    return _looked_at(path, splats, Truth.of(motion, RAYS), (40, 40, 472, 472))


def _looked_at(path: Path, splats: PosedSplats, truth: Truth, box: tuple[int, ...]) -> list[Row]:
    lift, camera = exact_lift.lift(20_000), truth.camera
    own = on_grey(tiles.render(splats, lift.texture, camera, CAMERA))
    painted = splats.painted(lifted_colors(splats))
    plain = on_grey(tiles.render(painted, lift.texture, camera, CAMERA))
    panels = [
        ("exact", shown(truth.exact)), ("the photo, looked up exactly", shown(truth.ceiling)),
        ("photo-textured, 20k", own), ("plain, 20k", plain),
    ]  # fmt: skip
    draw_sheet(path, panels, (box[0], box[1], box[2], box[3]), 1, 2)
    rows = [truth.row("the photo, looked up through the exact geometry", truth.ceiling.color)]
    rows += [truth.row("photo-textured", own, len(splats))]
    return [*rows, truth.row("plain", plain, len(splats))]


def _wide() -> Camera:
    """The middle of the stretched ellipsoid."""
    return CAMERA.windowed(26, 126, 460, 260)


def _painted(splats: PosedSplats, colors: np.ndarray | None) -> PosedSplats:
    return splats if colors is None else splats.painted(colors)


def shown(cast: solid.Cast) -> F32:
    """(h, w, 3) on grey."""
    alpha = cast.alpha[..., None]
    return (cast.color * alpha + (1 - alpha) * GREY).astype(np.float32)
