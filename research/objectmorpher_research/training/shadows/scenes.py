"""What a camera sees of a scene about its thing, and the light there with and without the thing."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import cv2
import numba as nb
import numpy as np

from objectmorpher_core.base.arrays import F32, F64, Mask
from objectmorpher_core.base.masks import box_of
from objectmorpher_core.compose.shadow.shadow_look import SIDE, THING

from .solids import (
    BOX,
    NOWHERE,
    PartArrays,
    Parts,
    add_thing,
    any_turn,
    hit,
    normal_at,
)

FINE = 2 * SIDE  # px across, of what is seen
GROUND, WALL, NEIGHBOUR, THING_SEEN, SKY = range(5)
LAMPS = 2  # of a scene; a sample mixes them
SHARP, RAYS, SKY_RAYS = 0.01, (2, 5), 10  # rays to a lamp that is nearly a point, to others, up
FARTHEST = 60.0  # of ground that is drawn
THROWN = 10.0  # from the origin, as far as anything throws a shadow
FIRST_LOOK = 80  # px across, of the look that finds the thing's box
LEAST = 20  # px of it, that are the thing's
LEAST_GROUND = 0.2  # of the window
TRIES = 50


class Wall(NamedTuple):
    """An upright plane; none where `away` is 0."""

    away: float
    normal: F64  # (3,)


@dataclass(frozen=True, eq=False)
class SceneGeometry:
    """A square window about a thing whose longer side is THING of SIDE cells."""

    what: np.ndarray  # (FINE, FINE) u8: GROUND to SKY
    place: F32  # (FINE, FINE, 2) on the ground or the wall; of a part: which, and its height
    facing: F32  # (LAMPS + 1, FINE, FINE) how much parts face the lamps, and the sky
    light: F32  # (LAMPS + 1, FINE, FINE, 2) share that reaches ground or wall, with the thing
    # and without


@nb.njit(cache=True, fastmath=True)
def _to_wall(eye, way, away, normal):  # type: ignore[no-untyped-def]
    facing = way[0] * normal[0] + way[2] * normal[2]
    if away <= 0 or facing <= 1e-5:
        return NOWHERE
    return (away - eye[0] * normal[0] - eye[2] * normal[2]) / facing


@nb.njit(cache=True, fastmath=True)
def _look(ways, eye, parts, shapes, wall, what, place, normals):  # type: ignore[no-untyped-def]
    """Write what rays (n, 3) from `eye` meet first, where, and parts' normals."""
    for k in range(len(ways)):
        way = ways[k]
        nearest, kind = NOWHERE, SKY
        if way[1] < -1e-5 and -eye[1] / way[1] <= FARTHEST:
            nearest, kind = -eye[1] / way[1], GROUND
        away = _to_wall(eye, way, wall[0], wall[1])
        if 0 < away < nearest:
            nearest, kind = away, WALL
        part = -1
        for q in range(len(parts.kind)):
            shape = shapes[parts.board[q]]
            away = hit(parts.kind[q], parts.into[q], parts.middle[q], shape, eye, way)
            if away < nearest:
                nearest, part = away, q
                kind = THING_SEEN if parts.is_thing[q] else NEIGHBOUR
        what[k] = kind
        if kind == SKY:
            continue
        at = eye + nearest * way
        if kind == GROUND:
            place[k, 0], place[k, 1] = at[0], at[2]
        elif kind == WALL:
            place[k, 0], place[k, 1] = at[0] * wall[1][2] - at[2] * wall[1][0], at[1]
        else:
            normal_at(parts.kind[part], parts.into[part], parts.middle[part], at, normals[k])
            place[k, 0], place[k, 1] = part, at[1]


