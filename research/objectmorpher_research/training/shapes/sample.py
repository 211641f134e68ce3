"""A made-up photo of a made-up object, and the whole truth about its shape.

Its units are those of `lift.crop`, in which the network sees a photo.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, F64, RGB, Mask
from objectmorpher_core.base.masks import box_of
from objectmorpher_core.lift.crop import SIDE

from .distance import lowest, trace
from .families import FAMILIES, FURTHER
from .families.prints import REACH, repainted
from .materials import Material, a_colour, a_crop, a_material, a_print, albedo, grain, noise_block
from .solid import PrimitiveBuilder, Solid, turned

COARSE = 56  # px of the first look, which finds the object's box
LOOSE = 1.05  # x the ball's angle, of the first look
PAD = (1.08, 1.5)  # crop's side over the object's larger side
FIELDS = (20.0, 75.0)  # degrees of the whole photo
SHARES = (0.2, 0.95)  # crop's side over the photo's
NEAREST = 1.25  # radii of the ball, from the camera to its middle
LEAST = 0.04  # x crop's area, that an object covers at least
CUT = 0.18  # how often the photo's frame cuts the object
CUT_AGAIN = 0.25  # how often it does on top where the object is photographed again
JUMP = 0.035  # crop units between neighbouring pixels, beyond what their slopes explain
PART_JUMP = 0.014  # likewise where another part begins: an arm that lies on a body
NO_GROUND = -99.0
COLUMNS = 96  # rays each way, by which the ground beneath the object is found
FACED, FACED_PRINT = 0.4, 0.8  # how often the photographer stood before the object
TWISTED, BENT = 1.0, 0.6  # radians per radius at most


@dataclass(frozen=True, eq=False)
class Sample:
    """A crop (s, s) of a photo. What is not the object is 0 in all but `rgb`."""

    rgb: RGB  # (s, s, 3); black beyond the photo's frame
    mask: Mask  # (s, s)
    front: F32  # (s, s) how much nearer than the mean the visible surface is
    thickness: F32  # (s, s) to where the ray leaves the part that it sees, cavities filled
    depth: F32  # (s, s) to where it leaves the whole object
    normal: F32  # (s, s, 3) camera axes: x right, y down, z forward; towards the camera
    edge: Mask  # (s, s) the nearer side of where one part hides another
    part: np.ndarray  # (s, s) int16, -1 outside
    tangents: F32  # (3,) of the crop: x and y of its middle, and its width
    family: str


class _Eye(NamedTuple):
    """A camera in the object's frame, and the crop of its picture."""

    at: F64  # (3,)
    axes: F64  # (3, 3) rows: right, down, forward
    middle: F64  # (2,) tangents of the crop's middle
    width: float  # of the crop, in tangents


class _Scene(NamedTuple):
    """What is drawn."""

    solid: Solid
    materials: list[Material]
    ground: float


def make_sample(seed: int, side: int = SIDE, families: tuple[str, ...] | None = None) -> Sample:
    """Make the sample of these numbers; `families` are the names of those to choose from."""
    return make_takes(seed, 1, side, families)[0]


def make_takes(
    seed: int, count: int, side: int = SIDE, families: tuple[str, ...] | None = None
) -> list[Sample]:
    """Make `count` samples of one thing as it stands, in other colours before other backdrops.

    The first has its own picture, if any, the others may have another; and more of them are cut.
    """
    for attempt in range(50):
        rng = np.random.default_rng([seed, attempt])
        names = families or tuple(FAMILIES)
        name = names[rng.integers(len(names))]
        stage = _Stage.of(rng, name, side)
        if stage is not None:
            first = stage.photographed(rng, stage.built)
            return [first, *(_taken_again(rng, stage) for _ in range(count - 1))]
    raise ValueError(f"no object of {families} can be seen with the seed {seed}")


def _taken_again(rng: np.random.Generator, stage: _Stage) -> Sample:
    painted = {
        part: (repainted(rng, picture), turn)
        for part, (picture, turn) in stage.built.prints.items()
    }
    sample = stage.photographed(rng, replace(stage.built, prints=painted))
    if rng.random() >= CUT_AGAIN:
        return sample
    rgb, mask = _cut(rng, sample.rgb, sample.mask)
    return replace(sample, rgb=rgb, mask=mask)


