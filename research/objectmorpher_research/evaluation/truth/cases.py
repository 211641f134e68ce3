"""The cases: made photos, what a user would say of the edit, and what is then truly seen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F64, RGB, Mask
from objectmorpher_core.base.camera import Camera

from .materials import SURFACES, SolidMaterial
from .motions import RIGID, Rigid, TruthEdit, grips
from .settings import FIELDS, HEIGHT, WIDTH, Lamp, Setting, SolidView, TruthStage

RIM = 4  # px within the silhouette, in which nobody takes hold
RIGID_POINTS = 6  # that are shown of a rigid motion
AROUND = 8  # px about what changes that count as inside
APART = 8.0  # px, of two points
STILL = 0.75  # px, a point that moves less is a pin


@dataclass(frozen=True, eq=False)
class TruthGuidance:
    """The guidance of every method: points of the thing and where they must be seen.

    Of a thing that moves as a whole also how, as one would type it: in degrees, as a factor.
    """

    at: F64  # (n, 2) px
    to: F64  # (n, 2) px
    away: F64  # (n,) x its own distance, that each goes away from the camera
    rigid: Rigid | None = None

    @property
    def is_pin(self) -> Mask:
        """(n,)"""
        return (np.linalg.norm(self.to - self.at, axis=1) < STILL) & (np.abs(self.away) < 0.002)


@dataclass(frozen=True, eq=False)
class TruthCase:
    """A photo, an edit, and the truth after it."""

    name: str
    category: str
    photo: RGB  # (H, W, 3)
    mask: Mask  # (H, W) the thing's
    camera: Camera
    guidance: TruthGuidance
    truth: RGB  # (H, W, 3) the result
    plate: RGB | None  # (H, W, 3) what is behind the thing; None: nobody knows
    shown: F64  # (H, W) the thing's true coverage after the edit
    region: F64  # (H, W) 1 where the edit changes something, or near it
    has_outside: bool = True  # whether the truth says what is outside the region


@dataclass(frozen=True, eq=False)
class EditOutcome:
    """A method's result for a case, and where the thing is in it."""

    pixels: RGB  # (H, W, 3)
    alpha: F64  # (H, W) the thing's coverage
    reached: F64  # (n, 2) px at which the guidance's points are now


@dataclass(frozen=True)
class PlannedCase:
    """A case that can be made."""

    number: int
    setting: Setting
    motion: TruthEdit

    @property
    def name(self) -> str:
        kind = self.motion.category.replace(" ", "-")
        return f"{self.number:02d}-{kind}-{self.setting.solid}"


# category -> the solids, and by how much
PLAN: dict[str, tuple[tuple[str, float], ...]] = {
    "turn": (("figure", 25), ("dog", -30), ("mug", 30), ("crate", 20), ("car", -25),
             ("cactus", -35), ("mushroom", 35), ("bottle", 25), ("star", -20), ("vase", -30)),
    "tilt": (("figure", 18), ("dog", -20), ("mug", -18), ("crate", 20), ("car", 15),
             ("banana", -25), ("mushroom", 20), ("bottle", -22)),
    "depth": (("figure", -0.28), ("dog", 0.4), ("mug", -0.25), ("crate", -0.3), ("car", 0.5),
              ("star", -0.22)),
    "scale": (("vase", 1.35), ("mushroom", 0.7), ("banana", 1.3), ("cactus", 0.75),
              ("bottle", 1.25)),
    "bend out": (("plank", 50), ("bottle", -40), ("figure", 30), ("vase", 40), ("banana", -45),
                 ("crate", 35), ("dog", -40), ("cactus", 45)),
    "bend in": (("plank", 50), ("bottle", -35), ("banana", -40), ("figure", 30), ("vase", 35),
                ("cactus", -40)),
    "twist": (("plank", 50), ("crate", -40), ("vase", 45), ("figure", -45), ("mushroom", 40),
              ("bottle", -50)),
    "limb": (("figure:left", 50), ("figure:right*", -40), ("dog:head", 30), ("dog:tail", -45),
             ("dog:leg 0", 40), ("star:arm 1", 35), ("cactus:left", 35), ("cactus:right*", 35)),
    "stretch": (("plank", 1.3), ("bottle", 1.25), ("banana", 1.25), ("dog", 1.25),
                ("vase", 0.75), ("car", 1.2)),
}  # fmt: skip
QUICK = {"turn": (0, 3), "tilt": (2,), "depth": (0,), "scale": (0,), "bend out": (0, 2),
         "bend in": (1,), "twist": (1,), "limb": (0,), "stretch": (1,)}  # fmt: skip
PLACES = ("coffee", "china", "astronaut", "flower", "chelsea", "rocket")
LYING = {"plank": 12.0, "banana": -15.0, "bottle": 8.0}  # degrees of roll, of some


def wanted_cases(seed: int = 0, is_quick: bool = False) -> tuple[PlannedCase, ...]:
    """Return all cases of a seed: 63, or 11 of them."""
    result, number = [], 0
    for category, things in PLAN.items():
        for k, (thing, amount) in enumerate(things):
            number += 1
            if is_quick and k not in QUICK.get(category, ()):
                continue
            solid, _, limb = thing.partition(":")
            motion = TruthEdit(category, amount, limb.rstrip("*"), limb.endswith("*"))
            result.append(PlannedCase(number, setting_of(solid, category in RIGID, seed), motion))
    return tuple(result)


