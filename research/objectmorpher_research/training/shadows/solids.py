"""Things of a few ellipsoids, boxes, cylinders, cones and boards, and where rays meet them.

World axes: x right, y up, z away from the camera; the ground is y = 0, and a thing is about 1 high.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import cv2
import numba as nb
import numpy as np

from objectmorpher_core.base.arrays import F64, Mask

ELLIPSOID, BOX, CYLINDER, BOARD, CONE = range(5)  # cylinders and cones stand along their own y
ANY_SOLID = (ELLIPSOID, BOX, CYLINDER, CONE)
NOWHERE = 1e30  # how far away what a ray never meets is
NEAREST = 1e-4  # along a ray
TINY = 1e-9
SIDE = 64  # px of a board's silhouette
FLOATING, SUNK = 0.06, 0.1  # how often a thing floats, and stands a little in the ground
KINDS = {
    "one": 0.13, "stack": 0.12, "legs": 0.08, "figure": 0.1, "blob": 0.12, "board": 0.17,
    "car": 0.06, "animal": 0.08, "plate": 0.05, "plant": 0.05, "lamp": 0.04,
}  # fmt: skip


class PartArrays(NamedTuple):
    """The parts of a scene, as kernels read them."""

    kind: np.ndarray  # (n,)
    into: F64  # (n, 3, 3) from the world to the part's own frame, in which it reaches from -1 to 1
    middle: F64  # (n, 3)
    board: np.ndarray  # (n,) which silhouette
    is_thing: Mask  # (n,) else a neighbour's


@nb.njit(cache=True, fastmath=True)
def hit(kind, into, middle, shape, origin, way):  # type: ignore[no-untyped-def]
    """How far along a ray a part is first met; NOWHERE where never. `shape`: a board's (s, s)."""
    p = origin - middle
    a0 = into[0, 0] * p[0] + into[0, 1] * p[1] + into[0, 2] * p[2]
    a1 = into[1, 0] * p[0] + into[1, 1] * p[1] + into[1, 2] * p[2]
    a2 = into[2, 0] * p[0] + into[2, 1] * p[1] + into[2, 2] * p[2]
    b0 = into[0, 0] * way[0] + into[0, 1] * way[1] + into[0, 2] * way[2]
    b1 = into[1, 0] * way[0] + into[1, 1] * way[1] + into[1, 2] * way[2]
    b2 = into[2, 0] * way[0] + into[2, 1] * way[1] + into[2, 2] * way[2]
    b0 = b0 if abs(b0) > TINY else TINY
    b1 = b1 if abs(b1) > TINY else TINY
    b2 = b2 if abs(b2) > TINY else TINY
    if kind == BOARD:
        t = -a2 / b2
        x, y, n = a0 + t * b0, a1 + t * b1, len(shape)
        if t <= NEAREST or abs(x) >= 1 or abs(y) >= 1:
            return NOWHERE
        row, column = min(int((1 - y) / 2 * n), n - 1), min(int((x + 1) / 2 * n), n - 1)
        return t if shape[row, column] else NOWHERE
    near, far = -NOWHERE, NOWHERE
    if kind != ELLIPSOID:  # between two lids
        first, last = (-1 - a1) / b1, (1 - a1) / b1
        near, far = min(first, last), max(first, last)
    if kind == BOX:
        for a, b in ((a0, b0), (a2, b2)):
            first, last = (-1 - a) / b, (1 - a) / b
            near, far = max(near, min(first, last)), min(far, max(first, last))
    else:
        qa, qb, qc = b0 * b0 + b2 * b2, a0 * b0 + a2 * b2, a0 * a0 + a2 * a2
        if kind == ELLIPSOID:
            qa, qb, qc = qa + b1 * b1, qb + a1 * b1, qc + a1 * a1 - 1
        elif kind == CYLINDER:
            qc -= 1
        else:
            wide, narrows = (1 - a1) / 2, -b1 / 2
            qa, qb, qc = qa - narrows * narrows, qb - wide * narrows, qc - wide * wide
        root = qb * qb - qa * qc
        if root < 0 or qa <= 0:
            return NOWHERE
        root = np.sqrt(root)
        near, far = max(near, (-qb - root) / qa), min(far, (-qb + root) / qa)
    if near > far or far <= NEAREST:
        return NOWHERE
    return near if near > NEAREST else far


