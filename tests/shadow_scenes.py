"""Made photos of a thing on a ground, with its shadow or without any: one scene for each seed.

Solids of a few ellipsoids, boxes and cylinders, and upright boards with photographed things on
them, are cast by rays onto a plane and a wall, under a lamp that has a size and light from all
around. Grounds are photographed or drawn, with marks, rugs, edges of another material, neighbours
that stand there and throw shadows of their own, light that falls off, and shade of things outside
the picture. In more than half of the scenes the thing throws no shadow at all, as one that was put
into a photo by hand: whatever is dark beside it is something else. Even seeds are for choosing,
odd ones are held out, and show other photos.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

import cv2
import numpy as np
from skimage import data

from objectmorpher_core.compose.shadow.shadow import GAMMA
from tests.photos import outlined, photo

WIDTH, HEIGHT = 360, 270  # px
FOCAL = 1.15 * WIDTH  # px
COARSE = 3  # px of the photo per ray to a lamp
LAMPS, SKY = 8, 8  # rays that stand for a lamp that has a size, and for the sky
BARE = 0.4  # of the scenes on grounds that are known are without a shadow of the thing
NOISE = 0.006
DARK = 0.12  # of the ground's light, from which it counts as shaded
LEAST_SHADE = 250  # px of it beside the thing: less is a shadow that one hardly sees
# By halves: what is photographed on boards, whole photos, and grounds that are parts of photos.
BOARDS = (("cat", "coffee", "pagoda"), ("dahlia", "rocket", "motorcycle", "helmet"))
PHOTOS = (("coffee", "chelsea", "china"), ("astronaut", "rocket", "flower", "motorcycle"))
GROUNDS = (
    ("brick", "grass", "wood", "lawn", "roof", "fur", "coins"),
    ("gravel", "leaves", "floor", "cloth", "moon"),
)

F64 = np.ndarray


@dataclass(frozen=True)
class Part:
    """An ellipsoid, a box, an upright cylinder or a board: its middle, half its extent, its yaw."""

    kind: str
    middle: tuple[float, float, float]  # x right, y up, z away
    half: tuple[float, float, float]
    yaw: float = 0.0  # radians
    colour: tuple[float, float, float] = (0.5, 0.5, 0.5)  # encoded
    board: str = ""  # the name of a photographed thing

    def local(self, points: F64, is_way: bool = False) -> F64:
        """World points (n, 3) in its own frame, in which it reaches from -1 to 1."""
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        x, y, z = (points if is_way else points - np.array(self.middle)).T
        a, b, c = self.half
        return np.stack([(cos * x + sin * z) / a, y / b, (cos * z - sin * x) / c], -1)

    def normal(self, at: F64) -> F64:
        """(n, 3) world, unit, at points of its own frame that lie on it."""
        if self.kind == "ellipsoid":
            own = at
        elif self.kind == "cylinder":
            is_lid = np.abs(at[:, 1:2]) > 0.999
            own = np.where(is_lid, at * [0, 1, 0], at * [1, 0, 1])
        else:
            sides = np.abs(at) >= np.abs(at).max(1, keepdims=True) - 1e-6
            own = np.sign(at) * sides
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        turn = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
        world = (own / np.array(self.half)) @ turn
        return world / np.maximum(np.linalg.norm(world, axis=1, keepdims=True), 1e-9)

    def hit(self, origin: F64, way: F64) -> F64:
        """(n,) how far along `way` (n, 3) a ray from `origin` first meets it; inf: never."""
        o, w = self.local(origin), self.local(way, is_way=True)
        w = np.where(np.abs(w) < 1e-9, 1e-9, w)
        with np.errstate(invalid="ignore", divide="ignore"):
            if self.kind == "ellipsoid":
                return _first(*_quadratic(o, w, (0, 1, 2)))
            if self.kind == "cylinder":
                near, far = _quadratic(o, w, (0, 2))
                low, high = _slabs(o[:, 1:2], w[:, 1:2])
                return _first(np.maximum(near, low), np.minimum(far, high))
            if self.kind == "board":
                along = -o[:, 2] / w[:, 2]
                at = o + along[:, None] * w
                alpha = _looked_up(photographed(self.board)[1], at)
                return np.where((along > 1e-6) & (alpha > 0.5), along, np.inf)
            return _first(*_slabs(o, w))


def _quadratic(o: F64, w: F64, axes: tuple[int, ...]) -> tuple[F64, F64]:
    o, w = o[:, axes], w[:, axes]
    a, b, c = (w * w).sum(1), (o * w).sum(1), (o * o).sum(1) - 1
    root = np.sqrt(b * b - a * c)  # NaN where it misses
    return (-b - root) / a, (-b + root) / a


def _slabs(o: F64, w: F64) -> tuple[F64, F64]:
    ends = np.stack([(-1 - o) / w, (1 - o) / w])
    return ends.min(0).max(1), ends.max(0).min(1)


def _first(near: F64, far: F64) -> F64:
    is_met = (far > 1e-6) & (near <= far)
    return np.where(is_met, np.maximum(near, 1e-6), np.inf)


def _looked_up(picture: F64, at: F64) -> F64:
    """Values of an image at places (n, 2+) in [-1, 1], x right, y up; 0 outside."""
    height, width = picture.shape[:2]
    return _at(picture, (at[:, 0] + 1) / 2 * width - 0.5, (1 - at[:, 1]) / 2 * height - 0.5)


def _at(picture: F64, x: F64, y: F64) -> F64:
    """Values of an image at px (n,); of at most 32,767 rows at a time, as OpenCV wants it."""
    rows = -(-len(x) // WIDTH)
    size = (rows, WIDTH)
    maps = [np.resize(v.astype(np.float32), size) for v in (x, y)]
    found = cv2.remap(picture.astype(np.float32), maps[0], maps[1], cv2.INTER_LINEAR)
    return found.reshape(rows * WIDTH, *picture.shape[2:])[: len(x)].astype(float)


@cache
def photographed(name: str) -> tuple[F64, F64]:
    """A photographed thing: its colours (h, w, 3) in [0, 1] and what it covers (h, w)."""
    of = {"cat": "chelsea", "dahlia": "flower", "pagoda": "china", "helmet": "astronaut"}
    pixels = photo(of.get(name, name)) / 255.0
    mask = outlined(name)
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return pixels[box], mask[box].astype(float)


@dataclass(frozen=True)
class Scene:
    """A made photo and what it is made of; pixels (h, w, 3) u8."""

    seed: int
    kind: str  # of the ground, and what else is there
    photo: np.ndarray
    mask: np.ndarray  # (h, w) bool, the thing
    dark: F64  # (h, w) share of the ground's light that the thing takes; 0 without a shadow
    unshaded: np.ndarray  # the photo without the thing's shadow
    upright: np.ndarray  # (h, w) bool, walls and neighbours

    @property
    def has_shadow(self) -> bool:
        return bool(self.dark.any())

    @property
    def shade(self) -> np.ndarray:
        """(h, w) bool where it is seen on the ground beside the thing."""
        near = cv2.dilate(self.mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        return (self.dark > DARK) & ~near


def things(rng: np.random.Generator, half: int) -> list[Part]:
    """The parts of a thing about 1 high, whose foot is on the ground at the origin."""
    colours = [tuple(rng.uniform(0.08, 0.95, 3)) for _ in range(4)]
    yaw = rng.uniform(0, np.pi)

    def part(kind: str, middle: tuple, half: tuple, turn: float = 0.0, colour: int = 0) -> Part:
        return Part(kind, middle, half, turn, colours[colour])

    kinds = ("vase", "rabbit", "box", "book", "ball", "cup", "table", "person", "car", "board",
             "board", "board")  # fmt: skip
    kind = kinds[rng.integers(len(kinds))]
    a, b = rng.uniform(0.75, 1.3, 2)
    if kind == "vase":
        return [part("cylinder", (0, 0.12, 0), (0.16 * a, 0.12, 0.16 * a)),
                part("ellipsoid", (0, 0.5, 0), (0.3 * b, 0.36, 0.3 * b), 0, 1),
                part("cylinder", (0, 0.9, 0), (0.1 * a, 0.12, 0.1 * a), 0, 2)]  # fmt: skip
    if kind == "rabbit":
        return [part("ellipsoid", (0, 0.26, 0), (0.4 * a, 0.26, 0.26)),
                part("ellipsoid", (0.32 * a, 0.52, 0), (0.18, 0.18, 0.16)),
                part("ellipsoid", (0.28 * a, 0.8, 0.06), (0.05, 0.22, 0.04)),
                part("ellipsoid", (0.36 * a, 0.8, -0.06), (0.05, 0.22, 0.04)),
                part("ellipsoid", (-0.4 * a, 0.3, 0), (0.08, 0.08, 0.08), 0, 1)]  # fmt: skip
    if kind == "box":
        return [part("box", (0, 0.4 * a, 0), (0.35 * b, 0.4 * a, 0.3), yaw)]
    if kind == "book":
        return [part("box", (0, 0.05 * a, 0), (0.5 * b, 0.05 * a, 0.36), yaw)]
    if kind == "ball":
        return [part("ellipsoid", (0, 0.4, 0), (0.4, 0.4, 0.4))]
    if kind == "cup":
        return [part("cylinder", (0, 0.4 * a, 0), (0.3 * b, 0.4 * a, 0.3 * b))]
    if kind == "table":
        legs = [part("box", (x * 0.4 * a, 0.3, z * 0.3), (0.035, 0.3, 0.035), 0, 1)
                for x in (-1, 1) for z in (-1, 1)]  # fmt: skip
        return [part("box", (0, 0.63, 0), (0.5 * a, 0.035, 0.38)), *legs]
    if kind == "person":
        legs = [part("cylinder", (x * 0.08, 0.22, 0.03 * x), (0.06, 0.22, 0.06), 0, 1)
                for x in (-1, 1)]  # fmt: skip
        arms = [part("ellipsoid", (x * 0.2 * a, 0.58, 0), (0.05, 0.2, 0.05), 0, 2) for x in (-1, 1)]
        head = part("ellipsoid", (0, 0.92, 0), (0.1, 0.12, 0.1), 0, 3)
        return [*legs, part("ellipsoid", (0, 0.6, 0), (0.16 * a, 0.22, 0.11), 0, 2), head, *arms]
    if kind == "car":
        wheels = [part("ellipsoid", (x * 0.4 * a, 0.13, z * 0.24), (0.13, 0.13, 0.05), 0, 1)
                  for x in (-1, 1) for z in (-1, 1)]  # fmt: skip
        body = part("box", (0, 0.26, 0), (0.68 * a, 0.13, 0.26))
        return [body, part("box", (0.02, 0.48, 0), (0.34 * a, 0.11, 0.22), 0, 2), *wheels]
    name = BOARDS[half][rng.integers(len(BOARDS[half]))]
    height, width = photographed(name)[1].shape
    wide = min(width / height, 1.6)
    high = wide * height / width
    return [Part("board", (0, 0.5 * high, 0), (0.5 * wide, 0.5 * high, 1.0), 0.0, board=name)]


@dataclass
class _World:
    """What is built of a scene before it is drawn."""

    rng: np.random.Generator
    half: int  # of the photos that it may show
    thing: list[Part]
    neighbours: list[Part] = field(default_factory=list)
    wall: float | None = None  # z
    words: list[str] = field(default_factory=list)


def scene(seed: int) -> Scene:
    """The scene of that seed: always the same one."""
    rng = np.random.default_rng(900_000 + seed)
    world = _World(rng, seed % 2, things(rng, seed % 2))
    has_shadow = rng.random() > BARE
    camera = _Camera(np.radians(rng.uniform(12, 48)), rng.uniform(2.6, 3.6))
    size = rng.uniform(0.75, 1.15)
    turn = rng.uniform(0, 2 * np.pi)
    if not any(p.kind == "board" for p in world.thing):
        world.thing = [_turned(p, turn) for p in world.thing]
    world.thing = [_moved(p, size, (rng.uniform(-0.25, 0.25), 0.0, 0.0)) for p in world.thing]
    _add_neighbours(world)
    if rng.random() < 0.35:
        world.wall = rng.uniform(0.55, 2.2)
        world.words.append("wall")
    albedo_ground, albedo_wall = _materials(world, camera)
    has_shadow &= not world.words[0].startswith("photo")  # nobody knows where its ground is
    return _drawn(world, camera, albedo_ground, albedo_wall, has_shadow, seed)


def _turned(part: Part, by: float) -> Part:
    x, y, z = part.middle
    at = (np.cos(by) * x - np.sin(by) * z, y, np.sin(by) * x + np.cos(by) * z)
    return Part(part.kind, at, part.half, part.yaw - by, part.colour, part.board)


def _moved(part: Part, scale: float, by: tuple[float, float, float]) -> Part:
    x, y, z = (scale * m + d for m, d in zip(part.middle, by, strict=True))
    a, b, c = (scale * h for h in part.half)
    return Part(part.kind, (x, y, z), (a, b, c), part.yaw, part.colour, part.board)


def _add_neighbours(world: _World) -> None:
    rng = world.rng
    for _ in range(int(rng.choice([0, 0, 1, 1, 2, 3]))):
        side = rng.choice([-1, 1])
        at = (side * rng.uniform(0.75, 1.6), 0.0, rng.uniform(-0.5, 1.3))
        if rng.random() < 0.4:  # dark and large, as a house front or a blue book
            half = (rng.uniform(0.2, 0.7), rng.uniform(0.05, 1.2), rng.uniform(0.1, 0.4))
            shade = tuple(rng.uniform(0.03, 0.4, 3))
            parts = [Part("box", (0, half[1], 0), half, rng.uniform(0, np.pi), shade)]
        else:
            parts = things(rng, world.half)
        scale = rng.uniform(0.6, 1.2)
        world.neighbours += [_moved(p, scale, at) for p in parts]
        if "neighbour" not in world.words:
            world.words.append("neighbour")


@dataclass(frozen=True)
class _Camera:
    """It looks down by `pitch`, at a point 0.35 above the origin, from so far away."""

    pitch: float
    away: float

    @property
    def origin(self) -> F64:
        return np.array(
            [0.0, 0.35 + self.away * np.sin(self.pitch), -self.away * np.cos(self.pitch)]
        )

    def ways(self, step: int = 1) -> F64:
        """(n, 3) unit, of the pixels' middles, row by row."""
        x, y = np.meshgrid(np.arange(step / 2, WIDTH, step), np.arange(step / 2, HEIGHT, step))
        x, y = (x - WIDTH / 2) / FOCAL, (y - HEIGHT / 2) / FOCAL
        cos, sin = np.cos(self.pitch), np.sin(self.pitch)
        way = np.stack([x, -y * cos - sin, cos - y * sin], -1).reshape(-1, 3)
        return way / np.linalg.norm(way, axis=1, keepdims=True)