class _Stage(NamedTuple):
    """An object before a camera, and what its rays meet."""

    name: str
    built: PrimitiveBuilder
    solid: Solid
    ground: float
    eye: _Eye
    rays: F64  # (n, 3)
    lengths: F64  # (n,)
    lamps: F64  # (3, 3)
    met: F64  # (n, 16): see `trace`
    mask: Mask  # (s, s)

    @staticmethod
    def of(rng: np.random.Generator, name: str, side: int) -> _Stage | None:
        """None where the object is hardly seen."""
        built = (FAMILIES | FURTHER)[name](rng)
        if not built.prints and rng.random() < 0.12:
            built.twist = float(np.clip(rng.normal(0, 0.5), -TWISTED, TWISTED))
        if not built.prints and rng.random() < 0.1:
            built.bend = float(np.clip(rng.normal(0, 0.25), -BENT, BENT))
        solid = built.finish()
        faced = FACED_PRINT if built.prints else FACED
        eye = _aim(rng, partial(_any_turn, faced=faced))
        is_over_ground = eye.axes[2, 1] < -0.05 and rng.random() < 0.75
        ground = lowest(solid, COLUMNS) if is_over_ground else NO_GROUND
        eye = _framed(rng, solid, eye)
        if eye is None:
            return None
        rays, lengths = _rays(eye, side)
        lamps = _lamps(rng, eye)
        met = np.zeros((side * side, 16))
        trace(rays, eye.at, solid, lamps, ground, 0, side * side, met)
        mask = (met[:, 0] > 0).reshape(side, side)
        if mask.mean() < LEAST:
            return None
        return _Stage(name, built, solid, ground, eye, rays, lengths, lamps, met, mask)

    def photographed(self, rng: np.random.Generator, built: PrimitiveBuilder) -> Sample:
        """`built` may have other pictures on it than the stage's own."""
        scene = _Scene(self.solid, _materials(rng, built), self.ground)
        side = len(self.mask)
        picture = _picture(rng, scene, self.eye, self.rays, self.lamps, self.met, side)
        return _measured(rng, self.name, self.eye, self.met, self.lengths, self.mask, picture)


def _aim(rng: np.random.Generator, turn: Callable[[np.random.Generator], F64]) -> _Eye:
    """A camera that looks at the object's middle, which is somewhere in its picture.

    `turn` draws how the object (y up, its front towards +z) is turned (3, 3) before the camera.
    """
    field = np.radians(rng.uniform(*FIELDS))
    width = 2 * np.tan(field / 2) * rng.uniform(*SHARES)  # tangents
    away = max(NEAREST, 1.25 / np.sin(np.arctan(width / 2)) / np.sqrt(2.0))
    down = np.diag([1.0, -1.0, -1.0])  # y up, towards the camera -> y down, forward
    axes = down @ turn(rng)
    room = 0.5 * max(2 * np.tan(field / 2) - width, 0.0)
    middle = rng.uniform(-room, room, 2) * [1.0, 0.6]
    forward = np.array([*middle, 1.0])
    return _Eye(-away * (axes.T @ (forward / np.linalg.norm(forward))), axes, middle, width)


def _any_turn(rng: np.random.Generator, faced: float) -> F64:
    """(3, 3) for `_aim`; `faced`: how often the camera stands before the object."""
    pitch = np.radians(rng.choice([rng.uniform(-5, 35), rng.uniform(-50, 88)], p=[0.75, 0.25]))
    yaw = rng.normal(0, 0.7) if rng.random() < faced else rng.uniform(0, 2 * np.pi)
    return turned(0, pitch, np.radians(rng.normal(0, 6))) @ turned(yaw).T


def _framed(rng: np.random.Generator, solid: Solid, eye: _Eye) -> _Eye | None:
    """The crop about what is seen of the object."""
    loose = eye._replace(width=2 * LOOSE / np.sqrt(max(eye.at @ eye.at - 1.0, 0.3)))
    rays, _ = _rays(loose, COARSE)
    out = np.zeros((COARSE * COARSE, 16))
    trace(rays, eye.at, solid, np.zeros((0, 3)), NO_GROUND, 0, len(rays), out)
    mask = (out[:, 0] > 0).reshape(COARSE, COARSE)
    if mask.sum() < 12:
        return None
    box = np.array(box_of(mask)) / COARSE - 0.5
    size = max(box[2] - box[0], box[3] - box[1]) + 1 / COARSE
    middle = 0.5 * (box[:2] + box[2:]) + rng.normal(0, 0.02, 2) * size
    pad = rng.uniform(*PAD)
    return eye._replace(
        middle=loose.middle + middle * loose.width, width=float(size * pad * loose.width)
    )