@nb.njit(cache=True, fastmath=True)
def normal_at(kind, into, middle, place, out):  # type: ignore[no-untyped-def]
    """Write the unit normal (3,) of a part at a place on it."""
    a = into @ (place - middle)
    own = np.zeros(3)
    if kind == ELLIPSOID:
        own[:] = a
    elif kind == BOX:
        side = np.argmax(np.abs(a))
        own[side] = np.sign(a[side])
    elif kind == BOARD:
        own[2] = -1.0
    elif abs(a[1]) > 0.995:
        own[1] = np.sign(a[1])
    else:
        own[0], own[2] = a[0], a[2]
        own[1] = 0.5 * max(np.sqrt(a[0] ** 2 + a[2] ** 2), 0.1) if kind == CONE else 0.0
    normal = into.T @ own
    out[:] = normal / max(np.sqrt((normal * normal).sum()), TINY)


@dataclass
class Parts:
    """What stands in a scene."""

    kind: list[int] = field(default_factory=list)
    into: list[F64] = field(default_factory=list)
    middle: list[F64] = field(default_factory=list)
    board: list[int] = field(default_factory=list)
    is_thing: list[bool] = field(default_factory=list)

    def add(
        self, kind: int, middle: F64, half: F64, turn: F64, board: int = 0, is_thing: bool = True
    ) -> None:
        """Add one part: its middle, half its extent along its own axes, and a rotation (3, 3)."""
        self.kind.append(kind)
        self.middle.append(middle)
        self.into.append(np.diag(1 / np.maximum(half, 1e-3)) @ turn.T)
        self.board.append(board)
        self.is_thing.append(is_thing)

    def arrays(self) -> PartArrays:
        """What kernels read."""
        return PartArrays(
            np.array(self.kind), np.array(self.into), np.array(self.middle), np.array(self.board),
            np.array(self.is_thing),
        )  # fmt: skip

    def lowest(self, first: int) -> float:
        """The y of the lowest point of all parts from `first` on."""
        found = []
        for k in range(first, len(self.kind)):
            axes = np.linalg.inv(self.into[k])[1]
            reach = np.linalg.norm(axes) if self.kind[k] == ELLIPSOID else np.abs(axes).sum()
            found.append(float(self.middle[k][1] - reach))
        return min(found)

    def move(self, first: int, size: float, by: F64) -> None:
        """Scale all parts from `first` on about the origin, and move them."""
        for k in range(first, len(self.kind)):
            self.middle[k] = size * self.middle[k] + by
            self.into[k] = self.into[k] / size


def any_turn(rng: np.random.Generator, tilt: float = 0.0) -> F64:
    """A rotation (3, 3) about the upright by any angle, then by about `tilt` radians about any."""
    cos, sin = np.cos(angle := rng.uniform(0, 2 * np.pi)), np.sin(angle)
    yaw = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    if tilt <= 0:
        return yaw
    return np.asarray(cv2.Rodrigues(rng.normal(size=3) * tilt)[0] @ yaw, np.float64)


