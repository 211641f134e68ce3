"""Scenes made in code, all of them seeded: clouds of points, masks, photos, lifted objects."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np
from PIL import Image
from scipy.spatial import KDTree

from objectmorpher_core.base.arrays import F32, F64, RGB, Mask, crop, frozen
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.rotations import matrices_from_quats, quats_along
from objectmorpher_core.compose.composite import object_texture
from objectmorpher_core.deform.control_points import sample_control_points
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.deform.skinning import Skinned
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.document.model import (
    Document,
    EditObject,
    Handle,
    LiftedObject,
    LiftSettings,
    Matte,
    Photo,
    PhotoTexture,
    Placement,
    Plate,
)
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.pictures.image import Picture, encode_mask, encode_picture
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.raster import reference
from objectmorpher_core.raster.posed import PosedSplats, RestSplats
from objectmorpher_core.raster.reference import Picture3D
from objectmorpher_core.raster.texture import TextureLevels, build_levels
from objectmorpher_core.segment.matting.matte import extended_mask, frame_extension
from tests import remembered

WIDTH, HEIGHT = 160, 120  # px, of the made photos
PLACEMENTS = {  # of an object that is drawn
    "at rest": Placement(),
    "turned": Placement(turn=(35.0, -20.0, 15.0)),
    "turned away": Placement(turn=(180.0, 0.0, 0.0)),
    "edge-on": Placement(turn=(90.0, 0.0, 0.0)),
    "far": Placement(depth=30.0, move=(10.0, 3.0)),
    "near": Placement(depth=-0.6),
    "large": Placement(scale=3.0, move=(40.0, -30.0)),
    "small": Placement(scale=0.05, turn=(50.0, 0.0, 0.0)),
}
KINDS = [  # of splatting, and whether the photo is shown
    ("surface", True), ("solid", True), ("edged surface", True), ("edged solid", True),
    ("mip", True), ("classic", True),
    ("mip", False), ("classic", False),
]  # fmt: skip
MASKS = ("disc", "ellipse", "thin", "frame", "parts", "ring", "star")


# ---- clouds of points, each (N, 3) ----------------------------------------------------------


def ball(count: int = 300, seed: int = 0) -> F64:
    """Points on a sphere of diameter 1."""
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return 0.5 * points / np.linalg.norm(points, axis=1, keepdims=True)


def bar(count: int = 200, length: float = 1.0, width: float = 0.12, seed: int = 0) -> F64:
    """Points on the four sides of a square bar along x."""
    rng = np.random.default_rng(seed)
    across = rng.uniform(-0.5, 0.5, count) * width
    side = rng.integers(0, 4, count)
    fixed = np.where(side < 2, 0.5, -0.5) * width
    is_y = side % 2 == 0
    x = rng.uniform(-0.5, 0.5, count) * length
    return np.column_stack([x, np.where(is_y, fixed, across), np.where(is_y, across, fixed)])


def sheet(columns: int = 14, rows: int = 9, thickness: float = 0.0) -> F64:
    """A flat grid of points, one unit long, in the plane z = 0 or on both faces of it."""
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, columns), np.linspace(-0.3, 0.3, rows))
    flat = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    if thickness == 0.0:
        return flat
    up = np.array([0.0, 0.0, 0.5 * thickness])
    return np.concatenate([flat + up, flat - up])


def two_sheets(gap: float) -> F64:
    """Two parallel sheets, `gap` apart."""
    return sheet(thickness=gap)


def horseshoe(count: int = 240, seed: int = 0) -> F64:
    """A tube bent into a U whose ends come near each other: near in space, far along it."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.15, 2 * np.pi - 0.15, count)
    around = rng.uniform(0, 2 * np.pi, count)
    radius = 0.4 + 0.05 * np.cos(around)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0.05 * np.sin(around)])


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed surface."""

    points: F64  # (N, 3)
    normals: F64  # (N, 3) outward, unit
    faces: np.ndarray  # (F, 3), anticlockwise from outside

    def volume(self, points: F64) -> float:
        """What the surface encloses when its points are at `points` (N, 3)."""
        a, b, c = (points[self.faces[:, k]] for k in range(3))
        return float(np.einsum("na,na->", a, np.cross(b, c)) / 6)

    def area(self, points: F64) -> float:
        a, b, c = (points[self.faces[:, k]] for k in range(3))
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def capsule(length: float = 1.0, radius: float = 0.08, around: int = 48) -> Mesh:
    """A round bar along x with round ends, `length` from tip to tip, about even."""
    step = 2 * np.pi * radius / around
    straight = length / 2 - radius
    cap = np.linspace(0, np.pi / 2, max(round(np.pi / 2 * radius / step), 3) + 1)[1:]
    bar_x = np.linspace(-straight, straight, max(round(2 * straight / step), 2) + 1)
    left = np.column_stack([-np.sin(cap[-2::-1]), np.cos(cap[-2::-1])])
    right = np.column_stack([np.sin(cap[:-1]), np.cos(cap[:-1])])
    tall = np.column_stack([np.zeros(len(bar_x)), np.ones(len(bar_x))])
    profile = np.concatenate([left, tall, right])  # normal's x and radial part, ring by ring
    x = np.concatenate([-straight + radius * left[:, 0], bar_x, straight + radius * right[:, 0]])
    angle = 2 * np.pi * np.arange(around) / around
    spokes = np.column_stack([np.cos(angle), np.sin(angle)])
    rings = np.concatenate(
        [np.repeat(profile[:, :1], around, 0), (profile[:, 1:, None] * spokes).reshape(-1, 2)], 1
    )
    points = np.column_stack([np.repeat(x, around), radius * rings[:, 1:]])
    points = np.concatenate([points, [[-length / 2, 0, 0], [length / 2, 0, 0]]])
    normals = np.concatenate([rings, [[-1.0, 0, 0], [1.0, 0, 0]]])
    i = np.arange(around)
    j = (i + 1) % around
    faces = []
    for ring in range(len(x) - 1):
        a, b = ring * around, (ring + 1) * around
        faces += [np.column_stack([a + i, b + j, b + i]), np.column_stack([a + i, a + j, b + j])]
    first, last = len(points) - 2, len(points) - 1
    top = (len(x) - 1) * around
    faces += [np.column_stack([np.full(around, first), j, i])]
    faces += [np.column_stack([np.full(around, last), top + i, top + j])]
    return Mesh(points, normals, np.concatenate(faces))


def even(points: np.ndarray, count: int) -> F64:
    """`count` of `points`, evenly spread, as control points are."""
    return sample_control_points(points, np.ones(len(points)), count).astype(np.float64)


def rotation(seed: int = 0) -> F64:
    """A random rotation matrix (3, 3)."""
    return matrices_from_quats(np.random.default_rng(seed).normal(size=(1, 4)))[0]


def rotations(count: int, seed: int = 0) -> F64:
    """Random rotation matrices (count, 3, 3)."""
    return matrices_from_quats(np.random.default_rng(seed).normal(size=(count, 4)))


# ---- lifted objects made of a cloud ---------------------------------------------------------


def gaussians_at(points: np.ndarray, sigma: float = 0.02, seed: int = 0) -> Gaussians:
    """Solid Gaussians at `points` (N, 3), turned and coloured at random."""
    rng = np.random.default_rng(seed)
    count = len(points)
    quats = rng.normal(size=(count, 4))
    return Gaussians(
        points,
        quats / np.linalg.norm(quats, axis=1, keepdims=True),
        sigma * np.array([1.0, 0.8, 0.2]) * rng.uniform(0.7, 1.3, (count, 1)),
        np.ones(count),
        rng.random((count, 3)),
    )


def lifted_surface(points: F64, normals: F64, count: int = 512) -> LiftedObject:
    """An object of flat Gaussians at `points` (N, 3), along the surface whose `normals` these are.

    They are spread over it in any order, and carry `count` control points.
    """
    order = np.random.default_rng(0).permutation(len(points))
    points, normals = points[order], normals[order]
    spacing = float(np.median(KDTree(points).query(points, k=2)[0][:, 1]))
    gaussians = Gaussians(
        points, quats_along(normals),
        np.tile(spacing * np.array([0.7, 0.7, 0.1]), (len(points), 1)),
        np.ones(len(points)), np.full((len(points), 3), 0.5),
    )  # fmt: skip
    return _standing(gaussians, even(points, count), 3.0)


def lifted_cloud(
    points: np.ndarray, control_points: np.ndarray, depth: float = 3.0
) -> LiftedObject:
    """An object of Gaussians at `points` that stands `depth` before a 160 x 120 camera."""
    return _standing(gaussians_at(points), control_points, depth)


def _standing(gaussians: Gaussians, control_points: np.ndarray, depth: float) -> LiftedObject:
    points = gaussians.means
    world_from_object = np.eye(4)
    world_from_object[2, 3] = depth
    world = gaussians.means + world_from_object[:3, 3]
    texture = PhotoTexture(camera().project(world), np.ones(len(points)), np.ones(len(points)))
    return LiftedObject(gaussians, texture, control_points, world_from_object, 0.03, "made")


def handle(lifted: LiftedObject, control_point: int, move: np.ndarray, **more) -> Handle:
    """A handle that takes a control point from where it is by `move` (3,)."""
    point = lifted.control_points[control_point].astype(np.float64)
    return Handle(control_point, point, point + move, **more)


# ---- masks and photos -----------------------------------------------------------------------


def mask(name: str, width: int = WIDTH, height: int = HEIGHT) -> Mask:
    """One of MASKS, (height, width)."""
    y, x = np.mgrid[:height, :width] + 0.5
    x, y = x / width * 160, y / height * 120
    if name == "disc":
        return np.hypot(x - 80, y - 60) < 40
    if name == "ellipse":
        return ((x - 78) / 45) ** 2 + ((y - 62) / 30) ** 2 < 1
    if name == "thin":  # a limb six px wide and a whisker of two
        limb = np.abs((y - 60) - 0.2 * (x - 80)) < 3
        whisker = (np.abs(x - 80) < 1) & (np.abs(y - 60) < 40)
        return (limb & (np.abs(x - 80) < 55)) | whisker
    if name == "frame":  # leaves the photo below and to the right
        return ((x - 130) / 60) ** 2 + ((y - 100) / 55) ** 2 < 1
    if name == "parts":
        return (np.hypot(x - 45, y - 55) < 24) | (np.hypot(x - 115, y - 65) < 20)
    if name == "ring":
        return (np.hypot(x - 80, y - 60) < 45) & (np.hypot(x - 80, y - 60) > 20)
    if name == "star":
        angle, radius = np.arctan2(y - 60, x - 80), np.hypot(x - 80, y - 60)
        return radius < 30 + 16 * np.cos(5 * angle)
    raise KeyError(name)


def picture(inside: Mask, seed: int = 0) -> RGB:
    """A photo (H, W, 3) u8 with soft texture everywhere and an object of another colour."""
    rng = np.random.default_rng(seed)
    noise = cv2.GaussianBlur(rng.normal(size=(*inside.shape, 3)), (0, 0), 1.2)
    noise = noise / noise.std() * 22
    ground = np.array([70, 105, 135]) + noise
    body = np.array([190, 120, 60]) + noise[::-1]
    soft = cv2.GaussianBlur(inside.astype(np.float64), (0, 0), 0.7)[..., None]
    return np.clip(soft * body + (1 - soft) * ground, 0, 255).astype(np.uint8)


def camera(width: int = WIDTH, height: int = HEIGHT) -> Camera:
    """The camera that a photo without EXIF gets."""
    return Camera.from_fov(width, height)


def png(pixels: np.ndarray, **more) -> bytes:
    """The bytes of a PNG of `pixels` (H, W, 3)."""
    return encode_picture(Picture(pixels, **more), ".png")


def mask_png(inside: Mask) -> bytes:
    """The bytes of a mask file."""
    return encode_mask(inside)


def jpeg(pixels: np.ndarray) -> bytes:
    """The bytes of a JPEG of `pixels` (H, W, 3) u8."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "JPEG", quality=90)
    return stream.getvalue()