Material = Callable[[F64], F64]  # places (n, 2) -> linear colours (n, 3)


def _photographed() -> dict[str, Callable[[], np.ndarray]]:
    return {
        "brick": data.brick, "gravel": data.gravel, "grass": data.grass,
        "wood": lambda: photo("coffee")[80:390, 490:598],
        "lawn": lambda: photo("china")[330:, 60:560], "leaves": lambda: photo("flower")[:, :220],
        "roof": lambda: photo("china")[150:250, 220:560],
        "fur": lambda: photo("chelsea")[190:290, 20:130],
        "floor": lambda: photo("motorcycle")[370:, 60:700],
        "cloth": lambda: photo("astronaut")[300:500, 40:240],
        "coins": lambda: photo("coins")[10:290, 10:370], "moon": data.moon,
    }  # fmt: skip


def _material(rng: np.random.Generator, half: int) -> tuple[str, Material]:
    """A ground or a wall, photographed or drawn."""
    drawn = ("plain", "tiles", "planks", "patches", "clouds", "checks")
    names = (*GROUNDS[half], *GROUNDS[half], *drawn)
    name = names[rng.integers(len(names))]
    tint = rng.uniform(0.35, 1.0) * rng.uniform(0.75, 1.0, 3)
    if name in _photographed():
        picture = _photographed()[name]()
        picture = np.repeat(picture[..., None], 3, 2) if picture.ndim == 2 else picture
        linear = (picture / 255.0) ** GAMMA
        scale = rng.uniform(70, 220)  # px of it per unit of the ground
        start, turn = rng.uniform(0, 500, 2), rng.uniform(0, 2 * np.pi)
        if linear.mean() < 0.12:
            linear = linear * (0.12 / linear.mean())
        blur = scale / 150  # about what a px of the made photo covers of it
        linear = cv2.GaussianBlur(linear, (0, 0), blur) if blur > 0.5 else linear

        def at(places: F64) -> F64:
            cos, sin = np.cos(turn), np.sin(turn)
            uv = places @ np.array([[cos, -sin], [sin, cos]]) * scale + start
            return _mirrored(linear, uv) * tint

        return name, at
    colours = rng.uniform(0.08, 0.8, (5, 3)) * [1.0, 0.95, 0.85]
    if name == "plain":
        base = rng.uniform(0.15, 0.75) * rng.uniform(0.8, 1.0, 3)
        return name, lambda p: np.broadcast_to(base, (len(p), 3)).copy()
    noise = cv2.GaussianBlur(rng.normal(size=(512, 512)), (0, 0), rng.uniform(2, 18))
    noise = noise / noise.std()
    if name == "clouds":
        depth = rng.uniform(0.1, 0.5)
        return name, lambda p: colours[0] * np.exp(depth * _mirrored(noise, p * 90 + 200))[:, None]
    size = rng.uniform(0.12, 0.6)
    ratio = rng.uniform(2, 7) if name == "planks" else 1.0
    many = 5 if name == "patches" else 2
    spread = rng.uniform(0.04, 0.3) if name in ("tiles", "planks") else 1.0
    table = rng.integers(0, many, (64, 64))
    tones = rng.normal(0, spread, (64, 64))
    joint = rng.uniform(0.02, 0.06) if name in ("tiles", "planks") else 0.0
    base = colours[0] if name in ("tiles", "planks") else None

    def drawn_at(places: F64) -> F64:
        cell = places / [size * ratio, size]
        i, j = (np.floor(c).astype(int) % 64 for c in cell.T)
        if base is None:
            colour = colours[table[i, j] if name == "patches" else (i + j) % 2]
        else:
            colour = base * np.exp(tones[i, j])[:, None]
        from_joint = np.abs(cell - np.round(cell)) * [size * ratio, size]
        is_inside = np.asarray(from_joint.min(1) > joint * size)
        return np.where(is_inside[:, None], colour, 0.4 * colour)

    return name, drawn_at