@nb.njit(cache=True, fastmath=True)
def _shine(ways, eye, parts, shapes, wall, lamps, spread, seed, out):  # type: ignore[no-untyped-def]
    """Write (n, 2) the share of the lamps' light on ground or wall, with the thing and without."""
    np.random.seed(seed)  # noqa: NPY002  # compiled: it has no generator of its own
    normal, beam = np.zeros(3), np.zeros(3)
    for k in range(len(ways)):
        way = ways[k]
        to_ground = -eye[1] / way[1] if way[1] < -1e-5 else NOWHERE
        to_wall = _to_wall(eye, way, wall[0], wall[1])
        if min(to_ground, to_wall) >= NOWHERE:
            out[k] = 1.0
            continue
        normal[:] = -wall[1]
        if to_ground < to_wall:
            normal[:] = 0.0
            normal[1] = 1.0
        at = eye + min(to_ground, to_wall, FARTHEST) * way + 1e-3 * normal
        is_near = at[0] ** 2 + at[2] ** 2 < THROWN**2
        whole, with_thing, without = 0.0, 0.0, 0.0
        for lamp in lamps:
            for axis in range(3):
                beam[axis] = lamp[axis] + spread * np.random.normal()  # noqa: NPY002  # compiled
            whole += max((lamp * normal).sum(), 0.0)
            facing = max((beam * normal).sum(), 0.0)
            if facing == 0 or beam[1] <= 0:
                continue
            is_free, past_thing = True, True
            for q in range(len(parts.kind)):
                if not is_near or (parts.is_thing[q] and not past_thing):
                    continue
                shape = shapes[parts.board[q]]
                if hit(parts.kind[q], parts.into[q], parts.middle[q], shape, at, beam) < NOWHERE:
                    if parts.is_thing[q]:
                        past_thing = False
                    else:
                        is_free = False
                        break
            without += facing if is_free else 0.0
            with_thing += facing if is_free and past_thing else 0.0
        whole = max(whole, 0.15 * len(lamps))
        out[k, 0], out[k, 1] = with_thing / whole, without / whole


@dataclass(frozen=True, eq=False)
class _Camera:
    eye: F64
    axes: F64  # (3, 3) rows: right, up, forward

    @staticmethod
    def drawn(rng: np.random.Generator) -> _Camera:
        low, high = (3, 88) if rng.random() < 0.3 else (8, 50)
        pitch, away = np.radians(rng.uniform(low, high)), rng.uniform(2, 6)
        at = np.array([rng.uniform(-0.3, 0.3), 0.4, 0.0])
        eye = at + away * np.array([0, np.sin(pitch), -np.cos(pitch)])
        eye[1] = max(eye[1], 0.15)
        forward = (at - eye) / np.linalg.norm(at - eye)
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.linalg.norm(right)
        up, roll = np.cross(forward, right), rng.normal(0, 0.04)
        cos, sin = np.cos(roll), np.sin(roll)
        return _Camera(eye, np.array([cos * right + sin * up, cos * up - sin * right, forward]))

    def ways(self, left: float, top: float, size: float, count: int) -> F64:
        """Unit rays (count², 3) through a square window of tangents."""
        steps = (np.arange(count) + 0.5) / count * size
        x, y = np.meshgrid(left + steps, top - steps)
        ways = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], 1) @ self.axes
        return np.asarray(ways / np.linalg.norm(ways, axis=1, keepdims=True))


def make_geometry(rng: np.random.Generator, shapes: Mask) -> SceneGeometry:
    """Draw a scene whose thing is seen whole. `shapes`: silhouettes of boards."""
    for _ in range(TRIES):
        parts, camera = _furnished(rng, len(shapes)), _Camera.drawn(rng)
        lean = rng.normal(0, 0.35)
        away = float(rng.uniform(0.4, 2.5)) if rng.random() < 0.3 else 0.0
        wall = Wall(away, np.array([np.sin(lean), 0.0, np.cos(lean)]))
        window = _window(camera, parts, shapes, wall)
        found = None if window is None else _geometry(rng, camera, parts, shapes, wall, window)
        if found is not None:
            return found
    raise RuntimeError(f"no thing was seen whole in {TRIES} scenes")


def _furnished(rng: np.random.Generator, boards: int) -> PartArrays:
    """A thing, and neighbours: some like it, others dark and large as a house front or a book."""
    parts = Parts()
    add_thing(rng, parts, boards)
    for _ in range(int(rng.choice([0, 0, 0, 1, 1, 2, 3, 4]))):
        turn, away = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 2)
        at = away * np.cos(turn), away * np.sin(turn) + 0.3
        if rng.random() < 0.3:
            half = np.array([rng.uniform(0.1, 0.9), rng.uniform(0.03, 1.2), rng.uniform(0.1, 0.6)])
            middle = np.array([at[0], half[1], at[1]])
            parts.add(BOX, middle, half, any_turn(rng), is_thing=False)
        else:
            add_thing(rng, parts, boards, False, at, rng.uniform(0.4, 1.3))
    return parts.arrays()


def _seen(
    camera: _Camera, ways: F64, parts: PartArrays, shapes: Mask, wall: Wall
) -> tuple[np.ndarray, F64, F64]:
    what = np.zeros(len(ways), np.uint8)
    place, normals = np.zeros((len(ways), 2)), np.zeros((len(ways), 3))
    _look(ways, camera.eye, parts, shapes, wall, what, place, normals)
    return what, place, normals