# ---- whole scenes ---------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Scene:
    """A photo with a lifted object, and what is derived from it."""

    pixels: RGB  # (H, W, 3)
    mask: Mask  # (H, W)
    camera: Camera
    matte: Matte
    lifted: LiftedObject
    texture: TextureLevels
    puppet: Puppet

    def cutout(self) -> tuple[F32, F32]:
        """Premultiplied colour (H, W, 3) and alpha (H, W) of the object in the photo."""
        height, width = self.mask.shape
        pad = 2 * max(height, width)  # the matte's crop may reach beyond the photo
        whole = np.zeros((height + 2 * pad, width + 2 * pad, 4), np.float32)
        x0, y0, x1, y1 = self.matte.box
        alpha = self.matte.alpha[..., None]
        whole[y0 + pad : y1 + pad, x0 + pad : x1 + pad] = np.concatenate(
            [self.matte.foreground * alpha, alpha], axis=2
        )
        whole = whole[pad : pad + height, pad : pad + width]
        return whole[..., :3], whole[..., 3]

    def with_plain_edge(self) -> Scene:
        """The scene whose matte is the mask, a pixel soft, however the picture is cut out."""
        x0, y0, x1, y1 = self.matte.box
        whole = frame_extension(self.mask)
        outline = extended_mask(self.mask, whole).astype(np.float32)
        soft = cv2.GaussianBlur(outline, (0, 0), 0.7)
        own = (-whole[2], -whole[0], soft.shape[1] - whole[2], soft.shape[0] - whole[0])
        matte = replace(self.matte, alpha=crop(soft, own, (x0, y0, x1, y1)))
        return replace(self, matte=matte, texture=object_texture(matte, self.lifted))

    def document(self) -> Document:
        """The document in which the object is lifted, at rest, before a plain grey plate."""
        photo = Photo(Picture(self.pixels), self.camera, png(self.pixels), "made.png")
        item = EditObject("Object 1", mask=frozen(self.mask))
        document = Document(photo, (item.with_lifted(self.matte, self.lifted),))
        return replace(document, plate=grey_plate(self.mask))