def _mirrored(picture: F64, uv: F64) -> F64:
    """Values of an image that goes on as its own mirror image, at px (n, 2)."""
    x, y = (np.abs(np.mod(c, 2 * (n - 1)) - (n - 1)) for c, n in
            zip(uv.T, picture.shape[1::-1], strict=True))  # fmt: skip
    return _at(picture, x, y)


def _materials(world: _World, camera: _Camera) -> tuple[F64, F64]:
    """Linear colours (h * w, 3) of what the ground and the wall are at each pixel."""
    rng, origin, ways = world.rng, camera.origin, camera.ways()
    if rng.random() < 0.22:  # a photo as it is: nobody knows where its ground ends
        name = PHOTOS[world.half][rng.integers(len(PHOTOS[world.half]))]
        pixels = photo(name)
        share = rng.uniform(0.55, 1.0)
        high = int(share * min(pixels.shape[0], pixels.shape[1] * HEIGHT / WIDTH))
        wide = int(high * WIDTH / HEIGHT)
        x, y = rng.integers(pixels.shape[1] - wide + 1), rng.integers(pixels.shape[0] - high + 1)
        crop = cv2.resize(pixels[y : y + high, x : x + wide], (WIDTH, HEIGHT))
        linear = np.maximum(crop / 255.0, 0.01) ** GAMMA
        world.words.insert(0, f"photo of {name}")
        world.wall = None
        return linear.reshape(-1, 3), linear.reshape(-1, 3)
    reach = np.where(ways[:, 1] < -1e-3, origin[1] / np.maximum(-ways[:, 1], 1e-3), 60.0)
    places = (origin + np.minimum(reach, 60.0)[:, None] * ways)[:, [0, 2]]
    name, ground = _material(rng, world.half)
    colour = ground(places)
    away = np.clip((reach - 7) / 12, 0, 1)[:, None]  # far away one sees its mean colour only
    colour = colour + away * (np.median(colour, 0) - colour)
    world.words.insert(0, name)
    if rng.random() < 0.35:  # an edge of another material, a rug or a puddle
        other = _material(rng, world.half)[1](places)
        is_other = _patch(rng, places)
        colour = np.where(is_other[:, None], other + away * (np.median(other, 0) - other), colour)
        world.words.append("edge")
    behind = colour
    if world.wall is not None:
        far = (world.wall - origin[2]) / np.maximum(ways[:, 2], 1e-3)
        behind = _material(rng, world.half)[1]((origin + far[:, None] * ways)[:, :2])
    return colour, behind