def _rays(eye: _Eye, side: int) -> tuple[F64, F64]:
    """Unit rays (n, 3) of the crop's pixels, object frame, and the lengths (n,) of (x, y, 1)."""
    steps = ((np.arange(side) + 0.5) / side - 0.5) * eye.width
    x, y = np.meshgrid(steps + eye.middle[0], steps + eye.middle[1])
    ways = np.stack([x.ravel(), y.ravel(), np.ones(side * side)], 1)
    lengths = np.linalg.norm(ways, axis=1)
    return np.ascontiguousarray((ways / lengths[:, None]) @ eye.axes), lengths


def _lamps(rng: np.random.Generator, eye: _Eye) -> F64:
    """(3, 3) directions towards them; mostly from above and from the camera's side."""
    lamps = rng.normal(0, 1, (3, 3)) * [1, 0.8, 1] + [0, 0.8, 0] - 0.7 * eye.axes[2]
    return lamps / np.linalg.norm(lamps, axis=1, keepdims=True)


def _materials(rng: np.random.Generator, built: PrimitiveBuilder) -> list[Material]:
    """One for each part; parts with the same number look the same, others often alike."""
    base = a_colour(rng)
    found: dict[int, Material] = {}
    for number in built.material:
        if number in built.prints:
            found[number] = a_print(rng, *built.prints[number], built.ball, REACH)
        elif number not in found:
            found[number] = a_material(rng, base if rng.random() < 0.35 else None)
    return [found[number] for number in built.material]


def _picture(
    rng: np.random.Generator, scene: _Scene, eye: _Eye, rays: F64, lamps: F64, out: F64, side: int,
    backdrop: F64 | None = None,
) -> F64:  # fmt: skip
    """(s, s, 3) linear light."""
    backdrop = _backdrop(rng, side) if backdrop is None else backdrop
    picture = backdrop.copy()
    on_ground = out[:, 13] > 0
    shadow = rng.uniform(0.2, 0.9) * (1 - out[:, 11]) + 0.5 * (1 - out[:, 12])
    picture[on_ground] *= (1 - np.clip(shadow, 0, 0.9))[on_ground, None]
    seen = np.flatnonzero(out[:, 0] > 0)
    at = eye.at + out[seen, :1] * rays[seen]
    normal, part = out[seen, 4:7], out[seen, 3].astype(int)
    noise = noise_block(rng)
    power = np.array([rng.uniform(0.6, 1.6), *rng.uniform(0, 0.6, 2) * (rng.random(2) < 0.5)])
    tint = np.exp(rng.normal(0, 0.12, (3, 3)))
    sky = rng.uniform(0.15, 0.7) * np.exp(rng.normal(0, 0.1, 3))
    for k in np.unique(part):
        own = part == k
        here = seen[own]
        picture[here] = _lit(
            scene.materials[k], at[own], normal[own], rays[here], lamps, out[here],
            (noise, power, tint, sky, backdrop, side, eye),
        )  # fmt: skip
    return picture.reshape(side, side, 3)


def _lit(
    material: Material, at: F64, normal: F64, rays: F64, lamps: F64, out: F64, light: tuple
) -> F64:
    """(n, 3) light that places (n, 3) send along rays (n, 3) (Blinn 1977)."""
    noise, power, tint, sky, backdrop, side, eye = light
    colour = albedo(material, at, normal, noise)
    if material.bumps:
        tilt = np.stack([grain(noise, at * s) for s in (9.0, 11.0, 13.0)], 1) - 0.5
        normal = normal + material.bumps * tilt
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    opened = (0.35 + 0.65 * out[:, 7]) * (0.6 + 0.4 * normal[:, 1])
    total = colour * sky * opened[:, None]
    for k, lamp in enumerate(lamps):
        lit = out[:, 8 + k] * power[k]
        facing = np.maximum(normal @ lamp, 0)
        half = lamp - rays
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        spark = material.shine * np.maximum((half * normal).sum(1), 0) ** material.gloss
        total += (lit * tint[k][:, None]).T * (colour * facing[:, None] + 0.6 * spark[:, None])
    if material.mirror:
        bounced = (rays - 2 * (rays * normal).sum(1, keepdims=True) * normal) @ eye.axes.T
        x, y = ((0.5 + 0.49 * bounced[:, c]) * (side - 1) for c in (0, 1))
        around = backdrop.reshape(side, side, 3)[y.astype(int), x.astype(int)]
        total = total * (1 - material.mirror) + material.mirror * around
    return total