def grey_plate(inside: Mask, margin: int = 1) -> Plate:
    """A plate that shows plain grey where the object was."""
    hole = cv2.dilate(inside.astype(np.uint8), np.ones((2 * margin + 1,) * 2)).astype(bool)
    return Plate(0, 0, np.full((*inside.shape, 3), 128, np.uint8), hole, "made")


def lifted_scene(pixels: RGB, inside: Mask, count: int, seed: int = 0, kind: str = "auto") -> Scene:
    """`inside` of the photo `pixels` lifted by the relief, to about `count` Gaussians."""
    height, width = inside.shape
    view = camera(width, height)
    settings = LiftSettings(count, trust=0, kind=kind)
    said = repr(("lifted scene", inside.shape, count, seed, kind)).encode()
    matte, lifted = remembered.once(
        said + pixels.tobytes() + inside.tobytes(),
        lambda: lift_mask(pixels, view, inside, "relief", settings, seed=seed),
    )
    texture = object_texture(matte, lifted)
    puppet = Puppet(lifted, DeformSettings(), view)
    return Scene(pixels, inside, view, matte, lifted, texture, puppet)


def around_the_camera(item: Scene) -> Placement:
    """Puts the object so near that a part of it is behind the camera."""
    lifted = item.lifted
    return Placement(depth=0.05 - float(lifted.centre[2]) / (lifted.diameter * lifted.scale))


