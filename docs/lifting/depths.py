"""How far the lifted surfaces of solids are from the true ones, seen from all around."""

from __future__ import annotations

from pathlib import Path

import mesh_view
import numpy as np
from solids import SOLIDS, Solid, load
from turning import AT, CAMERA, SEEN, SHARE, SIDE, Shot, over_plate

from objectmorpher_core.document.model import LiftSettings
from objectmorpher_core.lift import LiftSubject
from objectmorpher_core.lift.relief.body import ReliefBody
from objectmorpher_core.lift.relief.lifter import ReliefLifter
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.segment.matting.matte import cut_out
from objectmorpher_research.training.shape_eval import ShapeError, Surfaces, score, surfaces_of

YAWS = range(0, 360, 45)  # degrees, from the side that the page's photo shows
WAYS = ("network", "relief", "inflation", "flat")


def depth_scores(meshes: Path) -> dict[str, dict[str, ShapeError]]:
    """Of each solid the means over its views, by way."""
    found = {}
    for name in SOLIDS:
        solid = load(name, meshes)
        views = [_scores(solid.turned(yaw)) for yaw in YAWS]
        found[name] = {way: _mean([view[way] for view in views]) for way in WAYS}
    return found


def _scores(solid: Solid) -> dict[str, ShapeError]:
    depth = CAMERA.focal / (SHARE * SIDE)
    view = mesh_view.draw(solid, solid.vertices + CAMERA.unproject(AT, depth), CAMERA)
    mask = (view.alpha > 0.5) & np.isfinite(view.depth)
    pixels = np.clip(over_plate(Shot(view.color, view.alpha)) * 255 + 0.5, 0, 255).astype(np.uint8)
    outline = ReliefSilhouette.of(mask)
    subject = LiftSubject(pixels, CAMERA, mask, cut_out(pixels, mask))
    bodies = {
        "network": ReliefLifter().body(subject, SEEN),
        "relief": ReliefBody.of(outline, CAMERA, LiftSettings()),
        "inflation": ReliefBody.of(outline, CAMERA, LiftSettings(is_standing=False)),
    }
    ways = {way: surfaces_of(body, mask) for way, body in bodies.items()}
    flat = np.full(mask.shape, float(ways["inflation"].thickness[mask].mean()))
    ways["flat"] = Surfaces(np.zeros(mask.shape), flat)
    nearest, farthest = (np.where(mask, side, 1.0) for side in (view.depth, view.back))
    scale = CAMERA.focal / float(nearest[mask].mean())  # px at which the photo is as wide
    true = Surfaces(-scale * nearest, scale * (farthest - nearest))
    return {way: score(surfaces, true, mask) for way, surfaces in ways.items()}


def _mean(scores: list[ShapeError]) -> ShapeError:
    return ShapeError(*np.mean(scores, 0))