def _backdrop(rng: np.random.Generator, side: int) -> F64:
    """(n, 3) a photograph, more or less out of focus; sometimes plain."""
    if rng.random() < 0.12:
        ramp = np.linspace(rng.uniform(0.5, 1), rng.uniform(0.5, 1), side)
        return np.repeat((ramp[:, None] * a_colour(rng)), side, 0).reshape(-1, 3)
    picture = cv2.resize(a_crop(rng), (side, side), interpolation=cv2.INTER_AREA)
    if rng.random() < 0.7:
        picture = cv2.GaussianBlur(picture, (0, 0), rng.uniform(0.4, 5.0))
    return np.asarray(picture, np.float64).reshape(-1, 3)


def _measured(
    rng: np.random.Generator, name: str, eye: _Eye, out: F64, lengths: F64, mask: Mask, picture: F64
) -> Sample:
    side = len(mask)
    rgb, shown = _developed(rng, picture), mask
    if rng.random() < CUT:
        rgb, shown = _cut(rng, rgb, mask)
    away, exit_, last = (np.where(mask.ravel(), out[:, k], 0.0) for k in (0, 1, 2))
    mean = away[shown.ravel()].mean()
    # One crop unit: its width at the object's distance, which is measured along the middle ray.
    unit = mean / np.hypot(np.linalg.norm(eye.middle), 1.0) * eye.width
    front = np.where(mask, (mean - away.reshape(mask.shape)) / unit, 0)
    thickness = np.where(mask, (exit_ - away).reshape(mask.shape) / unit, 0)
    depth = np.where(mask, (last - away).reshape(mask.shape) / unit, 0)
    normal = (out[:, 4:7] @ eye.axes.T).reshape(side, side, 3) * mask[..., None]
    part = np.where(mask, out[:, 3].reshape(mask.shape), -1).astype(np.int16)
    edge, mask = _hiding(front, mask, part), shown
    kept = mask.astype(np.float32)
    tangents = np.array([*eye.middle, eye.width], np.float32)
    return Sample(
        rgb, mask, front.astype(np.float32) * kept, thickness.astype(np.float32) * kept,
        depth.astype(np.float32) * kept, normal.astype(np.float32) * kept[..., None],
        edge & mask, np.where(mask, part, -1).astype(np.int16), tangents, name,
    )  # fmt: skip


def _hiding(front: F64, mask: Mask, part: np.ndarray) -> Mask:
    """(s, s) pixels beside which the surface jumps back, more than the slopes around it say."""
    edge = np.zeros(mask.shape, bool)
    for axis in (0, 1):
        for sense in (1, -1):
            other, inside = np.roll(front, -sense, axis), np.roll(mask, -sense, axis)
            before, own = np.roll(front, sense, axis), np.roll(mask, sense, axis)
            beyond = np.roll(front, -2 * sense, axis)
            slope = np.where(own, np.abs(front - before), 0)
            slope = np.maximum(slope, np.where(inside, np.abs(beyond - other), 0).clip(0, JUMP))
            least = np.where(part == np.roll(part, -sense, axis), JUMP, PART_JUMP)
            edge |= mask & inside & (front - other > least + 1.5 * np.minimum(slope, JUMP))
    return edge


def _developed(rng: np.random.Generator, picture: F64) -> RGB:
    """Linear light as a camera stores it: exposure, blur, noise, and now and then JPEG."""
    exposure = np.exp(rng.normal(0, 0.25))
    level = np.quantile(picture, 0.97)
    light = picture * exposure / max(level, 0.15) * 0.85
    blurred = cv2.GaussianBlur(light, (0, 0), rng.uniform(0.35, 0.9))
    shown = np.clip(blurred, 0, 1) ** (1 / 2.2) + rng.normal(0, rng.uniform(0, 0.03), light.shape)
    rgb = np.clip(shown * 255 + 0.5, 0, 255).astype(np.uint8)
    if rng.random() < 0.3:
        quality = int(rng.uniform(40, 90))
        _, coded = cv2.imencode(".jpg", rgb, [cv2.IMWRITE_JPEG_QUALITY, quality])
        rgb = np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), np.uint8)
    return rgb


def _cut(rng: np.random.Generator, rgb: RGB, mask: Mask) -> tuple[RGB, Mask]:
    """As if the photo ended there; never more than half of the object is lost."""
    side = len(mask)
    axis, at = int(rng.integers(2)), int(rng.uniform(0.15, 0.45) * side)
    beyond = np.arange(side) >= side - at if rng.random() < 0.5 else np.arange(side) < at
    gone = np.broadcast_to(beyond if axis else beyond[:, None], mask.shape)
    if (mask & gone).sum() > 0.5 * mask.sum():
        return rgb, mask
    return np.where(gone[..., None], 0, rgb).astype(np.uint8), mask & ~gone
