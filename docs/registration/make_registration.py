"""Writes docs/registration/README.md: twenty known objects, found again in made photos.

python docs/registration/make_registration.py [quick]
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import solids
import truth
from page import write_page
from pictures import draw_sheet
from skimage import data

from objectmorpher_core.base.arrays import F64, Pixels
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.lift.registration.placement import Hints, Proposal, Registration, register
from objectmorpher_core.lift.registration.view import Target

FOLDER = Path(__file__).parent
SEED = 100
SHOWN = ("patterned ball", "patterned knot", "patterned bracket", "plain cylinder")


@dataclass(frozen=True)
class Way:
    """One way in which all objects are registered."""

    title: str
    is_focal_free: bool
    is_cloud: bool


WAYS = (
    Way("The focal length is not known", True, False),
    Way("The focal length is known", False, False),
    Way("A cloud of round, translucent Gaussians; the focal length is not known", True, True),
)


@dataclass(frozen=True)
class Row:
    """One object, found."""

    name: str
    symmetry: str
    fov: float  # degrees, the truth
    error: float  # degrees, the turn that is left; of a symmetric object the least of its turns
    iou: float  # of the silhouettes, as the triangles draw them
    focal: float  # x the truth
    score_iou: float  # what the registration itself says
    colour_error: float
    is_ambiguous: bool
    seconds: float
    busy: float  # s, of the processor: both cores together


def grounds() -> list[Pixels]:
    """Photos (480, 640, 3) to stand before."""
    photos = (data.astronaut(), data.coffee(), data.chelsea(), data.rocket())
    return [cv2.resize(photo, (truth.WIDTH, truth.HEIGHT)) for photo in photos]


def found(scene: truth.Scene, way: Way, seed: int) -> tuple[Registration, float, float]:
    """Its registration, the seconds that it took, and those of the processor."""
    given = scene.camera
    if way.is_focal_free:
        given = Camera.from_fov(truth.WIDTH, truth.HEIGHT)
    splats = solids.gaussians(scene.solid, way.is_cloud, seed)
    target = Target(scene.pixels, scene.mask, given)
    start, busy = time.perf_counter(), time.process_time()
    registration = register(splats, target, Hints(way.is_focal_free))
    return registration, time.perf_counter() - start, time.process_time() - busy


def measured(
    scene: truth.Scene, registration: Registration, seconds: float, busy: float
) -> Row:  # fmt: skip
    best, solid = registration.best, scene.solid
    focal = best.camera.focal / scene.camera.focal
    fov = float(2 * np.degrees(np.arctan(truth.WIDTH / 2 / scene.camera.focal)))
    return Row(
        solid.name, solid.symmetry, fov, turn_error(scene, best), silhouette_iou(scene, best),
        focal, best.iou, best.colour_error, registration.is_ambiguous, seconds, busy,
    )  # fmt: skip


def turn_error(scene: truth.Scene, best: Proposal) -> float:
    """Degrees between the pose found and the true one, or one that looks the same."""
    if scene.solid.symmetry == "any turn":
        return 0.0
    linear = best.world_from_object[:3, :3]
    turn: F64 = linear / np.cbrt(np.linalg.det(linear))
    alike = scene.world_from_solid[:3, :3] @ scene.solid.turns
    cosine = ((alike * turn).sum((1, 2)) - 1) / 2
    return float(np.degrees(np.arccos(cosine.clip(-1, 1).max())))


def silhouette_iou(scene: truth.Scene, best: Proposal) -> float:
    alpha, _ = truth.draw(scene.solid, best.world_from_object, best.camera)
    inside = alpha > 0.5
    return float((inside & scene.mask).sum() / (inside | scene.mask).sum())


def main() -> None:
    chosen = solids.solids()[:4] if "quick" in sys.argv else solids.solids()
    photos = grounds()
    scenes = [
        truth.scene(solid, photos[k % len(photos)], SEED + k) for k, solid in enumerate(chosen)
    ]
    found(scenes[0], WAYS[0], 0)  # compiles
    tables: list[tuple[Way, list[Row]]] = []
    for way in WAYS:
        rows = []
        for k, scene in enumerate(scenes):
            registration, seconds, busy = found(scene, way, k)
            rows.append(measured(scene, registration, seconds, busy))
            print(rows[-1], flush=True)
            if way is WAYS[0] and scene.solid.name in SHOWN:
                draw_sheet(
                    FOLDER / f"{scene.solid.name.replace(' ', '-')}.jpg", scene, registration
                )
        tables.append((way, rows))
    (FOLDER / "README.md").write_text(write_page(tables), encoding="utf-8")


if __name__ == "__main__":
    main()