def setting_of(solid: str, is_first: bool, seed: int) -> Setting:
    """Return one of a solid's two photos."""
    key = [seed, sum(map(ord, solid)), int(is_first)]
    rng = np.random.default_rng(key)
    surface = ("marble", *SURFACES)[int(rng.integers(1 + len(SURFACES)))]
    tint = tuple(float(v) for v in rng.uniform(0.55, 1.0, 3))
    shine = float(rng.choice([0.0, 0.0, 0.25]))
    scale = float(rng.uniform(220, 420))
    material = SolidMaterial(surface, scale, tint, shine, int(rng.integers(8)))  # type: ignore[arg-type]
    yaw, pitch = float(rng.uniform(15, 35) * rng.choice([-1, 1])), float(rng.uniform(6, 16))
    if solid in ("star", "banana", "plank"):  # flat or thin: seen from the front
        yaw *= 0.5
    roll = LYING.get(solid, 0.0) if is_first else 0.0
    lamp = Lamp(
        (float(rng.uniform(-0.9, 0.9)), float(rng.uniform(-0.9, -0.4)), -0.6),
        float(rng.uniform(0.35, 0.6)),
    )
    place, fov = PLACES[int(rng.integers(len(PLACES)))], FIELDS[int(rng.integers(len(FIELDS)))]
    at = (WIDTH / 2 + float(rng.uniform(-35, 35)), HEIGHT / 2 + float(rng.uniform(-12, 12)))
    share = float(rng.uniform(0.52, 0.6))
    return Setting(solid, material, (yaw, pitch, roll), place, lamp, fov, share, at)


@lru_cache(maxsize=2)
def staged(setting: Setting) -> tuple[TruthStage, SolidView]:
    """A setting and its photo's view."""
    stage = TruthStage(setting)
    return stage, stage.draw(stage.body().points)


def make_case(wanted: PlannedCase) -> TruthCase:
    """Draws the photo and the truth."""
    stage, rest = staged(wanted.setting)
    motion = wanted.motion
    world = stage.moved(motion)
    after = stage.draw(world)
    mask = rest.alpha > 0.5
    covered = (rest.alpha > 0) | (after.alpha > 0)
    near = cv2.dilate(covered.astype(np.uint8), np.ones((2 * AROUND + 1, 2 * AROUND + 1)))
    return TruthCase(
        wanted.name, motion.category, rest.over(stage.plate), mask, stage.camera,
        _guidance(stage, rest, after, world, motion), after.over(stage.plate), stage.plate,
        after.alpha, near.astype(np.float64),
    )  # fmt: skip


def _guidance(
    stage: TruthStage, rest: SolidView, after: SolidView, world: F64, motion: TruthEdit
) -> TruthGuidance:
    body = stage.body(motion.limb)
    xy = inner_pixels(rest.alpha > 0.5)
    corners, weights = stage.surface_points(xy, rest)
    before = np.einsum("nkd,nk->nd", body.points[corners], weights)
    there = np.einsum("nkd,nk->nd", world[corners], weights)
    if motion.rigid is not None:
        seen = np.flatnonzero(stage.is_seen(there, after))
        chosen = seen[spread_out(xy[seen], RIGID_POINTS)]
    else:
        where, pins = grips(motion, body)
        own = _of_parts(body.limb[0], corners, stage) if body.limb is not None else None
        picked = [_nearest(xy, place, own) for place in stage.camera.project(where)]
        if own is not None:
            rest_of_it = np.flatnonzero(~own)
            picked += list(rest_of_it[spread_out(xy[rest_of_it], pins)])
        chosen = _apart(xy, picked)
    at, to = stage.camera.project(before[chosen]), stage.camera.project(there[chosen])
    return TruthGuidance(at, to, there[chosen, 2] / before[chosen, 2] - 1, motion.rigid)


def _of_parts(parts: tuple[int, ...], corners: np.ndarray, stage: TruthStage) -> Mask:
    return np.isin(stage.solid.parts[corners[:, 0]], parts)


def _apart(xy: F64, picked: list[int]) -> np.ndarray:
    """Those that are not next to one before them."""
    kept: list[int] = []
    for index in picked:
        if all(np.linalg.norm(xy[index] - xy[other]) >= APART for other in kept):
            kept.append(index)
    return np.array(kept)


def _nearest(xy: F64, place: F64, own: Mask | None) -> int:
    gaps = np.linalg.norm(xy - place, axis=1)
    return int(np.where(own, gaps, np.inf).argmin() if own is not None else gaps.argmin())


def inner_pixels(mask: Mask) -> F64:
    """(n, 2) middles of the pixels that are well inside a mask (H, W)."""
    away = cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    rim = RIM if (away > RIM).sum() >= 50 else 1
    rows, columns = np.nonzero(away > rim)
    return np.column_stack([columns, rows]).astype(np.float64) + 0.5


def spread_out(xy: F64, count: int) -> np.ndarray:
    """Indices of `count` of the points (n, 2), each the farthest from those before it."""
    chosen = [int(np.linalg.norm(xy - xy.mean(0), axis=1).argmax())]
    gaps = np.linalg.norm(xy - xy[chosen[0]], axis=1)
    while len(chosen) < min(count, len(xy)):
        chosen.append(int(gaps.argmax()))
        gaps = np.minimum(gaps, np.linalg.norm(xy - xy[chosen[-1]], axis=1))
    return np.array(chosen)
