"""The product's own chain on a case, as it ships or with one thing otherwise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from objectmorpher_core.base.arrays import F64, RGB, Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.progress import silent
from objectmorpher_core.compose.composite import (
    Composite,
    composite,
    object_texture,
    straight_cutout,
)
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document import edits
from objectmorpher_core.document.bounds import LEAST_THICKNESS
from objectmorpher_core.document.model import (
    Document,
    LiftedObject,
    LiftSettings,
    Matte,
    Placement,
    Plate,
    Prompt,
)
from objectmorpher_core.document.settings import DeformSettings, Shadow
from objectmorpher_core.pictures.image import Picture, encode_picture
from objectmorpher_core.pipeline import lift_mask, open_photo
from objectmorpher_core.scripting.options import EditScript
from objectmorpher_core.scripting.runner import with_plate

from .cases import EditOutcome, TruthCase, TruthGuidance

OWN, CARD, PLAIN = "own", "card", "plain"  # what is lifted
LIFTS = {
    OWN: LiftSettings(),
    CARD: LiftSettings(  # a board that faces the camera
        thickness=LEAST_THICKNESS, is_standing=False, is_symmetric=False, uses_depth=False, trust=0
    ),
    PLAIN: LiftSettings(count=64_000),  # more of them: they alone carry the colours
}
ALIGNED = 4  # times the thing is moved to where its points must be seen
MOST_AWAY = 0.9  # x its distance, that a thing can come nearer


@dataclass(frozen=True)
class Way:
    """The chain, and what is otherwise; the defaults are the product's, harmonised."""

    lift: str = OWN
    deform: str = "arap"
    links: str = "geodesic"
    is_harmonised: bool = True


class Chain:
    """A photo's object in the product; work that several edits and methods share is done once."""

    def __init__(self, photo: RGB, mask: Mask, camera: Camera, seed: int = 0) -> None:
        self._photo, self._mask, self._camera, self._seed = photo, mask, camera, seed
        self._data = encode_picture(Picture(photo), ".png")
        self._lifted: dict[str, tuple[Matte, LiftedObject]] = {}
        self._puppets: dict[tuple[str, ...], Puppet] = {}
        self._plates: dict[bool, tuple[Plate, Shadow]] = {}

    def document(self, way: Way = Way()) -> Document:
        """The photo with its object lifted."""
        fov = float(np.degrees(2 * np.arctan(0.5 * self._camera.width / self._camera.focal)))
        document = open_photo(self._data, "photo.png", fov, self._seed)
        document = edits.set_mask(edits.add_object(document), 0, self._mask, Prompt())
        matte, lifted = self.lift(way)
        document = edits.set_lifted(document, 0, matte, lifted, LIFTS[way.lift])
        return edits.set_deform(document, 0, DeformSettings(mode=way.deform, links=way.links))

    def lift(self, way: Way = Way()) -> tuple[Matte, LiftedObject]:
        """The cut-out, and the object in 3D."""
        if way.lift not in self._lifted:
            matte, lifted = lift_mask(
                self._photo, self._camera, self._mask, settings=LIFTS[way.lift], seed=self._seed
            )
            if way.lift == PLAIN:
                lifted = unpainted(lifted)
            self._lifted[way.lift] = matte, lifted
        return self._lifted[way.lift]

    def puppet(self, document: Document, way: Way) -> Puppet:
        key = (way.lift, way.deform, way.links)
        if key not in self._puppets:
            item = document.objects[0]
            assert item.lifted is not None
            self._puppets[key] = Puppet(item.lifted, item.deform, document.photo.camera)
        return self._puppets[key]

    def moved(self, case: TruthCase, way: Way = Way()) -> tuple[Document, Puppet, F64]:
        """The document after the edit, and where the guidance's points are in its object (n, 3)."""
        document = self.document(way)
        puppet = self.puppet(document, way)
        points = _picked(puppet, document, case.guidance)
        document = self._steered(document, puppet, points, case.guidance)
        plate, shadow = self._plate(document)
        document = edits.set_shadow(edits.set_plate(document, plate), 0, shadow)
        return edits.harmonised(document, 0, way.is_harmonised), puppet, points

    def apply(self, case: TruthCase, way: Way = Way()) -> EditOutcome:
        """The edited photo."""
        document, puppet, points = self.moved(case, way)
        result = composite(document, {0: puppet})
        pose, place = document.objects[0].pose, document.objects[0].placement
        reached = np.array([puppet.picture_of(p, pose, place) for p in points])
        return EditOutcome(_bytes(result.pixels), coverage(result, document), reached)

    def plate(self, case: TruthCase) -> RGB:
        """(H, W, 3) the photo without the object, that every method puts its result on."""
        document, _, _ = self.moved(case)
        plate = document.plate
        assert plate is not None
        x0, y0, x1, y1 = plate.box
        whole = self._photo.copy()
        whole[y0:y1, x0:x1] = plate.pixels
        return whole

    def _plate(self, document: Document) -> tuple[Plate, Shadow]:
        """What is behind the object, and the shadow that it takes along."""
        from objectmorpher_core.scripting.runner import has_left

        item = document.objects[0]
        leaves = has_left(item, document)
        if leaves not in self._plates:
            casting = frozenset({0}) if leaves else frozenset[int]()
            made = with_plate(document, EditScript(seed=self._seed), casting, silent).document
            assert made.plate is not None
            self._plates[leaves] = made.plate, made.objects[0].shadow
        return self._plates[leaves]

    def _steered(
        self, document: Document, puppet: Puppet, points: F64, guidance: TruthGuidance
    ) -> Document:
        if guidance.rigid is not None:
            return edits.set_placement(document, 0, _placed(puppet, points, guidance))
        lifted, camera = puppet.lifted, document.photo.camera
        depths = lifted.world_points(points)[:, 2] * (1 + guidance.away)
        targets = lifted.object_points(camera.unproject(guidance.to, depths))
        for point, target, is_pin in zip(points, targets, guidance.is_pin, strict=True):
            try:
                document = edits.add_handle(
                    document, 0, point, None if is_pin else target, bool(is_pin)
                )
            except edits.EditError:  # it has the control point of one before it
                continue
        item = document.objects[0]
        return edits.set_pose(document, 0, puppet.deformer.solve(item.handles, item.footing).pose)