def _patch(rng: np.random.Generator, places: F64) -> np.ndarray:
    """(n,) bool, a half of the ground, or a rug or a puddle on it near the thing."""
    middle, turn = rng.uniform(-0.7, 0.7, 2), rng.uniform(0, np.pi)
    cos, sin = np.cos(turn), np.sin(turn)
    own = (places - middle) @ np.array([[cos, -sin], [sin, cos]])
    kind = rng.integers(3)
    if kind == 0:
        return own[:, 1] > rng.uniform(-0.3, 0.4)
    half = rng.uniform(0.2, 0.9, 2)
    return np.abs(own / half).max(1) < 1 if kind == 1 else ((own / half) ** 2).sum(1) < 1


def _drawn(
    world: _World, camera: _Camera, ground: F64, wall: F64, has_shadow: bool, seed: int
) -> Scene:
    rng, origin, ways = world.rng, camera.origin, camera.ways()
    lamp, ambient = _lamp(rng)
    reach = np.where(ways[:, 1] < -1e-6, origin[1] / np.maximum(-ways[:, 1], 1e-6), np.inf)
    is_wall = np.zeros(len(ways), bool)
    if world.wall is not None:
        far = np.where(ways[:, 2] > 1e-6, (world.wall - origin[2]) / ways[:, 2], np.inf)
        is_wall = far < reach
        reach = np.minimum(reach, far)
    others = world.neighbours
    lights = _light(camera, world.wall, others, lamp, ambient, int(rng.integers(1 << 30)))
    own = lights
    if has_shadow:
        own = _light(camera, world.wall, [*world.thing, *others], lamp, ambient,
                     int(rng.integers(1 << 30)))  # fmt: skip
    shading = _uneven(rng)
    surface = np.where(is_wall[:, None], wall, ground)
    colours, shown = _things_seen(reach, [*others, *world.thing], camera, lamp, ambient)
    mask = (shown >= len(others)).reshape(HEIGHT, WIDTH)
    upright = (is_wall | (shown >= 0)).reshape(HEIGHT, WIDTH) & ~mask
    pictures, noise = [], rng.normal(0, NOISE, (HEIGHT, WIDTH, 3))
    for light in (own, lights):
        linear = surface * (light * shading).reshape(-1, 1)
        linear = np.where(shown[:, None] >= 0, colours, linear)
        encoded = np.clip(linear, 0, 1) ** (1 / GAMMA)
        smooth = cv2.GaussianBlur(encoded.reshape(HEIGHT, WIDTH, 3), (0, 0), 0.6)
        pictures.append(np.rint(np.clip(smooth + noise, 0, 1) * 255).astype(np.uint8))
    dark = np.clip(1 - own / np.maximum(lights, 1e-6), 0, 1) * ~upright
    is_seen = np.count_nonzero((dark > DARK) & ~mask) >= LEAST_SHADE
    if not (has_shadow and is_seen):
        pictures[0], dark = pictures[1], np.zeros_like(dark)
    return Scene(seed, ", ".join(world.words), pictures[0], mask, dark, pictures[1], upright)