class _Builder:
    """Adds the parts of one thing, all turned alike."""

    def __init__(self, rng: np.random.Generator, parts: Parts, boards: int, is_thing: bool) -> None:
        self.rng, self.parts, self.boards, self.is_thing = rng, parts, boards, is_thing
        self.turn = any_turn(rng)

    def any(self, *kinds: int) -> int:
        return int(self.rng.choice(kinds))

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def part(
        self, kind: int, middle: tuple, half: tuple, tilt: float = 0.0, turn: F64 | None = None
    ) -> None:
        if turn is None:
            turn = any_turn(self.rng, tilt) if tilt else np.eye(3)
        at = self.turn @ np.array(middle, float)
        self.parts.add(kind, at, np.array(half, float), self.turn @ turn, is_thing=self.is_thing)

    def one(self) -> None:
        between, tilt = self.between, 0.0 if self.rng.random() < 0.7 else 0.8
        kind = int(self.rng.choice(ANY_SOLID, p=(0.3, 0.35, 0.25, 0.1)))
        half = between(0.1, 0.7), between(0.05, 0.5), between(0.1, 0.7)
        self.part(kind, (0, 0.5, 0), half, turn=any_turn(self.rng, tilt))

    def plate(self) -> None:
        between = self.between
        half = between(0.3, 0.8), between(0.02, 0.1), between(0.3, 0.8)
        self.part(self.any(CYLINDER, BOX, ELLIPSOID), (0, 0.06, 0), half)
        if self.rng.random() < 0.6:
            at = between(-0.2, 0.2), 0.25, between(-0.2, 0.2)
            half = between(0.1, 0.35), between(0.1, 0.3), between(0.1, 0.35)
            self.part(self.any(CYLINDER, ELLIPSOID, BOX), at, half)

    def stack(self) -> None:
        between, top = self.between, 0.0
        for _ in range(int(self.rng.integers(2, 5))):
            high = between(0.05, 0.3)
            at = between(-0.05, 0.05), top + high, between(-0.05, 0.05)
            self.part(self.any(*ANY_SOLID), at, (between(0.08, 0.4), high, between(0.08, 0.4)))
            top += 2 * high * between(0.8, 1)

    def legs(self) -> None:
        between = self.between
        high, wide, deep = between(0.2, 0.5), between(0.2, 0.6), between(0.15, 0.5)
        thick = between(0.02, 0.07)
        for x in (-0.9, 0.9):
            for z in (-0.9, 0.9):
                at = x * wide, high, z * deep
                self.part(self.any(BOX, CYLINDER), at, (thick, high, thick))
        self.part(BOX, (0, 2 * high + 0.04, 0), (wide, between(0.02, 0.12), deep))
        if self.rng.random() < 0.5:
            self.part(BOX, (0, 2 * high + 0.4, deep), (wide, between(0.2, 0.4), 0.03))

    def figure(self) -> None:
        between, wide = self.between, self.between(0.12, 0.22)
        for x in (-1, 1):
            leg = between(0.04, 0.08), 0.26, between(0.04, 0.08)
            self.part(CYLINDER, (x * 0.08, 0.25, between(-0.1, 0.1)), leg, 0.2)
            at = x * (wide + between(0, 0.15)), 0.65, between(-0.1, 0.1)
            self.part(ELLIPSOID, at, (0.05, between(0.15, 0.25), 0.05), 0.6)
        self.part(ELLIPSOID, (0, 0.65, 0), (wide, 0.24, between(0.09, 0.14)), 0.15)
        self.part(ELLIPSOID, (0, 1, 0), (between(0.08, 0.13), between(0.1, 0.15), 0.1))
        if self.rng.random() < 0.3:
            self.part(CYLINDER, (0, 1.1, 0), (0.18, 0.02, 0.18))

    def blob(self) -> None:
        for _ in range(int(self.rng.integers(2, 8))):
            half = self.between(0.08, 0.35) * self.rng.uniform(0.5, 1.5, 3)
            self.part(ELLIPSOID, tuple(self.rng.normal(0, 0.25, 3)), tuple(half), 1.5)

    def board(self) -> None:
        wide, share = self.between(0.3, 0.9), self.rng.random()
        tilt = 1.5 if share < 0.2 else 0.3 if share < 0.5 else 0.0
        turn = any_turn(self.rng, tilt) if tilt else np.eye(3)
        self.parts.add(
            BOARD, np.array([0, 0.5, 0]), np.array([wide, 0.5, 1.0]), turn,
            int(self.rng.integers(self.boards)), self.is_thing,
        )  # fmt: skip

    def car(self) -> None:
        between, long = self.between, self.between(0.5, 0.9)
        across = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
        for x in (-0.6, 0.6):
            for z in (-0.25, 0.25):
                self.part(CYLINDER, (x * long, 0.13, z), (0.13, 0.05, 0.13), turn=across)
        self.part(self.any(BOX, ELLIPSOID), (0, 0.28, 0), (long, 0.16, 0.27))
        cabin = long * between(0.4, 0.7), 0.14, 0.23
        self.part(self.any(BOX, ELLIPSOID), (between(-0.1, 0.1), 0.5, 0), cabin)

    def animal(self) -> None:
        between, long = self.between, self.between(0.25, 0.45)
        for x in (-0.7, 0.7):
            for z in (-0.1, 0.1):
                self.part(CYLINDER, (x * long, 0.2, z), (0.045, 0.22, 0.045), 0.15)
        self.part(ELLIPSOID, (0, 0.45, 0), (long, between(0.14, 0.22), 0.16))
        self.part(ELLIPSOID, (long, 0.65, 0), (0.14, 0.13, 0.1))
        self.part(ELLIPSOID, (long + 0.12, 0.6, 0), (0.1, 0.06, 0.06))
        self.part(ELLIPSOID, (-long - 0.1, 0.55, 0), (0.18, 0.03, 0.03), 0.5)
        for z in (-0.06, 0.06):
            self.part(self.any(CONE, ELLIPSOID), (long - 0.02, 0.82, z), (0.04, 0.1, 0.03))

    def plant(self) -> None:
        between = self.between
        kind = CONE if self.rng.random() < 0.3 else CYLINDER
        self.part(kind, (0, 0.15, 0), (0.15, 0.15, 0.15))
        for _ in range(int(self.rng.integers(4, 12))):
            x, y, z = self.rng.normal(0, 0.22, 3)
            half = between(0.04, 0.2), between(0.02, 0.25), between(0.02, 0.1)
            self.part(ELLIPSOID, (x, 0.65 + y, z), half, 2.0)

    def lamp(self) -> None:
        self.part(CYLINDER, (0, 0.03, 0), (0.2, 0.03, 0.2))
        self.part(CYLINDER, (0, 0.5, 0), (0.03, 0.5, 0.03))
        wide = self.between(0.15, 0.35)
        shade = self.any(CONE, CYLINDER, ELLIPSOID)
        self.part(shade, (0, 0.95, 0), (wide, self.between(0.1, 0.2), wide))