def _picked(puppet: Puppet, document: Document, guidance: TruthGuidance) -> F64:
    """(n, 3) the points of the surface that are taken hold of, object frame."""
    matte = document.objects[0].matte
    assert matte is not None
    texture = object_texture(matte, document.objects[0].lifted)
    found = []
    for x, y in guidance.at:
        point = puppet.pick((float(x), float(y)), None, Placement(), texture)
        assert point is not None, "the guidance's points are inside the mask"
        found.append(point.rest)
    return np.array(found)


def _placed(puppet: Puppet, points: F64, guidance: TruthGuidance) -> Placement:
    """The motion as it was typed, then moved until the points are seen where they must be."""
    rigid, lifted = guidance.rigid, puppet.lifted
    assert rigid is not None
    away = max(rigid.away, -MOST_AWAY) * lifted.centre[2] / (lifted.diameter * lifted.scale)
    place = Placement((0.0, 0.0), float(away), rigid.turn, rigid.scale)
    for _ in range(ALIGNED):
        seen = np.array([puppet.picture_of(point, None, place) for point in points])
        step = (guidance.to - seen).mean(0)
        move = (place.move[0] + float(step[0]), place.move[1] + float(step[1]))
        place = replace(place, move=move)
    return place


def unpainted(lifted: LiftedObject) -> LiftedObject:
    """Return the same with nothing of the photo on its Gaussians but their own colours.

    Edged kinds leave it to the photo to cover what the photo shows: without it there is nothing.
    """
    texture = replace(lifted.texture, visibility=np.zeros_like(lifted.texture.visibility))
    return replace(lifted, texture=texture, splatting=lifted.splatting.removeprefix("edged "))


def coverage(result: Composite, document: Document) -> F64:
    """(H, W) of the object in a composite."""
    cutout = straight_cutout(result, np.dtype(np.uint8), document.photo.size)
    if not result.moved:
        matte = document.objects[0].matte
        assert matte is not None
        from objectmorpher_core.base.arrays import crop

        width, height = document.photo.size
        return crop(matte.alpha, matte.box, (0, 0, width, height)).astype(np.float64)
    return cutout[..., 3] / 255.0


def _bytes(pixels: np.ndarray) -> RGB:
    assert pixels.dtype == np.uint8
    return np.asarray(pixels, np.uint8)