def _lamp(rng: np.random.Generator) -> tuple[F64, float]:
    """(LAMPS, 3) ways towards it, and the share of the light that comes from everywhere."""
    turn, rise = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(18, 68))
    way = np.array([np.cos(turn) * np.cos(rise), np.sin(rise), np.sin(turn) * np.cos(rise)])
    ways = way + rng.normal(0, rng.uniform(0.01, 0.12), (LAMPS, 3))
    ways[:, 1] = np.maximum(ways[:, 1], 0.1)
    return ways / np.linalg.norm(ways, axis=1, keepdims=True), rng.uniform(0.2, 0.6)


def _sky(seed: int) -> F64:
    """(SKY, 3) ways upwards, as many as their share of an even sky's light."""
    rng = np.random.default_rng(seed)
    turn, out = (
        2 * np.pi * (np.arange(SKY) * 0.618 + rng.random()),
        np.sqrt((np.arange(SKY) + 0.5) / SKY),
    )
    return np.stack([out * np.cos(turn), np.sqrt(1 - out**2), out * np.sin(turn)], -1)


def _light(
    camera: _Camera, wall: float | None, parts: list[Part], lamp: F64, ambient: float, seed: int
) -> F64:
    """(h, w) on ground and wall, 1 where nothing takes any, as the pixels see them."""
    ways, origin = camera.ways(COARSE), camera.origin
    reach = np.where(ways[:, 1] < -1e-6, origin[1] / np.maximum(-ways[:, 1], 1e-6), 40.0)
    is_wall = np.zeros(len(ways), bool)
    if wall is not None:
        far = np.where(ways[:, 2] > 1e-6, (wall - origin[2]) / ways[:, 2], 40.0)
        is_wall, reach = far < reach, np.minimum(reach, far)
    points = origin + np.minimum(reach, 40.0)[:, None] * ways
    normal = np.where(is_wall[:, None], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0])
    points = points + 1e-3 * normal
    near = np.linalg.norm(points[:, [0, 2]], axis=1) < 6
    shares = []
    for directions in (lamp, _sky(seed)):
        total = np.zeros(len(points))
        for way in directions:
            is_free = np.ones(len(points), bool)
            facing = normal @ way
            if not parts:
                total += np.maximum(facing, 0)
                continue
            is_met = np.zeros(int(near.sum()), bool)
            for part in parts:
                is_met |= np.isfinite(part.hit(points[near], way[None]))
            is_free[near] = ~is_met
            total += is_free * np.maximum(facing, 0)
        shares.append(total / np.maximum((normal @ directions.T).clip(0).sum(1), 1e-6))
    light = (1 - ambient) * shares[0] + ambient * shares[1]
    light = np.where((normal @ lamp.mean(0)) > 0.05, light, ambient * shares[1] / ambient)
    coarse = light.reshape(HEIGHT // COARSE, WIDTH // COARSE).astype(np.float32)
    soft = cv2.GaussianBlur(coarse, (0, 0), 0.8)
    return cv2.resize(soft, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR).astype(float)


def _uneven(rng: np.random.Generator) -> F64:
    """(h, w) light that falls off across the picture, and shade of what is outside it."""
    x, y = np.meshgrid(np.linspace(-1, 1, WIDTH), np.linspace(-1, 1, HEIGHT))
    falls = np.exp(rng.normal(0, 0.2) * x + rng.normal(0, 0.2) * y - rng.uniform(0, 0.15) *
                   (x * x + y * y))  # fmt: skip
    if rng.random() < 0.2:  # dappled
        blobs = cv2.GaussianBlur(rng.normal(size=(HEIGHT, WIDTH)), (0, 0), rng.uniform(8, 35))
        edge = cv2.GaussianBlur((blobs > blobs.std() * rng.uniform(0, 1.2)).astype(float), (0, 0),
                                rng.uniform(1, 5))  # fmt: skip
        falls = falls * (1 - rng.uniform(0.3, 0.65) * edge)
    return rng.uniform(0.6, 1.2) * falls


def _things_seen(
    reach: F64, parts: list[Part], camera: _Camera, lamp: F64, ambient: float
) -> tuple[F64, np.ndarray]:
    """Linear colours (n, 3) of the part that is seen at each pixel, and which it is; -1: none."""
    origin, ways = camera.origin, camera.ways()
    colours, shown, nearest = np.zeros_like(ways), np.full(len(ways), -1), reach.copy()
    way = lamp.mean(0)
    for k, part in enumerate(parts):
        met = part.hit(origin[None], ways)
        own = np.flatnonzero(met < nearest)
        if not len(own):
            continue
        at = part.local(origin + met[own, None] * ways[own])
        if part.kind == "board":
            colour = _looked_up(photographed(part.board)[0], at) ** GAMMA
        else:
            facing = np.clip(part.normal(at) @ way, 0, 1)
            grain = 1 + 0.1 * np.sin(at @ np.array([9.0, 13.0, 7.0]) + 3 * np.sin(at[:, 0] * 5))
            light = ambient * (0.75 + 0.25 * part.normal(at)[:, 1]) + (1 - ambient) * facing
            colour = np.array(part.colour) ** GAMMA * (light * grain)[:, None]
        colours[own], shown[own], nearest[own] = colour, k, met[own]
    return colours, shown