def add_thing(
    rng: np.random.Generator,
    parts: Parts,
    boards: int,
    is_thing: bool = True,
    at: tuple[float, float] = (0.0, 0.0),
    size: float = 1.0,
) -> None:
    """Add something about `size` high that stands, most of the time, at a place of the ground."""
    first = len(parts.kind)
    kind = rng.choice(list(KINDS), p=list(KINDS.values()))
    getattr(_Builder(rng, parts, boards, is_thing), kind)()
    up = -parts.lowest(first)
    up += rng.uniform(0.05, 0.8) if rng.random() < FLOATING else 0.0
    up -= rng.uniform(0, 0.08) if rng.random() < SUNK else 0.0
    parts.move(first, 1.0, np.array([0, up, 0]))
    parts.move(first, size, np.array([at[0], 0, at[1]]))


def silhouettes(count: int, seed: int) -> Mask:
    """(count, SIDE, SIDE) outlines of boards: blobs, stars, letters and bundles of strokes."""
    rng = np.random.default_rng(seed)
    found: list[Mask] = []
    while len(found) < count:
        drawn = (_drawn_blob, _drawn_star, _drawn_letter, _drawn_strokes)[rng.integers(4)](rng)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(drawn)
        if len(stats) < 2 or stats[1:, cv2.CC_STAT_AREA].max() < SIDE * SIDE // 14:
            continue
        x, y, wide, high, _ = stats[1 + np.argmax(stats[1:, cv2.CC_STAT_AREA])]
        own = labels == 1 + np.argmax(stats[1:, cv2.CC_STAT_AREA])
        cut = own[y : y + high, x : x + wide].astype(np.uint8)
        found.append(cv2.resize(cut, (SIDE, SIDE), interpolation=cv2.INTER_NEAREST) > 0)
    return np.array(found)


def _drawn_blob(rng: np.random.Generator) -> np.ndarray:
    blurred = cv2.GaussianBlur(rng.normal(size=(2 * SIDE, 2 * SIDE)), (0, 0), rng.uniform(6, 16))
    y, x = np.mgrid[-1 : 1 : 2j * SIDE, -1 : 1 : 2j * SIDE]
    falls = 2.5 * (x * x + y * y) ** rng.uniform(1, 2)
    return np.asarray(blurred / blurred.std() - falls + rng.uniform(0.5, 1.5) > 0, np.uint8)


def _drawn_star(rng: np.random.Generator) -> np.ndarray:
    count, drawn = 2 * int(rng.integers(3, 12)), np.zeros((2 * SIDE, 2 * SIDE), np.uint8)
    away, turn = rng.uniform(0.3, 1, count) * SIDE, np.sort(rng.uniform(0, 2 * np.pi, count))
    corners = SIDE + away[:, None] * np.stack([np.cos(turn), np.sin(turn)], 1)
    return np.asarray(cv2.fillPoly(drawn, [corners.astype(np.int32)], (1,)), np.uint8)


def _drawn_letter(rng: np.random.Generator) -> np.ndarray:
    drawn, letter = np.zeros((2 * SIDE, 2 * SIDE), np.uint8), chr(rng.integers(33, 127))
    font, size, thick = int(rng.integers(0, 8)), rng.uniform(2.5, 5), int(rng.integers(4, 20))
    return np.asarray(
        cv2.putText(drawn, letter, (10, 2 * SIDE - 20), font, size, (1,), thick), np.uint8
    )


def _drawn_strokes(rng: np.random.Generator) -> np.ndarray:
    drawn = np.zeros((2 * SIDE, 2 * SIDE), np.uint8)
    for _ in range(int(rng.integers(3, 14))):
        start = rng.integers(10, 2 * SIDE - 10, 2)
        end = np.clip(start + rng.normal(0, 35, 2), 4, 2 * SIDE - 4).astype(int)
        thick = int(rng.integers(4, 26))
        cv2.line(drawn, tuple(map(int, start)), tuple(map(int, end)), (1,), thick)
    return drawn