def _window(
    camera: _Camera, parts: PartArrays, shapes: Mask, wall: Wall
) -> tuple[float, float, float] | None:
    """Left, top and size of the window about the thing; None where it is not seen whole."""
    half = 2.4 / float(np.linalg.norm(camera.eye)) + 0.6
    ways = camera.ways(-half, half, 2 * half, FIRST_LOOK)
    mask = _seen(camera, ways, parts, shapes, wall)[0].reshape(FIRST_LOOK, FIRST_LOOK) == THING_SEEN
    if mask.sum() < LEAST:
        return None
    x0, y0, x1, y1 = box_of(mask)
    if min(x0, y0) == 0 or max(x1, y1) == FIRST_LOOK:
        return None
    step = 2 * half / FIRST_LOOK
    size = max(x1 - x0, y1 - y0) * step * SIDE / THING
    x, y = -half + step * (x0 + x1) / 2, half - step * (y0 + y1) / 2
    return x - size / 2, y + size / 2, size


def _geometry(
    rng: np.random.Generator, camera: _Camera, parts: PartArrays, shapes: Mask, wall: Wall,
    window: tuple[float, float, float],
) -> SceneGeometry | None:  # fmt: skip
    what, place, normals = _seen(camera, camera.ways(*window, FINE), parts, shapes, wall)
    if (what == GROUND).mean() < LEAST_GROUND:
        return None
    ways = {side: camera.ways(*window, side) for side in (FINE, SIDE)}
    lights, lamps = [], []
    for _ in range(LAMPS):
        turn, rise = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(15, 80))
        flat = np.cos(rise)
        lamps.append(np.array([np.cos(turn) * flat, np.sin(rise), np.sin(turn) * flat]))
        spread = float(rng.choice([0.005, 0.02, 0.05, 0.1, 0.2]))
        beams = np.repeat(lamps[-1][None], RAYS[spread >= SHARP], 0)
        lights.append(_lit(rng, camera, ways[FINE], parts, shapes, wall, beams, spread))
    sky = _lit(rng, camera, ways[SIDE], parts, shapes, wall, _sky(rng), 0.12)  # it is soft
    lights.append(cv2.resize(sky, (FINE, FINE), interpolation=cv2.INTER_LINEAR))
    facing = [np.clip(normals @ lamp, 0, 1) for lamp in lamps] + [0.6 + 0.4 * normals[:, 1]]
    fine = (FINE, FINE)
    return SceneGeometry(
        what.reshape(fine), place.reshape(*fine, 2).astype(np.float32),
        np.stack(facing).reshape(-1, *fine).astype(np.float32), np.stack(lights),
    )  # fmt: skip


def _lit(
    rng: np.random.Generator, camera: _Camera, ways: F64, parts: PartArrays, shapes: Mask,
    wall: Wall, beams: F64, spread: float,
) -> F32:  # fmt: skip
    out = np.zeros((len(ways), 2))
    seed = int(rng.integers(1 << 30))
    _shine(ways, camera.eye, parts, shapes, wall, beams, spread, seed, out)
    side = round(len(ways) ** 0.5)
    return out.reshape(side, side, 2).astype(np.float32)


def _sky(rng: np.random.Generator) -> F64:
    """(n, 3) ways upwards, as many as their share of an even sky's light."""
    k = np.arange(SKY_RAYS)
    turn, out = 2 * np.pi * (k * 0.618 + rng.random()), np.sqrt((k + 0.5) / SKY_RAYS)
    return np.stack([out * np.cos(turn), np.sqrt(1 - out**2), out * np.sin(turn)], -1)


def packed(scenes: list[SceneGeometry]) -> dict[str, np.ndarray]:
    """Arrays (n, ...) of scenes, in half precision where that is enough."""
    found = {f.name: np.stack([getattr(s, f.name) for s in scenes]) for f in fields(SceneGeometry)}
    return found | {name: found[name].astype(np.float16) for name in ("facing", "light")}


def unpacked(arrays: dict[str, np.ndarray]) -> list[SceneGeometry]:
    """The scenes in arrays of `packed`."""
    names = [f.name for f in fields(SceneGeometry)]
    count = len(arrays["what"])
    return [
        SceneGeometry(arrays["what"][k], *(arrays[n][k].astype(np.float32) for n in names[1:]))
        for k in range(count)
    ]