@cache
def scene(name: str = "ellipse", count: int = 800, seed: int = 0) -> Scene:
    """The lifted object of one of MASKS in a made photo."""
    inside = mask(name)
    return lifted_scene(picture(inside, seed), inside, count, seed)


def placed(placement: str, scene: Scene) -> PosedSplats:
    """The object at rest in one of PLACEMENTS, or "around the camera"."""
    return scene.puppet.posed(None, PLACEMENTS.get(placement) or around_the_camera(scene))


def specified(item: Scene, placement: str, view: Camera) -> Picture3D:
    """What the specification draws of a `scene` in a `view`: by one process of a run."""
    of = (item.pixels, item.mask, item.lifted.gaussians.means)
    said = repr(("placed", placement, view)).encode() + b"".join(part.tobytes() for part in of)
    splats = placed(placement, item)
    return remembered.once(said, lambda: reference.render(splats, item.texture, view, item.camera))


# ---- clouds of Gaussians of every kind ------------------------------------------------------


def random_splats(
    seed: int, splatting: str = "surface", is_textured: bool = True, count: int = 160
) -> tuple[PosedSplats, TextureLevels]:
    """Gaussians before a 160 x 120 camera, moved every way, and a noisy texture.

    Huge and tiny ones, flat ones seen edge-on, many on one another, some behind the camera or at
    it, some of an opacity of a thousandth.
    """
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.7, 0.7, (count, 3))
    points[: count // 4] = rng.normal(0, 0.06, (count // 4, 3)) + [0.1, -0.05, 0]  # on one another
    lifted = lifted_cloud(points, ball(10))
    sizes = np.exp(rng.uniform(np.log(0.3), np.log(5), (count, 1)))
    sizes[rng.choice(count, 6, replace=False)] = 25.0
    sizes[rng.choice(count, 12, replace=False)] = 0.02
    opacities = rng.uniform(0.2, 1.0, count)
    opacities[rng.choice(count, 12, replace=False)] = 1e-3
    gaussians = replace(
        lifted.gaussians, scales=lifted.gaussians.scales * sizes.astype(np.float32),
        opacities=opacities,
    )  # fmt: skip
    edge_on = rng.choice(count, 12, replace=False)
    quats = gaussians.quats.copy()
    across = rng.normal(size=(12, 3)) * [1, 1, 0]
    quats[edge_on] = quats_along(across / np.linalg.norm(across, axis=1, keepdims=True))
    scales = gaussians.scales.copy()
    scales[edge_on, 2] *= 0.02
    gaussians = replace(gaussians, quats=quats, scales=scales)
    visible = (rng.random(count) < 0.7) if is_textured else np.zeros(count)
    texture = replace(
        lifted.texture, visibility=visible,
        solidity=(rng.random(count) < 0.8).astype(np.float32),
    )  # fmt: skip
    lifted = replace(lifted, gaussians=gaussians, texture=texture, splatting=splatting)
    linear = np.eye(3) + rng.normal(size=(count, 3, 3)) * 0.3
    means = points + rng.normal(size=(count, 3)) * 0.02
    near = rng.choice(count, 16, replace=False)
    means[near, 2] = rng.uniform(-4.0, -2.6, 16)  # at the camera, which is at -3, and behind it
    noise = cv2.GaussianBlur(rng.random((HEIGHT, WIDTH, 4)).astype(np.float32), (0, 0), 2)
    noise[..., 3] = np.clip((noise[..., 3] - 0.4) * 5, 0, 1)
    splats = PosedSplats(RestSplats(lifted, camera()), Skinned(means, linear), np.eye(4))
    return splats, build_levels(noise[..., :3], noise[..., 3], 0, 0)


def specified_random(seed: int, splatting: str = "surface", is_textured: bool = True) -> Picture3D:
    """What the specification draws of `random_splats`: by one process of a run."""

    def draw() -> Picture3D:
        return reference.render(*random_splats(seed, splatting, is_textured), camera(), camera())

    return remembered.once(repr(("random", seed, splatting, is_textured)).encode(), draw)


def two_discs(front_opacity: float) -> tuple[PosedSplats, TextureLevels, tuple[float, float]]:
    """A cloud of two wide discs on the ray through (80, 60), and their depths."""
    lifted = lifted_cloud(np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]), ball(10))
    gaussians = replace(
        lifted.gaussians,
        quats=np.tile(np.float32([0, 1, 0, 0]), (2, 1)),  # facing the camera
        scales=np.tile(np.float32([0.2, 0.2, 0.02]), (2, 1)),
        opacities=np.float32([front_opacity, 1.0]),
    )
    texture = replace(lifted.texture, visibility=np.zeros(2))
    lifted = replace(lifted, gaussians=gaussians, texture=texture, splatting="mip")
    splats = PosedSplats(RestSplats(lifted, camera()), None, np.eye(4))
    nothing = np.zeros((4, 4), np.float32)
    return splats, build_levels(np.dstack([nothing] * 3), nothing, 0, 0), (2.5, 3.5)
